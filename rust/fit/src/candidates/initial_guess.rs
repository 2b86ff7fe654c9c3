//! Selection of the candidates that are worth a full fit, and their initial guesses.

use crate::candidates::contact_guess::{contact_guesses, residual_torques};
use crate::candidates::dead_zone_guess::dead_zone_guess;
use crate::candidates::periodogram::periodogram_peaks;
use crate::candidates::screen::{ScoreTest, TestPoint, effect_instances};
use crate::candidates::traces::Traces;
use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::holdout::CONSEQUENTIAL_ERROR;
use crate::likelihood::holdout::is_plausible;
use crate::likelihood::jacobian::Sensitivities;
use crate::likelihood::solve::Fit;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::residual_torque::InverseDynamicsResidual;
use crate::progress::Phase;
use armgap_core::arm::Arm;
use armgap_core::effect::{Trial, dead_zone_with_jump};
use std::sync::Arc;

/// Largest number of candidates that get a full fit at each node of the model search.
const FULL_FITS: usize = 18;

/// Share of a candidate's squared sensitivity that the arm's own parameters cannot imitate, below which only the prior of the parameters can
/// distinguish the candidate from a change of the parameters.
pub(crate) const ABSORBED: f64 = 0.03;

/// Share of a candidate's squared sensitivity that the arm's own parameters cannot imitate, below which derivatives do not determine the candidate's
/// size.
const IMITATED: f64 = 1e-4;

/// Least part of the training cost that a candidate must remove to first order to be fitted.
const TRACE: f64 = 0.01;

/// Least part of the training cost above the noise floor that a candidate must remove to first order to be fitted where the gap is of no consequence:
/// only an effect that explains a large part of such a gap would be named. For effects with a threshold `TRACE` counts there too: at an initial guess far
/// from the arm's play or shaft the test shows little of what the effect removes once fitted.
const TRACE_IN_SMALL: f64 = 0.2;

/// Number of initial guesses of an effect with a threshold on one joint, the best by traces of an earlier node, that are simulated again.
const SIMULATED_AGAIN: usize = 3;

/// Score tests of all candidates around a fit.
pub(crate) struct Screening<const N: usize> {
    /// All candidates at their initial guesses, those not in the model first.
    pub(crate) candidates: Vec<EffectInstance>,
    /// Score test of each candidate.
    pub(crate) tests: Vec<ScoreTest>,
    /// Jacobian of the predictions on the training windows at the fit.
    pub(crate) jacobian: Sensitivities<N>,
    /// Traces of the candidates, if kept.
    pub(crate) traces: Option<Arc<Traces<N>>>,
    /// Whether all candidates were simulated around this fit.
    pub(crate) own_traces: bool,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Hypotheses that are worth a full fit, each the fitted model with one more candidate, from the score tests around it. `size` is the RMS
    /// prediction error relative to the motion, without relevance up to `min_relevance`.
    pub(crate) fn initial_guesses(
        &self,
        fit: &Fit<P>,
        weights: &SplitWeighting<N>,
        screening: &Screening<N>,
        size: f64,
        min_relevance: f64,
    ) -> Vec<Hypothesis<P>> {
        let gap = size > min_relevance;
        let training: f64 = self.problem(&weights.training).window_costs(&fit.hypothesis).iter().sum();
        let least = match size {
            _ if !gap => [f64::INFINITY; 2],
            _ if size < CONSEQUENTIAL_ERROR => {
                [TRACE_IN_SMALL * self.above_floor(training, weights), TRACE * training]
            }
            _ => [TRACE * training; 2],
        };
        let promising = promising(&screening.tests, least);
        let more = promising.iter().map(|found| {
            let effect = found.effect;
            self.payload_guess(&fit.hypothesis, effect)
                .unwrap_or_else(|| self.compensated(&fit.hypothesis, found))
        });
        let mut initial_guesses: Vec<Hypothesis<P>> = more.collect();
        let far = promising.iter().filter_map(|found| found.suggested());
        initial_guesses.extend(far.map(|effect| fit.hypothesis.with(effect)));
        if !is_plausible::<P>(fit.prior_cost) {
            // A contact that carries a part of the load all the time has biased the parameters that were fitted without it.
            let trusted = Hypothesis { theta: self.prior.theta, ..fit.hypothesis.clone() };
            initial_guesses.extend(
                contacts(&screening.candidates, &self.residual_torques(&trusted))
                    .into_iter()
                    .map(|stop| trusted.with(stop)),
            );
        }
        initial_guesses
    }

    /// Part of the training windows' cost `cost` above the expected cost of measurement noise alone.
    fn above_floor(&self, cost: f64, weights: &SplitWeighting<N>) -> f64 {
        let rows = self.training.data.rows as f64 / self.holdout.data.rows as f64;
        (cost - rows * self.floor(weights)).max(1e-9 * cost)
    }

    /// Score tests of all candidates around a fit. Effects with a threshold are ranked by the traces `known` of earlier nodes, and the best of each
    /// effect and joint simulated again.
    pub(crate) fn screened(
        &self,
        fit: &Fit<P>,
        weights: &SplitWeighting<N>,
        known: Option<&Traces<N>>,
    ) -> Screening<N> {
        let candidates = self.candidates_around(fit, weights);
        self.progress.begin(Phase::Screen, candidates.len());
        let problem = self.problem(&weights.training);
        let scale = &weights.training.scale;
        let jacobian = problem.jacobian(&fit.hypothesis);
        let point = TestPoint::new(&problem, &fit.hypothesis, &jacobian);
        let known = known.filter(|known| known.hold_beside(&fit.hypothesis));
        let earlier = |c: &EffectInstance| {
            known.filter(|_| c.law.spec().trial == Trial::Whole).and_then(|known| known.whitened(c, scale))
        };
        let (mut traces, is_earlier) = point.traces_beside(&candidates, earlier);
        let mut tests = point.tests(&candidates, &traces);
        let again = best_of_places(&tests, &is_earlier);
        let best: Vec<EffectInstance> = again.iter().map(|i| candidates[*i]).collect();
        let renewed = point.traces(&best);
        let tested = point.tests(&best, &renewed);
        // Initial guesses that are not simulated again lose to those that are.
        for (test, _) in tests.iter_mut().zip(&is_earlier).filter(|(_, earlier)| **earlier) {
            test.gain = 0.0;
        }
        for ((i, trace), test) in again.into_iter().zip(renewed).zip(tested) {
            (traces[i], tests[i]) = (trace, test);
        }
        let traces = Traces::keep(&fit.hypothesis, &candidates, &traces, scale).map(Arc::new);
        let own_traces = !is_earlier.contains(&true);
        Screening { candidates, tests, jacobian, traces, own_traces }
    }

    /// All candidates that a fit may lack, at their initial guesses, those that do not depend on its residual first.
    fn candidates_around(&self, fit: &Fit<P>, weights: &SplitWeighting<N>) -> Vec<EffectInstance> {
        let mut all = self.open_candidates(&fit.hypothesis);
        all.extend(self.ripple_guesses(&all, weights, fit));
        let rows = self.residual_torques(&fit.hypothesis);
        all.extend(contacts(&all, &rows));
        all.extend(dead_zone_guesses(&all, &rows));
        all
    }

    /// Residual torques of the training logs under `model`.
    fn residual_torques(&self, model: &Hypothesis<P>) -> Vec<InverseDynamicsResidual<N>> {
        residual_torques(&self.training.data.tracks, &self.arm, model, &self.scales.speed)
    }

    /// Candidate effects that are not yet in `model`, at their initial guesses.
    pub fn open_candidates(&self, model: &Hypothesis<P>) -> Vec<EffectInstance> {
        let taken = |c: &EffectInstance| model.effects.iter().any(|e| e.same_place(c));
        let known = effect_instances(&self.scales, &self.sides, model.effects.is_empty()).into_iter();
        known.chain(self.custom_effects.iter().copied()).filter(|c| !taken(c)).collect()
    }

    /// Initial guesses of effects that are periodic in position, from the periodogram of the residual.
    fn ripple_guesses(
        &self,
        all: &[EffectInstance],
        weights: &SplitWeighting<N>,
        fit: &Fit<P>,
    ) -> Vec<EffectInstance> {
        let mut open: Vec<EffectInstance> = all.iter().filter(|c| c.is_periodic()).copied().collect();
        open.dedup_by(|a, b| a.same_place(b));
        let problem = self.problem(&weights.training);
        let initial_guesses = |effect: &EffectInstance| {
            let found = periodogram_peaks(&problem, &fit.hypothesis, effect.joint);
            found
                .into_iter()
                .map(|r| EffectInstance { p: [r.amplitude, r.cycles, r.phase], ..*effect })
                .collect::<Vec<_>>()
        };
        open.iter().flat_map(initial_guesses).collect()
    }

    /// The model with the payload that brings the arm's parameters closest to their prior values at unchanged motion; `None` for effects other
    /// than a payload.
    ///
    /// For a given distance the parameters' shift is linear in the payload's mass, so a line search over the distance suffices.
    fn payload_guess(&self, model: &Hypothesis<P>, effect: EffectInstance) -> Option<Hypothesis<P>> {
        effect.law.payload(&effect.p)?;
        let off: Vec<f64> =
            (0..P).map(|i| (model.theta[i] - self.prior.theta[i]) / self.prior.sigma[i]).collect();
        let attempt = |step: usize| {
            let distance = self.scales.length * 0.02 * step as f64;
            let unit = self.arm.payload(&model.theta, 1.0, distance);
            let shift: Vec<f64> = (0..P).map(|i| unit[i] / self.prior.sigma[i]).collect();
            let along: f64 = shift.iter().map(|s| s * s).sum();
            let mass = (off.iter().zip(&shift).map(|(o, s)| o * s).sum::<f64>() / along).max(0.0);
            let left: f64 = off.iter().zip(&shift).map(|(o, s)| (o - mass * s).powi(2)).sum();
            (left, mass, distance, unit)
        };
        let best = (1..=150).map(attempt).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (_, mass, distance, unit) = best;
        let mut initial_guess = model.with(EffectInstance { p: [mass, distance, 0.0], ..effect });
        for (value, shift) in initial_guess.theta.iter_mut().zip(unit) {
            *value -= mass * shift;
        }
        Some(initial_guess)
    }

    /// The model with one more candidate. Where the arm's parameters can imitate the candidate, they are shifted to compensate it; where the
    /// imitation is exact to rounding, so that motion does not determine the candidate's size, the size is that which brings the parameters closest
    /// to their prior values.
    fn compensated(&self, model: &Hypothesis<P>, found: &ScoreTest) -> Hypothesis<P> {
        if found.distinct >= ABSORBED {
            return model.with(found.effect);
        }
        let (effect, size) =
            if found.distinct < IMITATED { self.trusted(model, found) } else { (found.effect, found.size) };
        let values = model.values();
        let room: Vec<f64> = values.iter().zip(&found.imitation).map(|(value, d)| value + d * size).collect();
        model.with_values(&room).with(effect)
    }

    /// A candidate at the size that brings the arm's parameters, shifted to compensate it, closest to their prior values; and this size, as a
    /// deviation of the tested parameter from its neutral value.
    fn trusted(&self, model: &Hypothesis<P>, found: &ScoreTest) -> (EffectInstance, f64) {
        let parameter = &found.effect.law.spec().parameters[found.tested];
        let (mut along, mut off) = (0.0, 0.0);
        for i in 0..P {
            let shift = found.imitation[i] / self.prior.sigma[i];
            along += shift * shift;
            off += shift * (self.prior.theta[i] - model.theta[i]) / self.prior.sigma[i];
        }
        let mut effect = found.effect;
        let size = if along > 0.0 { off / along } else { 0.0 };
        effect.p[found.tested] = (parameter.neutral + size).clamp(parameter.lower, parameter.upper);
        (effect, effect.p[found.tested] - parameter.neutral)
    }
}

/// Initial guesses of contacts, which act beyond a position, from residual torques.
fn contacts<const N: usize>(
    all: &[EffectInstance],
    rows: &[InverseDynamicsResidual<N>],
) -> Vec<EffectInstance> {
    let mut open: Vec<EffectInstance> = all.iter().filter(|c| c.is_contact()).copied().collect();
    open.sort_by_key(|c| c.joint);
    open.dedup_by(|a, b| a.same_place(b));
    if open.is_empty() {
        return Vec::new();
    }
    let found = contact_guesses(rows);
    let initial_guesses = |effect: &EffectInstance| {
        let effect = *effect;
        found[effect.joint].iter().map(move |stop| EffectInstance { p: *stop, ..effect }).collect::<Vec<_>>()
    };
    open.iter().flat_map(initial_guesses).collect()
}

/// Initial guesses of dead zones whose torque jumps at the level, from residual torques, on the joints that have a dead zone among the candidates `all`.
fn dead_zone_guesses<const N: usize>(
    all: &[EffectInstance],
    rows: &[InverseDynamicsResidual<N>],
) -> Vec<EffectInstance> {
    let law = dead_zone_with_jump();
    let open = |j: &usize| all.iter().any(|c| c.same_place(&EffectInstance::new(law, *j, [0.0; 3])));
    let guess = |j: usize| Some(EffectInstance::new(law, j, [dead_zone_guess(rows, j)?, 1.0, 0.0]));
    (0..N).filter(open).filter_map(guess).collect()
}

/// Indices of the best `SIMULATED_AGAIN` tests of every effect and joint, of those with `of`.
fn best_of_places(tests: &[ScoreTest], of: &[bool]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..tests.len()).filter(|i| of[*i] && tests[*i].gain > 0.0).collect();
    order.sort_by(|a, b| tests[*b].gain.total_cmp(&tests[*a].gain));
    let mut best: Vec<usize> = Vec::new();
    for i in order {
        let beside = best.iter().filter(|k| tests[**k].effect.same_place(&tests[i].effect));
        if beside.count() < SIMULATED_AGAIN {
            best.push(i);
        }
    }
    best
}

/// Best initial guesses of the candidates to be fitted: those with the largest gains in the score test, above `least` or, for an effect with a threshold,
/// `least_with_threshold`, and those that the arm's parameters imitate but for a share of `ABSORBED`, which only the prior of the parameters can distinguish
/// from a change of them.
fn promising(screened: &[ScoreTest], [least, least_with_threshold]: [f64; 2]) -> Vec<&ScoreTest> {
    let mut order: Vec<&ScoreTest> = screened.iter().filter(|s| s.gain > 0.0).collect();
    order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    let mut chosen: Vec<&ScoreTest> = Vec::new();
    for scored in order {
        let has_threshold = scored.effect.law.spec().trial == Trial::Whole;
        let is_promising = scored.gain > if has_threshold { least_with_threshold } else { least };
        let wanted = (chosen.len() < FULL_FITS && is_promising) || scored.distinct < ABSORBED;
        // A score test at a trial value says little about the best initial guess, so two initial guesses are taken; so are two peaks of a
        // periodogram.
        let several = has_threshold || scored.effect.is_periodic();
        let initial_guesses = if several { 2 } else { 1 };
        if wanted && chosen.iter().filter(|c| c.effect.same_law(&scored.effect)).count() < initial_guesses {
            chosen.push(scored);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::{find, find_form};

    fn test_of(joint: usize, gain: f64) -> ScoreTest {
        test_by("joint_elasticity", joint, gain)
    }

    fn test_by(name: &str, joint: usize, gain: f64) -> ScoreTest {
        let law = find::<f64>(name).expect("known");
        ScoreTest::of(EffectInstance::new(law, joint, [0.0; 3]), gain, 0.0)
    }

    #[test]
    fn an_effect_with_a_threshold_is_fitted_for_less_than_one_whose_test_is_exact_to_first_order() {
        let tests = [("backlash", 5.0), ("stribeck", 5.0), ("torque_offset", 15.0), ("contact", 1.5)];
        let tests = tests.map(|(name, gain)| ScoreTest { distinct: 1.0, ..test_by(name, 0, gain) });
        let names = |least: [f64; 2]| -> Vec<&str> {
            promising(&tests, least).iter().map(|test| test.effect.law.spec().name).collect()
        };
        assert_eq!(names([10.0, 2.0]), ["torque_offset", "backlash"]);
        assert_eq!(names([2.0, 2.0]), ["torque_offset", "backlash", "stribeck"]);
        assert!(names([f64::INFINITY; 2]).is_empty());
    }

    #[test]
    fn every_form_of_a_law_is_fitted() {
        let name = "position_dependent_friction";
        let twice = find_form::<f64>(name, "twice_per_turn").expect("known");
        let form = ScoreTest::of(EffectInstance::new(twice, 0, [0.0; 3]), 6.0, 0.0);
        let tests = [test_by(name, 0, 5.0), test_by(name, 0, 4.0), form];
        let tests = tests.map(|test| ScoreTest { distinct: 1.0, ..test });
        let gains: Vec<f64> = promising(&tests, [1.0; 2]).iter().map(|test| test.gain).collect();
        assert_eq!(gains, [6.0, 5.0]);
    }

    #[test]
    fn the_best_initial_guesses_of_every_effect_and_joint_are_simulated_again() {
        let gains = [(0, 1.0), (0, 5.0), (0, 3.0), (0, 4.0), (1, 0.5), (1, 0.0), (0, 9.0)];
        let tests: Vec<ScoreTest> = gains.iter().map(|(joint, gain)| test_of(*joint, *gain)).collect();
        // The last was simulated at this node already; one with no gain has nothing to show.
        let of = [true, true, true, true, true, true, false];
        assert_eq!(best_of_places(&tests, &of), [1, 3, 2, 4]);
    }
}
