//! Spring at a joint, as of a cable, a hose or a counterbalance: the torque `-k (q - q0)`.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Spring at a joint: the torque `-k (q - q0)`.
#[derive(Debug)]
pub struct JointSpring;

static SPEC: Spec = Spec {
    name: "joint_spring",
    title: "joint spring",
    equation: "tau_joint = tau - k (q - q0)",
    source: "cable forces; `stiffness` of common simulators",
    excited_by: "a wide range of positions",
    parameters: &[
        EffectParameter::signed("k", Quantity::Stiffness),
        EffectParameter::shape("q0", Quantity::Rest, f64::NEG_INFINITY, f64::INFINITY),
    ],
    initial_guesses: &[
        [0.05, 0.0, 0.0],
        [0.05, 1.5, 0.0],
        [0.05, -1.5, 0.0],
        [0.02, 6.0, 0.0],
        [0.02, -6.0, 0.0],
    ],
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for JointSpring {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        -p[0] * (x.q - p[1])
    }
}
