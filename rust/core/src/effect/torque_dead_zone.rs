//! Dead zone of a drive: commands below a level give no torque, larger commands give their excess over the level, `sgn(tau) max(|tau| - level, 0)`.

use super::{Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Dead zone of a drive, which gives no torque for commands below a level.
#[derive(Debug)]
pub struct TorqueDeadZone;

static SPEC: Spec = Spec {
    name: "torque_dead_zone",
    title: "torque dead zone",
    equation: "tau_joint = sgn(tau) max(|tau| - level, 0)",
    source: "valves and amplifiers with overlap",
    excited_by: "torque that changes sign",
    parameters: &[EffectParameter::bounded("level", Quantity::Torque, 0.0, f64::INFINITY)],
    initial_guesses: &[[0.05, 0.0, 0.0], [0.3, 0.0, 0.0]],
    hooks: Hooks::COMMAND,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for TorqueDeadZone {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], _t: &[T], torque: &mut [InputSegment<T>]) {
        for segment in torque {
            *segment = segment.map(|tau| tau - tau.max(-p[0]).min(p[0]));
        }
    }
}
