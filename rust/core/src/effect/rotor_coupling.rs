//! Coupling of a remote motor's rotor: a motor on link 1 that drives joint 2 through a gear adds `gear inertia` to `M_12`.
//!
//! Its share of `M_22` is the effect of `rotor_inertia` on joint 2; the two together are the whole rotor.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Quantity, Scope, Spec};
use crate::real::Real;

/// Inertia between the first two joints.
#[derive(Debug)]
pub struct RotorCoupling;

static SPEC: Spec = Spec {
    name: "rotor_coupling",
    title: "inertial coupling of a remote rotor",
    equation: "M_12 + inertia, M_21 + inertia",
    source: "Murphy, Wen and Saridis 1991",
    excited_by: "acceleration of both joints",
    scope: Scope::Arm,
    least_joints: 2,
    parameters: &[EffectParameter::signed("inertia", Quantity::Inertia)],
    // Never searched for: the same motion as the opposite rotor_inertia of joint 2 with theta3 moved by as much.
    initial_guesses: &[],
    hooks: Hooks::NONE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for RotorCoupling {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn coupling(&self, p: &[T; MAX_PARAMETERS]) -> T {
        p[0]
    }
}
