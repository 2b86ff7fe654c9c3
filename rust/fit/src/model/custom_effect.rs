//! Custom effects: a torque per unit of size, given by the user at every sample of every log.
//!
//! A function of time, position, velocity and torque evaluated along the *measured* motion is a torque on the joint; the size of this torque is
//! fitted and ranked like that of any effect. Within a window the predicted motion stays close to the measured one, so evaluation along the measured
//! motion rather than the prediction causes an error of second order.

use armgap_core::effect::{
    Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Scope, Spec, Trial,
};

/// Largest number of custom effects in one diagnosis.
pub const MAX_CUSTOM_EFFECTS: usize = 4;

/// Index of the table of torques for an unnamed dependence, after the tables of custom effects.
pub const UNNAMED: usize = MAX_CUSTOM_EFFECTS;

/// Effect whose torques are table `.0` of the logs, as given by the user.
#[derive(Debug)]
struct Tabulated(usize);

static LAWS: [Tabulated; UNNAMED + 1] =
    [Tabulated(0), Tabulated(1), Tabulated(2), Tabulated(3), Tabulated(UNNAMED)];

static PARAMETERS: [EffectParameter; 1] = [EffectParameter::signed("size", Quantity::Torque)];
static STARTS: [[f64; MAX_PARAMETERS]; 1] = [[0.05, 0.0, 0.0]];

const fn spec(name: &'static str) -> Spec {
    Spec {
        name,
        title: "effect of the user's own",
        equation: "tau_joint = tau + size f(t, q, dq, tau)",
        source: "the user",
        excited_by: "samples at which the function is not zero",
        scope: Scope::Joint,
        least_joints: 1,
        parameters: &PARAMETERS,
        initial_guesses: &STARTS,
        trial: Trial::Amplitudes(1),
        hooks: Hooks::COMMAND,
    }
}

static SPECS: [Spec; UNNAMED + 1] = [
    spec("user_effect_1"),
    spec("user_effect_2"),
    spec("user_effect_3"),
    spec("user_effect_4"),
    spec("unnamed_law"),
];

impl Effect<f64> for Tabulated {
    fn spec(&self) -> &'static Spec {
        &SPECS[self.0]
    }
}

/// Effect whose torques are table `index` of the logs: a custom effect, or the unnamed dependence at index [`UNNAMED`].
pub fn law(index: usize) -> &'static dyn Effect<f64> {
    &LAWS[index]
}

/// Index of an effect among those whose torques are tables; `None` for any other effect.
fn index(law: &dyn Effect<f64>) -> Option<usize> {
    SPECS.iter().position(|spec| std::ptr::eq(spec, law.spec()))
}

/// Applies an effect to one joint's commanded torques: by the effect's own rule, or from the user's table.
pub fn command(
    law: &dyn Effect<f64>,
    p: &[f64; MAX_PARAMETERS],
    t: &[f64],
    tables: &[Vec<f64>],
    torque: &mut [InputSegment<f64>],
) {
    let Some(index) = index(law) else {
        law.command(p, t, torque);
        return;
    };
    if let Some(table) = tables.get(index) {
        for (segment, unit) in torque.iter_mut().zip(table) {
            *segment = segment.map(|tau| tau + p[0] * unit);
        }
    }
}
