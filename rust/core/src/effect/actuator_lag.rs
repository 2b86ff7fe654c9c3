//! First-order lag of the torque: `time_constant dtau_joint/dt + tau_joint = tau`.
//!
//! With the command held over an interval of length `h`, the torque goes exponentially from its old value to the
//! command. Start, end and mean of that are exact for every time constant down to zero.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Pulse, Quantity, Scope, Spec, Trial};
use crate::real::Real;

/// First-order actuator.
#[derive(Debug)]
pub struct ActuatorLag;

static SPEC: Spec = Spec {
    name: "actuator_lag",
    title: "first-order actuator lag",
    equation: "time_constant dtau_joint/dt + tau_joint = tau",
    source: "current-loop bandwidth; filtered actuator of common simulators",
    excited_by: "torque that changes within a few time constants",
    scope: Scope::Joint,
    least_joints: 1,
    parameters: &[EffectParameter::bounded("time_constant", Quantity::Time, 0.0, 2.0)],
    starts: &[[0.5, 0.0, 0.0], [4.0, 0.0, 0.0]],
    trial: Trial::Amplitudes(1),
    hooks: Hooks::COMMAND,
};

impl<T: Real> Effect<T> for ActuatorLag {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], t: &[T], torque: &mut [Pulse<T>]) {
        let Some(first) = torque.first() else { return };
        let mut y = first.start;
        for (k, pulse) in torque.iter_mut().enumerate() {
            let h = super::interval(t, k);
            let u = pulse.mean();
            let ratio = if p[0] > T::zero() { h / p[0] } else { T::zero() };
            let decay = if p[0] > T::zero() { (-ratio).exp() } else { T::zero() };
            let end = u + (y - u) * decay;
            let held = if ratio > T::zero() { (T::one() - decay) / ratio } else { T::zero() };
            *pulse = Pulse::with_mean(y, u + (y - u) * held, end);
            y = end;
        }
    }
}
