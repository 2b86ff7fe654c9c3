//! Pure delay of the torque: `tau_joint(t) = tau(t - delay)`.
//!
//! A delay that is no whole number of samples puts a step of the held command inside an interval; the torque over the interval then has the exact
//! mean and first moment of the delayed command. Before the log begins, the first command is taken to have been held.

use super::{Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Spec};
use crate::real::{Real, lit};

/// Pure delay of the torque command: `tau_joint(t) = tau(t - delay)`.
#[derive(Debug)]
pub struct ActuatorDelay;

static SPEC: Spec = Spec {
    name: "actuator_delay",
    title: "actuator delay",
    equation: "tau_joint(t) = tau(t - delay)",
    source: "bus and firmware latency",
    excited_by: "torque that changes from sample to sample",
    parameters: &[EffectParameter::bounded("delay", Quantity::Time, 0.0, 1.0)],
    initial_guesses: &[[0.5, 0.0, 0.0], [3.0, 0.0, 0.0]],
    hooks: Hooks::COMMAND,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for ActuatorDelay {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], t: &[T], torque: &mut [InputSegment<T>]) {
        for k in (0..torque.len()).rev() {
            let h = super::interval(t, k);
            let Some(&start) = t.get(k) else { continue };
            let (mean, moment) = held(t, torque, k, start - p[0], start - p[0] + h);
            if let Some(segment) = torque.get_mut(k) {
                *segment = InputSegment::with_moment(mean, moment, h);
            }
        }
    }
}

/// Mean over `[from, to]` of the held command `torque`, N m (N), and its first moment about the middle; `last` is the last interval that is read.
fn held<T: Real>(t: &[T], torque: &[InputSegment<T>], last: usize, from: T, to: T) -> (T, T) {
    let (length, middle) = (to - from, lit::<T>(0.5) * (from + to));
    let (mut upper, mut sum, mut moment, mut i) = (to, T::zero(), T::zero(), last);
    loop {
        let (Some(&begin), Some(segment)) = (t.get(i), torque.get(i)) else {
            return (T::zero(), T::zero());
        };
        let lower = if i == 0 { from } else { begin.max(from) };
        if upper > lower {
            let piece = (upper - lower) * segment.mean();
            sum += piece;
            moment += piece * (lit::<T>(0.5) * (upper + lower) - middle);
            upper = lower;
        }
        if i == 0 || begin <= from {
            return if length > T::zero() { (sum / length, moment) } else { (segment.mean(), T::zero()) };
        }
        i -= 1;
    }
}
