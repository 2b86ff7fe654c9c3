//! External disturbance of one log: a constant torque of the given impulse, N m s (N s), for `duration`, s, around `time`, s.
//!
//! The torque over each sample interval has the exact mean and first moment, so a mass gains the exact speed and distance whatever the sample times.

use super::{Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::{Real, lit};

/// External disturbance at one time of one log: a constant torque over a short duration.
#[derive(Debug)]
pub struct ExternalPulse;

static SPEC: Spec = Spec {
    name: "external_pulse",
    title: "external push",
    equation: "tau_joint = tau + impulse / duration while |t - time| < duration / 2",
    source: "collision detection by momentum observers, De Luca and Mattone 2003",
    excited_by: "a push during the log",
    parameters: &[
        EffectParameter::signed("impulse", Quantity::Impulse),
        EffectParameter::shape("time", Quantity::Duration, f64::NEG_INFINITY, f64::INFINITY),
        EffectParameter::shape("duration", Quantity::Duration, 1e-4, f64::INFINITY),
    ],
    initial_guesses: &[],
    trial: Trial::Disturbance,
    hooks: Hooks::COMMAND,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for ExternalPulse {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], t: &[T], torque: &mut [InputSegment<T>]) {
        let half = p[2] * lit(0.5);
        let (from, to) = (p[1] - half, p[1] + half);
        for (k, (&start, segment)) in t.iter().zip(torque.iter_mut()).enumerate() {
            let h = super::interval(t, k);
            let (begin, end) = (start.max(from), (start + h).min(to));
            if end > begin && h > T::zero() && p[2] > T::zero() {
                let part = p[0] / p[2] * (end - begin);
                let behind = lit::<T>(0.5) * (begin + end - h) - start;
                *segment = segment.plus(InputSegment::with_moment(part / h, part * behind, h));
            }
        }
    }
}
