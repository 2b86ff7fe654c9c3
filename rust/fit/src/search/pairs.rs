//! Two effects that are accepted at once, where neither of them is the best one alone.
//!
//! The first of two effects that an arm lacks is fitted in place of both, and so with a wrong size: the delay of one drive takes up a part of what the
//! delay of the other one causes, and then predicts another motion no better than before. A search that adds one effect at a time stops there, or accepts
//! a third effect that imitates both. So where the best single effect leaves most of the gap, the pairs that are best by their score tests are fitted. One
//! of them is accepted if it meets the acceptance criteria, is certain to need each of its two effects, and predicts better than the best single effect,
//! alone and with the best second one.

use crate::candidates::initial_guess::ABSORBED;
use crate::candidates::pair_test::{PairTest, Projected, best_of_each, bounds, of_size};
use crate::candidates::screen::TestPoint;
use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::jacobian::Sensitivities;
use crate::likelihood::solve::Effort;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::search::acceptance::{Ground, MOST_OF_GAP, certain, is_possible, moves, restores};
use crate::search::attribute::{Candidate, SearchNode};
use crate::search::belief::{name, probability_over};
use crate::search::model_search::ModelSearch;
use crate::search::reconsider::BETTER;
use armgap_core::arm::Arm;
use rayon::prelude::*;

/// Number of pairs of candidates, the best by their score tests, that are fitted.
const PAIRS: usize = 4;

/// Two effects that are accepted at once.
pub(crate) struct Pair<const P: usize> {
    /// The model with the effect alone without which the pair loses most.
    first: Candidate<P>,
    /// The other effect, as fitted beside the first.
    second: EffectInstance,
    /// Probability that the pair explains the windows better than the best model that it was compared with.
    better: f64,
}

/// Two effects and the model with both, fitted.
struct Fitted<const P: usize> {
    effects: [EffectInstance; 2],
    model: Candidate<P>,
}

impl<const P: usize> Fitted<P> {
    /// Whether one of the two effects is `effect`.
    fn contains(&self, effect: &EffectInstance) -> bool {
        self.effects.iter().any(|e| e.same_place(effect))
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The two effects to be accepted in place of the candidate `single` that the current node has accepted; none if that one explains most of the gap or is
    /// no effect, or no pair does better.
    pub(crate) fn better_pair(
        &self,
        search: &ModelSearch<N, P>,
        single: Option<(usize, Ground)>,
        seed: u64,
    ) -> Option<Pair<P>> {
        let node = &search.node;
        if !node.is_open() {
            return None;
        }
        let leaves_most = |c: &Candidate<P>| c.effect.is_some() && node.share(c) <= MOST_OF_GAP;
        let single = match single {
            Some((index, Ground::Motion)) => Some(node.candidates.get(index).filter(|c| leaves_most(c))?),
            Some((_, Ground::Trust)) => return None,
            None => None,
        };
        let alone = single.and_then(|c| c.effect);
        let pairs = self.fitted_pairs(node, alone.as_ref());
        let has_single = |pair: &&Fitted<P>| alone.is_some_and(|effect| pair.contains(&effect));
        let best = lowest(pairs.iter().filter(|pair| is_possible(&pair.model)))?;
        if has_single(&best) || single.is_some_and(|c| c.score() < best.model.score()) {
            return None;
        }
        let fitted = |start: &Hypothesis<P>| {
            self.candidate(&node.weights, start, node.settled.hypothesis.effects.len(), Effort::FULL, None)
        };
        let both = fitted(&best.model.fit.hypothesis);
        let with_single =
            lowest(pairs.iter().filter(has_single)).map(|pair| fitted(&pair.model.fit.hypothesis));
        let rivals = [single, with_single.as_ref(), Some(&node.base)].into_iter().flatten();
        let rival = rivals.min_by(|a, b| a.score().total_cmp(&b.score()))?;
        if both.z_over(rival) < BETTER || !moves(node, &both, search.threshold) {
            return None;
        }
        let each = best.effects.map(|effect| fitted(&node.settled.hypothesis.with(effect)));
        let needed = |i: usize| both.z_over(&each[1 - i]) > certain(Some(&best.effects[i]));
        if !(needed(0) && needed(1) && each.iter().all(is_possible)) {
            return None;
        }
        let [first, second] = if each[1].score() < each[0].score() { [1, 0] } else { [0, 1] };
        let in_both = |e: &&EffectInstance| e.same_place(&best.effects[second]);
        Some(Pair {
            first: each[first].clone(),
            second: *both.fit.hypothesis.effects.iter().find(in_both)?,
            better: probability_over(&both, rival, seed),
        })
    }

    /// Pairs of effects with the largest gains in the score tests around a node's model, fitted roughly.
    fn fitted_pairs(&self, node: &SearchNode<N, P>, alone: Option<&EffectInstance>) -> Vec<Fitted<P>> {
        let known = &node.settled.hypothesis;
        let jacobian = self.problem(&node.weights.training).jacobian(known);
        let fitted = |effects: [EffectInstance; 2]| {
            let start = known.with(effects[0]).with(effects[1]);
            let count = known.effects.len();
            let model = self.candidate(&node.weights, &start, count, Effort::ROUGH, Some(&jacobian));
            Fitted { effects, model }
        };
        self.promising_pairs(node, &jacobian, alone).into_par_iter().map(fitted).collect()
    }

    /// The `PAIRS` pairs of effects with the largest gains in the score tests around a node's model, of which `jacobian` is the Jacobian, no two of them
    /// alike, and the best one with the effect `alone`. Effects with a threshold are left out: their tests are not exact to first order.
    fn promising_pairs(
        &self,
        node: &SearchNode<N, P>,
        jacobian: &Sensitivities<N>,
        alone: Option<&EffectInstance>,
    ) -> Vec<[EffectInstance; 2]> {
        let Some(kept) = &node.traces else { return Vec::new() };
        let problem = self.problem(&node.weights.training);
        let point = TestPoint::new(&problem, &node.settled.hypothesis, jacobian);
        let exact = kept.candidates().iter().filter(|c| bounds(c).is_some());
        let (candidates, traces): (Vec<EffectInstance>, Vec<Vec<f64>>) =
            exact.filter_map(|c| Some((*c, kept.whitened(c, &node.weights.training.scale)?))).unzip();
        let of_each = best_of_each(&point.tests(&candidates, &traces), ABSORBED);
        let candidates: Vec<EffectInstance> = of_each.iter().map(|i| candidates[*i]).collect();
        let traces: Vec<Vec<f64>> = of_each.iter().map(|i| traces[*i].clone()).collect();
        let projected = point.projected(&traces);
        let tests = projected.pair_tests(&candidates.iter().filter_map(bounds).collect::<Vec<_>>());
        let has_alone =
            |t: &&PairTest| alone.is_some_and(|e| t.of.iter().any(|i| candidates[*i].same_place(e)));
        let mut chosen = distinct(&projected, &tests, PAIRS);
        if !chosen.iter().any(has_alone) {
            chosen.extend(tests.iter().find(has_alone));
        }
        chosen.iter().map(|t| [0, 1].map(|k| of_size(&candidates[t.of[k]], t.sizes[k]))).collect()
    }

    /// Accepts a pair: two steps of the search, the second to the other effect of the pair, on the evidence that the two have together.
    pub(crate) fn accept_pair(
        &self,
        search: &mut ModelSearch<N, P>,
        pair: &Pair<P>,
        min_relevance: f64,
        seed: u64,
    ) {
        let choice = search.node.index_of(&pair.first, |_| pair.first.clone());
        search.causes.push(name(&search.node, choice, Ground::Motion, seed).chosen_with(pair.better));
        self.advance(search, &pair.first.fit, min_relevance);
        let known = &search.node.settled.hypothesis;
        let start = known.with(pair.second);
        let second = self.candidate(&search.node.weights, &start, known.effects.len(), Effort::FULL, None);
        if !is_possible(&second) {
            return;
        }
        // Beside the first effect the parameters may take up the second one, as a rotor's inertia, at values that they cannot have.
        let by_trust = !moves(&search.node, &second, search.threshold) && restores(&search.node, &second);
        let ground = if by_trust { Ground::Trust } else { Ground::Motion };
        let choice = search.node.index_of(&second, |_| second.clone());
        search.causes.push(name(&search.node, choice, ground, seed));
        let next = search.node.candidates[choice].fit.clone();
        self.advance(search, &next, min_relevance);
    }
}

/// The pair whose model has the lowest cost.
fn lowest<'a, const P: usize>(pairs: impl Iterator<Item = &'a Fitted<P>>) -> Option<&'a Fitted<P>> {
    pairs.min_by(|a, b| a.model.score().total_cmp(&b.model.score()))
}

/// The first `count` tests of which no two are of candidates with nearly the same traces.
fn distinct<'a>(projected: &Projected, tests: &'a [PairTest], count: usize) -> Vec<&'a PairTest> {
    let mut chosen: Vec<&PairTest> = Vec::new();
    let alike = |one: &PairTest, other: &PairTest| {
        let ([a, b], [c, d]) = (one.of, other.of);
        let same = |x, y| projected.are_alike(x, y);
        (same(a, c) && same(b, d)) || (same(a, d) && same(b, c))
    };
    for test in tests {
        if chosen.len() < count && !chosen.iter().any(|other| alike(test, other)) {
            chosen.push(test);
        }
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// A lag and a delay of one drive have the same trace to first order, so that only one of their pairs with another effect is fitted.
    #[test]
    fn pairs_that_differ_in_look_alikes_are_fitted_once() {
        let [lag, delay, inertia, offset] = [0, 1, 2, 3];
        let normal = DMatrix::from_fn(4, 4, |a, b| match (a, b) {
            _ if a == b => 1.0,
            (0, 1) | (1, 0) => 0.99,
            _ => 0.3,
        });
        let projected = Projected { normal, gradient: DVector::zeros(4) };
        let test = |a: usize, b: usize, gain: f64| PairTest { of: [a, b], gain, sizes: [1.0; 2] };
        let tests = [
            test(lag, inertia, 9.0),
            test(delay, inertia, 8.9),
            test(inertia, offset, 5.0),
            test(delay, offset, 3.0),
            test(lag, offset, 2.9),
        ];
        let of = |count: usize| -> Vec<[usize; 2]> {
            distinct(&projected, &tests, count).iter().map(|test| test.of).collect()
        };
        assert_eq!(of(4), [[lag, inertia], [inertia, offset], [delay, offset]]);
        assert_eq!(of(2), [[lag, inertia], [inertia, offset]]);
    }
}
