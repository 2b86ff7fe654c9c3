//! Comparison of two candidate effects that lower the cost about equally, each under window weights made around it.
//!
//! The robust weights of windows and their fitted initial states follow from the predictions of the best candidate. This favours the best candidate:
//! an initial state that had to be moved far for it gets a larger standard deviation, and can then take up the error that the rival would explain in
//! that window. Two close candidates are therefore compared under weights made around either, and the weights under which the winner leads by more
//! standard errors decide.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::solve::Effort;
use crate::model::hypothesis::Hypothesis;
use crate::search::acceptance::{CLOSE, MATTERS};
use crate::search::attribute::{Candidate, SearchNode};
use crate::search::rivals::equivalent;
use armgap_core::arm::Arm;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The node with its candidates fitted again under window weights made around its best candidate or around the closest rival, whichever make the
    /// winner lead by more standard errors; the node itself if no rival is close.
    pub(crate) fn duel(&self, node: SearchNode<N, P>) -> SearchNode<N, P> {
        let Some((best, rival)) = close_pair(&node) else { return node };
        let current = node.settled.hypothesis.clone();
        let (own, other) =
            rayon::join(|| self.around(&current, &node, best), || self.around(&current, &node, rival));
        if lead(&other) > lead(&own) { other } else { own }
    }

    /// The node with its candidates fitted again under window weights made around the candidate of index `one`.
    fn around(&self, current: &Hypothesis<P>, node: &SearchNode<N, P>, one: usize) -> SearchNode<N, P> {
        let chosen = &node.candidates[one].fit.hypothesis;
        let (_, weights) = self.settle(chosen, node.weights.training.scale);
        let initial_guesses = node.candidates.iter().map(|c| c.fit.hypothesis.clone()).collect();
        let (candidates, base) = rayon::join(
            || self.fit_candidates(&weights, current, initial_guesses, Effort::FULL, None),
            || self.candidate(&weights, current, current.effects.len(), Effort::FULL, None),
        );
        let (settled, field, traces) = (node.settled.clone(), node.field.clone(), node.traces.clone());
        let (floor, motion) = (self.floor(&weights), self.motion(&weights));
        let screened = Vec::new();
        SearchNode { settled, base, candidates, field, screened, traces, weights, floor, motion }
    }
}

/// Indices of a node's best candidate and of the first other one with nearly the same cost whose effect logs of motion can distinguish; none if there
/// is none, or if the best removes too little of the gap to count.
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

/// Mean difference of the windows' costs between a node's second and best candidates, in standard errors of this mean.
fn lead<const N: usize, const P: usize>(node: &SearchNode<N, P>) -> f64 {
    match &node.candidates[..] {
        [best, second, ..] => best.z_over(second),
        _ => 0.0,
    }
}
