//! Status of every candidate effect that is no cause: absent, undecided, or not excited by the logs.

use crate::candidates::screen::{ScoreTest, screen};
use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::covariance::NORMAL_95;
use crate::model::hypothesis::EffectInstance;
use crate::result::report::{Bound, RuledOut, SeveralJoints, Status};
use crate::search::acceptance::{ALMOST, MATTERS, restores};
use crate::search::model_search::Attribution;
use armgap_core::arm::Arm;
use armgap_core::effect::{Quantity, Scope, Spec, Trial, catalogue};
use armgap_core::transmission::Sides;

/// Standard deviation of an effect's size, relative to a typical size or to that of its trial, above which the logs have not excited the effect.
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
    let mut places: Vec<EffectInstance> = Vec::new();
    for test in &scored {
        if !places.iter().any(|place| place.same_place(&test.effect)) {
            places.push(test.effect);
        }
    }
    let of_place = |place: EffectInstance| {
        let tests: Vec<&ScoreTest> = scored.iter().filter(|t| t.effect.same_place(&place)).collect();
        let doubted = unexplained.then_some(remains);
        let entry = if is_whole(&place) {
            of_trials(&tests, doubted, rotary)
        } else {
            // Of the tests of an effect at several initial guesses, the weakest statement holds for the effect.
            let entries = tests.iter().map(|test| {
                let mut entry = status(context, test, rotary);
                if let Some(remains) = doubted {
                    doubt(&mut entry, test, remains);
                }
                entry
            });
            entries.reduce(|known, entry| if weaker(&entry, &known) { entry } else { known })?
        };
        Some((place, entry))
    };
    let mut list: Vec<(EffectInstance, RuledOut)> = places.into_iter().filter_map(of_place).collect();
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

/// Whether entry `a` states less than entry `b`: a less certain status, or a larger bound at the same status.
fn weaker(a: &RuledOut, b: &RuledOut) -> bool {
    let size = |r: &RuledOut| r.bound.as_ref().map_or(f64::INFINITY, |b| b.value);
    (a.status, size(a)) > (b.status, size(b))
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
    let most = entry.bound.as_ref().map_or(test.gain, |bound| (bound.value / test.information_sigma).powi(2));
    let share = (most / remains).min(1.0);
    if entry.status == Status::Absent && share > COULD_BE {
        entry.status = Status::Undecided;
        let percent = 100.0 * share;
        entry.why = Some(format!("a gap remains, and up to {percent:.0} % of it could be its doing"));
    }
}

/// Whether an effect is tested as a whole, at trial values, as one that acts beyond a threshold; estimates are then relative to the trial.
fn is_whole(effect: &EffectInstance) -> bool {
    effect.law.spec().trial == Trial::Whole
}

/// Status of an effect that is tested as a whole, from its tests at several trial values; `doubted` is the cost of a gap that remains.
///
/// Excited if trials leave traces; undecided if a trial finds a trace, or cannot exclude one as large as it would leave; else absent. Of backlash, which
/// alone has a size, trials may be too small: it is absent from the size on from which all trials exclude it, for all sides of encoder and friction.
/// Of joint elasticity they may be too soft, and the reason states the stiffness up to which it is absent.
fn of_trials(tests: &[&ScoreTest], doubted: Option<f64>, rotary: bool) -> RuledOut {
    let effect = &tests[0].effect;
    let spec = effect.law.spec();
    let statuses: Vec<Status> = tests.iter().map(|test| trial_status(test)).collect();
    let excluded = if effect.is_backlash() {
        smallest_excluded(tests, &statuses)
    } else {
        statuses.iter().all(|s| *s == Status::Absent).then_some(f64::INFINITY)
    };
    let parameter = &spec.parameters[0];
    let unit = parameter.quantity.unit(rotary);
    let is_stiffness = parameter.quantity == Quantity::ShaftStiffness;
    let stiffest = if is_stiffness { stiffest_excluded(tests) } else { f64::INFINITY };
    let gain = tests.iter().map(|test| test.gain).fold(0.0, f64::max);
    let share = doubted.map_or(0.0, |remains| (gain / remains).min(1.0));
    let (status, why) = match excluded {
        _ if tests.iter().any(|test| is_traced(test)) => (Status::Undecided, TRACED.to_owned()),
        None if statuses.contains(&Status::NotExcited) => {
            (Status::NotExcited, format!("these logs never reach it; it needs {}", spec.excited_by))
        }
        None => (Status::Undecided, "at trial values its trace could be lost in the scatter of these logs".to_owned()),
        // The trial thresholds lie within the motion of the training logs, and the gap may arise beyond, where only the holdout went.
        Some(_) if doubted.is_some() && !effect.law.has_transmission() => (
            Status::Undecided,
            "a gap remains, and it may begin beyond where the training logs went; let them reach what the holdout reaches"
                .to_owned(),
        ),
        Some(_) if share > COULD_BE => (
            Status::Undecided,
            format!("a gap remains, and up to {:.0} % of it could be its doing", 100.0 * share),
        ),
        Some(_) if stiffest.is_finite() => (
            Status::Absent,
            format!(
                "a shaft of up to {stiffest:.3e} {unit}, with any rotor that was tried, would leave a trace that these logs do not show"
            ),
        ),
        Some(_) => {
            (Status::Absent, "at trial values it would leave a trace that these logs do not show".to_owned())
        }
    };
    let bound = excluded.filter(|size| status == Status::Absent && size.is_finite()).map(|value| Bound {
        parameter: parameter.name,
        value,
        unit,
        level: 0.95,
    });
    let joint = effect.joint_number();
    RuledOut { effect: spec.name, joint, on: SeveralJoints::default(), status, bound, why: Some(why) }
}

/// Size of backlash from which on every trial is absent, the largest over the sides of encoder and friction that were tried; none if with some sides
/// the largest trial is not.
fn smallest_excluded(tests: &[&ScoreTest], statuses: &[Status]) -> Option<f64> {
    let mut sides: Vec<Sides> = Vec::new();
    for test in tests {
        if !sides.contains(&test.effect.sides) {
            sides.push(test.effect.sides);
        }
    }
    let with = |sides: Sides| {
        let mut trials: Vec<(f64, Status)> = tests
            .iter()
            .zip(statuses)
            .filter(|(test, _)| test.effect.sides == sides)
            .map(|(test, status)| (test.effect.p[0], *status))
            .collect();
        trials.sort_by(|a, b| b.0.total_cmp(&a.0));
        trials.iter().take_while(|(_, status)| *status == Status::Absent).last().map(|(size, _)| *size)
    };
    sides.into_iter().map(with).try_fold(0.0, |most, size| Some(f64::max(most, size?)))
}

/// Stiffness up to which trials exclude a shaft with any rotor: the least, over the rotor inertias and sides that were tried, of the stiffest trial.
fn stiffest_excluded(tests: &[&ScoreTest]) -> f64 {
    let alike = |a: &EffectInstance, b: &EffectInstance| a.p[2] == b.p[2] && a.sides == b.sides;
    let stiffest = |test: &&ScoreTest| {
        let same = tests.iter().filter(|other| alike(&other.effect, &test.effect));
        same.map(|other| other.effect.p[0]).fold(0.0, f64::max)
    };
    tests.iter().map(stiffest).fold(f64::INFINITY, f64::min)
}

/// What one trial of an effect as a whole says: the trial leaves no trace, or a trace as large is excluded with 95 %, or it is not.
fn trial_status(test: &ScoreTest) -> Status {
    let sigma = test.sigma.max(test.information_sigma);
    let reached = test.distinct > 0.0 && test.information_sigma < PINNED;
    match () {
        () if !reached => Status::NotExcited,
        () if is_traced(test) || test.estimate.abs() + NORMAL_95 * sigma > 1.0 => Status::Undecided,
        () => Status::Absent,
    }
}

/// Whether the score test of an effect on the training logs finds a size of more than three standard deviations.
fn is_traced(test: &ScoreTest) -> bool {
    test.estimate.abs() > 3.0 * test.sigma.max(test.information_sigma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    /// Score test of backlash with the gap `size`, rad: estimated share of the trial and its standard deviation.
    fn backlash(size: f64, estimate: f64, sigma: f64) -> ScoreTest {
        ScoreTest {
            effect: EffectInstance::new(find::<f64>("backlash").unwrap(), 0, [size, 0.0, 0.0]),
            gain: 1.0,
            estimate,
            sigma: 0.1,
            information_sigma: sigma,
            imitation: Vec::new(),
            share: 1.0,
            size: estimate,
            tested: 0,
            distinct: 0.5,
        }
    }

    fn found(tests: &[ScoreTest], doubted: Option<f64>) -> (Status, Option<f64>) {
        let entry = of_trials(&tests.iter().collect::<Vec<_>>(), doubted, true);
        (entry.status, entry.bound.map(|b| b.value))
    }

    #[test]
    fn backlash_is_absent_from_the_size_on_that_all_larger_trials_exclude() {
        let [small, large] = [0.005, 0.02].map(|size| backlash(size, 0.1, 0.1));
        let unseen = backlash(0.0025, 0.0, 2.0);
        let hidden = backlash(0.005, 0.4, 0.4);
        assert_eq!(found(&[small.clone(), large.clone()], None), (Status::Absent, Some(0.005)));
        assert_eq!(found(&[unseen.clone(), small, large.clone()], None), (Status::Absent, Some(0.005)));
        assert_eq!(found(&[hidden.clone(), large.clone()], None), (Status::Absent, Some(0.02)));
        assert_eq!(found(&[hidden], None), (Status::Undecided, None));
        assert_eq!(found(&[unseen], None), (Status::NotExcited, None));
        // With other sides of encoder and friction only larger gaps are excluded.
        let mut other = backlash(0.08, 0.1, 0.1);
        other.effect.sides = Sides::MOTOR;
        assert_eq!(found(&[large, other], None), (Status::Absent, Some(0.08)));
    }

    #[test]
    fn a_shaft_is_absent_up_to_the_stiffness_that_trials_exclude_with_every_rotor() {
        let shaft = |stiffness: f64, rotor: f64| ScoreTest {
            effect: EffectInstance::new(find::<f64>("joint_elasticity").unwrap(), 0, [stiffness, 1.0, rotor]),
            ..backlash(0.0, 0.1, 0.1)
        };
        let tests = [shaft(100.0, 0.01), shaft(400.0, 0.01), shaft(500.0, 0.1), shaft(6000.0, 0.1)];
        let entry = of_trials(&tests.iter().collect::<Vec<_>>(), None, true);
        assert_eq!(entry.status, Status::Absent);
        assert!(entry.why.unwrap().contains("up to 4.000e2 N m/rad"));
    }

    #[test]
    fn a_trace_or_a_gap_that_remains_leaves_backlash_undecided() {
        let [seen, absent] = [0.9, 0.1].map(|estimate| backlash(0.01, estimate, 0.1));
        assert_eq!(found(&[absent.clone(), seen], None), (Status::Undecided, None));
        assert_eq!(found(std::slice::from_ref(&absent), Some(2.0)), (Status::Undecided, None));
        assert_eq!(found(&[absent], Some(200.0)), (Status::Absent, Some(0.01)));
    }
}
