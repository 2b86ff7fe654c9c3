//! Diagnosis of an arm with a closed-form model: where the gap lies, which effect causes it, how far it shrinks.

use crate::disturbance::push::Conclusion;
use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::scale::Scales;
use crate::likelihood::solve::Prior;
use crate::log::input::{DiagnoseError, FEWEST_WINDOWS, LogData, Options, validate};
use crate::log::track::Track;
use crate::model::arm::{ArmDescription, WithArm};
use crate::model::custom_effect;
use crate::model::hypothesis::EffectInstance;
use crate::predict::window::Dataset;
use crate::progress::{Observer, Phase, ProgressReporter, guarded};
use crate::result::headline::Headline;
use crate::result::report::{Diagnosis, TrainingErrors};
use crate::result::sanity::bounded_sigma;
use crate::result::training_gap::training_gap;
use crate::search::crosswise::{crosswise, explains};
use armgap_core::arm::Arm;
use std::time::Instant;

/// Note in the result of a diagnosis by interleaved cross-validation.
const CROSSWISE: &str = "training and holdout logs show different gaps: every log was cut into stretches that were learnt from and judged on \
     by turns";

/// Probability, 0 to 1, from which an external disturbance counts as named.
const NAMED_DISTURBANCE: f64 = 0.5;

/// Diagnoses the gap between an arm and its logs; `observer` receives the progress and may cancel the diagnosis.
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

/// Input of a diagnosis: arm, training and holdout logs, options and progress observer.
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
        let hidden = max_causes > 0 && hidden_in_training(&context, &conclusion, seed);
        let instead = self.crosswise(arm, theta, &context, &conclusion, hidden)?;
        let is_crosswise = instead.is_some();
        if let Some(instead) = instead {
            (context, conclusion) = instead;
        }
        let headline = context.headline(conclusion, max_causes, &self.options.withheld);
        let in_training = if is_crosswise { None } else { left_in_training(&context, &headline, seed) };
        let attribution = &headline.attribution;
        let open = context.open_candidates(&attribution.model.hypothesis).len();
        context.progress.begin(Phase::Result, open + attribution.nodes[0].field.len());
        let mut diagnosis =
            crate::result::assemble::assemble(&context, &headline, in_training, self.arm, self.options);
        if is_crosswise {
            diagnosis.notes.insert(0, CROSSWISE.to_owned());
        }
        diagnosis.seconds = started.elapsed().as_secs_f64();
        Ok(diagnosis)
    }
}

/// Whether the training logs show a gap, which a diagnosis took for external pushes or for nothing, and the holdout does not.
fn hidden_in_training<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    first: &Conclusion<N, P>,
    seed: u64,
) -> bool {
    let found = first.without_disturbances();
    let Some(last) = found.nodes.last() else { return false };
    if !found.causes.is_empty() || found.is_unexplained() {
        return false;
    }
    let WindowSet { data, measured } = context.all_windows(&context.training);
    let (bare, zeros) = (WindowSet { data: data.without_pushes(), measured }, &last.weights.training.zeros);
    training_gap(context, &bare, &found.model.hypothesis, zeros, seed).is_some()
}

/// Gap that the reported model leaves on the training logs, where no cause is named and the model search has explained the holdout.
fn left_in_training<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    headline: &Headline<N, P>,
    seed: u64,
) -> Option<TrainingErrors> {
    if headline.open || !headline.causes.is_empty() || !headline.disturbances.is_empty() {
        return None;
    }
    let zeros = &headline.weights.training.zeros;
    training_gap(context, &context.training, &headline.model.hypothesis, zeros, seed)
}

impl Request<'_> {
    /// The diagnosis by interleaved cross-validation, where it explains what the diagnosis `first` left open or took for external disturbances, or
    /// what only the training logs show (`hidden`).
    fn crosswise<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        &self,
        arm: A,
        theta: [f64; P],
        plain: &DiagnosisContext<A, N, P>,
        first: &Conclusion<N, P>,
        hidden: bool,
    ) -> Result<Option<(DiagnosisContext<A, N, P>, Conclusion<N, P>)>, DiagnoseError> {
        let Options { max_causes, seed, horizon, .. } = *self.options;
        let pushed = first.disturbances.iter().any(|e| e.probability > NAMED_DISTURBANCE);
        let open = first.attribution.is_unexplained() || pushed;
        let differ = hidden || (open && plain.holdout_shows_more(first.without_disturbances()));
        if !differ {
            return Ok(None);
        }
        let Some([training, holdout]) = crosswise(self.training, self.holdout, horizon) else {
            return Ok(None);
        };
        let mut context = match self.context(arm, theta, &training, &holdout) {
            Ok(context) => context,
            // Stretches of logs may hold too few windows although the whole logs hold enough.
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

    /// Diagnosis context with the windows of training and holdout logs, scales of the residual and priors of the arm's parameters.
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
            crate::log::track::median(training.data.tracks.iter().map(|t| t.noise[j]).collect())
        });
        let start = self.options.start.as_deref().map(<[f64; P]>::try_from).transpose();
        let start = start.map_err(|_| DiagnoseError::Parameters(self.arm.kind))?;
        let progress = ProgressReporter::new(Observer::clone(self.observer));
        let custom_effects = self.custom_effects(&scales);
        let sides = std::array::from_fn(|j| self.arm.sides(j));
        Ok(DiagnosisContext {
            arm,
            prior,
            start,
            scales,
            training,
            holdout,
            horizon: self.options.horizon,
            noise,
            sides,
            custom_effects,
            progress,
        })
    }

    /// The custom effects of the options, each with its parameter at the initial guess.
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
                .of_source(&log.source)
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
