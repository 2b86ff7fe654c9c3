//! First-order lag of the torque: `time_constant dtau_joint/dt + tau_joint = tau`.
//!
//! With the command held over an interval of length `h`, the torque goes exponentially from its old value to the command. The torque's mean over the
//! interval and its first moment are exact for every time constant down to zero.

use super::{Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Spec};
use crate::real::{Real, lit};

/// First-order lag of the torque: `time_constant dtau_joint/dt + tau_joint = tau`.
#[derive(Debug)]
pub struct ActuatorLag;

static SPEC: Spec = Spec {
    name: "actuator_lag",
    title: "first-order actuator lag",
    equation: "time_constant dtau_joint/dt + tau_joint = tau",
    source: "current-loop bandwidth; filtered actuator of common simulators",
    excited_by: "torque that changes within a few time constants",
    parameters: &[EffectParameter::bounded("time_constant", Quantity::Time, 0.0, 2.0)],
    initial_guesses: &[[0.5, 0.0, 0.0], [4.0, 0.0, 0.0]],
    hooks: Hooks::COMMAND,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for ActuatorLag {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], t: &[T], torque: &mut [InputSegment<T>]) {
        let Some(first) = torque.first() else { return };
        let mut lag = first.start;
        for (k, segment) in torque.iter_mut().enumerate() {
            let h = super::interval(t, k);
            let (u, constant) = (segment.mean(), p[0]);
            let behind = lag - u;
            let decay = if constant > T::zero() { (-h / constant).exp() } else { T::zero() };
            let held = if h > T::zero() { constant * (T::one() - decay) / h } else { T::zero() };
            let half = lit::<T>(0.5) * h;
            let moment = constant * (constant * (T::one() - decay) - half * (T::one() + decay));
            *segment = InputSegment::with_moment(u + behind * held, behind * moment, h);
            lag = u + behind * decay;
        }
    }
}
