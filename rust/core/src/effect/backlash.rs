//! Backlash between motor and link: inside it the motor turns alone and the link is not driven.
//!
//! The rotor carries a share of the joint's nominal inertia, so with the backlash closed the arm is the nominal one. The rotor's coupling
//! ratio to the joints before its own (the parameter `riding`) is 1 for a motor on the previous link and `1 / n` behind a gear of ratio n; at
//! the first joint it has no influence. Flanks are rigid in simulation ([`crate::drivetrain`]); their stiffness and damping hold a motor to a
//! link whose motion is measured.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::{Real, lit};
use crate::transmission::Transmission;

/// Natural frequency of the rotor of a backlash on its flanks where the motion of the link is measured, not simulated, 1/s.
const FLANK_RATE: f64 = 800.0;

/// Damping ratio of the rotor of a backlash on its flanks, where the motion of the link is measured; large enough that the rotor does not rebound.
const FLANK_DAMPING: f64 = 0.8;

/// Backlash between a motor and its link.
#[derive(Debug)]
pub struct Backlash;

static SPEC: Spec = Spec {
    name: "backlash",
    title: "backlash",
    equation: "rotor d2(q + riding q_before + twist)/dt2 = tau - T, T = 0 while |twist| < gap/2",
    source: "Nordin and Gutman 2002",
    excited_by: "a transmitted torque that changes sign",
    parameters: &[
        EffectParameter::bounded("gap", Quantity::Position, 0.0, f64::INFINITY),
        EffectParameter::shape("rotor_share", Quantity::Ratio, 0.005, 0.8),
        EffectParameter::shape("riding", Quantity::Ratio, 0.0, 1.0),
    ],
    initial_guesses: &[
        [0.005, 0.03, 0.5],
        [0.01, 0.1, 0.5],
        [0.02, 0.03, 0.5],
        [0.04, 0.1, 0.5],
        [0.08, 0.03, 0.5],
        [0.16, 0.1, 0.5],
    ],
    trial: Trial::Whole,
    hooks: Hooks::NONE,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for Backlash {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn has_transmission(&self) -> bool {
        true
    }

    /// The motor travels the width of the backlash without its link.
    fn at_share(&self, p: &[T; MAX_PARAMETERS], share: T) -> [T; MAX_PARAMETERS] {
        [p[0] * share, p[1], p[2]]
    }

    fn transmission(&self, p: &[T; MAX_PARAMETERS], inertia: T) -> Option<Transmission<T>> {
        let rotor = p[1] * inertia;
        let rate = lit::<T>(FLANK_RATE);
        (p[0] > T::zero()).then_some(Transmission {
            inertia: rotor,
            stiffness: rotor * rate * rate,
            damping: lit::<T>(2.0 * FLANK_DAMPING) * rotor * rate,
            backlash: p[0],
            part_of_link: true,
            coupling_ratio: p[2],
        })
    }
}
