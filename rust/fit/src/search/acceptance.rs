//! Acceptance criteria of a cause in the model search.
//!
//! A cause is accepted when it removes a part of the gap that matters, on windows of other motions too, and by more than the windows' own scatter, or
//! when it brings the parameters back to their prior values.

use crate::likelihood::holdout::CONSEQUENTIAL_ERROR;
use crate::likelihood::holdout::is_plausible;
use crate::model::hypothesis::EffectInstance;
use crate::search::attribute::{Candidate, SearchNode};
use armgap_core::effect::Quantity;

/// Mean advantage per window, in standard errors, below which a cause is not accepted.
pub const CERTAIN: f64 = 3.5;

/// Mean advantage per window, in standard errors, below which a nuisance, which is never named, is not accepted.
const CERTAIN_ENOUGH: f64 = 2.5;

/// Mean advantage per holdout window, in standard errors, below which a cause is not accepted: the holdout alone has fewer windows and must only
/// agree.
const HOLDOUT_CERTAIN: f64 = 1.0;

/// Share of the gap above the noise floor below which an improvement does not matter.
pub const MATTERS: f64 = 0.1;

/// Share of a gap of no consequence below which an improvement does not matter: only an effect that explains most of it counts.
const MATTERS_IN_SMALL: f64 = 0.5;

/// Ratio of the cost to its noise floor below which there is nothing left to explain.
pub const ABOVE_FLOOR: f64 = 1.25;

/// Cost of a typical window, relative to what noise alone leaves, up to which a gap is due to a few outlying windows.
const AT_FLOOR: f64 = 1.5;

/// Least decrease of the cost of outlying windows by a candidate that explains them: in standard deviations of a typical window's cost where that is
/// noise, in costs of a typical window elsewhere.
const OUTLYING: f64 = 30.0;

/// Largest increase of the cost of all other windows by a candidate that explains outlying windows, as a part of the decrease of their cost.
const HARMLESS: f64 = 0.05;

/// Decrease of the prior cost, in squared standard deviations, that makes a cause on its own.
pub const TRUST_GAIN: f64 = 16.0;

/// Unexplained gap, relative to the motion, that moves the parameters by about as much as their prior standard deviations: what an unmodelled torque
/// adds to a gap, it also adds to the parameters that are fitted to it.
const MOVES_A_SIGMA: f64 = 0.02;

/// Difference of prior costs, in squared standard deviations, below which two candidates are look-alikes.
pub const ALIKE_TRUST: f64 = 6.0;

/// Ratio of the cost to its noise floor beyond which a gap without a cause is called unexplained.
pub const UNEXPLAINED: f64 = 4.0;

/// Improvement relative to the motion within a window below which an effect is of no consequence.
pub const RELEVANT: f64 = 1e-4;

/// Smallest gap, relative to the motion, that is searched for causes: a gap too small to matter by itself, which is searched if it stands far above
/// the noise floor.
pub const FAINTEST: f64 = 5e-6;
/// Ratio of the cost to its noise floor from which a gap too small to matter by itself is searched for causes.
pub const CLEAR: f64 = 2.75;

/// Share of a gap too small to matter by itself that a cause must explain: no error of the integrator explains as much.
const MATTERS_IF_FAINT: f64 = 0.7;

/// Mean advantage per window, in standard errors, that a cause of a gap too small to matter by itself must have.
const CERTAIN_IF_FAINT: f64 = 5.0;

/// Power of the explained share of the gap in the probability of causes: effects that are in no library were seen to be imitated by two or three that
/// are, for up to eight tenths of the gap.
pub const REMAINDER_POWER: i32 = 6;

/// Improvement relative to the first gap below which an effect is no cause of the gap.
const NOTICEABLE: f64 = 0.02;

/// Part of the largest possible size of an effect above which a fit has found no effect.
const AT_BOUND: f64 = 0.98;

/// Resamples of the windows for the selection probability of a cause.
pub const RESAMPLES: usize = 400;

/// Look-alikes that are listed with a cause at most: what a reader takes in.
pub const LOOK_ALIKES: usize = 3;

/// Part of the best candidate's advantage from which a candidate with fewer parameters is preferred.
pub const ALMOST: f64 = 0.95;

/// Part of the best candidate's advantage from which one with fewer parameters is preferred if even the best leaves most of the gap to other causes.
const ALMOST_IN_DOUBT: f64 = 0.6;

/// Share of the gap above which a candidate explains most of the gap.
const MOST: f64 = 0.5;

/// Part of the winner's advantage within which the cost of a look-alike lies.
const LOOK_ALIKE: f64 = 0.03;

/// Smallest improvement, RMS relative to the motion, for which a cause is named, given the relative error `first_gap` before any cause. What is of
/// consequence by itself is always named.
pub fn min_relevance(first_gap: f64) -> f64 {
    (NOTICEABLE * first_gap).clamp(RELEVANT, CONSEQUENTIAL_ERROR)
}

impl<const N: usize, const P: usize> SearchNode<N, P> {
    /// Whether the data hardly prefer candidate `best` to candidate `other`.
    pub fn is_alike(&self, best: &Candidate<P>, other: &Candidate<P>) -> bool {
        let advantage = self.base.score() - best.score();
        other.score() - best.score() < (LOOK_ALIKE * advantage).max(3.0) || best.z_over(other) < 1.0
    }

    /// Whether a candidate explains windows whose errors stand far out of the noise, in training and holdout, while no other window gets worse.
    ///
    /// An effect that shows in a few windows, such as a joint limit that is hardly touched, never has a mean advantage of many standard errors. The
    /// effect needs none where all other windows are at the noise floor: the noise is known there, and the errors that the effect explains are not
    /// noise.
    fn settles_outliers(&self, candidate: &Candidate<P>) -> bool {
        self.is_typically_noise()
            && self.share(candidate) > MOST
            && self.settles(&candidate.training, &self.base.training)
            && self.settles(&candidate.holdout, &self.base.holdout)
    }

    /// Whether fit `fit` explains windows of the training or of the holdout that stand far out of noise under fit `other`, while no other window gets
    /// worse.
    pub fn takes_outliers(&self, fit: &Candidate<P>, other: &Candidate<P>) -> bool {
        self.settles(&fit.training, &other.training) || self.settles(&fit.holdout, &other.holdout)
    }

    /// Whether a typical window's cost is what noise alone leaves.
    fn is_typically_noise(&self) -> bool {
        self.weights.holdout.typical < AT_FLOOR * self.floor / self.base.holdout.len() as f64
    }

    fn settles(&self, mine: &[f64], base: &[f64]) -> bool {
        settles(mine, base, outlying(self.weights.holdout.typical, self.is_typically_noise()))
    }

    /// Factor by which the gap that is left widens the prior variance of the parameters; 1 where the gap is explained.
    pub fn prior_inflation(&self) -> f64 {
        if self.is_open() { inflation(self.relative_error()) } else { 1.0 }
    }

    /// Whether an effect is accepted as a cause of a gap of this size: an error of the integrator, which resembles a shift in time or a stiff shaft,
    /// may make a small gap.
    pub fn shows(&self, effect: Option<&EffectInstance>) -> bool {
        self.relative_error() > RELEVANT
            || effect.is_some_and(|e| {
                !matches!(e.law.spec().parameters[0].quantity, Quantity::Time | Quantity::ShaftStiffness)
            })
    }
}

/// Whether the window costs `mine` are lower than `base` by more than `least` in some windows and hardly higher in any.
fn settles(mine: &[f64], base: &[f64], least: f64) -> bool {
    let gains = || base.iter().zip(mine).map(|(b, m)| b - m);
    let gain: f64 = gains().filter(|g| *g > 0.0).sum();
    let loss: f64 = gains().filter(|g| *g < 0.0).sum();
    gain > least && -loss < HARMLESS * gain
}

/// Least decrease of the cost of outlying windows beside windows of the cost `typical`. The cost of noise is a sum of squares, whose variance is twice
/// its mean; what a model lacks scatters by as much as it costs.
fn outlying(typical: f64, is_noise: bool) -> f64 {
    OUTLYING * if is_noise { (2.0 * typical).sqrt() } else { typical }
}

/// Ground on which a candidate is accepted as a cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// The candidate moves predictions closer to the measurement.
    Motion,
    /// The candidate brings the parameters back to their prior values.
    Trust,
}

/// Index of the accepted candidate and the ground for it, if any is accepted; friction regularisation is accepted unless `regularised` before.
///
/// Improvements below `min_relevance`, relative to the motion, do not count.
pub fn choose<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    regularised: bool,
    min_relevance: f64,
) -> Option<(usize, Ground)> {
    let by_motion = best(node, regularised).filter(|i| moves(node, &node.candidates[*i], min_relevance));
    if let Some(best) = by_motion {
        return Some((simplest(node, best, regularised, min_relevance), Ground::Motion));
    }
    let free = |i: usize| node.candidates[i].effect.as_ref().map_or(0, EffectInstance::len) as f64;
    let trust = |i: &usize| node.candidates[*i].fit.prior_cost + free(*i);
    (0..node.candidates.len())
        .filter(|i| restores(node, &node.candidates[*i]))
        .min_by(|a, b| trust(a).total_cmp(&trust(b)))
        .map(|index| (index, Ground::Trust))
}

/// The best candidate whose values are possible; a candidate with a value at its bound gives way to one that does almost as well without.
pub fn best<const N: usize, const P: usize>(node: &SearchNode<N, P>, regularised: bool) -> Option<usize> {
    let open = |i: &usize| node.candidates[*i].effect.is_some() || !regularised;
    let first = (0..node.candidates.len()).find(open)?;
    let advantage = |i: usize| node.base.score() - node.candidates[i].score();
    let as_good = |i: &usize| open(i) && advantage(*i) >= ALMOST * advantage(first);
    (first..node.candidates.len()).filter(as_good).find(|i| is_possible(&node.candidates[*i]))
}

/// Whether a candidate's effect is neither idle nor at the largest size.
pub fn is_possible<const P: usize>(candidate: &Candidate<P>) -> bool {
    candidate.size < AT_BOUND && !candidate.is_idle()
}

/// The candidate with the fewest parameters among those that do almost as well as candidate `best`: a spring with a far-off rest position is an
/// offset, and a hysteresis over next to no path is regularised friction.
fn simplest<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    best: usize,
    regularised: bool,
    min_relevance: f64,
) -> usize {
    let almost = if node.share(&node.candidates[best]) > MOST { ALMOST } else { ALMOST_IN_DOUBT };
    let offer = |candidate: &Candidate<P>| Offer {
        advantage: node.base.score() - candidate.score(),
        values: free_values(candidate, regularised),
        moves: moves(node, candidate, min_relevance),
    };
    let offers: Vec<Offer> = node.candidates.iter().map(offer).collect();
    fewest_values(&offers, best, almost)
}

/// Decrease of the cost, number of values and acceptance of one candidate, from which the simplest of several candidates is chosen.
#[derive(Debug, Clone, Copy)]
struct Offer {
    /// Decrease of the cost by the candidate.
    advantage: f64,
    /// Number of the candidate's values beyond the arm's parameters; zero if the candidate is not to be chosen for its simplicity.
    values: usize,
    /// Whether the candidate would be accepted by itself.
    moves: bool,
}

/// Index of the candidate (`offers`) with the fewest values, the first of several, among those that are accepted by themselves and reach more than
/// the part `almost` of the advantage of candidate `best`.
fn fewest_values(offers: &[Offer], best: usize, almost: f64) -> usize {
    let Offer { advantage, values, .. } = offers[best];
    if values == 0 {
        return best;
    }
    let as_good =
        |i: &usize| offers[*i].advantage > almost * advantage && offers[*i].moves && offers[*i].values > 0;
    (0..offers.len()).filter(as_good).min_by_key(|i| (offers[*i].values, *i)).unwrap_or(best)
}

/// Number of a candidate's free values beyond the arm's parameters: those of its effect, or one for the width of friction regularisation while that
/// is open. Zero of a candidate that is not to be chosen for its simplicity.
fn free_values<const P: usize>(candidate: &Candidate<P>, regularised: bool) -> usize {
    let width = usize::from(!regularised && candidate.fit.hypothesis.is_rounded());
    candidate.effect.as_ref().map_or(width, EffectInstance::len)
}

/// Whether a candidate closes a part of the gap that matters, on the holdout too.
pub fn moves<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    candidate: &Candidate<P>,
    min_relevance: f64,
) -> bool {
    let (matters, certain) = match node.relative_error() {
        _ if min_relevance <= FAINTEST => (MATTERS_IF_FAINT, CERTAIN_IF_FAINT),
        error if error > CONSEQUENTIAL_ERROR => (MATTERS, CERTAIN),
        _ => (MATTERS_IN_SMALL, CERTAIN),
    };
    node.excess() > ABOVE_FLOOR
        && node.shows(candidate.effect.as_ref())
        && is_possible(candidate)
        && node.share(candidate) > matters
        && node.relevance(candidate) > min_relevance
        && (is_certain(node, candidate, certain) || node.settles_outliers(candidate))
}

/// Whether a candidate's advantage exceeds the windows' scatter, by `certain` standard errors on all windows, and on the holdout alone too.
fn is_certain<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    candidate: &Candidate<P>,
    certain: f64,
) -> bool {
    candidate.z_over(&node.base) > certain && candidate.holdout_z_over(&node.base) > HOLDOUT_CERTAIN
}

/// Whether friction regularisation, a nuisance that is never named, explains most of the gap.
pub fn is_regularisation<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    candidate: &Candidate<P>,
) -> bool {
    node.share(candidate) > MOST && is_certain(node, candidate, CERTAIN_ENOUGH)
}

/// Whether a candidate is accepted for bringing implausible parameters back to their prior values by one effect.
pub fn restores<const N: usize, const P: usize>(node: &SearchNode<N, P>, candidate: &Candidate<P>) -> bool {
    candidate.effect.is_some() && brings_back(node, candidate)
}

/// Whether a candidate brings implausible parameters back towards their prior values, at no cost.
pub fn brings_back<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    candidate: &Candidate<P>,
) -> bool {
    let [before, after] = [&node.base, candidate].map(|c| c.fit.prior_cost / node.prior_inflation());
    !is_plausible::<P>(before)
        && before - after > TRUST_GAIN
        && after < 0.4 * before
        && candidate.score() < node.base.score()
}

/// Factor by which an unexplained gap `relative_error`, relative to the motion, widens the prior variance of the parameters.
fn inflation(relative_error: f64) -> f64 {
    1.0 + (relative_error / MOVES_A_SIGMA).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(advantage: f64, values: usize) -> Offer {
        Offer { advantage, values, moves: true }
    }

    #[test]
    fn rounded_friction_goes_before_a_hysteresis_that_hardly_does_better() {
        let [hysteresis, rounding] = [offer(100.0, 2), offer(97.0, 1)];
        assert_eq!(fewest_values(&[hysteresis, rounding], 0, ALMOST), 1);
        assert_eq!(fewest_values(&[hysteresis, Offer { values: 0, ..rounding }], 0, ALMOST), 0);
        assert_eq!(fewest_values(&[hysteresis, offer(60.0, 1)], 0, ALMOST), 0);
        assert_eq!(fewest_values(&[hysteresis, Offer { moves: false, ..rounding }], 0, ALMOST), 0);
    }

    #[test]
    fn the_better_of_two_with_as_many_values_stays() {
        assert_eq!(fewest_values(&[offer(100.0, 1), offer(99.0, 1)], 0, ALMOST), 0);
        assert_eq!(fewest_values(&[offer(100.0, 3), offer(99.0, 2), offer(98.0, 2)], 0, ALMOST), 1);
    }

    #[test]
    fn few_windows_far_out_of_the_noise_are_evidence_enough() {
        let (mut base, mut mine) = ([500.0; 40], [499.0; 40]);
        base[7..12].copy_from_slice(&[800.0; 5]);
        mine[30] = 505.0;
        assert!(
            settles(&mine, &base, outlying(500.0, true)),
            "five windows, each ten standard deviations of noise"
        );
        assert!(
            !settles(&mine, &base, outlying(500.0, false)),
            "beside windows that the model misses as well"
        );
        mine[30] = 650.0;
        assert!(!settles(&mine, &base, outlying(500.0, true)), "another window gets worse");
    }

    #[test]
    fn a_large_gap_may_have_moved_the_parameters_by_itself() {
        assert!((inflation(0.001) - 1.0).abs() < 0.01);
        assert_eq!(inflation(MOVES_A_SIGMA), 2.0);
        // A distance of 70 squared standard deviations is evidence beside a gap of 2 % of the motion, and none beside one of 10 %.
        assert!(70.0 / inflation(0.02) > TRUST_GAIN && 70.0 / inflation(0.1) < TRUST_GAIN);
    }
}
