//! Friction that grows with the load on the joint: `mu |load| sgn dq`. The load is the torque that the transmission passes on to the link, that for
//! the link's inertia included; of arms whose parameters do not tell rotors from links it is the torque `C dq + g`, or, in a second form of the law, the
//! torque of the actuator, which the transmission passes on but for friction and the rotor's inertia.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Coulomb friction in proportion to the load that the joint carries: `mu |load| sgn dq`.
#[derive(Debug)]
pub struct LoadDependentFriction {
    /// Whether the load is the torque of the actuator.
    pub of_torque: bool,
}

static SPEC: Spec = Spec {
    name: "load_dependent_friction",
    title: "friction that grows with load",
    equation: "f = mu |load| sgn dq; load = C dq + g, or with shape torque tau, of serial arms M ddq + C dq + g of the links",
    source: "Hamon, Gautier and Garrec 2010",
    excited_by: "motion in both directions under different loads",
    parameters: &[EffectParameter::signed("mu", Quantity::Ratio)],
    initial_guesses: &[[0.05, 0.0, 0.0]],
    hooks: Hooks { load: true, ..Hooks::COULOMB },
    ..Spec::OF_JOINT
};

static OF_TORQUE: Spec = Spec {
    title: "friction that grows with the actuator's torque",
    equation: "f = mu |tau| sgn dq",
    hooks: Hooks::COULOMB,
    ..SPEC
};

impl<T: Real> Effect<T> for LoadDependentFriction {
    fn spec(&self) -> &'static Spec {
        if self.of_torque { &OF_TORQUE } else { &SPEC }
    }

    fn form(&self) -> Option<&'static str> {
        self.of_torque.then_some("torque")
    }

    fn coulomb(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>, _direction: T) -> T {
        p[0] * if self.of_torque { x.tau } else { x.load }.abs()
    }
}
