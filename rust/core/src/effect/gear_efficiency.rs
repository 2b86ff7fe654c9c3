//! Gear efficiency that depends on the direction of power: a share of the motor's torque is lost while the motor drives, none while it brakes.
//!
//! The loss opposes the motion, so it is a part of the Coulomb level wherever the motor pushes in the direction of motion.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Loss of a share of the motor's torque in the gear while the motor drives the joint.
#[derive(Debug)]
pub struct GearEfficiency;

static SPEC: Spec = Spec {
    name: "gear_efficiency",
    title: "gear efficiency by direction of power",
    equation: "tau_joint = (1 - loss) tau while tau dq > 0, tau otherwise",
    source: "Gautier and Khalil 2002; load- and direction-dependent friction, Hamon et al. 2010",
    excited_by: "motion both driven and braked by the motor",
    parameters: &[EffectParameter::bounded("loss", Quantity::Ratio, 0.0, 0.9)],
    initial_guesses: &[[0.1, 0.0, 0.0]],
    hooks: Hooks::COULOMB,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for GearEfficiency {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn coulomb(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>, direction: T) -> T {
        p[0] * (x.tau * direction).max(T::zero())
    }
}
