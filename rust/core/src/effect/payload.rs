//! A point mass fixed at a distance along the last link.
//!
//! A payload moves the inertial base parameters along a known curve, so re-estimated parameters absorb it without a trace: it
//! shows only against values of the arm file that are trusted.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Quantity, Scope, Spec};
use crate::real::Real;

/// Point mass fixed at a distance along the last link.
#[derive(Debug)]
pub struct Payload;

static SPEC: Spec = Spec {
    name: "payload",
    title: "payload on the last link",
    equation: "theta + dtheta(mass, distance)",
    source: "Swevers et al. 2002; Gautier and Briot 2014",
    excited_by: "any motion; seen only against trusted parameters",
    scope: Scope::Arm,
    parameters: &[
        EffectParameter::bounded("mass", Quantity::Mass, 0.0, f64::INFINITY),
        EffectParameter::bounded("distance", Quantity::Length, 0.0, f64::INFINITY),
    ],
    initial_guesses: &[[0.05, 0.5, 0.0], [0.05, 1.0, 0.0]],
    hooks: Hooks::NONE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for Payload {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn payload(&self, p: &[T; MAX_PARAMETERS]) -> Option<(T, T)> {
        Some((p[0], p[1]))
    }
}
