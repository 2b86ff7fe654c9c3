//! Dry friction whose level varies with the joint's position, once per turn: `(a cos q + b sin q) sgn dq`.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::Real;
use crate::trig::sin_cos;

/// Coulomb friction whose level varies with the joint's position, once per turn: `(a cos q + b sin q) sgn dq`.
#[derive(Debug)]
pub struct PositionDependentFriction;

static SPEC: Spec = Spec {
    name: "position_dependent_friction",
    title: "friction that varies with position",
    equation: "f = (a cos q + b sin q) sgn dq",
    source: "Bittencourt and Gunnarsson 2012",
    excited_by: "motion in both directions through different positions",
    parameters: &[
        EffectParameter::signed("a", Quantity::Torque),
        EffectParameter::signed("b", Quantity::Torque),
    ],
    initial_guesses: &[[0.05, 0.0, 0.0], [0.0, 0.05, 0.0]],
    trial: Trial::Amplitudes(2),
    hooks: Hooks::COULOMB,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for PositionDependentFriction {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn coulomb(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>, _direction: T) -> T {
        let (s, c) = sin_cos(x.q);
        p[0] * c + p[1] * s
    }
}
