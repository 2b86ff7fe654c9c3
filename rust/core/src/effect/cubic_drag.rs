//! Drag that grows with the cube of speed: `-c3 dq^3` (lubricant under shear, the next term of a polynomial load curve).

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Drag cubic in speed: the torque `-c3 dq^3`.
#[derive(Debug)]
pub struct CubicDrag;

static SPEC: Spec = Spec {
    name: "cubic_drag",
    title: "cubic drag",
    equation: "f = c3 dq^3",
    source: "polynomial damping of common simulators",
    excited_by: "a wide range of speeds",
    parameters: &[EffectParameter::signed("c3", Quantity::CubicDrag)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for CubicDrag {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        -p[0] * x.dq * x.dq * x.dq
    }
}
