//! Stribeck friction: `amplitude exp(-(dq/velocity)^2) sgn dq` on top of Coulomb friction.
//!
//! The level at rest is the break-away torque `fc + amplitude`; the surplus fades within about twice `velocity`.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::{Real, lit};

/// Stribeck friction: friction that falls with speed from a higher level at standstill.
#[derive(Debug)]
pub struct Stribeck;

static SPEC: Spec = Spec {
    name: "stribeck",
    title: "Stribeck friction (stiction)",
    equation: "f = amplitude exp(-(dq/velocity)^2) sgn dq",
    source: "Armstrong-Helouvry, Dupont and Canudas de Wit 1994, eq. (4)",
    excited_by: "reversals and slow motion, below twice the Stribeck velocity",
    parameters: &[
        EffectParameter::bounded("amplitude", Quantity::Torque, 0.0, f64::INFINITY),
        EffectParameter::bounded("velocity", Quantity::Speed, 1e-3, f64::INFINITY),
    ],
    initial_guesses: &[
        [0.05, 0.03, 0.0],
        [0.05, 0.1, 0.0],
        [0.05, 0.3, 0.0],
        [0.05, 0.8, 0.0],
        [0.05, 2.0, 0.0],
    ],
    hooks: Hooks::COULOMB,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for Stribeck {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn coulomb(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>, _direction: T) -> T {
        let ratio = x.dq / p[1].max(lit(1e-9));
        p[0] * (-ratio * ratio).exp()
    }
}
