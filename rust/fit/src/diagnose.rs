//! The diagnosis: where the gap lies, which effect causes it, how far it shrinks.

use crate::arm::{ArmDescription, WithArm};
use crate::context::{DiagnosisContext, WindowSet};
use crate::crosswise::{crosswise, explains};
use crate::custom_effect;
use crate::model::EffectInstance;
use crate::progress::{Observer, Phase, ProgressReporter, guarded};
use crate::push::Conclusion;
use crate::report::Diagnosis;
use crate::sanity::bounded_sigma;
use crate::scale::Scales;
use crate::solve::Prior;
use crate::track::Track;
use crate::window::Dataset;
use armgap_core::arm::{Arm, ArmKind};
use std::time::Instant;

/// One log: sample times, positions and torques, row by row.
#[derive(Debug, Clone)]
pub struct LogData<'a> {
    /// Name in results.
    pub name: String,
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

/// Note of a diagnosis by interleaved cross-validation.
const CROSSWISE: &str = "effects fitted to the training logs did not explain the holdout: every log was cut into stretches that were learnt \
     from and judged on by turns";

/// Probability from which an external disturbance counts as named.
const NAMED: f64 = 0.5;

/// Diagnoses the gap between an arm and its logs; `observer` gets the progress and may cancel.
pub fn diagnose(
    arm: &ArmDescription,
    training: &[LogData<'_>],
    holdout: &[LogData<'_>],
    options: &Options,
    observer: &Observer,
) -> Result<Diagnosis, DiagnoseError> {
    validate(arm.kind.joints(), training, holdout, options)?;
    let request = Request { arm, training, holdout, options, observer };
    let ended = guarded(|| arm.dispatch(request)).ok_or(DiagnoseError::Stopped)?;
    ended.ok_or(DiagnoseError::Parameters(arm.kind))?
}

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

/// What was asked for.
pub(crate) struct Request<'a> {
    pub(crate) arm: &'a ArmDescription,
    pub(crate) training: &'a [LogData<'a>],
    pub(crate) holdout: &'a [LogData<'a>],
    pub(crate) options: &'a Options,
    pub(crate) observer: &'a Observer,
}

impl WithArm for Request<'_> {
    type Output = Result<Diagnosis, DiagnoseError>;

    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        theta: [f64; P],
    ) -> Self::Output {
        let started = Instant::now();
        let mut context = self.context::<A, N, P>(arm.clone(), theta, self.training, self.holdout)?;
        let Options { max_causes, seed, .. } = *self.options;
        let mut conclusion = context.conclude(context.attribute(max_causes, seed, None), max_causes, seed);
        let instead = self.crosswise(arm, theta, &context, &conclusion)?;
        let is_crosswise = instead.is_some();
        if let Some(instead) = instead {
            (context, conclusion) = instead;
        }
        let headline = context.headline(conclusion, max_causes);
        let attribution = &headline.attribution;
        let open = context.open_candidates(&attribution.model.hypothesis).len();
        context.progress.begin(Phase::Result, open + attribution.nodes[0].field.len());
        let mut diagnosis = crate::assemble::assemble(&context, &headline, self.arm, self.options);
        if is_crosswise {
            diagnosis.notes.insert(0, CROSSWISE.to_owned());
        }
        diagnosis.seconds = started.elapsed().as_secs_f64();
        Ok(diagnosis)
    }
}

impl Request<'_> {
    /// The diagnosis by interleaved cross-validation, where it explains what the first one left open or took for external disturbances.
    fn crosswise<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        &self,
        arm: A,
        theta: [f64; P],
        plain: &DiagnosisContext<A, N, P>,
        first: &Conclusion<N, P>,
    ) -> Result<Option<(DiagnosisContext<A, N, P>, Conclusion<N, P>)>, DiagnoseError> {
        let Options { max_causes, seed, horizon, .. } = *self.options;
        let pushed = first.disturbances.iter().any(|e| e.probability > NAMED);
        if !(first.attribution.is_unexplained() || pushed)
            || !plain.holdout_shows_more(first.without_disturbances())
        {
            return Ok(None);
        }
        let Some([training, holdout]) = crosswise(self.training, self.holdout, horizon) else {
            return Ok(None);
        };
        let mut context = match self.context(arm, theta, &training, &holdout) {
            Ok(context) => context,
            // Stretches may hold too few windows where the logs do not.
            Err(DiagnoseError::TooShort { .. }) => return Ok(None),
            Err(error) => return Err(error),
        };
        let attribution = context.attribute(max_causes, seed, None);
        if !explains(&attribution, &first.attribution) {
            return Ok(None);
        }
        let conclusion = context.conclude(attribution, max_causes, seed);
        Ok((!pushed || conclusion.disturbances.is_empty()).then_some((context, conclusion)))
    }

    /// Windows of both sets, scales and priors.
    pub(crate) fn context<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        &self,
        arm: A,
        theta: [f64; P],
        training: &[LogData<'_>],
        holdout: &[LogData<'_>],
    ) -> Result<DiagnosisContext<A, N, P>, DiagnoseError> {
        let training = self.sample("training", training, &arm, &theta)?;
        let holdout = self.sample("holdout", holdout, &arm, &theta)?;
        let length = self.arm.link_length.as_ref().and_then(|l| l.last().copied());
        let scales = Scales::new(&arm, &theta, &training.data.tracks, self.arm.gravity, length);
        let bounded = bounded_sigma(self.arm.kind, &theta, &self.arm.sigma);
        let sigma = std::array::from_fn(|i| bounded[i]);
        let prior = Prior { theta, sigma, inertial: A::INERTIAL };
        let noise = std::array::from_fn(|j| {
            crate::track::median(training.data.tracks.iter().map(|t| t.noise[j]).collect())
        });
        let progress = ProgressReporter::new(Observer::clone(self.observer));
        let custom_effects = self.custom_effects(&scales);
        let sides = std::array::from_fn(|j| self.arm.sides(j));
        Ok(DiagnosisContext { arm, prior, scales, training, holdout, noise, sides, custom_effects, progress })
    }

    /// The custom effects at their initial guesses.
    fn custom_effects<const N: usize>(&self, scales: &Scales<N>) -> Vec<EffectInstance> {
        let placed = |(index, joint): (usize, &usize)| {
            let law = custom_effect::law(index);
            let (parameter, start) = (&law.spec().parameters[0], law.spec().initial_guesses[0][0]);
            let size = start * scales.size(parameter.quantity, *joint);
            EffectInstance::new(law, *joint, [size, 0.0, 0.0])
        };
        self.options.custom_effects.iter().enumerate().map(placed).collect()
    }

    fn sample<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        &self,
        set: &'static str,
        logs: &[LogData<'_>],
        arm: &A,
        theta: &[f64; P],
    ) -> Result<WindowSet<N>, DiagnoseError> {
        let steps = self.arm.counts_per_rev.as_ref().map(|counts| {
            std::array::from_fn(|j| {
                if self.arm.kind.rotary() { std::f64::consts::TAU / counts[j] } else { 1.0 / counts[j] }
            })
        });
        let track = |log: &LogData<'_>| {
            let tables = log.tables.iter().map(|table| table.to_vec()).collect();
            Track::new(&log.name, log.t, log.q, log.tau, steps)
                .with_moments(log.moment)
                .with_tables(tables)
                .smoothed_beside_torque(arm, theta)
        };
        let tracks = logs.iter().map(track).collect();
        let data = Dataset::new(tracks, self.options.horizon);
        if data.windows.len() < FEWEST_WINDOWS {
            return Err(DiagnoseError::TooShort { set, windows: data.windows.len(), needed: FEWEST_WINDOWS });
        }
        Ok(WindowSet::new(data))
    }
}
