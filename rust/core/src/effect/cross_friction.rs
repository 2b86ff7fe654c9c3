//! Friction that depends on another joint's motion, as in wrists whose axes share a gear: `level sgn(dq_other)`.
//!
//! The other joint is the next one along the arm; for the last joint, the first.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Friction of a joint by the direction of the next joint, `level sgn(dq_other)`.
#[derive(Debug)]
pub struct CrossFriction;

static SPEC: Spec = Spec {
    name: "cross_friction",
    title: "friction coupled from the other joint",
    equation: "tau_joint = tau - level sgn(dq_other)",
    source: "coupled joints 5 and 6 of a six-axis arm, Janot et al. 2014",
    excited_by: "both joints moving, in all four combinations of directions",
    least_joints: 2,
    parameters: &[EffectParameter::signed("level", Quantity::Torque)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for CrossFriction {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        -p[0] * x.other
    }
}
