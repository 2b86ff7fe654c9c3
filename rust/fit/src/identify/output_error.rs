//! All parameters of an arm from one log by output error: Levenberg-Marquardt over short windows, with exact dry friction.
//!
//! Every window starts from its measured initial state and runs under the logged torque; the sum of squared differences of positions is
//! minimised over `theta` by Levenberg's and Marquardt's method with forward differences. All windows under all displaced parameters
//! are independent rollouts, distributed over vector units and processors (see [`armgap_core::rollout`]).

use crate::likelihood::solve::scaled_inverse;
use crate::log::track::Track;
use crate::model::arm::WithArm;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::{cross, squares};
use crate::predict::window::{Dataset, InitialStateOffset};
use armgap_core::arm::Arm;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Displacement of a parameter for forward differences, relative to the parameter's initial value; the error of event location in rollouts is far
/// smaller.
const RELATIVE_STEP: f64 = 1e-6;

/// Largest number of Levenberg-Marquardt iterations.
const MAX_OUTPUT_ERROR_ITERATIONS: usize = 50;

/// Relative change of all parameters by a step below which the search ends.
const STEP_TOLERANCE: f64 = 1e-8;

/// Largest number of attempts at a step, each with more damping.
const MAX_ATTEMPTS: usize = 8;

/// A log to be fitted by output error; rows of `q` and `tau` (one entry per joint) follow each other.
#[derive(Debug, Clone)]
pub struct OutputError<'a> {
    /// Sample times, s.
    pub t: &'a [f64],
    /// Measured positions, rad or m, row by row.
    pub q: &'a [f64],
    /// Torques held from each sample to the next, N m or N, row by row.
    pub tau: &'a [f64],
    /// Length of a prediction window, s.
    pub horizon: f64,
    /// Encoder steps per joint, rad or m, where they are known.
    pub steps: Option<&'a [f64]>,
}

/// Parameters at a minimum of the output error, with their uncertainty.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Estimated parameters of the arm, SI.
    pub theta: Vec<f64>,
    /// Standard deviations of the estimated parameters, for white residuals.
    pub sigma: Vec<f64>,
    /// RMS difference of measured and predicted positions over all joints, rad or m.
    pub rms: f64,
    /// Number of Levenberg-Marquardt steps taken.
    pub iterations: usize,
    /// Whether the search converged: its last step changed no parameter beyond the tolerance.
    pub settled: bool,
}

impl WithArm for OutputError<'_> {
    type Output = Option<Estimate>;

    /// Parameters at the minimum of the output error that is reached from the initial values `theta`; `None` for a log shorter than one window.
    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        theta: [f64; P],
    ) -> Option<Estimate> {
        let steps = self.steps.and_then(|steps| steps.try_into().ok());
        let data = Dataset::new(vec![Track::<N>::new("", self.t, self.q, self.tau, steps)], self.horizon);
        if data.rows * N <= P {
            return None;
        }
        let (measured, offsets) = (data.measured(), data.zero_offsets());
        Some(OutputErrorProblem { arm: &arm, data: &data, measured, offsets }.minimum(theta))
    }
}

/// Windows of a log with their measured positions and the offsets of their initial states.
struct OutputErrorProblem<'a, A, const N: usize> {
    arm: &'a A,
    data: &'a Dataset<N>,
    measured: Vec<f64>,
    offsets: Vec<InitialStateOffset<N>>,
}

/// Parameters with the residual and cost of their predictions.
struct TrialPoint<const P: usize> {
    theta: [f64; P],
    residual: Vec<f64>,
    cost: f64,
}

impl<A, const N: usize> OutputErrorProblem<'_, A, N> {
    fn point<const P: usize>(&self, theta: [f64; P]) -> TrialPoint<P>
    where
        A: Arm<f64, N, P>,
    {
        let predicted = self.data.predict(self.arm, &Hypothesis::rigid(theta), &self.offsets);
        let residual: Vec<f64> = self.measured.iter().zip(&predicted).map(|(y, x)| y - x).collect();
        let cost = squares(&[&residual])[0];
        TrialPoint { theta, residual, cost }
    }

    /// Derivatives of the predicted positions by each parameter, by forward differences.
    fn sensitivities<const P: usize>(&self, at: &TrialPoint<P>, steps: &[f64; P]) -> Vec<Vec<f64>>
    where
        A: Arm<f64, N, P>,
    {
        let column = |i: usize| {
            let mut theta = at.theta;
            theta[i] += steps[i];
            let there = self.point(theta).residual;
            at.residual.iter().zip(&there).map(|(here, there)| (here - there) / steps[i]).collect()
        };
        (0..P).into_par_iter().map(column).collect()
    }

    fn minimum<const P: usize>(&self, theta: [f64; P]) -> Estimate
    where
        A: Arm<f64, N, P>,
    {
        let steps = theta.map(|x| RELATIVE_STEP * x.abs().max(1e-3));
        let mut at = self.point(theta);
        let (mut damping, mut iterations, mut settled) = (1e-6, 0, false);
        let mut normal;
        loop {
            let gradient;
            (normal, gradient) = normal_equations(&self.sensitivities(&at, &steps), &at.residual);
            if settled || iterations == MAX_OUTPUT_ERROR_ITERATIONS {
                break;
            }
            iterations += 1;
            let mut found = None;
            for _ in 0..MAX_ATTEMPTS {
                let theta = moved::<A, N, P>(&at.theta, &normal, &gradient, damping);
                settled = theta
                    .iter()
                    .zip(&at.theta)
                    .all(|(a, b)| (a - b).abs() <= STEP_TOLERANCE * b.abs().max(1e-3));
                found = Some(self.point(theta)).filter(|there| there.cost < at.cost);
                if found.is_some() || settled {
                    break;
                }
                damping *= 10.0;
            }
            damping = (damping * 0.1).max(1e-12);
            match found {
                Some(there) => at = there,
                None => break,
            }
        }
        self.estimate(&at, &normal, iterations, settled)
    }

    fn estimate<const P: usize>(
        &self,
        at: &TrialPoint<P>,
        normal: &DMatrix<f64>,
        iterations: usize,
        settled: bool,
    ) -> Estimate {
        let count = self.measured.len();
        let variance = at.cost / (count - P) as f64;
        let inverse = scaled_inverse(normal);
        let sigma = |i: usize| inverse.as_ref().map_or(f64::INFINITY, |m| (m[(i, i)] * variance).sqrt());
        Estimate {
            theta: at.theta.to_vec(),
            sigma: (0..P).map(sigma).collect(),
            rms: (at.cost / count as f64).sqrt(),
            iterations,
            settled,
        }
    }
}

/// Normal matrix and right-hand side of a linear least-squares problem.
fn normal_equations(columns: &[Vec<f64>], residual: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
    let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let k = columns.len();
    let normal = DMatrix::from_row_slice(k, k, &cross(&columns, &columns));
    (normal, DVector::from_vec(cross(&[residual], &columns)))
}

/// Parameters after one damped Gauss-Newton step; friction coefficients stay non-negative.
fn moved<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    theta: &[f64; P],
    normal: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
) -> [f64; P] {
    let mut damped = normal.clone();
    for i in 0..P {
        damped[(i, i)] *= 1.0 + damping;
    }
    let Some(inverse) = scaled_inverse(&damped) else { return *theta };
    let step = inverse * gradient;
    std::array::from_fn(|i| {
        let next = theta[i] + step[i];
        if i < A::INERTIAL { next } else { next.max(0.0) }
    })
}
