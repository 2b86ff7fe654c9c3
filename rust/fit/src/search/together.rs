//! Two causes at once: either leaves so much of the gap to the other that neither is accepted alone.
//!
//! A cause is judged by the share of the gap that it removes. Of two causes of the same size each removes a half of the gap at most, and much less if
//! the other one dominates the windows' costs. So before a search ends with an open gap, each of the best candidates is accepted on trial: if a
//! second effect then closes nearly all of the gap, and neither of the two can be spared, both are causes.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::solve::Effort;
use crate::model::hypothesis::EffectInstance;
use crate::search::acceptance::{CERTAIN, Ground, best, brings_back, choose, is_possible, moves};
use crate::search::attribute::{Candidate, SearchNode};
use crate::search::belief::{Cause, name};
use armgap_core::arm::Arm;

/// Share of the gap above the noise floor that two effects must explain to be accepted together.
const NEARLY_ALL: f64 = 0.85;

/// Decrease of the cost that a score test (first order) must promise for some second effect, relative to the decrease needed from it, for a second
/// effect to be fitted together with a first one that is accepted on trial.
const PROMISED_DECREASE: f64 = 0.3;

/// Number of candidates that are accepted on trial, one after another, as the first of two causes.
const CANDIDATES_ON_TRIAL: usize = 3;

/// Least mean decrease of the windows' cost by a candidate, in standard errors of this mean, for the candidate to be tried as one of two causes,
/// unless it brings implausible parameters back to their prior values.
const HOPEFUL: f64 = 1.5;

/// Two causes that are accepted together, and the search node at which the second was found.
pub struct Both<const N: usize, const P: usize> {
    /// The two causes, in the order in which they were found.
    pub causes: [Cause; 2],
    /// Search node around the model with the first cause, at which the second was found.
    pub node: SearchNode<N, P>,
    /// Index of the second cause among the node's candidates.
    pub choice: usize,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Two effects that together explain the gap of search node `alone`, where none explains it alone, the first of them not being the effect `but`;
    /// none if there is no such pair.
    pub fn together(
        &self,
        alone: &SearchNode<N, P>,
        but: Option<&EffectInstance>,
        min_relevance: f64,
        seed: u64,
    ) -> Option<Both<N, P>> {
        if !alone.is_worth_more(min_relevance) {
            return None;
        }
        let other = |e: &EffectInstance| but.is_none_or(|but| !e.same_place(but));
        let hopeful = |c: &&Candidate<P>| {
            c.effect.as_ref().is_some_and(other)
                && alone.shows(c.effect.as_ref())
                && is_possible(c)
                && (c.z_over(&alone.base) > HOPEFUL || brings_back(alone, c))
        };
        alone
            .candidates
            .iter()
            .filter(hopeful)
            .take(CANDIDATES_ON_TRIAL)
            .find_map(|first| self.beside(alone, first, min_relevance, seed))
    }

    /// Effect `first` and the effect that explains the rest of the gap of search node `alone`, as two causes; none if there is no such effect or if
    /// one of the two can be spared.
    fn beside(
        &self,
        alone: &SearchNode<N, P>,
        first: &Candidate<P>,
        min_relevance: f64,
        seed: u64,
    ) -> Option<Both<N, P>> {
        let (fit, weights) = self.settle(&first.fit.hypothesis, alone.weights.training.scale);
        // Share of the gap left by `first` that a second effect must remove for the two to remove `NEARLY_ALL` of the whole gap.
        let needed = 1.0 - (1.0 - NEARLY_ALL) / (1.0 - alone.share(first)).max(1e-9);
        let known = alone.traces.as_deref();
        let tests = match known {
            Some(known) => self.screened_roughly(&fit, &weights, known),
            None => self.screened(&fit, &weights, None).tests,
        };
        if self.largest_gain(&fit, &weights, &tests) < PROMISED_DECREASE * needed {
            return None;
        }
        let node = self.node_around((fit, weights), min_relevance, known);
        let (choice, ground) = choose(&node, true, min_relevance)?;
        let pair = &node.candidates[choice];
        let none = &alone.settled.hypothesis;
        let base = self.candidate(&node.weights, none, none.effects.len(), Effort::FULL, None);
        let whole = SearchNode {
            settled: alone.settled.clone(),
            base,
            candidates: Vec::new(),
            field: Vec::new(),
            screened: Vec::new(),
            traces: None,
            weights: node.weights.clone(),
            floor: node.floor,
            motion: node.motion,
        };
        if ground != Ground::Motion || whole.share(pair) < NEARLY_ALL || !moves(&whole, pair, min_relevance) {
            return None;
        }
        let mut without = pair.fit.hypothesis.clone();
        without.effects.remove(none.effects.len());
        let known = node.traces.as_deref();
        let again = self.node(&without, node.weights.training.scale, min_relevance, known);
        let (found, needed) = match choose(&again, true, min_relevance) {
            Some((found, Ground::Trust)) => (found, Ground::Trust),
            _ => (best(&again, true)?, Ground::Motion),
        };
        let certain = needed == Ground::Trust || again.candidates[found].z_over(&again.base) > CERTAIN;
        let same = again.candidates[found].effect?.same_place(&first.effect?);
        let causes = [name(&again, found, needed, seed), name(&node, choice, ground, seed)];
        (same && certain).then_some(Both { causes, node, choice })
    }
}
