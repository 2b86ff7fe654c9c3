//! Coulomb friction whose level depends on the direction: `fc + delta` for `dq > 0`, `fc - delta` for `dq < 0`.
//!
//! While the joint moves, Coulomb asymmetry is the same function of time as a constant torque `-delta`; the two differ only at rest, where
//! friction holds and a torque does not.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Coulomb friction that differs by direction: `(fc + delta sgn dq) sgn dq`.
#[derive(Debug)]
pub struct CoulombAsymmetry;

static SPEC: Spec = Spec {
    name: "coulomb_asymmetry",
    title: "Coulomb friction that differs by direction",
    equation: "f = (fc + delta sgn dq) sgn dq",
    source: "Elhami and Brookfield 1996; Reyes and Kelly 1997, Table I",
    excited_by: "motion in both directions",
    parameters: &[EffectParameter::signed("delta", Quantity::Torque)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks::COULOMB,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for CoulombAsymmetry {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn coulomb(&self, p: &[T; MAX_PARAMETERS], _x: &JointPoint<T>, direction: T) -> T {
        p[0] * direction
    }
}
