//! Comparison of two effects that explain about the same, each under window weights made around it.
//!
//! Windows are weighed, and their initial states fitted, around the best candidate. This favours the best candidate: an initial state that had to be
//! moved far for it is known less well from then on, and can take up the error that the rival would explain in that window. Of two candidates that
//! are close, each is therefore judged under weights made around either, and the weights under which the winner leads more clearly decide.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::solve::Effort;
use crate::model::hypothesis::Hypothesis;
use crate::search::acceptance::MATTERS;
use crate::search::attribute::{Candidate, SearchNode};
use crate::search::rivals::equivalent;
use armgap_core::arm::Arm;

/// Standard errors of the mean advantage per window within which the best candidate leads a close rival.
const CLOSE: f64 = 3.0;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The node under window weights made around its best candidate or around the closest rival, whichever make the winner lead more clearly.
    pub(crate) fn duel(&self, node: SearchNode<N, P>) -> SearchNode<N, P> {
        let Some((best, rival)) = close_pair(&node) else { return node };
        let current = node.settled.hypothesis.clone();
        let own = self.around(&current, &node, best);
        let other = self.around(&current, &node, rival);
        if lead(&other) > lead(&own) { other } else { own }
    }

    /// The node with its finalists fitted under window weights made around candidate `one`.
    fn around(&self, current: &Hypothesis<P>, node: &SearchNode<N, P>, one: usize) -> SearchNode<N, P> {
        let chosen = &node.candidates[one].fit.hypothesis;
        let (_, weights) = self.settle(chosen, node.weights.training.scale);
        let initial_guesses = node.candidates.iter().map(|c| c.fit.hypothesis.clone()).collect();
        let candidates = self.fit_candidates(&weights, current, initial_guesses, Effort::FULL, &[]);
        let base = self.candidate(&weights, current, current.effects.len(), Effort::FULL, &[]);
        let (settled, field) = (node.settled.clone(), node.field.clone());
        let (floor, motion) = (self.floor(&weights), self.motion(&weights));
        SearchNode { settled, base, candidates, field, screened: Vec::new(), weights, floor, motion }
    }
}

/// Indices of the best candidate and of the first one close to it, if motion can tell their effects apart.
fn close_pair<const N: usize, const P: usize>(node: &SearchNode<N, P>) -> Option<(usize, usize)> {
    let (best, others) = node.candidates.split_first()?;
    if node.share(best) < MATTERS {
        return None;
    }
    let rival = others.iter().position(|c| is_close(node, best, c))?;
    Some((0, rival + 1))
}

fn is_close<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    best: &Candidate<P>,
    other: &Candidate<P>,
) -> bool {
    let (Some(a), Some(b)) = (best.effect, other.effect) else { return false };
    let alike = node.is_alike(best, other) || best.z_over(other) < CLOSE;
    alike && other.z_over(&node.base) > CLOSE && !equivalent::are(&a, &b, N)
}

/// Lead of a node's best candidate over the second, in standard errors of the mean advantage per window.
fn lead<const N: usize, const P: usize>(node: &SearchNode<N, P>) -> f64 {
    match &node.candidates[..] {
        [best, second, ..] => best.z_over(second),
        _ => 0.0,
    }
}
