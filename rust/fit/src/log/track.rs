//! One log prepared for simulation: times, positions, held torques, noise and smoothed motion.

use crate::log::noise::noise;
use crate::model::hypothesis::EffectInstance;
use crate::numeric::smooth::{Local, local_cubic, samples_near};
use armgap_core::arm::Arm;
use armgap_core::effect::InputSegment;
use nalgebra::SVector;
use rayon::prelude::*;
use std::sync::OnceLock;

/// Half widths, in samples, that a local cubic may have.
const HALF_WIDTHS: [usize; 8] = [3, 4, 6, 8, 11, 15, 20, 27];

/// Half width, in standard deviations, of the confidence intervals that successive widths of a local cubic must share.
const CONFIDENCE: f64 = 2.0;

/// Lower bound of the estimated mean square error of a measured state, in units of its variance: an estimate from the samples of one local cubic is
/// too uncertain to show less.
const LEAST_ERROR: f64 = 0.25;

/// Upper bound of the estimated mean square error of a measured position, in units of its variance, because a single sample says no more; and of a
/// measured velocity in the floor of serial arms.
pub const LARGEST_ERROR: f64 = 10.0;

/// Mean square error of a measured velocity, in units of its variance, per unit of one plus the cubic's mean square residual in units of the noise.
/// Of 255 joints of simulated logs with known velocities it puts the RMS error over the windows within a factor of 0.7 to 1.4 in 0.70; with 0.5 in
/// 0.67, with 1 in 0.56.
const ERROR_PER_MISFIT: f64 = 0.7;

/// Number of samples of the widest local cubic.
const WIDEST: usize = 2 * HALF_WIDTHS[HALF_WIDTHS.len() - 1] + 1;

/// Stride of the samples that decide whether positions are smoother without the motion due to the torque.
const ASKED: usize = 7;

/// A log of `N` joints, prepared for simulation.
#[derive(Debug, Clone)]
pub struct Track<const N: usize> {
    /// Name of the log in results.
    pub name: String,
    /// Name of the recording that the log is the whole or a part of.
    pub source: String,
    /// Sample times, s, increasing; the first is the start of the log.
    pub t: Vec<f64>,
    /// Measured positions, rad or m.
    pub q: Vec<SVector<f64, N>>,
    /// Commanded torque, N m or N, held until the next sample.
    pub held: Vec<[InputSegment<f64>; N]>,
    /// Standard deviation of the position measurement, per joint, rad or m.
    pub noise: [f64; N],
    /// Whether the joint's position samples are held over several rows, per joint.
    pub is_held: [bool; N],
    /// Smallest step of the position measurement, per joint, rad or m; zero where the positions show no step.
    pub step: [f64; N],
    /// Known external disturbances that act in the log.
    pub pushes: Vec<EffectInstance>,
    /// Torque per unit of size of each custom effect, one value per sample.
    pub tables: Vec<Vec<f64>>,
    /// Reference of a position controller, for a log that holds references instead of torques.
    pub reference: Option<Reference<N>>,
    /// Acceleration of each joint due to the torque, `M(q)^-1 tau`, rad/s^2 or m/s^2, from sample to sample; `None` for a joint whose measured motion
    /// is no smoother when the motion due to the torque is subtracted.
    driven: [Option<Vec<f64>>; N],
    /// Median sample period, s, computed at first use.
    period: OnceLock<f64>,
    /// Smoothed motion, computed at first use.
    path: OnceLock<Vec<MeasuredState<N>>>,
    /// Local cubics at all samples, computed at first use.
    smoothed: OnceLock<Vec<[Smoothed; N]>>,
}

/// Reference of a position controller, row by row, held until the next sample.
#[derive(Debug, Clone)]
pub struct Reference<const N: usize> {
    /// Reference positions, rad or m.
    pub q: Vec<[f64; N]>,
    /// Reference velocities, rad/s or m/s, where they are logged.
    pub dq: Option<Vec<[f64; N]>>,
}

/// Local cubic whose width is adapted to the motion around its sample.
#[derive(Debug, Clone, Copy)]
pub struct Smoothed {
    /// Local cubic that is used for the sample's state.
    pub local: Local,
    /// Half width of the local cubic, in samples.
    pub half_width: usize,
}

/// Measured position and velocity of all joints at one sample.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredState<const N: usize> {
    /// Positions, rad or m.
    pub q: SVector<f64, N>,
    /// Velocities, rad/s or m/s.
    pub dq: SVector<f64, N>,
}

/// Measured initial state of a window: position and velocity of each joint with their covariance.
#[derive(Debug, Clone, Copy)]
pub struct InitialState<const N: usize> {
    /// Positions, rad or m.
    pub q: SVector<f64, N>,
    /// Velocities, rad/s or m/s.
    pub dq: SVector<f64, N>,
    /// Per joint: variance of the position, covariance of position and velocity, variance of the velocity, SI.
    pub covariance: [[f64; 3]; N],
    /// Per joint: estimated mean square error of position and of velocity, bias of the local cubic included, in units of their variance.
    pub mean_square: [[f64; 2]; N],
}

impl<const N: usize> Track<N> {
    /// A track from columns `t`, `q` and `tau`; `steps` are the encoder steps per joint, rad or m, where the arm file knows them.
    pub fn new(name: &str, t: &[f64], q: &[f64], tau: &[f64], steps: Option<[f64; N]>) -> Self {
        let rows = |x: &[f64]| -> Vec<[f64; N]> {
            x.chunks_exact(N).map(|row| std::array::from_fn(|j| row[j])).collect()
        };
        let mut track = Self {
            name: name.to_owned(),
            source: name.to_owned(),
            t: t.to_vec(),
            q: rows(q).into_iter().map(SVector::from).collect(),
            held: rows(tau).into_iter().map(|row| row.map(InputSegment::held)).collect(),
            noise: [0.0; N],
            is_held: [false; N],
            step: [0.0; N],
            pushes: Vec::new(),
            tables: Vec::new(),
            reference: None,
            driven: std::array::from_fn(|_| None),
            period: OnceLock::new(),
            path: OnceLock::new(),
            smoothed: OnceLock::new(),
        };
        for j in 0..N {
            let column = track.column(j);
            track.step[j] = steps.map_or_else(|| smallest_step(&column), |s| s[j]);
            let found = noise(&track.t, &column, track.step[j]);
            (track.noise[j], track.is_held[j]) = (found.sigma, found.is_held);
        }
        track
    }

    /// The track with the name of the recording that it is a part of.
    pub fn of_source(self, source: &str) -> Self {
        Self { source: source.to_owned(), ..self }
    }

    /// Replaces held torques by linear segments of equal mean with the given first moments about the middle of each interval.
    pub fn with_moments(mut self, moments: Option<&[f64]>) -> Self {
        let Some(moments) = moments else { return self };
        for (k, row) in moments.chunks_exact(N).enumerate() {
            let Some(h) = self.t.get(k + 1).map(|next| next - self.t[k]) else { break };
            for (segment, moment) in self.held[k].iter_mut().zip(row) {
                *segment = InputSegment::with_moment(segment.mean(), *moment, h);
            }
        }
        self
    }

    /// The track with the torques of the custom effects, one table per effect.
    pub fn with_tables(mut self, tables: Vec<Vec<f64>>) -> Self {
        self.tables = tables;
        self
    }

    /// Subtracts the motion due to the torque from the measured motion before local cubics are fitted to it.
    ///
    /// A torque that jumps from sample to sample, as that of a controller with a noisy velocity does, allows cubics through a few samples only. The
    /// motion due to the torque over some samples follows from the inertia `M(q)` alone; the rest, due to friction, gravity and effects that the
    /// model leaves out, is smooth. Where the arm is not driven in this way (a wrong sign or unit, a motor behind a spring), subtraction makes the
    /// motion no smoother, and the motion is taken as measured.
    pub fn smoothed_beside_torque<A: Arm<f64, N, P>, const P: usize>(
        mut self,
        arm: &A,
        theta: &[f64; P],
    ) -> Self {
        let accelerations: Vec<SVector<f64, N>> = self
            .q
            .iter()
            .zip(&self.held)
            .map(|(q, held)| {
                let tau = SVector::from_fn(|j, _| held[j].mean());
                arm.inertia(theta, q).cholesky().map_or_else(SVector::zeros, |inertia| inertia.solve(&tau))
            })
            .collect();
        for j in (0..N).filter(|j| !self.is_held[*j]) {
            let column: Vec<f64> = accelerations.iter().map(|a| a[j]).collect();
            let is_finite = column.iter().all(|a| a.is_finite());
            if is_finite && self.roughness(j, Some(&column)) < self.roughness(j, None) {
                self.driven[j] = Some(column);
            }
        }
        self
    }

    /// Sum over some samples of the logarithm of the variance of a joint's velocity by a local cubic: low where cubics are wide; `driven` is the
    /// acceleration due to the torque whose motion is subtracted, rad/s^2 or m/s^2.
    fn roughness(&self, j: usize, driven: Option<&[f64]>) -> f64 {
        (0..self.len()).step_by(ASKED).map(|k| self.widest(j, k, driven).local.covariance[2].ln()).sum()
    }

    /// Index of the first sample and positions of joint `j` for cubics around sample `at`, minus the displacement since the first sample due to the
    /// accelerations `driven`.
    fn positions_near(&self, j: usize, at: usize, driven: Option<&[f64]>) -> (usize, [f64; WIDEST]) {
        let (first, count) = samples_near(&self.t, at, WIDEST / 2);
        let mut positions = [0.0; WIDEST];
        for (place, q) in positions.iter_mut().zip(&self.q[first..first + count]) {
            *place = q[j];
        }
        let Some(driven) = driven else { return (first, positions) };
        let (mut distance, mut speed) = (0.0, 0.0);
        for k in at + 1..first + count {
            let (h, a) = (self.t[k] - self.t[k - 1], driven[k - 1]);
            distance += h * (speed + 0.5 * h * a);
            speed += h * a;
            positions[k - first] -= distance;
        }
        (distance, speed) = (0.0, 0.0);
        for k in (first..at).rev() {
            let (h, a) = (self.t[k + 1] - self.t[k], driven[k]);
            distance -= h * (speed - 0.5 * h * a);
            speed -= h * a;
            positions[k - first] -= distance;
        }
        (first, positions)
    }

    /// One track of pieces that follow each other in time; `None` for no pieces.
    pub fn joined(pieces: &[&Self]) -> Option<Self> {
        let (first, rest) = pieces.split_first()?;
        // The motion due to the torque is subtracted at a joint only if it was subtracted in all pieces.
        let driven = std::array::from_fn(|j| {
            pieces
                .iter()
                .map(|piece| piece.driven[j].clone())
                .collect::<Option<Vec<_>>>()
                .map(|all| all.concat())
        });
        let mut whole = Self {
            period: OnceLock::new(),
            path: OnceLock::new(),
            smoothed: OnceLock::new(),
            pushes: Vec::new(),
            driven,
            ..(*first).clone()
        };
        for piece in rest {
            whole.t.extend(&piece.t);
            whole.q.extend(&piece.q);
            whole.held.extend(&piece.held);
            for (table, more) in whole.tables.iter_mut().zip(&piece.tables) {
                table.extend(more);
            }
        }
        Some(whole)
    }

    /// Measured positions of joint `j`, rad or m.
    pub fn column(&self, j: usize) -> Vec<f64> {
        self.q.iter().map(|q| q[j]).collect()
    }

    /// Number of samples of the track.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether the track has no sample.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Median sample period, s.
    pub fn period(&self) -> f64 {
        *self.period.get_or_init(|| median(self.t.windows(2).map(|w| w[1] - w[0]).collect()))
    }

    /// Measured state at sample `at`, from a local cubic in each joint.
    pub fn initial_state(&self, at: usize) -> InitialState<N> {
        let mut start = InitialState {
            q: self.q[at],
            dq: SVector::zeros(),
            covariance: [[0.0; 3]; N],
            mean_square: [[1.0; 2]; N],
        };
        for j in 0..N {
            let local = self.local(j, at);
            start.mean_square[j] = self.mean_square(j, at, &local);
            let variance = self.noise[j] * self.noise[j];
            (start.q[j], start.dq[j]) = (local.q, local.dq);
            start.covariance[j] = local.covariance.map(|c| c * variance);
        }
        start
    }

    /// Smoothed positions and velocities at every sample.
    pub fn path(&self) -> &[MeasuredState<N>] {
        self.path.get_or_init(|| {
            let moving = |smoothed: &[Smoothed; N]| MeasuredState {
                q: SVector::from_fn(|j, _| smoothed[j].local.q),
                dq: SVector::from_fn(|j, _| smoothed[j].local.dq),
            };
            self.smoothed().iter().map(moving).collect()
        })
    }

    /// Local cubics of all joints at every sample.
    pub fn smoothed(&self) -> &[[Smoothed; N]] {
        let at = |k: usize| std::array::from_fn(|j| self.nested(j, k));
        self.smoothed.get_or_init(|| (0..self.len()).into_par_iter().map(at).collect())
    }

    /// Local cubic of joint `j` around sample `at`, with a width adapted to the motion.
    ///
    /// The width grows while the confidence intervals of the velocities have a point in common; a jump of the acceleration nearby ends the growth
    /// early, smooth motion late (intersection of confidence intervals, Goldenshluger and Nemirovski 1997). The widest cubic that passes may still
    /// err by several of its standard deviations without contradicting narrower ones; the next narrower one errs by a third of this and has the
    /// larger standard deviation, so its error agrees with its covariance.
    pub fn local(&self, j: usize, at: usize) -> Local {
        self.nested(j, at).local
    }

    /// Local cubic of joint `j` around sample `at`, with its half width.
    fn nested(&self, j: usize, at: usize) -> Smoothed {
        self.widest(j, at, self.driven[j].as_deref())
    }

    /// Local cubic of joint `j` around sample `at`, the widest but one that is consistent with all narrower ones, after subtraction of the motion due
    /// to the accelerations `driven`.
    fn widest(&self, j: usize, at: usize, driven: Option<&[f64]>) -> Smoothed {
        let (first, positions) = self.positions_near(j, at, driven);
        let fit = |half: usize| (local_cubic(&self.t, |k| positions[k - first], at, half), half);
        let mut widest = fit(HALF_WIDTHS[0]);
        let mut before = widest;
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for half in HALF_WIDTHS.into_iter().filter(|half| 2 * half < self.len()) {
            let (local, half) = fit(half);
            let radius = CONFIDENCE * self.noise[j] * local.covariance[2].sqrt();
            (low, high) = (low.max(local.dq - radius), high.min(local.dq + radius));
            if low > high {
                break;
            }
            (before, widest) = (widest, (local, half));
        }
        Smoothed { local: before.0, half_width: before.1 }
    }

    /// Mean square errors of a local cubic's position and velocity in units of their variance: raised where the cubic's residuals exceed the noise
    /// because no cubic describes the motion, and that of the position by the distance of the cubic from the sample.
    ///
    /// Where positions are held over several rows, the residuals of a cubic say nothing about the motion.
    fn mean_square(&self, j: usize, at: usize, local: &Local) -> [f64; 2] {
        if self.is_held[j] {
            return [1.0; 2];
        }
        let noise = self.noise[j].powi(2);
        let vq = local.covariance[0];
        let misfit = local.misfit / noise;
        let position = misfit + ((self.q[at][j] - local.q).powi(2) / noise - (1.0 - vq)) / vq;
        [position.clamp(LEAST_ERROR, LARGEST_ERROR), ERROR_PER_MISFIT * (1.0 + misfit)]
    }
}

/// Median of a list of numbers; zero for an empty list.
pub fn median(mut x: Vec<f64>) -> f64 {
    if x.is_empty() {
        return 0.0;
    }
    let middle = x.len() / 2;
    *x.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Step of the grid on which the values `q` lie: their smallest repeated non-zero difference; zero without a grid.
fn smallest_step(q: &[f64]) -> f64 {
    let mut steps: Vec<f64> = q.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 1e-12).collect();
    if steps.len() < 20 {
        return 0.0;
    }
    steps.sort_by(f64::total_cmp);
    let step = steps[steps.len() / 200];
    let on_grid = steps.iter().filter(|d| ((*d / step).round() * step - *d).abs() < 0.05 * step).count();
    if on_grid * 10 > steps.len() * 9 { step } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;
    use armgap_core::arm::Pendulum;

    const INERTIA: f64 = 0.5;
    const STEP: f64 = 1e-7;

    /// Positions, torques and true velocities of a pendulum's inertia under a torque that is random in every sample, beside a slow motion.
    fn jerky(sign: f64) -> (Track<1>, Vec<f64>) {
        let (h, mut random) = (0.0025, Random(1));
        let (mut q, mut dq) = (0.0, 0.0);
        let (mut t, mut positions, mut torques, mut rates) = (vec![], vec![], vec![], vec![]);
        for k in 0..800 {
            let now = h * f64::from(k);
            let tau = 3.0 * random.normal();
            t.push(now);
            positions.push(((q + now.powi(2)) / STEP).round() * STEP);
            rates.push(dq + 2.0 * now);
            torques.push(sign * tau);
            q += h * (dq + 0.5 * h * tau / INERTIA);
            dq += h * tau / INERTIA;
        }
        (Track::new("", &t, &positions, &torques, Some([STEP])), rates)
    }

    fn worst(track: &Track<1>, rates: &[f64]) -> f64 {
        (10..790).map(|k| (track.initial_state(k).dq[0] - rates[k]).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn the_torque_s_part_of_a_jerky_motion_is_known() {
        let (track, rates) = jerky(1.0);
        let theta = [INERTIA, 0.0, 0.0, 0.0];
        let arm = Pendulum { gravity: 9.81 };
        let plain = worst(&track, &rates);
        let beside = worst(&track.smoothed_beside_torque(&arm, &theta), &rates);
        assert!(beside < 0.05 * plain, "{beside} beside {plain}");
    }

    #[test]
    fn a_torque_of_the_wrong_sign_is_left_aside() {
        let (track, rates) = jerky(-1.0);
        let plain = worst(&track, &rates);
        let beside = worst(
            &track.smoothed_beside_torque(&Pendulum { gravity: 9.81 }, &[INERTIA, 0.0, 0.0, 0.0]),
            &rates,
        );
        assert!((beside - plain).abs() < 1e-12, "{beside} beside {plain}");
    }

    #[test]
    fn pieces_are_joined_with_what_their_torques_make() {
        let arm = Pendulum { gravity: 9.81 };
        let beside = || jerky(1.0).0.smoothed_beside_torque(&arm, &[INERTIA, 0.0, 0.0, 0.0]);
        let mut later = beside();
        later.t.iter_mut().for_each(|t| *t += 2.0);
        let whole = Track::joined(&[&beside(), &later]).unwrap();
        assert_eq!(whole.driven[0].as_ref().map(Vec::len), Some(whole.len()));
        assert!(whole.initial_state(whole.len() - 1).dq[0].is_finite());
        let mixed = Track::joined(&[&beside(), &jerky(1.0).0]).unwrap();
        assert!(mixed.driven[0].is_none());
    }

    /// Ratios to the true RMS velocity error over all samples: of the estimated one, and of the standard deviation from the noise alone.
    fn claimed(track: &Track<1>, rates: &[f64]) -> [f64; 2] {
        let (mut claimed, mut true_square) = ([0.0; 2], 0.0);
        for (k, rate) in rates.iter().enumerate().take(790).skip(10) {
            let state = track.initial_state(k);
            let variance = state.covariance[0][2];
            claimed[0] += state.mean_square[0][1] * variance;
            claimed[1] += variance;
            true_square += (state.dq[0] - rate).powi(2);
        }
        claimed.map(|square| (square / true_square).sqrt())
    }

    /// Track and true velocities of a slow motion behind an encoder, with an acceleration that jumps every eighth of a second, rad/s^2.
    fn with_jumps(size: f64) -> (Track<1>, Vec<f64>) {
        let (h, step, mut random) = (0.0025, 1e-5, Random(3));
        let (mut q, mut dq, mut ddq) = (0.0, 0.1, 0.0);
        let (mut t, mut positions, mut rates) = (vec![], vec![], vec![]);
        for k in 0..800 {
            if k % 50 == 0 {
                ddq = size * random.normal();
            }
            let now = h * f64::from(k);
            t.push(now);
            positions.push(((q + 0.3 * (2.0 * now).sin()) / step).round() * step);
            rates.push(dq + 0.6 * (2.0 * now).cos());
            q += h * (dq + 0.5 * h * ddq);
            dq += h * ddq;
        }
        (Track::new("", &t, &positions, &vec![0.0; 800], Some([step])), rates)
    }

    #[test]
    fn the_error_of_a_velocity_is_that_of_the_noise_in_smooth_motion_and_larger_beside_jumps() {
        for size in [0.0, 0.02, 0.5] {
            let (track, rates) = with_jumps(size);
            let [ratio, _] = claimed(&track, &rates);
            assert!((0.5..2.0).contains(&ratio), "{size}: {ratio}");
        }
        let (track, rates) = with_jumps(10.0);
        let [ratio, of_noise] = claimed(&track, &rates);
        assert!(of_noise < 0.25 && ratio > 2.0 * of_noise, "{ratio}, by the noise alone {of_noise}");
    }
}
