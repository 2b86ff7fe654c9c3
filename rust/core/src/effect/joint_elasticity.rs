//! Joint elasticity: the motor drives the link through a spring and damper (Spong 1987),
//!
//! ```text
//! rotor_inertia d2(q + deflection)/dt2 = tau - stiffness deflection - damping d(deflection)/dt
//! ```
//!
//! Damping above the critical damping of the rotor on its shaft, `2 sqrt(stiffness rotor_inertia)`, is replaced by the critical damping.
//!
//! The rotor comes in addition to the rigid arm; encoder and friction are on the link's side or on the motor's
//! ([`crate::transmission::Sides`]). A shaft of infinite stiffness is a rigid joint whose rotor is part of the arm's own inertia.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, NEVER, Quantity, Spec, Trial};
use crate::real::{Real, lit};
use crate::transmission::Transmission;

/// Elastic transmission: a spring and damper between motor and link.
#[derive(Debug)]
pub struct JointElasticity;

static SPEC: Spec = Spec {
    name: "joint_elasticity",
    title: "joint elasticity",
    equation: "rotor_inertia d2(q + twist)/dt2 = tau - T, tau_joint = T = stiffness twist + damping dtwist",
    source: "Spong 1987",
    excited_by: "torque that changes within the period of the motor's oscillation",
    parameters: &[
        EffectParameter::threshold("stiffness", Quantity::ShaftStiffness, 0.0),
        EffectParameter::bounded("damping", Quantity::ShaftDamping, 0.0, f64::INFINITY),
        EffectParameter::bounded("rotor_inertia", Quantity::Inertia, 1e-6, f64::INFINITY),
    ],
    // Rotors of 3, 8, 35 and 80 % of the link's inertia that oscillate against the link at 5 to 40 Hz, the heavy ones from 3 Hz: within a window of
    // 0.25 s a guess a factor of 1.6 away still moves with the residual.
    initial_guesses: &[
        [0.15, 0.3, 0.03],
        [0.5, 0.5, 0.03],
        [1.8, 1.0, 0.03],
        [0.08, 0.2, 0.08],
        [0.3, 0.5, 0.08],
        [1.2, 1.0, 0.08],
        [4.5, 2.0, 0.08],
        [0.13, 0.3, 0.35],
        [0.35, 0.7, 0.35],
        [1.0, 1.2, 0.35],
        [3.0, 2.5, 0.35],
        [9.0, 5.0, 0.35],
        [25.0, 8.0, 0.35],
        [0.22, 0.4, 0.8],
        [0.6, 1.0, 0.8],
        [1.6, 2.0, 0.8],
        [5.0, 4.0, 0.8],
    ],
    trial: Trial::Whole,
    hooks: Hooks::NONE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for JointElasticity {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn has_transmission(&self) -> bool {
        true
    }

    /// Deflection is torque over stiffness, so the share is one of the compliance; the time constant of the damping stays.
    fn at_share(&self, p: &[T; MAX_PARAMETERS], share: T) -> [T; MAX_PARAMETERS] {
        [p[0] / share, p[1] / share, p[2]]
    }

    fn transmission(&self, p: &[T; MAX_PARAMETERS], _inertia: T) -> Option<Transmission<T>> {
        let rigid = p[0] >= lit(NEVER);
        (!rigid).then_some(Transmission {
            inertia: p[2],
            stiffness: p[0],
            // Beyond critical damping no resonance is left by which a shaft could be recognised.
            damping: p[1].min((p[0] * p[2]).max(T::zero()).sqrt() * lit(2.0)),
            backlash: T::zero(),
            part_of_link: false,
            coupling_ratio: T::zero(),
        })
    }
}
