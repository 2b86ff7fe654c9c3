//! Evidence for a cause in the final model, and the probability that the cause is in the arm.
//!
//! A real arm always has effects that the library does not have, so an unexplained remainder of the gap is no evidence against a cause by itself.
//! What counts is how the part of the gap that the cause explains compares with the remainder: an effect that is not in the arm takes up a part of
//! the remainder, and another part under another motion. So the probability follows from three figures: how often the cause is chosen when the
//! windows are drawn again, by how much the holdout's error rises without it, and whether fits to the holdout and to the training logs give it the
//! same size.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::holdout::is_plausible;
use crate::likelihood::solve::{Effort, Fit, neutral};
use crate::model::hypothesis::EffectInstance;
use crate::search::acceptance::{ABOVE_FLOOR, Ground, UNEXPLAINED};
use crate::search::attribute::SearchNode;
use crate::search::belief::{Cause, belief_beside, left_over};
use crate::search::model_search::Attribution;
use crate::search::rivals::rival_law::LawBeside;
use crate::search::size_certainty::size_certainty;
use armgap_core::arm::Arm;
use armgap_core::effect::{Scope, Trial, catalogue};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

/// Standard deviation of the ratio of an effect's sizes fitted to two logs, for an effect that is in the arm: made by other unmodelled effects, in
/// addition to the fits' own standard deviation.
const SAME: f64 = 0.15;

/// Mean and standard deviation of the ratio of an effect's sizes fitted to two logs, for an effect that is not in the arm.
const OTHER: [f64; 2] = [0.7, 0.8];

/// Odds of a cause that removes as much of the gap as remains with it, and whose size the holdout neither confirms nor contradicts. Fitted to causes
/// named on arms of another simulator (docs/decisions/034-probability-of-a-cause.md), whose nominal models mostly omit several effects of the
/// library, and in two of five cases an effect that the library does not have. With half the value the log loss on these arms grows by a fifth; with
/// twice the value it falls by a thirtieth, but of the causes named at 0.75 to 0.9 fewer are right than claimed.
const PRIOR_ODDS: f64 = 2.0;

/// Exponent, in the odds of a cause, of its gain (rise of the holdout's cost without the cause), fitted as `PRIOR_ODDS` is: a gain also varies with
/// the other unmodelled effects of an arm, so it says less than in proportion. At 1 the log loss is larger by a twelfth.
const GAIN_POWER: f64 = 0.5;

/// Exponent, in the odds of a cause, of the ratio of the gap left by an unnamed law (a table over one variable in place of the cause) to the gap left
/// by the cause; fitted as `PRIOR_ODDS` is. At 1 the log loss is larger by a fifth, at 3 by a hundredth.
const RIVAL_POWER: i32 = 4;

/// Evidence for a cause in the final model.
#[derive(Debug, Clone, Copy, Default, JsonSchema, Serialize)]
pub struct Evidence {
    /// Share, 0 to 1, of bootstrap resamples of the windows on which the cause has the lowest cost of all candidates, at the search node where it was
    /// added.
    pub selected: f64,
    /// Rise of the holdout's cost without the cause, everything else fitted again, relative to the cost above the noise floor with the cause; the
    /// training logs' where no more than noise remains on the holdout, and none where this holds of both.
    pub gain: Option<f64>,
    /// The gain beside a torque without a name: the same rise of the cost where the model has, in addition, the table over one or two variables that best
    /// predicts what the causes leave; none where no table predicts. A cause that the table makes superfluous only stood for a part of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_beside: Option<f64>,
    /// Standard error of the gain, from the scatter between the holdout's windows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_sigma: Option<f64>,
    /// Decrease of the holdout's cost by an unnamed law in the cause's place (the table over one or two variables that best predicts the residual
    /// torque without the cause), relative to the cost above the noise floor with the cause; none where no table predicts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rival_gain: Option<f64>,
    /// Size of the effect as fitted to the holdout, relative to its size fitted to the training logs; none for an effect whose first parameter is no
    /// amplitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_ratio: Option<f64>,
    /// Standard deviation of the size ratio.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_ratio_sigma: Option<f64>,
    /// Probability, 0 to 1, that none of twenty effects that are not in the arm would have a size as many standard deviations from none; none for an effect
    /// without such a size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_certainty: Option<f64>,
    /// Squared distance of the arm's parameters from the arm file's values, in standard deviations, without the cause and with it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior_costs: Option<[f64; 2]>,
    /// Odds that the encoder zeros of the recordings have a common mean that is not zero, against a scatter around zero; only for an offset of the
    /// encoder's zero and effects that are equivalent to it, and `None` where all recordings have the same zero.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beyond_scatter: Option<f64>,
}

impl Evidence {
    /// Probability that the effect, or a listed look-alike, is in the arm.
    pub fn probability(&self) -> f64 {
        let beyond = self.beyond_scatter.map_or(1.0, |odds| 1.0 / (1.0 + 1.0 / odds))
            * self.size_certainty.unwrap_or(1.0);
        let Some(gain) = self.gain else { return beyond * self.selected };
        let odds = PRIOR_ODDS
            * self.gain_beside.map_or(gain, |beside| beside.min(gain)).max(0.0).powf(GAIN_POWER)
            * self.agreement()
            * self.left_by_rival().powi(RIVAL_POWER);
        beyond * self.selected * odds / (1.0 + odds)
    }

    /// Takes note that an unnamed law, in the place of the cause and perhaps of others, leaves the part `left` of the gap that the causes leave.
    fn leave_at_most(&mut self, left: f64) {
        if let Some(gain) = self.gain {
            let of_law = 1.0 + gain - left;
            self.rival_gain = Some(self.rival_gain.map_or(of_law, |rival| rival.max(of_law)));
        }
    }

    /// Gap left by an unnamed law (a table over one or two variables) in the cause's place, relative to the gap that the cause leaves: 0 to 1.
    fn left_by_rival(&self) -> f64 {
        let (Some(gain), Some(rival)) = (self.gain, self.rival_gain) else { return 1.0 };
        (1.0 + gain - rival).clamp(0.0, 1.0)
    }

    /// Likelihood ratio, effect in the arm over effect not in the arm, of the ratio of its sizes fitted to the holdout and to the training logs.
    fn agreement(&self) -> f64 {
        let (Some(ratio), Some(sigma)) = (self.size_ratio, self.size_ratio_sigma) else { return 1.0 };
        let density = |mean: f64, scatter: f64| {
            let scatter = scatter.hypot(sigma);
            (-0.5 * ((ratio - mean) / scatter).powi(2)).exp() / scatter
        };
        let likelihood_ratio = density(1.0, SAME) / density(OTHER[0], OTHER[1]);
        if likelihood_ratio.is_finite() { likelihood_ratio } else { 1.0 }
    }
}

/// A model whose causes are weighed.
#[derive(Clone, Copy)]
pub(crate) struct Weighed<'a, const N: usize, const P: usize> {
    /// Last node of the model search, with the weights of windows by which models are judged.
    pub last: &'a SearchNode<N, P>,
    /// The model, fitted to the training logs.
    pub model: &'a Fit<P>,
    /// The model, fitted to the holdout.
    pub on_holdout: &'a Fit<P>,
    /// Fits to the training logs without one of the model's effects each, in the order of the effects; those after the last are unknown.
    pub without: &'a [Fit<P>],
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Computes strength, evidence and probability of all causes that a model search has found.
    ///
    /// The strength of a cause is what the predictions lose without it while everything else keeps its value. What the parameters and the other causes
    /// could take over depends on the windows' length, and with it the order of causes that are about as strong.
    pub(crate) fn weigh(&self, attribution: &mut Attribution<N, P>) {
        let Attribution { model, on_holdout, without, causes, nodes, .. } = attribution;
        let Some(last) = nodes.last() else { return };
        self.weigh_in(&Weighed { last, model, on_holdout, without }, causes);
        // What is left unexplained moves the parameters too, whose return to their prior values is all that speaks for these; but hardly in the direction of
        // an effect with few values.
        let belief = belief_beside(left_over(nodes), 0.0);
        for cause in causes.iter_mut().filter(|cause| cause.ground == Ground::Trust) {
            let chance = cause.evidence.prior_costs.map_or(1.0, |costs| {
                restored_by_chance(costs, self.prior.inertial, cause.effect.len(), catalogue::<f64>().len())
            });
            cause.probability = belief.max(1.0 - chance) * cause.evidence.selected;
        }
    }

    /// Computes strength, evidence and probability of causes in a model that has them.
    pub(crate) fn weigh_in(&self, weighed: &Weighed<'_, N, P>, causes: &mut [Cause]) {
        if causes.is_empty() {
            return;
        }
        let Weighed { last, model, on_holdout, without: reduced } = *weighed;
        let held_out = |fit: &Fit<P>| self.judged_on_holdout(&last.weights, fit).0;
        let in_training = |fit: &Fit<P>| self.problem(&last.weights.training).window_costs(&fit.hypothesis);
        let total = |costs: Vec<f64>| costs.iter().sum::<f64>();
        let rows = self.training.data.rows as f64 / self.holdout.data.rows as f64;
        let on_holdout_rest = above_noise(total(held_out(model)), last.floor, noise_ratio(last));
        // A holdout of hardly any motion leaves nothing of a model's errors: what stays on the training logs counts then.
        let judged_in_training = on_holdout_rest.is_none();
        let rest = on_holdout_rest
            .or_else(|| above_noise(total(in_training(model)), rows * last.floor, UNEXPLAINED));
        let per_window = |fit: &Fit<P>| if judged_in_training { in_training(fit) } else { held_out(fit) };
        let full = total(per_window(model));
        let error = self.holdout_error(&last.weights, &model.hypothesis);
        let has_rivals = rest.is_some() && !judged_in_training;
        let besides = if has_rivals { self.laws_beside(model, &last.weights, true) } else { Vec::new() };
        let best_beside = besides.iter().min_by(|a, b| a.cost.total_cmp(&b.cost));
        causes.par_iter_mut().for_each(|cause| {
            let Some(place) = model.hypothesis.effects.iter().position(|e| e.same_place(&cause.effect))
            else {
                return;
            };
            let mut taken_out = model.hypothesis.clone();
            taken_out.effects.remove(place);
            let rise = self.holdout_error(&last.weights, &taken_out) - error;
            cause.relevance = (rise.max(0.0) / last.motion).sqrt();
            if let Some(rest) = rest {
                let refitted = || self.problem(&last.weights.training).solve(&taken_out, Effort::FULL);
                let without = reduced.get(place).cloned().unwrap_or_else(refitted);
                let rises = differences(&per_window(&without), &per_window(model));
                let bare = full + rises.iter().sum::<f64>();
                cause.evidence.gain = Some((bare - full) / rest);
                cause.evidence.gain_sigma = Some(standard_error_of_sum(&rises) / rest);
                cause.evidence.prior_costs = Some([without.prior_cost, model.prior_cost]);
                if is_plausible::<P>(without.prior_cost) {
                    // The other effects in the model keep the parameters plausible without this cause: only predicted motion can be evidence for it.
                    cause.ground = Ground::Motion;
                }
                let beside_law =
                    |law: &LawBeside| (self.cost_with(&taken_out, &law.law, &last.weights) - law.cost) / rest;
                cause.evidence.gain_beside = best_beside.map(beside_law);
                let effect = &model.hypothesis.effects[place];
                let rival = || self.rival_cost(&taken_out, &[*effect], &besides, &last.weights);
                let rival = has_rivals.then(rival).flatten();
                cause.evidence.rival_gain = rival.map(|rival| (bare - rival) / rest);
            }
            if let Some((ratio, sigma)) = size_ratio(place, model, on_holdout) {
                (cause.evidence.size_ratio, cause.evidence.size_ratio_sigma) = (Some(ratio), Some(sigma));
            }
            let certainties = [model, on_holdout].map(|fit| size_certainty(place, fit));
            cause.evidence.size_certainty = certainties.into_iter().flatten().reduce(f64::max);
            cause.evidence.beyond_scatter = zero_of(&model.hypothesis.effects[place])
                .and_then(|(joint, shared)| last.weights.holdout.zeros.odds_of_shared(joint, shared));
        });
        for set in on_one_joint(causes) {
            let Some(rest) = rest.filter(|_| has_rivals) else { break };
            let mut taken_out = model.hypothesis.clone();
            let is_of_set = |e: &EffectInstance| set.iter().any(|i| causes[*i].effect.same_place(e));
            let (effects, others) = taken_out.effects.iter().copied().partition(is_of_set);
            taken_out.effects = others;
            let effects: Vec<EffectInstance> = effects;
            if let Some(rival) = self.rival_cost(&taken_out, &effects, &besides, &last.weights) {
                let left = (rival - full + rest) / rest;
                for i in set {
                    causes[i].evidence.leave_at_most(left);
                }
            }
        }
        for cause in causes.iter_mut().filter(|cause| cause.ground == Ground::Motion) {
            cause.probability = cause.evidence.probability();
        }
    }
}

/// Chance, 0 to 1, that one of `tried` effects with `values` free values each takes so much of the squared distance of the parameters from their prior values
/// (costs without and with it) if they were moved in any direction: the share of the squared length of a random direction in `parameters` dimensions that
/// is outside of a subspace of `values` dimensions has a beta distribution, and is below `s` with the probability `s^((parameters - values) / 2)`, for two
/// values exactly.
fn restored_by_chance([without, with]: [f64; 2], parameters: usize, values: usize, tried: usize) -> f64 {
    let outside = (with / without).clamp(0.0, 1.0);
    let one = outside.powf(0.5 * parameters.saturating_sub(values) as f64);
    (tried as f64 * one).min(1.0)
}

/// Sets of two and more causes on one joint (by index) in whose place one table may stand: all on the joint, and all but the one with the largest gain.
fn on_one_joint(causes: &[Cause]) -> Vec<Vec<usize>> {
    let acts_on = |i: &usize, joint: usize| {
        let effect = &causes[*i].effect;
        effect.joint == joint && effect.law.spec().scope == Scope::Joint && !effect.law.has_transmission()
    };
    let gain = |i: usize| causes[i].evidence.gain.unwrap_or(0.0);
    let joints = causes.iter().map(|cause| cause.effect.joint + 1).max().unwrap_or(0);
    let mut sets = Vec::new();
    for joint in 0..joints {
        let mut on_joint: Vec<usize> = (0..causes.len()).filter(|i| acts_on(i, joint)).collect();
        on_joint.sort_by(|a, b| gain(*b).total_cmp(&gain(*a)));
        let weaker = on_joint.get(1..).unwrap_or_default().to_vec();
        sets.extend([on_joint, weaker].into_iter().filter(|set| set.len() > 1));
    }
    sets
}

/// Joint (from 0) whose encoder zero an effect shifts, and the shift, rad or m; a tilted base shifts that of the first joint of an arm in a plane.
/// None for other effects.
fn zero_of(effect: &EffectInstance) -> Option<(usize, f64)> {
    let [at_zero, at_one] = [0.0, 1.0].map(|q| effect.law.measured(&effect.p, q));
    let tilt = effect.law.tilt(&effect.p);
    if tilt != 0.0 {
        return Some((0, tilt));
    }
    let shifts = effect.law.spec().hooks.measured && (at_one - at_zero - 1.0).abs() < 1e-12;
    shifts.then_some((effect.joint, at_zero))
}

/// Differences in the cost of every window between a model of higher and one of lower cost.
fn differences(higher: &[f64], lower: &[f64]) -> Vec<f64> {
    higher.iter().zip(lower).map(|(higher, lower)| higher - lower).collect()
}

/// Standard error of a sum, from the scatter of its terms.
fn standard_error_of_sum(terms: &[f64]) -> f64 {
    let n = terms.len() as f64;
    let mean = terms.iter().sum::<f64>() / n;
    (n / (n - 1.0).max(1.0) * terms.iter().map(|x| (x - mean).powi(2)).sum::<f64>()).sqrt()
}

/// Ratio of the holdout's cost to its noise floor, at the last node of a model search, up to which noise may have left it.
fn noise_ratio<const N: usize, const P: usize>(last: &SearchNode<N, P>) -> f64 {
    if last.is_open() { ABOVE_FLOOR } else { UNEXPLAINED }
}

/// Cost above the noise floor; none where the cost is at most `ratio` times the floor, as noise may leave it.
fn above_noise(cost: f64, floor: f64, ratio: f64) -> Option<f64> {
    (cost > ratio * floor).then_some(cost - floor).filter(|rest| *rest > 0.0)
}

/// Size of the effect with index `place` in fit `other`, projected on its amplitudes in fit `of` and relative to them, and the ratio's standard
/// deviation; none for an effect whose first parameter is no amplitude.
fn size_ratio<const P: usize>(place: usize, of: &Fit<P>, other: &Fit<P>) -> Option<(f64, f64)> {
    let effects = &of.hypothesis.effects;
    let (one, two) = (&effects[place], &other.hypothesis.effects[place]);
    if matches!(one.law.spec().trial, Trial::Whole | Trial::Disturbance) {
        return None;
    }
    let first = P + effects[..place].iter().map(EffectInstance::len).sum::<usize>();
    let off = neutral(one);
    let (mut along, mut square, mut variance) = (0.0, 0.0, 0.0);
    for i in 0..one.amplitudes() {
        let (a, b) = (one.p[i] - off.p[i], two.p[i] - off.p[i]);
        along += a * b;
        square += a * a;
        variance += a * a * (of.sigma(first + i).powi(2) + other.sigma(first + i).powi(2));
    }
    let (ratio, sigma) = (along / square, variance.sqrt() / square);
    (ratio.is_finite() && sigma.is_finite()).then_some((ratio, sigma))
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    fn evidence(gain: f64, ratio: Option<f64>) -> Evidence {
        Evidence {
            selected: 1.0,
            gain: Some(gain),
            gain_beside: None,
            gain_sigma: None,
            rival_gain: None,
            size_ratio: ratio,
            size_ratio_sigma: ratio.map(|_| 0.05),
            size_certainty: None,
            prior_costs: None,
            beyond_scatter: None,
        }
    }

    #[test]
    fn a_cause_without_a_rest_beside_it_is_as_sure_as_its_choice() {
        let choice = Evidence { selected: 0.97, gain: None, ..evidence(0.0, Some(-3.0)) };
        assert_eq!(choice.probability(), 0.97);
    }

    #[test]
    fn parameters_seldom_return_by_chance() {
        let chance = |with: f64, values: usize| restored_by_chance([300.0, with], 5, values, 30);
        // A 3-dimensional normal vector beside 2 dimensions: 0.01^1.5 for one effect.
        assert!((chance(3.0, 2) - 0.03).abs() < 1e-12);
        assert!(chance(3.0, 1) < chance(3.0, 2));
        assert_eq!(chance(100.0, 2), 1.0, "a third of the distance that is left says nothing");
        assert_eq!(
            restored_by_chance([300.0, 3.0], 2, 2, 30),
            1.0,
            "two values restore two parameters always"
        );
    }

    #[test]
    fn what_noise_may_leave_is_no_rest() {
        assert_eq!(above_noise(3.0, 1.0, UNEXPLAINED), None);
        assert_eq!(above_noise(5.0, 1.0, UNEXPLAINED), Some(4.0));
        assert_eq!(above_noise(0.5, 1.0, 0.0), None);
    }

    #[test]
    fn the_more_a_cause_takes_off_beside_what_stays_the_likelier_it_is() {
        let probability = |gain: f64| evidence(gain, None).probability();
        assert!((probability(1.0) - PRIOR_ODDS / (1.0 + PRIOR_ODDS)).abs() < 1e-12);
        let odds = |p: f64| p / (1.0 - p);
        assert!((odds(probability(9.0)) / odds(probability(1.0)) - 9.0_f64.powf(GAIN_POWER)).abs() < 1e-9);
        assert!(probability(9.0) > 0.8 && probability(0.1) < 0.4);
        assert_eq!(probability(-1.0), 0.0);
    }

    #[test]
    fn a_law_without_a_name_takes_odds_from_a_cause_only_where_it_explains_more() {
        let beside = |rival: f64| Evidence { rival_gain: Some(rival), ..evidence(1.0, None) }.probability();
        let alone = evidence(1.0, None).probability();
        assert_eq!((beside(-0.3), beside(0.5), beside(1.0)), (alone, alone, alone));
        let odds = PRIOR_ODDS * 0.5_f64.powi(RIVAL_POWER);
        assert!((beside(1.5) - odds / (1.0 + odds)).abs() < 1e-12);
        assert_eq!(beside(2.5), 0.0);
    }

    #[test]
    fn one_law_may_stand_in_the_place_of_several_causes() {
        let cause = |name: &str, joint: usize, gain: f64| {
            let effect = EffectInstance::new(find::<f64>(name).unwrap(), joint, [0.1, 0.1, 0.0]);
            Cause {
                effect,
                sigma: Vec::new(),
                probability: 1.0,
                share: 0.5,
                relevance: 0.1,
                look_alikes: Vec::new(),
                evidence: evidence(gain, None),
                ground: Ground::Motion,
            }
        };
        let friction = ["quadratic_drag", "friction_warmup", "cubic_drag"];
        let three: Vec<Cause> =
            friction.iter().zip([0.5, 4.0, 0.7]).map(|(name, gain)| cause(name, 0, gain)).collect();
        assert_eq!(on_one_joint(&three), [vec![1, 2, 0], vec![2, 0]]);
        assert_eq!(on_one_joint(&three[..2]), [vec![1, 0]]);
        assert!(on_one_joint(&[cause("stribeck", 0, 1.0), cause("stribeck", 1, 1.0)]).is_empty());
        assert!(on_one_joint(&[cause("stribeck", 0, 1.0), cause("base_tilt", 0, 1.0)]).is_empty());
        let mut weighed = three[0].evidence;
        weighed.leave_at_most(0.5);
        assert!((weighed.left_by_rival() - 0.5).abs() < 1e-12);
        weighed.leave_at_most(0.9);
        assert!((weighed.left_by_rival() - 0.5).abs() < 1e-12, "the better law counts");
    }

    #[test]
    fn a_cause_that_a_law_makes_superfluous_is_improbable() {
        let beside = |gain: f64| Evidence { gain_beside: Some(gain), ..evidence(2.0, None) }.probability();
        let alone = evidence(2.0, None).probability();
        assert_eq!(beside(3.0), alone, "a larger gain beside the law is no better evidence");
        assert!(beside(0.5) < alone && beside(0.01) < 0.3 * alone);
        assert_eq!(beside(-0.1), 0.0);
    }

    #[test]
    fn a_zero_that_scatters_is_no_offset() {
        let with = |odds: f64| Evidence { beyond_scatter: Some(odds), ..evidence(1.0, None) }.probability();
        let alone = evidence(1.0, None).probability();
        assert!((with(1.0) - 0.5 * alone).abs() < 1e-12 && with(0.1) < 0.1 && with(1e9) > 0.999 * alone);
        let effect = |name: &str, p| EffectInstance::new(find::<f64>(name).unwrap(), 1, p);
        assert_eq!(zero_of(&effect("encoder_offset", [0.02, 0.0, 0.0])), Some((1, 0.02)));
        assert_eq!(zero_of(&effect("base_tilt", [0.02, 0.0, 0.0])), Some((0, 0.02)));
        assert_eq!(zero_of(&effect("torque_offset", [0.02, 0.0, 0.0])), None);
        assert_eq!(zero_of(&effect("encoder_eccentricity", [0.02, 0.3, 0.0])), None);
    }

    #[test]
    fn a_sum_is_as_uncertain_as_its_terms_scatter() {
        assert_eq!(standard_error_of_sum(&[2.0; 5]), 0.0);
        // Four terms with a sample variance of 4/3 each.
        assert!(
            (standard_error_of_sum(&[1.0, -1.0, 1.0, -1.0]) - (4.0 * 4.0 / 3.0_f64).sqrt()).abs() < 1e-12
        );
        assert_eq!(differences(&[3.0, 1.0], &[1.0, 4.0]), [2.0, -3.0]);
    }

    #[test]
    fn sizes_that_agree_speak_for_a_cause_and_others_against_it() {
        let [same, near, far, turned] =
            [1.0, 0.85, 1.8, -0.5].map(|ratio| evidence(1.0, Some(ratio)).probability());
        let silent = evidence(1.0, None).probability();
        assert!(same > near && near > silent && silent > far && far > turned);
    }

    #[test]
    fn a_size_that_is_hardly_known_says_little() {
        let known = evidence(1.0, Some(1.6));
        let unknown = Evidence { size_ratio_sigma: Some(2.0), ..known };
        let silent = evidence(1.0, None).probability();
        assert!((unknown.probability() - silent).abs() < 0.1 && known.probability() < 0.5 * silent);
    }

    #[test]
    fn a_size_that_is_not_told_from_none_is_hardly_evidence() {
        let sure = evidence(5.0, Some(1.0));
        let unsure = Evidence { size_certainty: Some(0.2), ..sure };
        assert!((unsure.probability() - 0.2 * sure.probability()).abs() < 1e-12);
    }
}
