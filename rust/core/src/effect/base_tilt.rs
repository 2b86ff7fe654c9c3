//! Tilted base: gravity is turned by `angle` in the plane of motion, for all joints alike.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Quantity, Scope, Spec};
use crate::real::Real;

/// Tilt of the base: gravity turned by `angle`, rad, in the plane of motion.
#[derive(Debug)]
pub struct BaseTilt;

static SPEC: Spec = Spec {
    name: "base_tilt",
    title: "tilted base",
    equation: "g(q) with gravity turned by angle",
    source: "mounting error; Khalil and Dombre 2002, section 11",
    excited_by: "gravity torque at any pose",
    scope: Scope::Arm,
    parameters: &[EffectParameter::bounded("angle", Quantity::Angle, -1.6, 1.6)],
    initial_guesses: &[[0.02, 0.0, 0.0]],
    hooks: Hooks::NONE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for BaseTilt {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn tilt(&self, p: &[T; MAX_PARAMETERS]) -> T {
        p[0]
    }
}
