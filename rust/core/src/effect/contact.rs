//! A joint limit: beyond a position, on the side away from zero, a spring and damper push back and never pull.

use super::{Edge, Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::Real;

/// Contact with a joint limit: a spring and damper beyond a position.
#[derive(Debug)]
pub struct Contact;

static SPEC: Spec = Spec {
    name: "contact",
    title: "contact with a stop",
    equation: "tau_joint = tau - max(stiffness depth + damping speed, 0) beyond position",
    source: "soft limits of common simulators",
    excited_by: "motion up to the stop",
    parameters: &[
        EffectParameter::threshold("position", Quantity::Reach, f64::NEG_INFINITY),
        EffectParameter::bounded("stiffness", Quantity::ContactStiffness, 0.0, f64::INFINITY),
        EffectParameter::bounded("damping", Quantity::ContactDamping, 0.0, f64::INFINITY),
    ],
    // Positions as shares of the farthest position reached on either side of zero.
    initial_guesses: &[
        [0.99, 150.0, 0.5],
        [-0.99, 150.0, 0.5],
        [0.95, 30.0, 0.2],
        [-0.95, 30.0, 0.2],
        [0.88, 12.0, 0.1],
        [-0.88, 12.0, 0.1],
        [0.75, 6.0, 0.1],
        [-0.75, 6.0, 0.1],
        [0.50, 3.0, 0.1],
        [-0.50, 3.0, 0.1],
    ],
    trial: Trial::Whole,
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for Contact {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn edge(&self, p: &[T; MAX_PARAMETERS]) -> Option<Edge<T>> {
        Some(Edge { position: p[0], stiffness: p[1], damping: p[2] })
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        let side = if p[0] < T::zero() { -T::one() } else { T::one() };
        let depth = side * (x.q - p[0]);
        if depth <= T::zero() {
            return T::zero();
        }
        -side * (p[1] * depth + p[2] * side * x.dq).max(T::zero())
    }
}
