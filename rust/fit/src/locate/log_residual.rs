//! Residual torque of a log by inverse dynamics, and the torque of a cause as the difference of two.

use crate::locate::table_form::{MotionPoint, Place, TableForm};
use crate::log::track::Track;
use crate::model::hypothesis::Hypothesis;
use crate::predict::residual_torque::{
    InverseDynamicsResidual, half_width, inverse_dynamics_residuals, rms_speeds, slow_speeds,
};
use armgap_core::arm::Arm;
use nalgebra::SVector;

/// Residual torque of one log under a model by inverse dynamics, sample by sample.
pub struct LogResidual<const N: usize> {
    /// Samples of the log except a few at either end.
    pub samples: Vec<InverseDynamicsResidual<N>>,
    /// Median sample period of the log, s.
    pub(super) period: f64,
    /// Standard deviation of the position measurement per joint, rad or m.
    pub(super) noise: [f64; N],
    /// Speeds below which a joint may be at rest, rad/s or m/s.
    pub(super) slow: [f64; N],
    /// Whether the torques of the tables are fitted to this log; all logs serve to judge which tables there are.
    pub(super) in_training: bool,
    /// Torque at every sample of the cause in whose place a table stands, N m or N; empty where there is none.
    pub(super) cause: Vec<SVector<f64, N>>,
}

impl<const N: usize> LogResidual<N> {
    /// Residual torque of a log under a model; `None` where the model cannot be simulated.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        arm: &A,
        track: &Track<N>,
        model: &Hypothesis<P>,
        in_training: bool,
    ) -> Option<Self> {
        let slow = slow_speeds(track, &rms_speeds(track));
        let slowest = slow.iter().copied().fold(f64::INFINITY, f64::min);
        let half = half_width(track);
        let samples = inverse_dynamics_residuals(arm, track, model, &track.pushes, half, slowest)?;
        (samples.len() > 2).then(|| Self {
            samples,
            period: track.period(),
            noise: track.noise,
            slow,
            in_training,
            cause: Vec::new(),
        })
    }

    /// The same residual torque as that of a model without a cause, which has the residual torque `with` with it: the difference is the cause's torque.
    pub fn beside_cause(self, with: &Self) -> Self {
        let cause = self.samples.iter().zip(&with.samples).map(|(a, b)| a.residual - b.residual).collect();
        Self { cause, ..self }
    }

    /// Torque of the cause at each of the log's `len` samples, N m or N: at those that are left out at either end, that of the next one.
    pub fn cause_along(&self, len: usize) -> Vec<SVector<f64, N>> {
        let (first, last) =
            (len.saturating_sub(self.samples.len()) / 2, self.samples.len().saturating_sub(1));
        (0..len).map(|k| self.cause_at(k.saturating_sub(first).min(last))).collect()
    }

    /// Torque of the cause on `joint` (from 0) at a sample, N m or N.
    pub fn cause_of(&self, joint: usize, sample: usize) -> f64 {
        self.cause_at(sample)[joint]
    }

    fn cause_at(&self, sample: usize) -> SVector<f64, N> {
        self.cause.get(sample).copied().unwrap_or_else(SVector::zeros)
    }

    /// Times of the samples since the first, s.
    pub fn times(&self) -> Vec<f64> {
        self.samples.iter().map(|x| x.t - self.samples[0].t).collect()
    }

    /// Factor and variables of a form at every sample.
    pub fn along(&self, form: TableForm) -> Vec<Place> {
        let first = self.samples[0].t;
        let point = |(k, x): (usize, &InverseDynamicsResidual<N>)| {
            let cause = self.cause_at(k);
            MotionPoint { t: x.t - first, motion: x.motion, tau: x.tau, cause }
        };
        let points: Vec<MotionPoint<N>> = self.samples.iter().enumerate().map(point).collect();
        form.along(&points, &self.slow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::dependence::MotionVariable;

    /// Log with the given residual torques.
    fn log(residual: &[f64]) -> LogResidual<1> {
        let zero = SVector::zeros();
        let sample = |(k, torque): (usize, &f64)| InverseDynamicsResidual {
            t: 0.01 * k as f64,
            motion: [zero; 3],
            tau: zero,
            residual: SVector::from([*torque]),
        };
        let samples = residual.iter().enumerate().map(sample).collect();
        let (noise, slow, cause) = ([0.0], [0.1], Vec::new());
        LogResidual { samples, period: 0.01, noise, slow, in_training: true, cause }
    }

    #[test]
    fn the_cause_is_what_its_model_supplies_and_is_held_at_either_end() {
        let (without, with) = (log(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]), log(&[0.5; 6]));
        let along =
            |log: &LogResidual<1>| log.cause_along(10).iter().map(|torque| torque[0]).collect::<Vec<_>>();
        assert_eq!(along(&without), [0.0; 10]);
        let without = without.beside_cause(&with);
        assert_eq!(along(&without), [-0.5, -0.5, -0.5, 0.5, 1.5, 2.5, 3.5, 4.5, 4.5, 4.5]);
        let form = TableForm::over(MotionVariable::Cause(0));
        assert_eq!(without.along(form)[3], Place { factor: 1.0, x: 2.5, y: 0.0 });
    }
}
