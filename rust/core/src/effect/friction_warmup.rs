//! Friction that is higher, or lower, when the log begins and settles with a time constant: a factor `1 + amplitude exp(-t/time_constant)`.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::{Real, lit};

/// Friction that changes while the arm warms up, by the factor `1 + amplitude exp(-t/time_constant)`.
#[derive(Debug)]
pub struct FrictionWarmup;

static SPEC: Spec = Spec {
    name: "friction_warmup",
    title: "friction that changes while the arm warms up",
    equation: "f (1 + amplitude exp(-t/time_constant))",
    source: "Bittencourt and Gunnarsson 2012; Simoni et al. 2017",
    excited_by: "motion over more than the time constant",
    parameters: &[
        EffectParameter::bounded("amplitude", Quantity::Ratio, -0.95, 20.0),
        EffectParameter::shape("time_constant", Quantity::Duration, 0.05, 5000.0),
    ],
    initial_guesses: &[[0.05, 1.0, 0.0], [0.05, 3.0, 0.0], [0.05, 10.0, 0.0]],
    hooks: Hooks::COULOMB,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for FrictionWarmup {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn coulomb(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>, _direction: T) -> T {
        p[0] * (-x.t / p[1].max(lit(1e-6))).exp() * x.friction
    }
}
