//! The joint receives `gain` times the commanded torque: a wrong torque constant, gear ratio or amplifier gain.

use super::{Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Wrong gain from commanded torque to joint torque.
#[derive(Debug)]
pub struct TorqueGain;

static SPEC: Spec = Spec {
    name: "torque_gain",
    title: "wrong torque gain",
    equation: "tau_joint = gain tau",
    source: "Gautier and Briot 2014, drive gains",
    excited_by: "any torque; seen only against trusted parameters or the other joints",
    parameters: &[EffectParameter {
        name: "gain",
        quantity: Quantity::Ratio,
        lower: 0.05,
        upper: 20.0,
        neutral: 1.0,
    }],
    initial_guesses: &[[1.05, 0.0, 0.0]],
    hooks: Hooks::COMMAND,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for TorqueGain {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], _t: &[T], torque: &mut [InputSegment<T>]) {
        for segment in torque {
            *segment = segment.map(|tau| p[0] * tau);
        }
    }
}
