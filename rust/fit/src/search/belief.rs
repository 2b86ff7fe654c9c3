//! Selection probability of a cause: how often the cause has the lowest cost of all candidates on bootstrap resamples of the windows.

use crate::model::hypothesis::EffectInstance;
use crate::numeric::random::Random;
use crate::search::acceptance::{
    ABOVE_FLOOR, ALIKE_TRUST, Ground, LOOK_ALIKES, REMAINDER_POWER, RESAMPLES, UNEXPLAINED, restores,
};
use crate::search::attribute::{Candidate, SearchNode};
use crate::search::evidence::Evidence;
use crate::search::rivals::equivalent;

/// An accepted cause with its probability, evidence and look-alikes.
#[derive(Debug, Clone)]
pub struct Cause {
    /// The effect with its values in the final model.
    pub effect: EffectInstance,
    /// Standard deviations of the effect's values, SI.
    pub sigma: Vec<f64>,
    /// Probability that the effect, or one of its look-alikes, is in the arm.
    pub probability: f64,
    /// Share of the holdout's gap above the noise floor that the cause removed when it was added.
    pub share: f64,
    /// RMS rise of the prediction errors on the holdout when the effect is taken out of the final model and nothing is fitted again, relative to the RMS
    /// motion within the windows; during the search, their RMS improvement when the cause was added.
    pub relevance: f64,
    /// Effects that the logs of the diagnosis cannot distinguish from the cause.
    pub look_alikes: Vec<EffectInstance>,
    /// Figures from which the probability of the cause follows.
    pub evidence: Evidence,
    /// Ground on which the cause was accepted: predicted motion or the arm's parameters.
    pub ground: Ground,
}

impl Cause {
    /// The cause, chosen over its rivals with the probability `better`.
    pub(crate) fn chosen_with(self, better: f64) -> Self {
        let evidence = Evidence { selected: better, ..self.evidence };
        Self { probability: better, evidence, ..self }
    }
}

impl<const N: usize, const P: usize> SearchNode<N, P> {
    /// Whether the effects of the candidates with indices `a` and `b` give the same motion under any torques, so that no log distinguishes them.
    fn are_equivalent(&self, a: usize, b: usize) -> bool {
        match (self.candidates[a].effect, self.candidates[b].effect) {
            (Some(a), Some(b)) => equivalent::are(&a, &b, N),
            _ => false,
        }
    }
}

/// The node's candidate of index `choice` as a cause, with its look-alikes and probability.
pub fn name<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    choice: usize,
    ground: Ground,
    seed: u64,
) -> Cause {
    let best = &node.candidates[choice];
    let alike = |c: &Candidate<P>| match ground {
        Ground::Motion => node.is_alike(best, c),
        Ground::Trust => {
            let apart = (c.fit.prior_cost - best.fit.prior_cost) / node.prior_inflation();
            restores(node, c) && apart < ALIKE_TRUST
        }
    };
    let others = (0..node.candidates.len()).filter(|i| *i != choice && node.candidates[*i].effect.is_some());
    let listed: Vec<usize> = others.filter(|i| alike(&node.candidates[*i])).take(LOOK_ALIKES).collect();
    let effect = best.effect.unwrap_or_else(|| unreachable!("only effects are named"));
    let probability = match ground {
        Ground::Motion => probability(node, choice, &listed, seed),
        Ground::Trust => trust_probability(node, choice, &listed),
    };
    let look_alikes = listed.iter().filter_map(|i| node.candidates[*i].effect).collect();
    Cause {
        effect,
        sigma: Vec::new(),
        probability,
        share: node.share(best).clamp(0.0, 1.0),
        relevance: node.relevance(best),
        look_alikes,
        evidence: Evidence { selected: probability, ..Evidence::default() },
        ground,
    }
}

/// Share of bootstrap resamples of the windows on which the lowest cost is that of the candidate `choice`, of one of its look-alikes `listed`, or of
/// an effect that gives the same motion under any torques.
fn probability<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    choice: usize,
    listed: &[usize],
    seed: u64,
) -> f64 {
    let advantages: Vec<Vec<f64>> = node.candidates.iter().map(|c| c.advantages(&node.base)).collect();
    let own: Vec<f64> = node.candidates.iter().map(|c| node.base.fit.prior_cost - c.fit.prior_cost).collect();
    // An effect with more free values that explains the windows no better is no evidence against one with fewer.
    let size = |i: usize| node.candidates[i].effect.as_ref().map_or(0, EffectInstance::len);
    let richer =
        |i: usize| size(i) > size(choice) && node.is_alike(&node.candidates[choice], &node.candidates[i]);
    let ours = |i: usize| i == choice || listed.contains(&i) || node.are_equivalent(i, choice) || richer(i);
    let windows = advantages[choice].len();
    let mut random = Random(seed);
    let mut wins = 0;
    for _ in 0..RESAMPLES {
        let draw: Vec<usize> = (0..windows).map(|_| random.below(windows)).collect();
        let gain = |i: usize| own[i] + draw.iter().map(|&w| advantages[i][w]).sum::<f64>();
        let winner = (0..advantages.len()).max_by(|&a, &b| gain(a).total_cmp(&gain(b)));
        if winner.is_some_and(|w| ours(w) && gain(w) > 0.0) {
            wins += 1;
        }
    }
    (f64::from(wins) + 0.5) / (RESAMPLES as f64 + 1.0)
}

/// Share of bootstrap resamples of the windows on which candidate `one` has a lower cost than candidate `other`.
pub fn probability_over<const P: usize>(one: &Candidate<P>, other: &Candidate<P>, seed: u64) -> f64 {
    let advantages = one.advantages(other);
    let own = other.fit.prior_cost - one.fit.prior_cost;
    let mut random = Random(seed);
    let gain = |random: &mut Random| -> f64 {
        own + (0..advantages.len()).map(|_| advantages[random.below(advantages.len())]).sum::<f64>()
    };
    let wins = (0..RESAMPLES).filter(|_| gain(&mut random) > 0.0).count();
    (wins as f64 + 0.5) / (RESAMPLES as f64 + 1.0)
}

/// Probability of the effect of candidate `choice`, of one of its look-alikes `listed`, or of one that gives the same motion under any torques, among
/// all candidate effects, from the prior costs with each (squared distances of the parameters from their prior values, in sigmas).
fn trust_probability<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    choice: usize,
    listed: &[usize],
) -> f64 {
    let of = |c: &Candidate<P>| c.fit.prior_cost / node.prior_inflation();
    let best = of(&node.candidates[choice]);
    let free = |c: &Candidate<P>| c.effect.as_ref().map_or(0, EffectInstance::len) as f64;
    // Every free value of an effect lowers the prior cost by one squared sigma by chance.
    let mass = |c: &Candidate<P>| (-0.5 * (of(c) + free(c) - best)).exp();
    let (mut ours, mut all) = (0.0, 0.0);
    for (i, candidate) in node.candidates.iter().enumerate() {
        if candidate.effect.is_none() {
            continue;
        }
        all += mass(candidate);
        if i == choice || listed.contains(&i) || node.are_equivalent(i, choice) {
            ours += mass(candidate);
        }
    }
    // The prior cost that remains with the best effect must itself be plausible, or the arm file's values are simply wrong.
    let plausible = (-0.5 * (best - P as f64).max(0.0) / (2.0 * P as f64).sqrt()).exp();
    (ours / all) * plausible
}

/// Share, 0 to 1, of the gap at the first node of a model search that the model of the last node leaves unexplained.
pub fn left_over<const N: usize, const P: usize>(nodes: &[SearchNode<N, P>]) -> f64 {
    unexplained_of(nodes.first(), nodes.last())
}

/// Share, 0 to 1, of the gap remaining at the end of a first model search that remains at the end of a second one.
pub fn left_beside<const N: usize, const P: usize>(
    first: &[SearchNode<N, P>],
    second: &[SearchNode<N, P>],
) -> f64 {
    unexplained_of(first.last(), second.last())
}

/// Share, 0 to 1, of the gap at search node `earlier` that remains at search node `last`; zero where no more than noise remains.
fn unexplained_of<const N: usize, const P: usize>(
    earlier: Option<&SearchNode<N, P>>,
    last: Option<&SearchNode<N, P>>,
) -> f64 {
    let (Some(earlier), Some(last)) = (earlier, last) else { return 0.0 };
    if last.excess() < if last.is_open() { ABOVE_FLOOR } else { UNEXPLAINED } {
        return 0.0;
    }
    left_of(earlier, last)
}

/// Share, 0 to 1, of the gap at search node `earlier` that remains at search node `last`, without regard to noise.
fn left_of<const N: usize, const P: usize>(earlier: &SearchNode<N, P>, last: &SearchNode<N, P>) -> f64 {
    // The squared error may be that of one diverged window; the robust (Student-t) cost is that of all windows. The larger of the two ratios counts
    // where the remaining gap is of consequence, the smaller one elsewhere.
    let as_it_is = (last.relative_error() / earlier.relative_error()).powi(2);
    let cut = last.excess() / earlier.excess();
    let left = if last.is_open() { as_it_is.max(cut) } else { as_it_is.min(cut) };
    left.min(1.0)
}

/// Factor on a probability where the share `left` of the gap remains unexplained: one if nothing remains, `least` if all of the gap does.
pub fn belief_beside(left: f64, least: f64) -> f64 {
    least + (1.0 - least) * (1.0 - left).powi(REMAINDER_POWER)
}
