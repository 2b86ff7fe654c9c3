//! Settings of a position controller that may differ from those of the arm file.

use crate::serial::controller::JointController;
use crate::serial::term::TermParameter;

/// Difference of one setting of a joint's position controller from the arm file.
#[derive(Debug, Clone, Copy)]
pub struct ControllerTerm {
    /// Setting of the controller that differs.
    pub setting: Setting,
    /// 0-based joint.
    pub joint: usize,
}

/// Setting of a position controller that may be shown by a log of references and positions to differ from the arm file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Setting {
    /// Proportional gain `kp`; the parameter is a factor on the arm file's value.
    Gain,
    /// Derivative gain `kd`; the parameter is added to the arm file's value, N m s/rad or N s/m.
    Damping,
    /// Delay of the reference; the parameter is added to the arm file's value, s.
    ReferenceDelay,
}

impl Setting {
    /// All settings of a position controller that may be wrong.
    pub const ALL: [Self; 3] = [Self::Gain, Self::Damping, Self::ReferenceDelay];

    /// Name in results of the term that changes this setting.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gain => "controller_gain",
            Self::Damping => "controller_damping",
            Self::ReferenceDelay => "reference_delay",
        }
    }

    /// Title in reports of the term that changes this setting.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Gain => "wrong proportional gain of the position controller",
            Self::Damping => "wrong derivative gain of the position controller",
            Self::ReferenceDelay => "late reference",
        }
    }

    /// Name, unit and bounds of the setting's parameter; `rotary` is whether the joint is rotary.
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

    /// Initial guesses of the setting's parameter for a joint's controller, from the joint's inertia, kg m^2 or kg, and the log's sample period, s.
    pub fn guesses(self, controller: &JointController, inertia: f64, period: f64) -> Vec<f64> {
        match self {
            Self::Gain => vec![1.1],
            // A tenth of the larger of the given derivative gain and the critical damping.
            Self::Damping => {
                vec![0.1 * controller.gains[1].max(2.0 * (controller.gains[0] * inertia).max(0.0).sqrt())]
            }
            Self::ReferenceDelay => vec![0.5 * period, 3.0 * period],
        }
    }
}

impl ControllerTerm {
    /// A joint's controller with the term's setting changed by `value`: a factor on the proportional gain, or what is added to the derivative gain or
    /// the delay of the reference.
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
