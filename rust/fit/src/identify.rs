//! Identification over a whole log: the online estimator, sample after sample.

use crate::arm::WithArm;
use crate::smooth::local_cubic;
use armgap_core::arm::Arm;
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Outcome, Sample, Settings};
use armgap_core::regression::{Scheme, Variant};
use nalgebra::SVector;

/// An identification to be run; rows of `q`, `tau` and `dq` follow each other.
#[derive(Debug, Clone)]
pub struct Identification<'a> {
    /// Regression model.
    pub scheme: Scheme,
    /// Filters and alignment.
    pub variant: Variant,
    /// Cut-off, rad/s.
    pub cutoff: f64,
    /// Forgetting factor.
    pub forgetting: f64,
    /// `P(0) = p0 I`.
    pub p0: f64,
    /// `theta(0)`: the arm's parameters, or those and one asymmetry per joint.
    pub theta0: &'a [f64],
    /// Sample times, s.
    pub t: &'a [f64],
    /// Positions.
    pub q: &'a [f64],
    /// Torques held from each sample on.
    pub tau: &'a [f64],
    /// Velocities at the samples; without them differences of positions serve.
    pub dq: Option<&'a [f64]>,
}

/// History of an estimate; one row per sample.
#[derive(Debug, Clone, Default)]
pub struct EstimateHistory {
    /// Estimates.
    pub theta: Vec<f64>,
    /// Prediction errors, the first column only for scalar schemes; NaN where there is none.
    pub errors: Vec<f64>,
    /// Last covariance for an error of unit variance, row by row.
    pub covariance: Vec<f64>,
    /// Parameters estimated.
    pub parameters: usize,
    /// Errors per sample.
    pub outputs: usize,
    /// Samples used.
    pub updates: u64,
    /// Samples rejected.
    pub rejected: u64,
}

impl WithArm for Identification<'_> {
    type Output = Option<EstimateHistory>;

    /// The history, or none if `theta0` has the wrong length.
    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        _: [f64; P],
    ) -> Option<EstimateHistory> {
        match self.theta0.len() {
            n if n == P => Some(self.run::<A, N, P, P>(arm)),
            n if n == R => Some(self.run::<A, N, P, R>(arm)),
            _ => None,
        }
    }
}

impl Identification<'_> {
    fn run<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        &self,
        arm: A,
    ) -> EstimateHistory {
        let settings = Settings {
            scheme: self.scheme,
            variant: self.variant,
            cutoff: Cutoff { rad_per_s: self.cutoff },
            forgetting: self.forgetting,
            theta0: SVector::<f64, R>::from_fn(|i, _| self.theta0[i]),
            p0: self.p0,
        };
        let mut estimator = Estimator::<f64, A, N, P, R>::new(arm, settings);
        let row = |x: &[f64], k: usize| SVector::<f64, N>::from_fn(|j, _| x[k * N + j]);
        let outputs = if self.scheme == Scheme::FilteredDynamic { N } else { 1 };
        let mut history = EstimateHistory { parameters: R, outputs, ..EstimateHistory::default() };
        for k in 0..self.t.len() {
            let dq = self.dq.map(|dq| row(dq, k));
            let sample = Sample { t: self.t[k], q: row(self.q, k), dq, tau: row(self.tau, k) };
            let error = match estimator.update(&sample) {
                Outcome::Updated(error) => error,
                Outcome::Starting | Outcome::Rejected => SVector::repeat(f64::NAN),
            };
            history.errors.extend(error.iter().take(outputs));
            history.theta.extend(estimator.rls().theta().iter());
        }
        history.covariance = estimator.rls().covariance().iter().copied().collect();
        history.updates = estimator.rls().updates();
        history.rejected = estimator.rejected();
        history
    }
}

/// How velocities are estimated from positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Velocity {
    /// The paper's: mean velocity of the period before; zero at the first sample.
    Backward,
    /// Slope of the parabola through a sample and its neighbours.
    Central,
    /// Local cubic least squares.
    LocalCubic,
}

impl Velocity {
    /// The method with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "backward" => Some(Self::Backward),
            "central" => Some(Self::Central),
            "local-cubic" => Some(Self::LocalCubic),
            _ => None,
        }
    }

    /// Velocities of one joint at all samples.
    pub fn of(self, t: &[f64], q: &[f64], half_width: usize) -> Vec<f64> {
        let slope = |a: usize, b: usize| (q[b] - q[a]) / (t[b] - t[a]);
        let last = t.len().saturating_sub(1);
        let one = |k: usize| match self {
            _ if last == 0 => 0.0,
            Self::Backward if k == 0 => 0.0,
            Self::Backward => slope(k - 1, k),
            Self::Central if k == 0 => slope(0, 1),
            Self::Central if k == last => slope(last - 1, last),
            Self::Central => {
                let (a, b) = (t[k] - t[k - 1], t[k + 1] - t[k]);
                (slope(k - 1, k) * b + slope(k, k + 1) * a) / (a + b)
            }
            Self::LocalCubic => local_cubic(t, |i| q[i], k, half_width).dq,
        };
        (0..t.len()).map(one).collect()
    }
}
