//! Torque ripple (cogging): `amplitude sin(n q + phase)`, a fixed number of cycles per turn.

use super::{Effect, EffectParameter, Hooks, JointPoint, JointPoints, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;
use crate::trig::{for_sines_cosines, sin_cos};

/// Torque ripple (cogging): torque that repeats with the position of the joint, `amplitude sin(n q + phase)`.
#[derive(Debug)]
pub struct TorqueRipple;

static SPEC: Spec = Spec {
    name: "torque_ripple",
    title: "torque ripple (cogging)",
    equation: "tau_joint = tau + amplitude sin(n q + phase)",
    source: "Holtz and Springob 1996; `cogging` of common simulators",
    excited_by: "motion over several cycles of the ripple",
    parameters: &[
        EffectParameter::signed("amplitude", Quantity::Torque),
        EffectParameter::shape("n", Quantity::Cycles, 0.2, f64::INFINITY),
        EffectParameter::shape("phase", Quantity::Angle, f64::NEG_INFINITY, f64::INFINITY),
    ],
    // Numbers of cycles over the joint's travel; larger numbers are guessed from the residual.
    initial_guesses: &[
        [0.05, 0.5, 0.0],
        [0.05, 0.5, 1.571],
        [0.05, 1.0, 0.0],
        [0.05, 1.0, 1.571],
        [0.05, 1.5, 0.0],
        [0.05, 1.5, 1.571],
        [0.05, 2.0, 0.0],
        [0.05, 2.0, 1.571],
        [0.05, 2.5, 0.0],
        [0.05, 2.5, 1.571],
        [0.05, 3.0, 0.0],
        [0.05, 3.0, 1.571],
    ],
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for TorqueRipple {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        p[0] * sin_cos(p[1] * x.q + p[2]).0
    }

    fn add_forces(&self, p: &[T; MAX_PARAMETERS], points: &JointPoints<'_, T>, sums: &mut [T]) {
        let wave = |i: usize, sine: T, _: T| sums[i] += p[0] * sine;
        for_sines_cosines(points.q.len(), |i| p[1] * points.q[i] + p[2], wave);
    }
}
