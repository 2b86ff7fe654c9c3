//! Viscous friction that differs by direction: `b + delta` forward, `b - delta` backward.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Viscous friction that differs by direction: `b + delta` forward, `b - delta` backward.
#[derive(Debug)]
pub struct ViscousAsymmetry;

static SPEC: Spec = Spec {
    name: "viscous_asymmetry",
    title: "viscous friction that differs by direction",
    equation: "tau_joint = tau - delta |dq|",
    source: "asymmetric viscous coefficients of identification toolboxes for geared arms",
    excited_by: "both directions at several speeds",
    parameters: &[EffectParameter::signed("delta", Quantity::Damping)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for ViscousAsymmetry {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        -p[0] * x.dq.abs()
    }
}
