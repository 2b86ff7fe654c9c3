//! Friction that grows with the load on the joint: `mu |load| sgn dq`, the load being the torque `C dq + g` that the links put on it.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Coulomb friction in proportion to the load that the joint carries: `mu |C dq + g| sgn dq`.
#[derive(Debug)]
pub struct LoadDependentFriction;

static SPEC: Spec = Spec {
    name: "load_dependent_friction",
    title: "friction that grows with load",
    equation: "f = mu |C dq + g| sgn dq",
    source: "Hamon, Gautier and Garrec 2010",
    excited_by: "motion in both directions under different loads",
    parameters: &[EffectParameter::signed("mu", Quantity::Ratio)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks::COULOMB,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for LoadDependentFriction {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn coulomb(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>, _direction: T) -> T {
        p[0] * x.load.abs()
    }
}
