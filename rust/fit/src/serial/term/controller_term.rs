//! Settings of a position controller that may differ from those of the arm file.

use crate::serial::controller::JointController;
use crate::serial::term::TermParameter;

/// A setting of one joint's controller.
#[derive(Debug, Clone, Copy)]
pub struct ControllerTerm {
    /// Which.
    pub setting: Setting,
    /// Joint, from 0.
    pub joint: usize,
}

/// Settings that a log of references and positions tells something about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setting {
    /// `kp` is so many times that of the arm file.
    Gain,
    /// `kd` is so much larger.
    Damping,
    /// The reference arrives so much later.
    ReferenceDelay,
}

impl Setting {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Gain, Self::Damping, Self::ReferenceDelay];

    /// Name in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gain => "controller_gain",
            Self::Damping => "controller_damping",
            Self::ReferenceDelay => "reference_delay",
        }
    }

    /// Name for people.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Gain => "wrong proportional gain of the position controller",
            Self::Damping => "wrong derivative gain of the position controller",
            Self::ReferenceDelay => "late reference",
        }
    }

    /// Its parameter.
    pub fn parameter(self, rotary: bool) -> TermParameter {
        let (name, unit, bounds, neutral) = match self {
            Self::Gain => ("gain", "1", [0.05, 20.0], 1.0),
            Self::Damping => (
                "kd_difference",
                if rotary { "N m s/rad" } else { "N s/m" },
                [f64::NEG_INFINITY, f64::INFINITY],
                0.0,
            ),
            Self::ReferenceDelay => ("delay", "s", [0.0, 1.0], 0.0),
        };
        TermParameter { name, unit, bounds, neutral, inverse: None }
    }

    /// Initial guesses of its parameter on a joint with this controller and of an inertia, at a sample period.
    pub fn guesses(self, controller: &JointController, inertia: f64, period: f64) -> Vec<f64> {
        match self {
            Self::Gain => vec![1.1],
            // A tenth of the damping that is given, or of a critical one.
            Self::Damping => {
                vec![0.1 * controller.gains[1].max(2.0 * (controller.gains[0] * inertia).max(0.0).sqrt())]
            }
            Self::ReferenceDelay => vec![0.5 * period, 3.0 * period],
        }
    }
}

impl ControllerTerm {
    /// The controller with this setting at `value`.
    pub fn on(&self, controller: &JointController, value: f64) -> JointController {
        let mut changed = *controller;
        match self.setting {
            Setting::Gain => changed.gains[0] *= value,
            Setting::Damping => changed.gains[1] += value,
            Setting::ReferenceDelay => changed.reference_delay += value,
        }
        changed
    }
}
