//! What a diagnosis is given: logs as they come and options; and what of them cannot be worked with.

use crate::model::custom_effect;
use armgap_core::arm::ArmKind;

/// One log: sample times, positions and torques, row by row.
#[derive(Debug, Clone)]
pub struct LogData<'a> {
    /// Name in results.
    pub name: String,
    /// Recording that it is the whole or a part of: its parts share the encoders' zeros.
    pub source: String,
    /// Sample times, s, increasing.
    pub t: &'a [f64],
    /// Positions, one row per sample.
    pub q: &'a [f64],
    /// Torques, one row per sample, held until the next; none of a log that holds references in their place.
    pub tau: &'a [f64],
    /// Positions that a controller was to reach, one row per sample, held until the next, and velocities where they are logged.
    pub reference: Option<(&'a [f64], Option<&'a [f64]>)>,
    /// First moment of every torque about the middle of its interval, where it is the mean of several, N m s^2 (N s^2).
    pub moment: Option<&'a [f64]>,
    /// Torque per unit of size of each custom effect, sample by sample.
    pub tables: Vec<&'a [f64]>,
}

/// Options of a diagnosis.
#[derive(Debug, Clone)]
pub struct Options {
    /// Prediction horizon, s.
    pub horizon: f64,
    /// Causes named at most.
    pub max_causes: usize,
    /// Seed of the resampling that gives probabilities and intervals.
    pub seed: u64,
    /// Half width of the test functions of a serial arm's equation of motion, s; none for the usual one. Logs that were low-passed before they were
    /// written ask for one that is wider than that filter.
    pub half_width: Option<f64>,
    /// Whether the unit of a serial arm's torques is known by itself. Where it was taken from the arm file's masses, logs cannot say that one of these
    /// is wrong too: loads, wrong links and gains are no candidates.
    pub known_units: bool,
    /// Joints, from 0, of the custom effects; their torques lie in the logs' tables.
    pub custom_effects: Vec<usize>,
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
        }
    }
}

/// Why there is no diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub enum DiagnoseError {
    /// The number of parameters does not fit the kind of arm.
    Parameters(ArmKind),
    /// Too few samples of `set` for windows of the horizon: found, needed.
    TooShort {
        /// `training` or `holdout`.
        set: &'static str,
        /// Windows found.
        windows: usize,
        /// Windows needed.
        needed: usize,
    },
    /// A log holds a number that is not finite, or times that do not increase.
    BadSamples(String),
    /// The horizon is not a positive number of seconds.
    Horizon(f64),
    /// A serial arm has this many joints; one to seven are possible.
    Joints(usize),
    /// A serial arm has another number of parameters than its joints ask for.
    Sizes {
        /// Parameters found.
        found: usize,
        /// Parameters needed.
        needed: usize,
    },
    /// Too many custom effects, one without a table of torques in some log, or on a joint that is not there.
    CustomEffects,
    /// A log holds no torques, and there is no controller that makes them from its references.
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

/// Windows without which nothing can be said.
pub(crate) const FEWEST_WINDOWS: usize = 4;

/// Checks the options and the numbers of all logs.
///
/// # Errors
///
/// The first thing that cannot be worked with.
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
