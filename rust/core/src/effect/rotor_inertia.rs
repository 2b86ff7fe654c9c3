//! Inertia of a rotor reflected to its joint (armature): the torque `inertia ddq` of one joint's own acceleration.
//!
//! A motor that drives joint `j` from the previous link adds its inertia times the gear ratio squared to `M_jj` and to
//! nothing else, unlike a link inertia, which also couples the joints.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Reflected rotor inertia (armature).
#[derive(Debug)]
pub struct RotorInertia;

static SPEC: Spec = Spec {
    name: "rotor_inertia",
    title: "rotor inertia (armature)",
    equation: "M_jj + inertia",
    source: "Featherstone 2008, section 9.6; `armature` of common simulators",
    excited_by: "acceleration of the joint",
    parameters: &[EffectParameter::bounded("inertia", Quantity::Inertia, 0.0, f64::INFINITY)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks::NONE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for RotorInertia {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn inertia(&self, p: &[T; MAX_PARAMETERS]) -> T {
        p[0]
    }
}
