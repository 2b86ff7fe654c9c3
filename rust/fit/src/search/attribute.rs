//! One node (step) of the model search: candidate effects are screened by score tests, those that pass are fitted in full, and the holdout decides.

use crate::candidates::screen::ScoreTest;
use crate::candidates::traces::Traces;
use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::holdout::{CONSEQUENTIAL_ERROR, is_plausible};
use crate::likelihood::jacobian::Sensitivities;
use crate::likelihood::solve::{Effort, Fit};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::progress::Phase;
use crate::search::acceptance::{ABOVE_FLOOR, UNEXPLAINED};
use crate::search::rivals::equivalent;
use armgap_core::arm::Arm;
use armgap_core::effect::Trial;
use armgap_core::transmission::Sides;
use rayon::prelude::*;
use std::sync::Arc;

/// Number of further arrangements of encoder and friction (each on the motor's or the link's side of the transmission) with which the best candidate
/// is fitted again if its effect is joint elasticity or backlash.
const OTHER_SIDES: usize = 2;

/// Number of candidates of lowest cost that are fitted again under window weights made from the best candidate's residual.
const FINALISTS: usize = 4;

/// Largest difference between a candidate's prior cost (squared distance of the parameters from the arm file's values, in sigmas) and the lowest one
/// at which the candidate is fitted to the end for its prior cost.
const TRUSTED: f64 = 10.0;

/// Largest number of rounds in which the finalists (candidates of lowest cost) are fitted under window weights made from the best candidate's
/// residual.
const MAX_REWEIGHTINGS: usize = 3;

/// Ratio of the residual's scale (standard deviation) in the window weights to that under the best candidate, up to which the weights are kept.
const SHRUNK: f64 = 1.15;

/// Size of an effect, relative to the largest size that a fit allows, below which the effect has vanished.
const IDLE: f64 = 2e-5;

/// An alternative to the current model, fitted on the training windows and judged on the holdout.
#[derive(Debug, Clone)]
pub struct Candidate<const P: usize> {
    /// The added effect; none for the current model, with or without friction regularisation.
    pub effect: Option<EffectInstance>,
    /// Deviation of the added effect's first parameter from its neutral value, relative to the largest deviation that a fit allows.
    pub size: f64,
    /// Fit of the alternative to the training windows.
    pub fit: Fit<P>,
    /// Student-t (robust) cost of every training window under the fit.
    pub training: Vec<f64>,
    /// Student-t (robust) cost of every holdout window under the fit.
    pub holdout: Vec<f64>,
    /// Sum of squared prediction errors of the holdout windows, in units of the residual's scale, without robust weights and without the worst few
    /// windows.
    pub error: f64,
}

impl<const P: usize> Candidate<P> {
    /// Total cost: Student-t costs of all training and holdout windows plus the prior cost of the parameters.
    pub fn score(&self) -> f64 {
        self.training.iter().chain(&self.holdout).sum::<f64>() + self.fit.prior_cost
    }

    /// Whether the candidate's effect is one with a threshold (`Trial::Whole`) whose fitted size is near zero, so that its other parameters have no
    /// meaning.
    pub fn is_idle(&self) -> bool {
        self.effect.is_some_and(|e| e.law.spec().trial == Trial::Whole) && self.size < IDLE
    }

    /// Whether two candidates add the same effect on the same joint, or both add none.
    pub fn is_same(&self, other: &Self) -> bool {
        match (&self.effect, &other.effect) {
            (Some(a), Some(b)) => a.same_place(b),
            (None, None) => true,
            _ => false,
        }
    }

    /// Cost of every window under candidate `other` minus its cost under this candidate, training windows first.
    pub fn advantages(&self, other: &Self) -> Vec<f64> {
        let here = self.training.iter().chain(&self.holdout);
        other.training.iter().chain(&other.holdout).zip(here).map(|(b, a)| b - a).collect()
    }

    /// Mean decrease of the windows' cost from candidate `other` to this candidate, in units of the mean's standard error, as a normal deviate (`z_score`).
    pub fn z_over(&self, other: &Self) -> f64 {
        z_score(&self.advantages(other))
    }

    /// Mean decrease of the holdout windows' cost from candidate `other` to this candidate, in units of the mean's standard error, as a normal deviate.
    pub fn holdout_z_over(&self, other: &Self) -> f64 {
        z_score(&self.advantages(other)[self.training.len()..])
    }
}

/// Mean of `x` in units of its standard error, as the normal deviate of equal probability. The ratio has Student's t distribution with one degree of
/// freedom less than there are values, whose tails are heavier the fewer these are; its deviate by the approximation of Wallace (1959), Bounds on normal
/// approximations to Student's and the chi-square distributions, Ann. Math. Statist. 30, 1121-1130.
fn z_score(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    let freedom = (n - 1.0).max(1.0);
    let mean = x.iter().sum::<f64>() / n;
    let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / freedom;
    let t = mean / (variance / n).sqrt().max(1e-12);
    let small_sample = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
    (small_sample * (freedom * (t * t / freedom).ln_1p()).sqrt()).copysign(t)
}

/// One node (step) of the model search: the current model and the candidates to extend it, fitted under common window weights.
#[derive(Debug, Clone)]
pub struct SearchNode<const N: usize, const P: usize> {
    /// The current model, fitted under window weights made from its own residual.
    pub settled: Fit<P>,
    /// The current model, fitted under the weights common to all candidates.
    pub base: Candidate<P>,
    /// Alternatives to the current model that were fitted to the end, lowest cost first, but for pairs that no motion distinguishes
    /// ([`SearchNode::with_commoner_first`]).
    pub candidates: Vec<Candidate<P>>,
    /// Every candidate effect that was fitted, lowest cost first, with the share of the gap that it removes under the current model's own window
    /// weights.
    pub field: Vec<(Candidate<P>, f64)>,
    /// Score tests (first-order) of all candidate effects around the model `settled`, those not in the model first; empty if the node's window
    /// weights were changed after the tests, or the tests used traces of an earlier node.
    pub screened: Vec<ScoreTest>,
    /// Traces of the candidates in the score tests, for later nodes.
    pub(crate) traces: Option<Arc<Traces<N>>>,
    /// Weights of the training and holdout windows, common to all candidates.
    pub weights: SplitWeighting<N>,
    /// Cost that measurement noise alone would leave on the holdout, under the node's weights.
    pub floor: f64,
    /// Cost on the holdout of predicting no motion at all within each window.
    pub motion: f64,
}

/// The finalists (best candidates, fitted to the end) and the current model after the last round of re-weighting the windows.
struct FinalRound<const N: usize, const P: usize> {
    base: Candidate<P>,
    candidates: Vec<Candidate<P>>,
    /// Window weights made from the best candidate's residual; none if the window weights were not changed.
    weights: Option<SplitWeighting<N>>,
}

impl<const N: usize, const P: usize> SearchNode<N, P> {
    /// Share of the holdout's cost above the noise floor that a candidate removes.
    pub fn share(&self, candidate: &Candidate<P>) -> f64 {
        let base: f64 = self.base.holdout.iter().sum();
        let here: f64 = candidate.holdout.iter().sum();
        (base - here) / (base - self.floor).max(1e-9 * base)
    }

    /// Index of the alternative that adds the same effect as `candidate`; where there is none, `fitted` makes it under the node's weights.
    pub(crate) fn index_of(
        &mut self,
        candidate: &Candidate<P>,
        fitted: impl FnOnce(&Self) -> Candidate<P>,
    ) -> usize {
        self.candidates.iter().position(|c| c.is_same(candidate)).unwrap_or_else(|| {
            let missing = fitted(self);
            self.candidates.push(missing);
            self.candidates.len() - 1
        })
    }

    /// RMS improvement of the predictions by a candidate on the holdout, relative to the RMS motion within the windows.
    pub fn relevance(&self, candidate: &Candidate<P>) -> f64 {
        ((self.base.error - candidate.error).max(0.0) / self.motion).sqrt()
    }

    /// RMS prediction error of the current model on the holdout, relative to the RMS motion within the windows.
    pub fn relative_error(&self) -> f64 {
        (self.base.error / self.motion).sqrt()
    }

    /// Whether the current model leaves a gap of consequence whose cost exceeds the noise floor by more than the factor `ABOVE_FLOOR`.
    pub fn is_open(&self) -> bool {
        self.relative_error() > CONSEQUENTIAL_ERROR && self.excess() > ABOVE_FLOOR
    }

    /// Whether the current model leaves a gap of consequence whose cost exceeds the noise floor by more than the factor `UNEXPLAINED`.
    pub fn is_unexplained(&self) -> bool {
        self.relative_error() > CONSEQUENTIAL_ERROR && self.excess() > UNEXPLAINED
    }

    /// Ratio of the current model's cost on the holdout to its noise floor.
    pub fn excess(&self) -> f64 {
        self.base.holdout.iter().sum::<f64>() / self.floor
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The search node around the model `current`, settled from the residual scales `scale`, rad or m; candidates are fitted to a gap only if it is
    /// larger than `min_relevance` (RMS, relative to the motion within a window); `known` are traces of candidates at an earlier node.
    pub fn node(
        &self,
        current: &Hypothesis<P>,
        scale: [f64; N],
        min_relevance: f64,
        known: Option<&Traces<N>>,
    ) -> SearchNode<N, P> {
        self.node_around(self.settle(current, scale), min_relevance, known)
    }

    /// The search node around a fit under window weights of its own residual; candidates are fitted to a gap only if it is larger than
    /// `min_relevance` (RMS, relative to the motion within a window). `known` are traces of candidates at an earlier node.
    pub fn node_around(
        &self,
        (fit, weights): (Fit<P>, SplitWeighting<N>),
        min_relevance: f64,
        known: Option<&Traces<N>>,
    ) -> SearchNode<N, P> {
        let size = self.relative_gap(&weights, &fit);
        let gap = size > min_relevance;
        let is_wanted = gap || !is_plausible::<P>(fit.prior_cost);
        let screening = is_wanted.then(|| self.screened(&fit, &weights, known));
        let mut initial_guesses = Vec::new();
        if let Some(screening) = &screening {
            initial_guesses = self.initial_guesses(&fit, &weights, screening, size, min_relevance);
        }
        if let Some(screening) = screening.as_ref().filter(|_| gap) {
            let more = self.regularisation_guesses(&fit.hypothesis, &weights, &screening.jacobian);
            initial_guesses.extend(more);
        }
        let jacobian = screening.as_ref().map(|screening| &screening.jacobian);
        self.progress.begin(Phase::Candidates, initial_guesses.len());
        let first = self.fit_candidates(&weights, &fit.hypothesis, initial_guesses, Effort::ROUGH, jacobian);
        let field = self.field(&weights, &fit, &first);
        self.progress.begin(Phase::Finalists, 2 * FINALISTS + MAX_REWEIGHTINGS);
        let final_round = self.final_round(&fit.hypothesis, first, &weights);
        let traces = screening.as_ref().and_then(|screening| screening.traces.clone());
        let tests = screening.filter(|s| s.own_traces).map_or_else(Vec::new, |screening| screening.tests);
        let screened = if final_round.weights.is_none() { tests } else { Vec::new() };
        let FinalRound { base, candidates, weights: heavier } = final_round;
        let weights = heavier.unwrap_or(weights);
        let floor = self.floor(&weights);
        let motion = self.motion(&weights);
        let settled = fit;
        self.duel(SearchNode { settled, base, candidates, field, screened, traces, weights, floor, motion })
            .with_commoner_first()
    }

    /// Deviation of an effect's first parameter from its neutral value, relative to the largest deviation that a fit allows.
    fn relative_size(&self, effect: &EffectInstance) -> f64 {
        let parameter = &effect.law.spec().parameters[0];
        let centre = self.scales.centre(parameter, effect.joint);
        (effect.p[0] - centre).abs() / self.scales.largest(parameter.quantity, effect.joint)
    }

    /// All fitted candidates that add an effect, each with the share of the gap above the noise floor that it removes under the given window weights.
    fn field(
        &self,
        weights: &SplitWeighting<N>,
        fit: &Fit<P>,
        fitted: &[Candidate<P>],
    ) -> Vec<(Candidate<P>, f64)> {
        let base: f64 = self.judge(&weights.holdout).window_costs(&fit.hypothesis).iter().sum();
        let above = (base - self.floor(weights)).max(1e-9 * base);
        let share = |c: &Candidate<P>| (base - c.holdout.iter().sum::<f64>()) / above;
        fitted.iter().filter(|c| c.effect.is_some()).map(|c| (c.clone(), share(c))).collect()
    }

    /// Candidates fitted from all initial guesses and judged on the holdout, lowest cost first, without those that diverged or whose effect vanished;
    /// `jacobian` is that of the model `base` that the guesses extend, if it is known.
    pub(crate) fn fit_candidates(
        &self,
        weights: &SplitWeighting<N>,
        base: &Hypothesis<P>,
        initial_guesses: Vec<Hypothesis<P>>,
        effort: Effort,
        jacobian: Option<&Sensitivities<N>>,
    ) -> Vec<Candidate<P>> {
        let known = base.effects.len();
        let fitted =
            |initial_guess: Hypothesis<P>| self.candidate(weights, &initial_guess, known, effort, jacobian);
        ranked(initial_guesses.into_par_iter().map(fitted).collect())
    }

    /// Candidate fitted from an initial guess to the training windows and judged on the holdout; the effect under test follows the first `known`
    /// effects of the model.
    pub(crate) fn candidate(
        &self,
        weights: &SplitWeighting<N>,
        initial_guess: &Hypothesis<P>,
        known: usize,
        effort: Effort,
        jacobian: Option<&Sensitivities<N>>,
    ) -> Candidate<P> {
        // Where the effect under test is near its neutral value, the Jacobian of the model without the effect is nearly that of the model with it.
        let near = initial_guess.effects.get(known).is_some_and(|e| e.law.spec().trial != Trial::Whole);
        let jacobian = jacobian.filter(|_| near);
        let fit = self.problem(&weights.training).solve_reusing(initial_guess, effort, jacobian);
        let training = fit.costs.iter().map(|cost| weights.training.student_t_cost(*cost)).collect();
        let (holdout, error) = self.judged_on_holdout(weights, &fit);
        let effect = fit.hypothesis.effects.get(known).copied();
        let size = effect.as_ref().map_or(0.0, |e| self.relative_size(e));
        Candidate { effect, size, fit, training, holdout, error }
    }

    /// Re-weights the windows by the best candidate's residual and fits the finalists and the current model again.
    fn final_round(
        &self,
        current: &Hypothesis<P>,
        mut candidates: Vec<Candidate<P>>,
        given: &SplitWeighting<N>,
    ) -> FinalRound<N, P> {
        let mut hopeless = f64::INFINITY;
        let mut heavier: Option<SplitWeighting<N>> = None;
        for round in 1..=MAX_REWEIGHTINGS {
            let Some(best) = candidates.first() else { break };
            let weights = heavier.as_ref().unwrap_or(given);
            let scale = self.residual_scale(&weights.training, &best.fit.hypothesis);
            let shrunk = (0..N).map(|j| weights.training.scale[j] / scale[j]).fold(0.0, f64::max);
            if shrunk > SHRUNK {
                heavier = Some(self.reweighted(&best.fit.hypothesis, scale, given));
            }
            let weights = heavier.as_ref().unwrap_or(given);
            let last = shrunk <= SHRUNK || round == MAX_REWEIGHTINGS;
            let mut initial_guesses = finalists(&candidates, hopeless);
            if last {
                initial_guesses
                    .extend(candidates.first().into_iter().flat_map(|c| self.other_sides(c, weights)));
            }
            let effort = if last { Effort::FULL } else { Effort::ROUGH };
            let base = || self.candidate(weights, current, current.effects.len(), effort, None);
            let (fitted, base) =
                rayon::join(|| self.fit_candidates(weights, current, initial_guesses, effort, None), base);
            candidates = fitted;
            if last {
                return FinalRound { base, candidates, weights: heavier };
            }
            let base = base.score();
            hopeless = candidates.first().map_or(base, |best| 0.5 * (base + best.score()));
        }
        let weights = heavier.as_ref().unwrap_or(given);
        let base = self.candidate(weights, current, current.effects.len(), Effort::FULL, None);
        FinalRound { base, candidates, weights: heavier }
    }

    /// Alternatives to a candidate whose effect is a transmission (joint elasticity, backlash): the same model with encoder and friction on other
    /// possible sides of the transmission, those of lowest cost on the training windows before they are fitted.
    fn other_sides(&self, candidate: &Candidate<P>, weights: &SplitWeighting<N>) -> Vec<Hypothesis<P>> {
        let Some(effect) = candidate.effect.filter(|effect| effect.law.has_transmission()) else {
            return Vec::new();
        };
        let model = &candidate.fit.hypothesis;
        let Some(index) = model.effects.iter().position(|e| e.same_place(&effect)) else {
            return Vec::new();
        };
        let others: Vec<Sides> = self.sides[effect.joint]
            .iter()
            .copied()
            .filter(|sides| *sides != effect.sides && (!effect.is_backlash() || !sides.rotor_rides))
            .collect();
        let problem = self.problem(&weights.training);
        let with = |sides: Sides| {
            let mut other = model.clone();
            other.effects[index].sides = sides;
            (problem.window_costs(&other).iter().sum::<f64>(), other)
        };
        let mut found: Vec<(f64, Hypothesis<P>)> = others.into_par_iter().map(with).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        found.into_iter().take(OTHER_SIDES).map(|(_, model)| model).collect()
    }
}

/// Candidates in order of cost, lowest first, every effect and joint once, without those that diverged or whose effect vanished.
fn ranked<const P: usize>(mut candidates: Vec<Candidate<P>>) -> Vec<Candidate<P>> {
    candidates.retain(|c| c.score().is_finite() && !c.is_idle());
    candidates.sort_by(|a, b| a.score().total_cmp(&b.score()));
    let mut best: Vec<Candidate<P>> = Vec::new();
    for candidate in candidates {
        if !best.iter().any(|c| c.is_same(&candidate)) {
            best.push(candidate);
        }
    }
    best
}

/// Index of the candidate whose effect no motion distinguishes from that of the first one and is the commoner of the two; none if there is none.
pub(crate) fn commoner_than_first<const P: usize>(
    candidates: &[Candidate<P>],
    joints: usize,
) -> Option<usize> {
    let first = candidates.first()?.effect?;
    let is_commoner =
        |c: &Candidate<P>| c.effect.is_some_and(|effect| equivalent::is_commoner(&effect, &first, joints));
    candidates.iter().position(is_commoner)
}

/// Hypotheses to be fitted to the end: those of the candidates of lowest cost, the first in any case and the others if below the cost `hopeless`, and
/// those of the candidates of lowest prior cost.
fn finalists<const P: usize>(candidates: &[Candidate<P>], hopeless: f64) -> Vec<Hypothesis<P>> {
    let prior = |c: &Candidate<P>| c.fit.prior_cost;
    let least = candidates.iter().map(prior).fold(f64::INFINITY, f64::min);
    let mut by_trust: Vec<usize> = (0..candidates.len()).collect();
    by_trust.sort_by(|a, b| prior(&candidates[*a]).total_cmp(&prior(&candidates[*b])));
    by_trust.truncate(FINALISTS / 2);
    by_trust.retain(|i| prior(&candidates[*i]) < least + TRUSTED);
    let kept = candidates.iter().enumerate();
    kept.filter(|(i, c)| *i == 0 || (*i < FINALISTS && c.score() < hopeless) || by_trust.contains(i))
        .map(|(_, c)| c.fit.hypothesis.clone())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::covariance::ParameterCovariance;
    use armgap_core::effect::find;
    use nalgebra::DMatrix;

    /// Candidate for an effect of the library on the first joint, of a size relative to the largest, with costs of training and holdout windows.
    fn candidate(effect: &str, size: f64, training: &[f64], holdout: &[f64]) -> Candidate<4> {
        let law = find::<f64>(effect).expect("in the catalogue");
        let effect = EffectInstance::new(law, 0, [size, 1.0, 1.0]);
        let covariance =
            ParameterCovariance { matrix: DMatrix::zeros(4, 4), degrees_of_freedom: vec![9.0; 4] };
        let hypothesis = Hypothesis::rigid([1.0; 4]).with(effect);
        let fit = Fit { hypothesis, data_cost: 0.0, prior_cost: 2.0, covariance, costs: Vec::new() };
        let (training, holdout) = (training.to_vec(), holdout.to_vec());
        Candidate { effect: Some(effect), size, fit, training, holdout, error: 1.0 }
    }

    fn names(models: &[Hypothesis<4>]) -> Vec<&'static str> {
        models.iter().map(|model| model.effects[0].law.spec().name).collect()
    }

    #[test]
    fn candidates_are_ranked_by_cost_and_those_that_diverged_or_vanished_are_left_out() {
        let all = [
            candidate("torque_gain", 0.5, &[3.0], &[4.0]),
            candidate("stribeck", 0.5, &[2.0], &[1.0]),
            candidate("torque_gain", 0.4, &[1.0], &[3.0]),
            candidate("torque_offset", 0.5, &[f64::INFINITY], &[1.0]),
            candidate("backlash", 0.5 * IDLE, &[0.0], &[0.0]),
            candidate("quadratic_drag", 0.5 * IDLE, &[4.0], &[4.0]),
        ];
        let found: Vec<(&str, f64)> = ranked(all.to_vec())
            .iter()
            .map(|c| (c.effect.expect("an effect").law.spec().name, c.score()))
            .collect();
        assert_eq!(found, [("stribeck", 5.0), ("torque_gain", 6.0), ("quadratic_drag", 10.0)]);
    }

    #[test]
    fn of_two_effects_that_no_motion_distinguishes_the_commoner_is_found() {
        let of = |name: &str, cost: f64| candidate(name, 0.5, &[cost], &[0.0]);
        let pair = [of("coulomb_asymmetry", 1.0), of("stribeck", 1.5), of("torque_offset", 2.0)];
        assert_eq!(commoner_than_first(&pair, 2), Some(2));
        assert_eq!(commoner_than_first(&[of("torque_offset", 1.0), of("coulomb_asymmetry", 2.0)], 2), None);
        assert_eq!(commoner_than_first(&[of("stribeck", 1.0), of("torque_offset", 2.0)], 2), None);
        assert_eq!(commoner_than_first::<4>(&[], 2), None);
    }

    #[test]
    fn finalists_are_the_best_that_are_not_hopeless_and_those_nearest_to_the_arm_file() {
        let costs = [("stribeck", 1.0), ("torque_gain", 2.0), ("torque_offset", 3.0)];
        let further = [("quadratic_drag", 4.0), ("cubic_drag", 5.0)];
        let mut all: Vec<Candidate<4>> =
            costs.iter().chain(&further).map(|(name, cost)| candidate(name, 0.5, &[*cost], &[0.0])).collect();
        for (candidate, prior) in all.iter_mut().zip([2.0, 2.0, 4.0, 6.0, 8.0]) {
            candidate.fit.prior_cost = prior;
        }
        let first_four = ["stribeck", "torque_gain", "torque_offset", "quadratic_drag"];
        assert_eq!(names(&finalists(&all, f64::INFINITY)), first_four);
        assert_eq!(names(&finalists(&all, 0.0)), first_four[..2], "the two of least prior cost");
        all[1].fit.prior_cost = 2.0 + 1.1 * TRUSTED;
        all[4].fit.prior_cost = 1.0;
        assert_eq!(names(&finalists(&all, 0.0)), ["stribeck", "cubic_drag"]);
        all[0].fit.prior_cost = 1.0 + 1.1 * TRUSTED;
        all[2].fit.prior_cost = all[0].fit.prior_cost;
        assert_eq!(names(&finalists(&all, 3.5)), ["stribeck", "quadratic_drag", "cubic_drag"]);
    }

    #[test]
    fn a_decrease_counts_in_standard_errors_of_its_mean_on_all_windows_or_on_the_holdout() {
        let base = candidate("stribeck", 0.5, &[5.0, 5.0], &[5.0, 7.0]);
        let better = candidate("stribeck", 0.5, &[4.0, 4.0], &[2.0, 6.0]);
        assert_eq!(better.advantages(&base), [1.0, 1.0, 3.0, 1.0]);
        // Mean 1.5, standard error sqrt(1 / 4): t of 3 with 3 degrees of freedom is exceeded with probability 0.02883, a normal deviate of 1.898.
        assert!((better.z_over(&base) - 1.898).abs() < 0.02);
        // On the holdout mean 2, standard error sqrt(2 / 2): t of 2 with 1 degree of freedom, 0.14758 and 1.047.
        assert!((better.holdout_z_over(&base) - 1.047).abs() < 0.02);
        assert_eq!(base.z_over(&better), -better.z_over(&base));
    }

    #[test]
    fn few_windows_have_to_show_more() {
        let of = |n: usize, t: f64| {
            let spread = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
            let error = (1.0 / (n as f64 - 1.0)).sqrt();
            z_score(&(0..n).map(|i| t * error + spread(i)).collect::<Vec<_>>())
        };
        // Student's t of 31 degrees of freedom exceeds 3.375 with the probability with which a normal deviate exceeds 3.090.
        assert!((of(32, 3.375) - 3.090).abs() < 0.01);
        assert!((of(2000, 3.5) - 3.5).abs() < 0.02);
        assert_eq!(of(40, 0.0), 0.0);
    }
}
