//! Online estimator of any arm with its monitor, and the trait of all such estimators.

use super::{EstimatorSettings, OnlineError, SampleStatus, When};
use crate::arm::Arm;
use crate::cpu::Level;
use crate::filter::Cutoff;
use crate::identify::{Estimator, Outcome, Reading, Sample, Settings};
use crate::monitor::Monitor;
use crate::real::{Real, lit};
use crate::regression::{AllColumns, Columns};
use nalgebra::SVector;

/// Online estimator of any arm, with its monitor.
pub trait OnlineEstimator<T: Real> {
    /// Number of joints.
    fn joints(&self) -> usize;

    /// Takes one sample, SI: positions, velocities where they are known, and the torques that act until the next sample, one per joint.
    fn update(
        &mut self,
        when: When<T>,
        q: &[T],
        dq: Option<&[T]>,
        tau: &[T],
    ) -> Result<SampleStatus, OnlineError>;

    /// Estimated parameters, SI.
    fn theta(&self) -> &[T];

    /// Prediction errors of the last sample used, N m, J or W by scheme: one per joint for the filtered dynamic model, else one.
    fn errors(&self) -> &[T];

    /// Writes the diagonal of the covariance `P`, for an error of unit variance, into `out`, fills the rest of `out` with zeros, and returns the
    /// number of estimated parameters.
    fn variances(&self, out: &mut [T]) -> usize;

    /// Mean square of each prediction error over the monitor's memory, N m, J or W squared by scheme.
    fn mean_square(&self) -> &[T];

    /// Excitation by the recent motion, from 0 (none) to about 1 (every parameter).
    fn excitation(&self) -> T;

    /// Largest cumulative sum of the alarm test as a share of its limit: above 1 the model no longer explains the arm.
    fn alarm_level(&self) -> T;

    /// Number of samples used.
    fn updates(&self) -> u64;

    /// Number of samples rejected.
    fn rejected(&self) -> u64;

    /// Writes standard deviations of the parameters, SI, into `out`, as if prediction errors were white, and returns their number.
    fn sigma(&self, out: &mut [T]) -> usize {
        let (count, squares) = (self.variances(out), self.mean_square());
        let spread = squares.iter().fold(T::zero(), |sum, x| sum + *x) / lit(squares.len() as f64);
        for x in out {
            *x = (*x * spread).max(T::zero()).sqrt();
        }
        count
    }
}

/// Online estimator with its monitor.
#[derive(Debug, Clone, Copy)]
pub struct MonitoredEstimator<T: Real, A, const N: usize, const P: usize, const R: usize, S = AllColumns>
where
    S: Columns<T, N, P, R>,
{
    estimator: Estimator<T, A, N, P, R, S>,
    monitor: Monitor<T, N>,
    errors: SVector<T, N>,
    /// Memory of the forgetting factor, `1 / (1 - forgetting)` samples; 1e30 without forgetting.
    memory: T,
    /// Numbers of joints in use, of estimated `parameters`, and of prediction errors per sample (`outputs`).
    joints: usize,
    parameters: usize,
    outputs: usize,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize>
    MonitoredEstimator<T, A, N, P, R, AllColumns>
{
    /// Estimator of all parameters, from the initial estimate `theta0`, padded with zeros.
    pub(super) fn new(arm: A, settings: &EstimatorSettings<T>, theta0: &[T]) -> Self {
        Self::of_columns(arm, AllColumns, [N, R], settings, theta0)
    }
}

impl<T: Real, A: Arm<T, N, P>, S: Columns<T, N, P, R>, const N: usize, const P: usize, const R: usize>
    MonitoredEstimator<T, A, N, P, R, S>
{
    /// Estimator of the parameters `columns`, in number `parameters`, of an arm of which the first `joints` move; further joints stand still.
    pub(super) fn of_columns(
        arm: A,
        columns: S,
        [joints, parameters]: [usize; 2],
        settings: &EstimatorSettings<T>,
        theta0: &[T],
    ) -> Self {
        let estimator_settings = Settings {
            scheme: settings.scheme,
            variant: settings.variant,
            cutoff: Cutoff { rad_per_s: settings.cutoff },
            forgetting: settings.forgetting,
            theta0: vector(theta0),
            p0: settings.p0,
        };
        let forgotten = T::one() - settings.forgetting;
        let estimator = Estimator::of_columns(arm, columns, estimator_settings);
        Self {
            estimator: match settings.form {
                Some(form) => estimator.with_form(form),
                None => estimator,
            },
            monitor: Monitor::new(settings.monitor),
            errors: SVector::zeros(),
            memory: if forgotten > T::zero() { T::one() / forgotten } else { lit(1e30) },
            joints,
            parameters,
            outputs: settings.outputs(joints),
        }
    }

    /// Changes the instruction set that samples are processed with; the default is that of [`crate::rls::Rls::with_level`].
    pub fn with_level(mut self, level: Level) -> Self {
        self.estimator = self.estimator.with_level(level);
        self
    }

    /// Writes the covariance `P`, for an error of unit variance, into `out`, row by row, and returns the number of parameters.
    pub fn covariance(&self, out: &mut [T]) -> usize {
        let (covariance, count) = (self.estimator.rls().covariance(), self.parameters);
        for (column, row) in covariance.data.0.iter().zip(out.chunks_mut(count.max(1))).take(count) {
            for (entry, value) in row.iter_mut().zip(column) {
                *entry = *value;
            }
        }
        count
    }

    /// Estimator without its monitor.
    pub fn estimator(&self) -> &Estimator<T, A, N, P, R, S> {
        &self.estimator
    }
}

/// Vector with the entries of a slice, and zeros where the slice ends.
#[inline]
fn vector<T: Real, const N: usize>(x: &[T]) -> SVector<T, N> {
    let mut v = SVector::<T, N>::zeros();
    for (entry, value) in v.iter_mut().zip(x) {
        *entry = *value;
    }
    v
}

/// The first `count` entries of a vector.
#[inline]
fn leading<T: Real, const N: usize>(x: &SVector<T, N>, count: usize) -> &[T] {
    x.as_slice().get(..count).unwrap_or(x.as_slice())
}

impl<T: Real, A: Arm<T, N, P>, S: Columns<T, N, P, R>, const N: usize, const P: usize, const R: usize>
    OnlineEstimator<T> for MonitoredEstimator<T, A, N, P, R, S>
{
    fn joints(&self) -> usize {
        self.joints
    }

    #[inline]
    fn update(
        &mut self,
        when: When<T>,
        q: &[T],
        dq: Option<&[T]>,
        tau: &[T],
    ) -> Result<SampleStatus, OnlineError> {
        let expected = self.joints;
        for (name, x) in [("q", q), ("dq", dq.unwrap_or(q)), ("tau", tau)] {
            if x.len() != expected {
                return Err(OnlineError::Length { name, expected });
            }
        }
        let (q, dq, tau) = (vector(q), dq.map(vector), vector(tau));
        let outcome = match when {
            When::At(t) => self.estimator.update(&Sample { t, q, dq, tau }),
            When::After(h) => self.estimator.update_after(h, &Reading { q, dq, tau }),
        };
        Ok(match outcome {
            Outcome::Starting => SampleStatus::Starting,
            Outcome::Rejected => SampleStatus::Rejected,
            Outcome::Updated(error) => {
                let rls = self.estimator.rls();
                let age = self.memory.min(lit(rls.updates() as f64));
                self.monitor.update(&error, rls.leverage(), self.parameters, age);
                self.errors = error;
                SampleStatus::Updated
            }
        })
    }

    #[inline]
    fn theta(&self) -> &[T] {
        leading(self.estimator.rls().theta(), self.parameters)
    }

    fn errors(&self) -> &[T] {
        leading(&self.errors, self.outputs)
    }

    fn variances(&self, out: &mut [T]) -> usize {
        let variances = self.estimator.rls().variances();
        out.fill(T::zero());
        for (x, v) in out.iter_mut().zip(leading(&variances, self.parameters)) {
            *x = *v;
        }
        self.parameters
    }

    fn mean_square(&self) -> &[T] {
        leading(self.monitor.mean_square(), self.outputs)
    }

    fn excitation(&self) -> T {
        self.monitor.excitation()
    }

    fn alarm_level(&self) -> T {
        self.monitor.alarm_level()
    }

    fn updates(&self) -> u64 {
        self.estimator.rls().updates()
    }

    fn rejected(&self) -> u64 {
        self.estimator.rejected()
    }
}
