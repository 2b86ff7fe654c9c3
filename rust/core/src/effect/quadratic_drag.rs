//! Drag that grows with the square of speed: `-c dq |dq|` (air, churning lubricant, a fan-like load).

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Drag quadratic in speed: the torque `-c dq |dq|`.
#[derive(Debug)]
pub struct QuadraticDrag;

static SPEC: Spec = Spec {
    name: "quadratic_drag",
    title: "quadratic drag",
    equation: "f = c dq |dq|",
    source: "Bittencourt and Gunnarsson 2012; polynomial damping of common simulators",
    excited_by: "a wide range of speeds",
    parameters: &[EffectParameter::signed("c", Quantity::Drag)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for QuadraticDrag {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        -p[0] * x.dq * x.dq.abs()
    }
}
