//! Status of every candidate effect that is no cause: absent, undecided, or not excited by the logs.

use crate::candidates::screen::{ScoreTest, screen};
use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::covariance::NORMAL_95;
use crate::model::hypothesis::EffectInstance;
use crate::result::report::{Bound, RuledOut, SeveralJoints, Status};
use crate::search::acceptance::{ALMOST, MATTERS, restores};
use crate::search::model_search::Attribution;
use armgap_core::arm::Arm;
use armgap_core::effect::{NEVER, Scope, Spec, Trial, catalogue};

/// Standard deviation of an effect's size, relative to a typical size, above which the logs have not excited the effect.
const PINNED: f64 = 0.5;

/// Share of the remaining gap above which an effect that could explain as much is not called absent.
const COULD_BE: f64 = 0.1;

/// Why an effect is undecided that the training logs show and the holdout does not.
const TRACED: &str = "it leaves a trace in the training logs, but does not reduce the gap on the holdout";

/// Status of every candidate effect that is no cause, from its score test (first-order) around the final model; `in_training`: whether the training
/// logs show a gap that the holdout does not.
pub fn ruled_out<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    attribution: &Attribution<N, P>,
    in_training: bool,
    rotary: bool,
) -> Vec<RuledOut> {
    let node = &attribution.nodes[attribution.nodes.len() - 1];
    let model = &attribution.model.hypothesis;
    let open = context.open_candidates(model);
    let problem = context.problem(&node.weights.training);
    let unchanged = model.effects.len() == node.settled.hypothesis.effects.len()
        && model.values() == node.settled.hypothesis.values();
    let known = node.screened.get(..open.len()).filter(|_| unchanged);
    let tested = || screen(&problem, model, &problem.jacobian(model), &open);
    let scored = known.map_or_else(tested, <[ScoreTest]>::to_vec);
    let remains = problem.weighting.total(&problem.raw_costs(model));
    let unexplained = node.is_open() || in_training;
    let mut list: Vec<(EffectInstance, RuledOut)> = Vec::new();
    for test in &scored {
        let mut entry = status(context, test, rotary);
        if unexplained {
            doubt(&mut entry, test, remains);
        }
        match list.iter_mut().find(|(place, _)| place.same_place(&test.effect)) {
            // Of the tests of an effect at several initial guesses, the weakest statement holds for the effect.
            Some((place, known)) if prevails(&entry, known, is_whole(place)) => *known = entry,
            Some(_) => {}
            None => list.push((test.effect, entry)),
        }
    }
    for (place, entry) in &mut list {
        if let Some(instead) = rivalled(attribution, place) {
            leave_open(entry, &instead);
        }
    }
    let mut entries: Vec<RuledOut> = list.into_iter().map(|(_, entry)| entry).collect();
    entries.extend(never_fitted::<N>(in_training));
    entries
}

/// Status of the effects for which no candidate is tested: external disturbances, and effects that other values always imitate.
fn never_fitted<const N: usize>(in_training: bool) -> Vec<RuledOut> {
    let laws = catalogue::<f64>().iter().map(|law| law.spec());
    let unsearched = laws.filter(|spec| spec.initial_guesses.is_empty() && spec.least_joints <= N);
    let entry = |spec: &Spec, joint: Option<usize>| {
        let (status, why) = if spec.trial == Trial::Disturbance && in_training {
            (
                Status::Undecided,
                "the training logs show a gap that pushes may have made, though none stands out",
            )
        } else if spec.trial == Trial::Disturbance {
            (
                Status::Absent,
                "no push stands out of what the model lacks in any of these logs; a joint at rest shows none below its friction",
            )
        } else {
            (Status::Undecided, "another effect and other parameters of the arm give the same motion, always")
        };
        RuledOut {
            effect: spec.name,
            joint,
            on: SeveralJoints::default(),
            status,
            bound: None,
            why: Some(why.to_owned()),
        }
    };
    let places = |spec: &Spec| -> Vec<Option<usize>> {
        if spec.scope == Scope::Joint { (1..=N).map(Some).collect() } else { vec![None] }
    };
    unsearched.flat_map(|spec| places(spec).into_iter().map(move |joint| entry(spec, joint))).collect()
}

/// Whether entry `a`, and not entry `b`, holds for an effect: its status is less certain, or its bound at the same status larger, or smaller for an
/// effect `by_trial`. Each trial excludes its own size, so together they exclude all sizes from the smallest on.
fn prevails(a: &RuledOut, b: &RuledOut, by_trial: bool) -> bool {
    let size = |r: &RuledOut| r.bound.as_ref().map_or(f64::INFINITY, |b| b.value);
    let weaker = if by_trial { size(a) < size(b) } else { size(a) > size(b) };
    a.status > b.status || a.status == b.status && weaker
}

/// Status and upper bound of the size of one candidate effect, from its score test.
fn status<A, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    test: &ScoreTest,
    rotary: bool,
) -> RuledOut {
    let spec = test.effect.law.spec();
    let parameter = &spec.parameters[0];
    let typical = context.scales.size(parameter.quantity, test.effect.joint);
    let sigma = test.sigma.max(test.information_sigma);
    let (effect, joint) = (spec.name, test.effect.joint_number());
    if spec.trial == Trial::Whole {
        return trial_status(test, rotary);
    }
    let pinned = sigma < PINNED * typical;
    if !pinned {
        let why = format!("these logs do not pin it down; it needs {}", spec.excited_by);
        return RuledOut {
            effect,
            joint,
            on: SeveralJoints::default(),
            status: Status::NotExcited,
            bound: None,
            why: Some(why),
        };
    }
    let value = test.estimate.abs() + NORMAL_95 * sigma;
    let bound =
        Bound { parameter: parameter.name, value, unit: parameter.quantity.unit(rotary), level: 0.95 };
    let traced = is_traced(test);
    RuledOut {
        effect,
        joint,
        on: SeveralJoints::default(),
        status: if traced { Status::Undecided } else { Status::Absent },
        bound: Some(bound),
        why: traced.then(|| TRACED.to_owned()),
    }
}

/// The named cause that the effect `place` could replace: when the cause was added, the effect lowered the gap, or restored the parameters' prior
/// values, nearly as well.
fn rivalled<const N: usize, const P: usize>(
    attribution: &Attribution<N, P>,
    place: &EffectInstance,
) -> Option<EffectInstance> {
    let named = |e: &&EffectInstance| attribution.causes.iter().any(|c| c.effect.same_place(e));
    attribution.nodes.iter().enumerate().find_map(|(i, node)| {
        let adopted = attribution.added(i).filter(named)?;
        let at = |place: &EffectInstance| {
            node.candidates.iter().find(|c| c.effect.is_some_and(|e| e.same_place(place)))
        };
        let (cause, rival) = (at(adopted)?, at(place)?);
        let is_near = node.share(cause) > MATTERS && node.share(rival) > ALMOST * node.share(cause);
        let by_motion = is_near && !node.excludes(cause, rival);
        (by_motion || (restores(node, cause) && restores(node, rival))).then_some(*adopted)
    })
}

/// Changes the status of an absent effect to undecided, as the effect would do nearly as well in place of the named cause `instead`.
fn leave_open(entry: &mut RuledOut, instead: &EffectInstance) {
    if entry.status == Status::Absent {
        (entry.status, entry.bound) = (Status::Undecided, None);
        let joint = instead.joint_number().map_or(String::new(), |j| format!(", joint {j}"));
        entry.why = Some(format!(
            "beside the named causes there is none of it, but in place of {}{joint} it would do nearly as well",
            instead.law.spec().title
        ));
    }
}

/// Makes an absent effect undecided if at its largest possible size it would explain a considerable share of the remaining gap, whose cost is
/// `remains`.
fn doubt(entry: &mut RuledOut, test: &ScoreTest, remains: f64) {
    let bound = entry.bound.as_ref().filter(|_| !is_whole(&test.effect));
    let most = bound.map_or(test.gain, |bound| (bound.value / test.information_sigma).powi(2));
    let share = (most / remains).min(1.0);
    let law = test.effect.law;
    if entry.status == Status::Absent && law.spec().trial == Trial::Whole && !law.has_transmission() {
        // An effect with a threshold: the trial thresholds lie within the motion of the training logs, and the gap may arise beyond, where only the
        // holdout went.
        entry.status = Status::Undecided;
        entry.why = Some(
            "a gap remains, and it may begin beyond where the training logs went; let them reach what the holdout reaches".to_owned(),
        );
    } else if entry.status == Status::Absent && share > COULD_BE {
        entry.status = Status::Undecided;
        let percent = 100.0 * share;
        entry.why = Some(format!("a gap remains, and up to {percent:.0} % of it could be its doing"));
    }
}

/// Whether an effect is tested as a whole, at trial values, as one that acts beyond a threshold; estimates are then relative to the trial.
fn is_whole(effect: &EffectInstance) -> bool {
    effect.law.spec().trial == Trial::Whole
}

/// Status of an effect at trial values: excited if the trial leaves a trace, absent if a trace as large is excluded with 95 %. The trial size is then
/// the bound, where the first parameter is a size and not a threshold.
fn trial_status(test: &ScoreTest, rotary: bool) -> RuledOut {
    let spec = test.effect.law.spec();
    let (effect, joint) = (spec.name, test.effect.joint_number());
    let sigma = test.sigma.max(test.information_sigma);
    let reached = test.distinct > 0.0 && test.information_sigma < PINNED;
    let (status, why) = match () {
        () if !reached => {
            (Status::NotExcited, format!("these logs never reach it; it needs {}", spec.excited_by))
        }
        () if is_traced(test) => (Status::Undecided, TRACED.to_owned()),
        () if test.estimate.abs() + NORMAL_95 * sigma > 1.0 => {
            (Status::NotExcited, format!("these logs do not pin it down; it needs {}", spec.excited_by))
        }
        () => {
            (Status::Absent, "at trial values it would leave a trace that these logs do not show".to_owned())
        }
    };
    let parameter = &spec.parameters[0];
    let is_size = parameter.neutral < NEVER && parameter.lower >= 0.0;
    let bound = (status == Status::Absent && is_size).then(|| Bound {
        parameter: parameter.name,
        value: (test.effect.p[0] - parameter.neutral).abs(),
        unit: parameter.quantity.unit(rotary),
        level: 0.95,
    });
    RuledOut { effect, joint, on: SeveralJoints::default(), status, bound, why: Some(why) }
}

/// Whether the score test of an effect on the training logs finds a size of more than three standard deviations.
fn is_traced(test: &ScoreTest) -> bool {
    test.estimate.abs() > 3.0 * test.sigma.max(test.information_sigma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    /// Status of backlash after a score test with a gap of 10 mrad: estimated size (1: that of the trial) and its standard deviation.
    fn of_backlash(estimate: f64, sigma: f64) -> RuledOut {
        let effect = EffectInstance::new(find::<f64>("backlash").unwrap(), 0, [0.01, 0.0, 0.0]);
        let test = ScoreTest {
            effect,
            gain: 1.0,
            estimate,
            sigma: 0.1,
            information_sigma: sigma,
            imitation: Vec::new(),
            size: estimate,
            tested: 0,
            distinct: 0.5,
        };
        trial_status(&test, true)
    }

    #[test]
    fn an_effect_tested_as_a_whole_is_absent_only_from_the_trial_size_on() {
        let absent = of_backlash(0.1, 0.1);
        assert_eq!(absent.status, Status::Absent);
        assert_eq!(absent.bound.map(|b| (b.parameter, b.value)), Some(("gap", 0.01)));
        let traced = of_backlash(0.9, 0.1);
        assert_eq!(
            (traced.status, traced.why.as_deref(), traced.bound.is_none()),
            (Status::Undecided, Some(TRACED), true)
        );
        assert_eq!(of_backlash(0.9, 2.0).status, Status::NotExcited);
        // The scatter of the logs leaves room for all of the trial.
        assert_eq!(of_backlash(0.4, 0.4).status, Status::NotExcited);
    }

    #[test]
    fn of_several_trials_the_least_certain_status_and_then_the_smallest_size_holds() {
        let [small, large] = [0.005, 0.02].map(|gap| {
            let mut entry = of_backlash(0.1, 0.1);
            entry.bound.iter_mut().for_each(|bound| bound.value = gap);
            entry
        });
        let open = of_backlash(0.9, 2.0);
        assert!(prevails(&small, &large, true) && !prevails(&large, &small, true));
        assert!(prevails(&large, &small, false) && !prevails(&small, &large, false));
        assert!(prevails(&open, &small, true) && !prevails(&small, &open, true));
    }
}
