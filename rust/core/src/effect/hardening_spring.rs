//! A spring that stiffens with its deflection, as cables and hoses do: `k (q - q0) + cubic (q - q0)^3`.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::Real;

/// Spring at a joint with a linear and a cubic part: `k (q - q0) + cubic (q - q0)^3`.
#[derive(Debug)]
pub struct HardeningSpring;

static SPEC: Spec = Spec {
    name: "hardening_spring",
    title: "hardening spring",
    equation: "tau_joint = tau - k (q - q0) - cubic (q - q0)^3",
    source: "Duffing 1918; cable forces of arms",
    excited_by: "wide travel",
    parameters: &[
        EffectParameter::signed("cubic", Quantity::Hardening),
        EffectParameter::signed("k", Quantity::Stiffness),
        EffectParameter::shape("q0", Quantity::Rest, f64::NEG_INFINITY, f64::INFINITY),
    ],
    initial_guesses: &[[0.1, 0.0, 0.0], [0.1, 0.0, 1.0], [0.1, 0.0, -1.0]],
    trial: Trial::Amplitudes(2),
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for HardeningSpring {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        let x = x.q - p[2];
        -(p[1] + p[0] * x * x) * x
    }
}
