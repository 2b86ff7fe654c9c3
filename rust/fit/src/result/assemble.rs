//! Assembly of the diagnosis as data from the result of a model search.

use crate::disturbance::intensity::shares;
use crate::disturbance::push::Disturbance;
use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::likelihood::holdout::CONSEQUENTIAL_ERROR;
use crate::likelihood::solve::Fit;
use crate::likelihood::weighting::Weighting;
use crate::locate::dependence::Dependence;
use crate::locate::energy::energy;
use crate::locate::regimes::{ResidualTorques, places, regimes};
use crate::log::input::Options;
use crate::model::arm::ArmDescription;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::numeric::products::rms;
use crate::result::gap::{Compared, Errors, FreeRuns, gap};
use crate::result::headline::Headline;
use crate::result::report::{
    self, ArmSummary, Cause, CauseValue, Diagnosis, EquivalentSummary, Gap, LogSummary, Named, Noise,
    OptionSummary, Parameters, Ranked, SecondHalves, SeveralJoints, SidesSummary, StageSummary,
    TrainingErrors, Value, Values,
};
use crate::result::ruled_out::ruled_out;
use crate::result::sanity::{Estimate, Sanity, bounded_sigma, sanity};
use crate::result::training_gap::remark;
use crate::result::verdict::{Evidence, Verdict, stands_out};
use crate::search::attribute::Candidate;
use crate::search::belief::left_over;
use crate::search::model_search::Attribution;
use armgap_core::arm::Arm;
use rayon::prelude::*;

/// Share of the gap below which its distribution over the joints is not computed.
const NEGLIGIBLE: f64 = 1e-3;

/// Part of a joint's error that known encoder zeros must take away to be worth a remark.
const ZEROS_MATTER: f64 = 0.1;

/// The diagnosis as data, from the named causes of a model search.
pub fn assemble<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    headline: &Headline<N, P>,
    in_training: Option<TrainingErrors>,
    description: &ArmDescription,
    options: &Options,
) -> Diagnosis {
    let Headline { attribution, disturbances, .. } = headline;
    let compared = Compared {
        before: Hypothesis::rigid(context.prior.theta),
        refit: headline.refit.hypothesis.clone(),
        after: headline.model.hypothesis.clone(),
    };
    let rotary = description.kind.rotary();
    let figures = || {
        let weights = &headline.weights;
        let errors = Errors::new(context, &compared, &weights.holdout.zeros, options.seed);
        let free = FreeRuns::new(context, &compared);
        let beside_zeros = errors.beside_zeros();
        let gap = gap(context, &compared, &errors, &free, weights, description, options);
        (gap, beside_zeros, errors.series(), free.series())
    };
    let residual = || {
        let residuals = residual_torques(context, &compared, &headline.weights.holdout);
        let regimes = regimes(&residuals, rotary);
        (residuals, regimes)
    };
    let hidden = in_training.is_some();
    let candidates =
        || (ruled_out(context, attribution, hidden, rotary), ranking(context, attribution, rotary));
    let ((absent, ranking), ((mut gap, beside_zeros, series, free_run_series), (residuals, regimes))) =
        rayon::join(candidates, || rayon::join(figures, residual));
    gap.training =
        in_training.filter(|_| !stands_out(&beside_zeros, &gap.floor, &gap.motion, CONSEQUENTIAL_ERROR));
    let evidence = Evidence {
        named: !headline.causes.is_empty() || !disturbances.is_empty(),
        open: headline.open,
        in_training: gap.training.is_some(),
        before: &gap.before,
        refit: &gap.refit,
        after: &beside_zeros,
        floor: &gap.floor,
        motion: &gap.motion,
        consequence: CONSEQUENTIAL_ERROR,
    };
    let (verdict, remains) = (evidence.verdict(), evidence.remains());
    let besides =
        if remains { context.laws_beside(&headline.model, &headline.weights, rotary) } else { Vec::new() };
    let laws: Vec<Dependence> = besides.into_iter().map(|beside| beside.law).collect();
    let sanity = sanity(description.kind, &estimates(&headline.model, description), remains);
    let mut notes = notes(headline, options.max_causes, remains, &sanity, &gap, description);
    notes.extend(left_out(context));
    notes.extend(gap.training.as_ref().map(|found| remark(found, &[rotary; N])));
    Diagnosis {
        schema: "armgap.diagnosis/1",
        verdict,
        places: places(&joint_shares(context, headline, &compared, verdict), &regimes),
        energy: energy(&residuals),
        gap,
        causes: headline
            .causes
            .iter()
            .map(|c| cause(c, context, headline, description))
            .chain(disturbances.iter().map(|e| push(context, e, rotary)))
            .collect(),
        candidates: unnamed(context, headline, description),
        ruled_out: absent
            .into_iter()
            .filter(|r| {
                let unnamed = headline.disturbance_candidates.iter().map(|u| &u.found);
                let found =
                    |e: &Disturbance| r.effect == "external_pulse" && r.joint == e.push.joint_number();
                !disturbances.iter().chain(unnamed).any(found)
            })
            .collect(),
        parameters: Parameters {
            nominal: nominal(description),
            refit: values(&headline.refit, description),
            with_causes: values(&headline.with_causes, description),
        },
        arm: arm_summary(description),
        training: logs(&context.training, &headline.weights.training.zeros, rotary),
        holdout: logs(&context.holdout, &headline.weights.holdout.zeros, rotary),
        ranking,
        stages: nodes(context, attribution),
        regimes,
        unnamed: laws,
        series,
        free_run_series,
        noise: noise(context),
        options: OptionSummary {
            horizon_s: options.horizon,
            max_causes: options.max_causes,
            seed: options.seed,
            friction_smoothing: headline.model.hypothesis.rounding.iter().copied().fold(0.0, f64::max),
            friction_widths: headline.model.hypothesis.rounding[..N].to_vec(),
        },
        version: env!("CARGO_PKG_VERSION"),
        seconds: 0.0,
        notes,
        sanity,
    }
}

fn residual_torques<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    compared: &Compared<P>,
    weights: &Weighting<N>,
) -> ResidualTorques<N> {
    let data = &context.holdout.data;
    let hypotheses = [&compared.before, &compared.refit, &compared.after];
    let [before, refit, after] =
        crate::locate::regimes::residual_torques(&context.arm, data, &weights.offsets, hypotheses);
    ResidualTorques { before, refit, after }
}

/// Share of each joint in the gap: what causes explain lies on their joints, weighted by their probability; the rest is shared by residual torque.
///
/// A residual torque on one joint changes the motion of all, and an error of its coupling shows on the others; so where a cause is known, its own
/// joint says more than the residual torque does.
fn joint_shares<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    Headline { attribution, weights, causes, disturbances, .. }: &Headline<N, P>,
    compared: &Compared<P>,
    verdict: Verdict,
) -> [f64; N] {
    let of = |hypothesis: &Hypothesis<P>| shares(context, hypothesis, &weights.holdout.offsets);
    let causes = causes.iter().map(|c| (c.effect.joint_number(), c.share, c.probability));
    let pushes = disturbances.iter().map(|e| (e.push.joint_number(), e.share.clamp(0.0, 1.0), e.probability));
    let placed: Vec<(Option<usize>, f64, f64)> = causes.chain(pushes).collect();
    let total: f64 = placed.iter().map(|(_, share, _)| share).sum();
    if total <= 0.0 {
        return of(if verdict == Verdict::Parameters { &compared.before } else { &compared.refit });
    }
    let left = left_over(&attribution.nodes);
    let mut told = [0.0; N];
    for (joint, share, probability) in placed {
        if let Some(number) = joint {
            told[number - 1] += (1.0 - left) * probability * share / total;
        }
    }
    let open = (1.0 - left - told.iter().sum::<f64>()).max(0.0);
    let whole = if open > NEGLIGIBLE { of(&compared.refit) } else { [0.0; N] };
    let rest = if left > NEGLIGIBLE { of(&compared.after) } else { [0.0; N] };
    std::array::from_fn(|j| told[j] + open * whole[j] + left * rest[j])
}

/// Causes and external disturbances that were found and are not named, with reasons.
fn unnamed<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    headline: &Headline<N, P>,
    description: &ArmDescription,
) -> Vec<report::Candidate> {
    let rotary = description.kind.rotary();
    let effects =
        headline.candidates.iter().map(|u| (cause(&u.found, context, headline, description), &u.why));
    let pushes = headline.disturbance_candidates.iter().map(|u| (push(context, &u.found, rotary), &u.why));
    effects.chain(pushes).map(|(cause, why)| report::Candidate { cause, why: why.clone() }).collect()
}

/// Parameters of the arm before and after their estimation.
fn estimates<const P: usize>(fit: &Fit<P>, description: &ArmDescription) -> Vec<Estimate> {
    let one = |i: usize| Estimate {
        nominal: description.theta[i],
        prior: description.sigma[i],
        value: fit.hypothesis.theta[i],
        sigma: fit.sigma(i),
    };
    (0..P).map(one).collect()
}

fn cause<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    cause: &crate::search::belief::Cause,
    context: &DiagnosisContext<A, N, P>,
    headline: &Headline<N, P>,
    description: &ArmDescription,
) -> Cause {
    let spec = cause.effect.law.spec();
    let rotary = description.kind.rotary();
    let compared = context.same_torque(&headline.model.hypothesis, rotary);
    let moved = |other: &EffectInstance| {
        let indices = compared.moved(&cause.effect, other)?;
        Some(indices.into_iter().map(|i| A::PARAMETERS[i].name).collect())
    };
    let equivalents = crate::search::rivals::equivalent::all(&cause.effect, &cause.look_alikes, N, moved);
    Cause {
        effect: spec.name,
        title: spec.title,
        joint: cause.effect.joint_number(),
        on: SeveralJoints::default(),
        probability: cause.probability,
        parameters: cause_values(&cause.effect, &cause.sigma, rotary),
        closed: cause.share,
        equivalents: equivalents
            .into_iter()
            .map(|e| EquivalentSummary {
                effect: e.effect,
                joint: e.joint,
                on: SeveralJoints::default(),
                why: e.why,
                motion_separates: e.motion_separates,
            })
            .collect(),
        evidence: Some(cause.evidence),
        sides: cause.effect.law.has_transmission().then(|| SidesSummary::of(cause.effect.sides)),
        log: None,
        shape: cause.effect.law.form(),
    }
}

/// An external disturbance in the form of a cause.
fn push<A, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    disturbance: &Disturbance,
    rotary: bool,
) -> Cause {
    let spec = disturbance.push.law.spec();
    let sample = if disturbance.holdout { &context.holdout } else { &context.training };
    Cause {
        effect: spec.name,
        title: spec.title,
        joint: disturbance.push.joint_number(),
        on: SeveralJoints::default(),
        probability: disturbance.probability,
        parameters: cause_values(&disturbance.push, &disturbance.sigma, rotary),
        closed: disturbance.share.clamp(0.0, 1.0),
        equivalents: Vec::new(),
        evidence: None,
        sides: None,
        log: Some(sample.data.tracks[disturbance.track].name.clone()),
        shape: disturbance.push.law.form(),
    }
}

fn cause_values(effect: &EffectInstance, sigma: &[f64], rotary: bool) -> Named<CauseValue> {
    effect_values(effect, sigma, rotary).into_iter().map(|(name, v)| (name, CauseValue::One(v))).collect()
}

fn effect_values(effect: &EffectInstance, sigma: &[f64], rotary: bool) -> Named<Value> {
    let parameters = effect.law.spec().parameters.iter().enumerate();
    parameters
        .map(|(i, p)| {
            let sigma = sigma.get(i).copied().unwrap_or(0.0);
            (p.name.to_owned(), Value { value: effect.p[i], sigma, unit: p.quantity.unit(rotary) })
        })
        .collect()
}

fn ranking<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    attribution: &Attribution<N, P>,
    rotary: bool,
) -> Vec<Ranked> {
    let node = &attribution.nodes[0];
    let WindowSet { data, measured } = context.all_windows(&context.holdout);
    let offsets = data.zero_offsets();
    let ranked = |c: &Candidate<P>, closed: f64| {
        context.progress.unit();
        let effect = c.effect?;
        let n = c.fit.hypothesis.values().len();
        let sigma: Vec<f64> = (n - effect.len()..n).map(|i| c.fit.sigma(i)).collect();
        let predicted = data.predict(&context.arm, &c.fit.hypothesis, &offsets);
        Some(Ranked {
            effect: effect.law.spec().name,
            title: effect.law.spec().title,
            joint: effect.joint_number(),
            closed,
            trust: c.fit.prior_cost,
            rms: rms::<N>(&measured, &predicted),
            parameters: effect_values(&effect, &sigma, rotary),
        })
    };
    let final_of = |c: &Candidate<P>| node.candidates.iter().any(|f| same_effect(f, c));
    let finalists = node.candidates.iter().map(|c| (c, node.share(c)));
    let others = node.field.iter().filter(|(c, _)| !final_of(c)).map(|(c, share)| (c, *share));
    let all: Vec<(&Candidate<P>, f64)> = finalists.chain(others).collect();
    all.into_par_iter().filter_map(|(c, share)| ranked(c, share)).collect()
}

fn same_effect<const P: usize>(a: &Candidate<P>, b: &Candidate<P>) -> bool {
    matches!((a.effect, b.effect), (Some(a), Some(b)) if a.same_place(&b))
}

fn nodes<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    attribution: &Attribution<N, P>,
) -> Vec<StageSummary> {
    let WindowSet { data, measured } = context.all_windows(&context.holdout);
    let offsets = data.zero_offsets();
    let summary_of = |effect: &EffectInstance| EquivalentSummary {
        effect: effect.law.spec().name,
        joint: effect.joint_number(),
        on: SeveralJoints::default(),
        why: String::new(),
        motion_separates: true,
    };
    let summary = |(i, node): (usize, &crate::search::attribute::SearchNode<N, P>)| StageSummary {
        added: attribution.added(i).map(summary_of),
        rms: rms::<N>(&measured, &data.predict(&context.arm, &node.settled.hypothesis, &offsets)),
        excess: node.excess(),
        relative_error: node.relative_error(),
        trust: node.base.fit.prior_cost,
    };
    attribution.nodes.iter().enumerate().map(summary).collect()
}

fn nominal(description: &ArmDescription) -> Named<Value> {
    let names = description.kind.parameters().iter().enumerate();
    names
        .map(|(i, p)| {
            let (value, sigma) = (description.theta[i], description.sigma[i]);
            (p.name.to_owned(), Value { value, sigma, unit: p.unit })
        })
        .collect()
}

fn values<const P: usize>(fit: &Fit<P>, description: &ArmDescription) -> Named<Value> {
    let names = description.kind.parameters().iter().enumerate();
    names
        .map(|(i, p)| {
            (p.name.to_owned(), Value { value: fit.hypothesis.theta[i], sigma: fit.sigma(i), unit: p.unit })
        })
        .collect()
}

fn arm_summary(description: &ArmDescription) -> ArmSummary {
    let kind = description.kind;
    ArmSummary {
        kind: kind.name(),
        n_joints: kind.joints(),
        parameter_names: kind.parameters().iter().map(|p| p.name.to_owned()).collect(),
        parameter_units: kind.parameters().iter().map(|p| p.unit).collect(),
        joint_unit: vec![if kind.rotary() { "rad" } else { "m" }; kind.joints()],
    }
}

fn logs<const N: usize>(sample: &WindowSet<N>, zeros: &EncoderZeros<N>, rotary: bool) -> Vec<LogSummary> {
    let zero = |source: &str| {
        let found = zeros.recordings.iter().find(|r| r.source == source)?;
        let (value, sigma) = (found.zero.as_slice().to_vec(), found.sigma.as_slice().to_vec());
        Some(Values { value, sigma, unit: if rotary { "rad" } else { "m" } })
    };
    let windows = |i: usize| sample.data.windows.iter().filter(|w| w.track == i).count();
    let tracks = sample.data.tracks.iter().enumerate();
    tracks
        .map(|(i, track)| LogSummary {
            name: track.name.clone(),
            samples: track.len(),
            duration_s: track.t[track.len() - 1] - track.t[0],
            windows: windows(i),
            encoder_zero: zero(&track.source),
        })
        .collect()
}

fn noise<A, const N: usize, const P: usize>(context: &DiagnosisContext<A, N, P>) -> Noise {
    let step = context.training.data.tracks.first().map_or([0.0; N], |t| t.step);
    Noise { position_sigma: context.noise.to_vec(), encoder_step: step.to_vec() }
}

/// Remarks on the result: nuisances fitted beside the causes, the remaining gap, limits set by the options, and implausible values.
fn notes<const N: usize, const P: usize>(
    headline: &Headline<N, P>,
    max_causes: usize,
    remains: bool,
    sanity: &[Sanity],
    gap: &Gap,
    description: &ArmDescription,
) -> Vec<String> {
    let mut notes = Vec::new();
    if headline.model.hypothesis.is_rounded() {
        let widths: Vec<String> =
            headline.model.hypothesis.rounding[..N].iter().map(|width| format!("{width:.3}")).collect();
        let widths = widths.join(" and ");
        notes.push(format!("the logs fit friction smoothed over {widths} rad/s better than dry friction"));
    }
    let named = !headline.causes.is_empty() || !headline.disturbances.is_empty();
    if max_causes == 0 {
        notes.push("no cause was allowed: a gap was not searched for one".to_owned());
    } else if named && remains {
        notes.push("a gap remains that no further effect in the library explains".to_owned());
    }
    for found in sanity {
        if !notes.contains(&found.message) {
            notes.push(found.message.clone());
        }
    }
    notes.extend(
        gap.second_halves
            .as_ref()
            .and_then(|halves| zeros_matter(halves, &headline.weights.holdout.zeros, gap.unit)),
    );
    notes.extend(narrowed(description));
    notes
}

/// Remark on windows that are not fitted to, because pushes act in them; none where all windows are.
fn left_out<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
) -> Option<String> {
    let samples = [&context.training, &context.holdout];
    let all: usize = samples.iter().map(|sample| context.all_windows(sample).data.windows.len()).sum();
    let fitted: usize = samples.iter().map(|sample| sample.data.windows.len()).sum();
    (fitted < all).then(|| {
        let left_out = all - fitted;
        format!(
            "the arm and its causes are fitted without the {left_out} of {all} windows in which pushes act"
        )
    })
}

/// Remark on how encoder zeros that differ between recordings change the gap; none where the change is small.
fn zeros_matter<const N: usize>(
    halves: &SecondHalves,
    zeros: &EncoderZeros<N>,
    unit: &str,
) -> Option<String> {
    let fall = |(after, with_zeros): (&f64, &f64)| *with_zeros < (1.0 - ZEROS_MATTER) * after;
    let list =
        |values: &[f64]| values.iter().map(|x| format!("{:.2}", x * 1e3)).collect::<Vec<_>>().join(" and ");
    halves.after.iter().zip(&halves.with_zeros).any(fall).then(|| {
        format!(
            "the encoders' zeros differ between recordings, by {} m{unit} (standard deviation, joint by joint), which was fitted beside the arm: \
             with the zeros that its first half shows, the second half of each holdout log is missed by {} in place of {} m{unit}",
            list(&zeros.spread),
            list(&halves.with_zeros),
            list(&halves.after)
        )
    })
}

/// Remark on the standard deviations of the arm file that are replaced by smaller ones; none where there are none.
fn narrowed(description: &ArmDescription) -> Option<String> {
    let bounded = bounded_sigma(description.kind, &description.theta, &description.sigma);
    let parameters = description.kind.parameters().iter();
    let wide: Vec<&str> = parameters
        .zip(bounded.iter().zip(&description.sigma))
        .filter(|(_, (bounded, sigma))| bounded < sigma)
        .map(|(parameter, _)| parameter.name)
        .collect();
    let names = wide.join(", ");
    (!wide.is_empty()).then(|| format!("sigma of {names}: more than ten times the value, so that much is used; a wider one lets the logs say no more"))
}
