//! Constant torque added to the command, `tau + offset`: bias of an amplifier or a current sensor.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Constant torque added to the commanded torque.
#[derive(Debug)]
pub struct TorqueOffset;

static SPEC: Spec = Spec {
    name: "torque_offset",
    title: "constant torque offset",
    equation: "tau_joint = tau + offset",
    source: "amplifier and current-sensor bias; Swevers et al. 2007",
    excited_by: "any motion",
    parameters: &[EffectParameter::signed("offset", Quantity::Torque)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for TorqueOffset {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], _x: &JointPoint<T>) -> T {
        p[0]
    }
}
