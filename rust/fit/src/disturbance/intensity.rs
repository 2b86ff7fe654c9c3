//! Maximum likelihood intensity of the random torque on each joint that explains the prediction errors.
//!
//! The prediction error of a window is the motion due to the residual torque `d`, measured with the encoders' noise:
//!
//! ```text
//! M(q) dde/dt2 = d,     y = e + v,     d white of intensity W = diag(w_1 .. w_n),     v white of the encoders' variances.
//! ```
//!
//! The intensities maximise the likelihood (innovations of the Kalman filter; Schweppe 1965), with the initial state of every window unknown. Noise
//! of the encoders and torque are told apart by their spectra, and the joint on which a torque acts from coupled joints by the inertia matrix.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::scale::Scales;
use crate::model::hypothesis::Hypothesis;
use crate::predict::window::{InitialStateOffset, Window};
use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::neldermead::NelderMead;
use armgap_core::arm::Arm;
use nalgebra::{Cholesky, SMatrix, SVector};
use rayon::prelude::*;

/// Factor on the standard deviations of a measured initial state that makes it practically unknown to the Kalman filter.
const OPEN: f64 = 100.0;

/// First guess of the random torque on a joint, relative to the joint's typical torque, held over one sample.
const FIRST: f64 = 1e-2;

/// Smallest random torque on a joint, relative to the joint's typical torque.
const MIN_RANDOM_TORQUE: f64 = 1e-5;

/// Ratio of intensities between the corners of the first Nelder-Mead simplex.
const SIMPLEX_RATIO: f64 = 100.0;

/// Standard deviation of the deviance over the Nelder-Mead simplex that ends the search for intensities.
const DEVIANCE_TOLERANCE: f64 = 0.1;

/// Largest number of Nelder-Mead iterations in the search for intensities; computation time is in proportion.
const MAX_INTENSITY_ITERATIONS: u64 = 60;

type Matrix<const N: usize> = SMatrix<f64, N, N>;
type Vector<const N: usize> = SVector<f64, N>;

/// Prediction error at one sample of a window, time to the next sample, s, and inverse inertia matrix at the sample.
struct PredictionError<const N: usize> {
    error: Vector<N>,
    step: f64,
    mobility: Matrix<N>,
}

/// Prediction errors of all windows, whose likelihood is a function of the torque intensities.
struct PredictionErrors<const N: usize> {
    windows: Vec<(KalmanFilter<N>, Vec<PredictionError<N>>)>,
    /// Covariance of the noise of measured positions, rad^2 or m^2.
    noise: Matrix<N>,
    /// Common logarithms of the smallest intensities ([`MIN_RANDOM_TORQUE`]).
    faintest: [f64; N],
}

/// Each joint's share of the kinetic energy that residual torques feed into the arm over the holdout, under a hypothesis: `w_j (M^-1)_jj`.
///
/// The metric is that of Gauss's principle of least constraint, in which torques of different joints can be compared; shares add to one.
pub fn shares<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    hypothesis: &Hypothesis<P>,
    offsets: &[InitialStateOffset<N>],
) -> [f64; N] {
    let data = &context.holdout.data;
    let predicted = data.predict(&context.arm, hypothesis, offsets);
    let mobility = |q: &Vector<N>| context.arm.inertia(&hypothesis.theta, q).try_inverse();
    let open = |window: &Window<N>| -> Option<(KalmanFilter<N>, Vec<PredictionError<N>>)> {
        let track = &data.tracks[window.track];
        let rows = predicted[window.range()].chunks_exact(N).enumerate();
        let miss = |(r, row): (usize, &[f64])| {
            let k = window.first + 1 + r;
            Some(PredictionError {
                error: track.q[k] - Vector::from_row_slice(row),
                step: track.t[(k + 1).min(track.len() - 1)] - track.t[k],
                mobility: mobility(&track.q[k])?,
            })
        };
        Some((KalmanFilter::open(window), rows.map(miss).collect::<Option<_>>()?))
    };
    let windows: Vec<_> = data.windows.par_iter().filter_map(open).collect();
    let unit = |part: f64| intensities(&context.scales, part);
    let mean = windows.iter().flat_map(|(_, w)| w).map(|m| m.mobility.diagonal()).sum::<Vector<N>>();
    let noise = Matrix::from_diagonal(&Vector::from(context.noise.map(|s| s * s)));
    let misses = PredictionErrors { windows, noise, faintest: unit(MIN_RANDOM_TORQUE) };
    let likeliest = misses.likeliest(unit(FIRST));
    let fed = Vector::<N>::from_fn(|j, _| 10f64.powf(likeliest[j]) * mean[j]);
    let whole = fed.sum();
    std::array::from_fn(|j| if whole > 0.0 && whole.is_finite() { fed[j] / whole } else { 1.0 / N as f64 })
}

/// Common logarithm, by joint, of the intensity, (N m)^2 s or N^2 s, of a torque of the size `part` times the joint's typical torque, drawn anew at
/// every sample.
fn intensities<const N: usize>(scales: &Scales<N>, part: f64) -> [f64; N] {
    scales.torque.map(|torque| ((part * torque).powi(2) * scales.period).max(1e-300).log10())
}

impl<const N: usize> PredictionErrors<N> {
    /// Common logarithms of the intensities of largest likelihood, by Nelder-Mead search from `first`.
    fn likeliest(self, first: [f64; N]) -> [f64; N] {
        let corner = |i: usize| {
            let mut corner = first.to_vec();
            if i < N {
                corner[i] += SIMPLEX_RATIO.log10();
            }
            corner
        };
        let faintest = self.faintest;
        let simplex = NelderMead::new((0..=N).map(corner).collect());
        let found = simplex
            .with_sd_tolerance(DEVIANCE_TOLERANCE)
            .and_then(|solver| {
                Executor::new(self, solver)
                    .configure(|s| s.max_iters(MAX_INTENSITY_ITERATIONS))
                    .timer(false)
                    .run()
            })
            .ok()
            .and_then(|end| end.state.get_best_param().cloned());
        std::array::from_fn(|j| found.as_ref().map_or(first[j], |found| found[j]).max(faintest[j]))
    }

    /// Deviance of the intensities: twice the negative log-likelihood, up to a constant.
    fn deviance(&self, intensity: &Vector<N>) -> f64 {
        let of = |(start, misses): &(KalmanFilter<N>, Vec<PredictionError<N>>)| {
            let mut filter = start.clone();
            misses.iter().map(|miss| filter.step(miss, &self.noise, intensity)).sum::<f64>()
        };
        // Added up in the order of the windows, so that the sum is the same with any number of threads.
        self.windows.par_iter().map(of).collect::<Vec<f64>>().iter().sum()
    }
}

impl<const N: usize> CostFunction for PredictionErrors<N> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, intensity: &Self::Param) -> Result<f64, Error> {
        let intensity = Vector::<N>::from_fn(|j, _| 10f64.powf(intensity[j].max(self.faintest[j])));
        let deviance = self.deviance(&intensity);
        Ok(if deviance.is_finite() { deviance } else { f64::MAX })
    }
}

/// Kalman filter of the prediction errors of positions and velocities: estimates and blocks of their covariance.
#[derive(Clone)]
struct KalmanFilter<const N: usize> {
    /// Estimated prediction error of the positions, rad or m.
    e: Vector<N>,
    /// Estimated prediction error of the velocities, rad/s or m/s.
    de: Vector<N>,
    /// Covariance of position errors.
    position: Matrix<N>,
    /// Covariance of position errors (rows) and velocity errors (columns).
    mixed: Matrix<N>,
    /// Covariance of velocity errors.
    velocity: Matrix<N>,
}

impl<const N: usize> KalmanFilter<N> {
    /// Filter at the start of a window, with a practically unknown initial state.
    fn open(window: &Window<N>) -> Self {
        let variance = |entry: usize| {
            let of = |j: usize| OPEN * OPEN * window.initial_state.covariance[j][entry];
            Matrix::from_diagonal(&Vector::from_fn(|j, _| of(j)))
        };
        Self {
            e: Vector::zeros(),
            de: Vector::zeros(),
            position: variance(0),
            mixed: Matrix::zeros(),
            velocity: variance(2),
        }
    }

    /// Updates the filter by one sample, predicts the next, and returns the sample's contribution to the deviance.
    fn step(&mut self, miss: &PredictionError<N>, noise: &Matrix<N>, intensity: &Vector<N>) -> f64 {
        let Some(innovation) = Cholesky::new(self.position + noise) else { return f64::NAN };
        let v = miss.error - self.e;
        let weighed = innovation.solve(&v);
        let deviance = v.dot(&weighed) + innovation.ln_determinant();
        let gain = innovation.inverse();
        self.e += self.position * weighed;
        self.de += self.mixed.transpose() * weighed;
        let (position, mixed) = (self.position * gain, self.mixed.transpose() * gain);
        self.velocity -= mixed * self.mixed;
        self.mixed -= position * self.mixed;
        self.position -= position * self.position;

        // A random torque held over the step of length `h`, with the variance `intensity / h`.
        let h = miss.step;
        self.e += self.de * h;
        self.position += (self.mixed + self.mixed.transpose()) * h + self.velocity * (h * h);
        self.mixed += self.velocity * h;
        if h > 0.0 {
            let torque = Matrix::from_diagonal(&(intensity / h));
            let kick = miss.mobility * torque * miss.mobility.transpose();
            self.position += kick * (h.powi(4) / 4.0);
            self.mixed += kick * (h.powi(3) / 2.0);
            self.velocity += kick * (h * h);
        }
        self.position = (self.position + self.position.transpose()) * 0.5;
        self.velocity = (self.velocity + self.velocity.transpose()) * 0.5;
        deviance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    const STEP: f64 = 2.5e-3;
    const NOISE: f64 = 1e-6;

    /// Prediction errors of a coupled two-joint arm under random torques of known intensities.
    fn misses(windows: usize, intensity: [f64; 2], seed: u64) -> PredictionErrors<2> {
        let mut random = Random(seed);
        let mobility = Matrix::<2>::new(0.4, -0.9, -0.9, 12.0);
        let mut one = || {
            let (mut e, mut de) = (Vector::<2>::zeros(), Vector::<2>::new(1e-3, -1e-3));
            let mut row = || {
                let torque = Vector::from_fn(|j, _| (intensity[j] / STEP).sqrt() * random.normal());
                let kick = mobility * torque;
                e += de * STEP + kick * (STEP * STEP / 2.0);
                de += kick * STEP;
                PredictionError { error: e.map(|x| x + NOISE * random.normal()), step: STEP, mobility }
            };
            let rows: Vec<_> = (0..100).map(|_| row()).collect();
            let start = KalmanFilter {
                e: Vector::zeros(),
                de: Vector::zeros(),
                position: Matrix::identity() * 1e-6,
                mixed: Matrix::zeros(),
                velocity: Matrix::identity(),
            };
            (start, rows)
        };
        let windows = (0..windows).map(|_| one()).collect();
        PredictionErrors { windows, noise: Matrix::identity() * (NOISE * NOISE), faintest: [-14.0; 2] }
    }

    fn found(intensity: [f64; 2], seed: u64) -> [f64; 2] {
        misses(20, intensity, seed).likeliest([-8.0; 2])
    }

    #[test]
    fn intensities_that_made_the_misses_are_found() {
        for (seed, exponents) in [(1, [-6.0, -7.0]), (2, [-8.0, -5.0]), (3, [-5.0, -5.0])] {
            let likeliest = found(exponents.map(|x| 10f64.powf(x)), seed);
            for j in 0..2 {
                assert!((likeliest[j] - exponents[j]).abs() < 0.15, "{likeliest:?} {exponents:?}");
            }
        }
    }

    #[test]
    fn what_coupling_shows_on_a_joint_is_not_taken_for_its_own() {
        let [one, two] = found([1e-6, 0.0], 4);
        assert!((one + 6.0).abs() < 0.15 && two < -9.5, "{one} {two}");
        let [one, two] = found([0.0, 1e-7], 5);
        assert!((two + 7.0).abs() < 0.15 && one < -8.5, "{one} {two}");
    }

    #[test]
    fn noise_alone_is_no_torque() {
        let quiet = found([0.0; 2], 6);
        // Over a window of 0.25 s torques of these intensities move the joints by less than the noise.
        assert!(quiet[0] < -9.5 && quiet[1] < -11.5, "{quiet:?}");
    }
}
