//! Two causes at once: either leaves so much of the gap to the other that neither is accepted alone.
//!
//! A cause is judged by the part of the gap it removes. Of two of the same size each removes a half of it at most, and if the windows
//! weigh by the worse of the two, much less. So before a search ends beside an open gap, the best candidates are each taken on trust:
//! if another then closes nearly all of the gap, and neither can be spared, both are causes.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::solve::Effort;
use crate::model::hypothesis::EffectInstance;
use crate::search::acceptance::{CERTAIN, Ground, best, brings_back, choose, is_possible, moves};
use crate::search::attribute::{Candidate, SearchNode};
use crate::search::belief::{Cause, name};
use armgap_core::arm::Arm;

/// Part of the gap above the floor that two effects must explain to be accepted together.
const NEARLY_ALL: f64 = 0.85;

/// Part of what a second effect has to explain that it must explain to first order to be looked for.
const FORESEEN: f64 = 0.3;

/// Candidates that are taken on trust.
const TRIED: usize = 3;

/// Mean advantage, in standard errors, below which a candidate is not worth that, unless it brings implausible parameters back to
/// their prior values.
const HOPEFUL: f64 = 1.5;

/// Two causes and the node in which the second was found.
pub struct Both<const N: usize, const P: usize> {
    /// Both, in the order in which they were found.
    pub causes: [Cause; 2],
    /// The node beside the first cause.
    pub node: SearchNode<N, P>,
    /// The second cause in it.
    pub choice: usize,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The two effects that explain together what none explains alone; the first of them is not `but`.
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
            .take(TRIED)
            .find_map(|first| self.beside(alone, first, min_relevance, seed))
    }

    /// The effect that explains the rest beside `first`, if both are needed.
    fn beside(
        &self,
        alone: &SearchNode<N, P>,
        first: &Candidate<P>,
        min_relevance: f64,
        seed: u64,
    ) -> Option<Both<N, P>> {
        let (fit, weights) = self.settle(&first.fit.hypothesis, alone.weights.training.scale);
        // The part of what `first` leaves that a second has to take off it.
        let needed = 1.0 - (1.0 - NEARLY_ALL) / (1.0 - alone.share(first)).max(1e-9);
        if self.largest_gain(&fit, &weights) < FORESEEN * needed {
            return None;
        }
        let node = self.node_around((fit, weights), min_relevance);
        let (choice, ground) = choose(&node, true, min_relevance)?;
        let pair = &node.candidates[choice];
        let none = &alone.settled.hypothesis;
        let base = self.candidate(&node.weights, none, none.effects.len(), Effort::FULL, &[]);
        let whole = SearchNode {
            settled: alone.settled.clone(),
            base,
            candidates: Vec::new(),
            field: Vec::new(),
            screened: Vec::new(),
            weights: node.weights.clone(),
            floor: node.floor,
            motion: node.motion,
        };
        if ground != Ground::Motion || whole.share(pair) < NEARLY_ALL || !moves(&whole, pair, min_relevance) {
            return None;
        }
        let mut without = pair.fit.hypothesis.clone();
        without.effects.remove(none.effects.len());
        let again = self.node(&without, node.weights.training.scale, min_relevance);
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
