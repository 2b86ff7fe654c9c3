//! Coupling of a remote motor's rotor: a motor on link 1 that drives joint 2 through a gear adds `gear inertia` to `M_12`.
//!
//! The rotor's share of `M_22` is the effect `rotor_inertia` on joint 2; both effects together model the whole rotor.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Quantity, Scope, Spec};
use crate::real::Real;

/// Inertial coupling between the first two joints by the rotor of a remote motor.
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
    // Never searched for: a `rotor_inertia` of joint 2 of opposite sign, with theta3 changed by the same amount, gives the same motion.
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
