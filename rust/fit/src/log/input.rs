//! Input of a diagnosis: logs and options, and errors for input that cannot be used.

use crate::model::custom_effect;
use armgap_core::arm::ArmKind;

/// One log as given to a diagnosis: sample times, positions and torques, row by row.
#[derive(Debug, Clone)]
pub struct LogData<'a> {
    /// Name of the log in results.
    pub name: String,
    /// Name of the recording that the log is the whole or a part of; parts of one recording share the encoder zeros.
    pub source: String,
    /// Sample times, s, increasing.
    pub t: &'a [f64],
    /// Measured positions, rad or m, one row of joints per sample.
    pub q: &'a [f64],
    /// Commanded torques, N m or N, one row per sample, held until the next sample; empty for a log that holds references instead.
    pub tau: &'a [f64],
    /// Reference positions of a controller, rad or m, one row per sample, held until the next sample, and reference velocities where they are logged.
    pub reference: Option<(&'a [f64], Option<&'a [f64]>)>,
    /// First moment of every torque sample about the middle of its sample interval, N m s^2 (N s^2), where samples are means of several finer ones.
    pub moment: Option<&'a [f64]>,
    /// Torque per unit of size of each custom effect, one value per sample.
    pub tables: Vec<&'a [f64]>,
}

/// Options of a diagnosis.
#[derive(Debug, Clone)]
pub struct Options {
    /// Prediction horizon, s.
    pub horizon: f64,
    /// Largest number of effects that are named; pushes are named besides unless it is zero.
    pub max_causes: usize,
    /// Seed of the resampling behind probabilities and intervals.
    pub seed: u64,
    /// Half width of the test functions of a serial arm's equation of motion, s; `None` for the default. Logs that were low-passed before they were
    /// written require a half width larger than that filter's. With a half width given, effects that a low-pass of friction resembles are not
    /// tested.
    pub half_width: Option<f64>,
    /// Whether the unit of a serial arm's torques is known independently. Where it was inferred from the arm file's masses, logs cannot show that a
    /// mass is wrong too: loads, wrong links and gains are no candidates.
    pub known_units: bool,
    /// Joints, from 0, of the custom effects, whose torques lie in the logs' tables.
    pub custom_effects: Vec<usize>,
    /// Parameters of the arm from which it is also fitted, SI; where the arm file's values are far off, the fit from these may have the smaller
    /// prediction errors.
    pub start: Option<Vec<f64>>,
    /// Effects that are not to be named; no serial arm's result heeds them.
    pub withheld: Vec<Withheld>,
}

/// An effect, or the pushes on a joint, that a diagnosis lists among its candidates and does not name: something beside the model explains it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Withheld {
    /// Name of the effect in the library.
    pub effect: String,
    /// 1-based joint; none for effects of the whole arm.
    pub joint: Option<usize>,
    /// Reason, in words.
    pub why: String,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            horizon: 0.25,
            max_causes: 4,
            seed: 1,
            half_width: None,
            known_units: true,
            custom_effects: Vec::new(),
            start: None,
            withheld: Vec::new(),
        }
    }
}

/// Reason why a diagnosis is impossible.
#[derive(Debug, Clone, PartialEq)]
pub enum DiagnoseError {
    /// The number of parameters does not fit the kind of arm.
    Parameters(ArmKind),
    /// The logs of `set` are too short: fewer windows of the horizon than needed.
    TooShort {
        /// Set of logs: `training` or `holdout`.
        set: &'static str,
        /// Number of windows found.
        windows: usize,
        /// Number of windows needed.
        needed: usize,
    },
    /// A log holds a number that is not finite, or times that do not increase.
    BadSamples(String),
    /// The horizon is not a positive number of seconds.
    Horizon(f64),
    /// The number of joints of a serial arm, as given, is outside one to seven.
    Joints(usize),
    /// The number of parameters of a serial arm does not fit its number of joints.
    Sizes {
        /// Number of parameters found.
        found: usize,
        /// Number of parameters needed.
        needed: usize,
    },
    /// Custom effects are too many, lack a table of torques in some log, or act on a joint that does not exist.
    CustomEffects,
    /// A log holds no torques, and no controller is known that computes them from its references.
    NoTorque(String),
    /// The observer cancelled the diagnosis.
    Stopped,
}

impl std::fmt::Display for DiagnoseError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Parameters(kind) => {
                write!(f, "a {} needs {} parameters", kind.name(), kind.parameters().len())
            }
            Self::TooShort { set, windows, needed } => write!(
                f,
                "the {set} logs hold {windows} windows of the prediction horizon, {needed} are needed; give more data or a shorter horizon"
            ),
            Self::BadSamples(name) => {
                write!(f, "log `{name}` holds values that are not finite, or times that do not increase")
            }
            Self::Horizon(h) => write!(f, "the horizon must be a positive number of seconds, not {h}"),
            Self::Joints(n) => write!(f, "a serial arm has one to seven joints, not {n}"),
            Self::Sizes { found, needed } => write!(f, "the arm needs {needed} parameters, not {found}"),
            Self::CustomEffects => write!(
                f,
                "effects of your own do not fit the logs; give at most {}, each on a joint of the arm, with one torque per sample of every log",
                custom_effect::MAX_CUSTOM_EFFECTS
            ),
            Self::NoTorque(name) => {
                write!(
                    f,
                    "log `{name}` holds no torques; give references and the controller that follows them"
                )
            }
            Self::Stopped => write!(f, "the diagnosis was stopped"),
        }
    }
}

impl std::error::Error for DiagnoseError {}

/// Least number of windows in each set of logs for a diagnosis.
pub(crate) const FEWEST_WINDOWS: usize = 4;

/// Checks the options and the numbers of all logs before a diagnosis.
///
/// # Errors
///
/// The first defect found.
pub(crate) fn validate(
    joints: usize,
    training: &[LogData<'_>],
    holdout: &[LogData<'_>],
    options: &Options,
) -> Result<(), DiagnoseError> {
    if !(options.horizon > 0.0 && options.horizon.is_finite()) {
        return Err(DiagnoseError::Horizon(options.horizon));
    }
    for log in training.iter().chain(holdout) {
        let finite = log
            .t
            .iter()
            .chain(log.q)
            .chain(log.tau)
            .chain(log.moment.into_iter().flatten())
            .chain(log.reference.into_iter().flat_map(|(q, dq)| q.iter().chain(dq.into_iter().flatten())))
            .chain(log.tables.iter().copied().flatten())
            .all(|x| x.is_finite());
        let fits = log.tables.len() == options.custom_effects.len()
            && log.tables.iter().all(|x| x.len() == log.t.len());
        if !fits
            || options.custom_effects.len() > custom_effect::MAX_CUSTOM_EFFECTS
            || options.custom_effects.iter().any(|j| *j >= joints)
        {
            return Err(DiagnoseError::CustomEffects);
        }
        if !finite || log.t.windows(2).any(|w| w[1] <= w[0]) || log.t.len() < 2 {
            return Err(DiagnoseError::BadSamples(log.name.clone()));
        }
    }
    Ok(())
}
