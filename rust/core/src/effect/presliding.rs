//! Presliding friction: before it slides, a friction contact deflects elastically, and after a reversal friction builds up again over a distance
//! (Dahl 1968),
//!
//! ```text
//! dz/dq = stiffness (1 - sgn(dq) z / amplitude),      tau_joint = tau - z
//! ```
//!
//! The hysteresis state `z` depends on the path alone, so between reversals it has a closed form in the distance travelled.

use super::{Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::Real;

/// Presliding hysteresis of Dahl (1968), in addition to Coulomb friction.
#[derive(Debug)]
pub struct Presliding;

static SPEC: Spec = Spec {
    name: "presliding",
    title: "presliding hysteresis",
    equation: "tau_joint = tau - z, dz/dq = stiffness (1 - sgn(dq) z / amplitude)",
    source: "Dahl 1968; Canudas de Wit et al. 1995 (LuGre)",
    excited_by: "many reversals, with little travel between some of them",
    parameters: &[
        EffectParameter::bounded("amplitude", Quantity::Torque, 0.0, f64::INFINITY),
        EffectParameter::bounded("stiffness", Quantity::Stiffness, 0.0, f64::INFINITY),
    ],
    // Friction builds up over distances, amplitude by stiffness, of 0.3 to 10 % of the joint's RMS travel.
    initial_guesses: &[[0.1, 30.0, 0.0], [0.1, 10.0, 0.0], [0.1, 3.0, 0.0], [0.1, 1.0, 0.0]],
    trial: Trial::Ray,
    hooks: Hooks { force: true, memory: true, ..Hooks::NONE },
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for Presliding {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn force(&self, _p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        -x.memory
    }

    fn hysteresis_after(&self, p: &[T; MAX_PARAMETERS], memory: T, distance: T) -> T {
        if p[0] <= T::zero() {
            return T::zero();
        }
        let goal = if distance < T::zero() { -p[0] } else { p[0] };
        goal + (memory - goal) * (-distance.abs() * p[1] / p[0]).exp()
    }
}
