//! Saturation of a drive: its torque never exceeds a level, whatever is commanded.

use super::{Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::Real;

/// Saturation of a drive: largest torque that it delivers.
#[derive(Debug)]
pub struct TorqueSaturation;

static SPEC: Spec = Spec {
    name: "torque_saturation",
    title: "torque saturation",
    equation: "tau_joint = clip(tau, -level, level)",
    source: "current limits; `forcerange` of common simulators",
    excited_by: "torque above the level",
    parameters: &[EffectParameter::threshold("level", Quantity::Torque, 0.0)],
    initial_guesses: &[[2.2, 0.0, 0.0], [1.7, 0.0, 0.0], [1.3, 0.0, 0.0], [0.9, 0.0, 0.0], [0.6, 0.0, 0.0]],
    trial: Trial::Whole,
    hooks: Hooks::COMMAND,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for TorqueSaturation {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], _t: &[T], torque: &mut [InputSegment<T>]) {
        for segment in torque {
            *segment = segment.map(|tau| tau.max(-p[0]).min(p[0]));
        }
    }
}
