//! Acceptance criteria of a cause in the model search.
//!
//! A candidate effect is accepted as a cause if predictions improve with it, on the holdout too, by more than the scatter between windows, or if fitted
//! parameters that were implausible return to their prior values with it.

use crate::likelihood::holdout::CONSEQUENTIAL_ERROR;
use crate::likelihood::holdout::is_plausible;
use crate::model::hypothesis::EffectInstance;
use crate::search::attribute::{Candidate, SearchNode, commoner_than_first};
use armgap_core::effect::{MAX_PARAMETERS, Quantity};

/// Least mean decrease of the windows' cost by an effect of three values, the most that effects have, in standard errors of this mean, for the effect to be
/// accepted as a cause; of any effect where the gap is of no consequence.
pub const CERTAIN: f64 = 3.5;

/// Decrease of `CERTAIN` with each value that an effect has less than three: with each value an effect has more forms, the best of which fits some part of
/// what no effect explains. At 0 the rotor inertia of a real arm is accepted from 13 of 24 choices of its logs, else from 17; from 24 further choices it is
/// from 10 either way. With 2.5 for all effects a ripple and a contact stand for a torque that depends on two positions together.
const CERTAIN_PER_VALUE: f64 = 0.5;

/// Least mean decrease of the holdout windows' cost by a candidate, in standard errors of this mean, for the candidate to be accepted: the holdout
/// alone has fewer windows than all logs and must only agree with them.
const HOLDOUT_CERTAIN: f64 = 1.0;

/// Share of the gap above the noise floor that a candidate must remove to be compared closely with others, and a table of torque to be listed.
pub const MATTERS: f64 = 0.1;

/// Share of a gap of consequence above the noise floor that a cause must remove. Where several effects are missing, the first that is added may remove
/// little before the others are known: at 0.1 a real arm's rotor inertia is refused at seven standard errors. At 0 a ripple of a twentieth of that arm's
/// gap is named at one of five horizons; 72 simulated arms keep all their names at 0 and 0.05.
const LEAST_SHARE: f64 = 0.05;

/// Share of the gap above the noise floor that a candidate must remove where the gap is of no consequence (RMS error relative to the motion below
/// `CONSEQUENTIAL_ERROR`): only an effect that explains a large part of such a gap counts. At 0.5 three narrow plays are missed that have 0.58, 1.00
/// and 1.00 at 0.3; 69 other arms of the same simulator keep their names.
const MATTERS_IN_SMALL: f64 = 0.3;

/// Ratio of the holdout's cost to its noise floor (the cost that measurement noise alone leaves) up to which no gap is left to explain.
pub const ABOVE_FLOOR: f64 = 1.25;

/// Largest ratio of the holdout's cost to the cost that noise alone leaves at which a model leaves no more than noise; of a typical holdout window's
/// cost, at which only a few outlying windows make up the gap.
const AT_FLOOR: f64 = 1.5;

/// Mean difference of the windows' costs between the best candidate and another one, in standard errors of this mean, below which the other one is a
/// close rival.
pub const CLOSE: f64 = 3.0;

/// Least decrease of the cost, summed over the windows that a candidate improves, for the candidate to explain outlying windows: in standard
/// deviations of a typical window's cost where that cost is noise, in typical windows' costs elsewhere.
const OUTLYING: f64 = 30.0;

/// Largest increase of the cost of all other windows by a candidate that explains outlying windows, relative to the decrease of the outlying windows'
/// cost.
const HARMLESS: f64 = 0.05;

/// Decrease of the prior cost (squared distance of the parameters from the arm file's values, in standard deviations) by an effect beyond which the
/// effect is a cause for this alone.
pub const TRUST_GAIN: f64 = 16.0;

/// RMS prediction error, relative to the motion within a window, at which unmodelled torques bias the fitted parameters by about one prior standard
/// deviation: the parameters are fitted to the same errors that make up the gap.
const MOVES_A_SIGMA: f64 = 0.02;

/// Difference of the prior costs of two candidates (squared distances of the parameters from their prior values, in standard deviations) below which
/// the candidates are look-alikes.
pub const ALIKE_TRUST: f64 = 6.0;

/// Ratio of the holdout's cost to its noise floor (the cost that measurement noise alone leaves) beyond which a gap without a cause is called
/// unexplained.
pub const UNEXPLAINED: f64 = 4.0;

/// RMS improvement of the predictions by an effect, relative to the motion within a window, below which the effect is of no consequence.
pub const RELEVANT: f64 = 1e-4;

/// Smallest RMS prediction error, relative to the motion within a window, that is searched for causes: so small a gap does not matter by itself and
/// is searched only if it stands far above the noise floor.
pub const FAINTEST: f64 = 5e-6;
/// Ratio of the holdout's cost to its noise floor (the cost that measurement noise alone leaves) from which a gap too small to matter by itself is
/// searched for causes.
pub const CLEAR: f64 = 2.75;

/// Share of the gap above the noise floor that a cause must remove where the gap is too small to matter by itself: no error of the numerical
/// integrator explains as much.
const MATTERS_IF_FAINT: f64 = 0.7;

/// Least mean decrease of the windows' cost by a candidate, in standard errors of this mean, for it to be the cause of a gap too small to matter by
/// itself.
const CERTAIN_IF_FAINT: f64 = 5.0;

/// Exponent of the explained share of the gap in a factor on probabilities: an effect that the library does not have was seen to be imitated by two
/// or three of its effects, for up to eight tenths of the gap.
pub const REMAINDER_POWER: i32 = 6;

/// RMS improvement of the predictions by an effect, relative to the RMS prediction error before any cause was added, below which the effect is no
/// cause of the gap.
const NOTICEABLE: f64 = 0.02;

/// Size of a fitted effect, relative to the largest size that a fit allows, from which the fit has run to its bound and has found no effect.
const AT_BOUND: f64 = 0.98;

/// Number of bootstrap resamples of the windows from which the selection probability of a cause is estimated.
pub const RESAMPLES: usize = 400;

/// Largest number of look-alikes (effects that the logs cannot distinguish from a cause) that are listed with a cause: as many as a reader takes in.
pub const LOOK_ALIKES: usize = 3;

/// Decrease of the cost by a candidate, relative to the decrease by the best one, from which both do almost as well and the one with fewer parameters
/// is preferred.
pub const ALMOST: f64 = 0.95;

/// Decrease of the cost by a candidate with fewer parameters, relative to the decrease by the best one, from which the simpler candidate is preferred
/// if even the best one leaves most of the gap to other causes.
const ALMOST_IN_DOUBT: f64 = 0.6;

/// Share of the gap above the noise floor that a candidate must remove to explain most of the gap.
pub const MOST_OF_GAP: f64 = 0.5;

/// Difference between the costs of the best candidate and another one, relative to the decrease of the cost by the best one, below which the two are
/// look-alikes, which the logs cannot distinguish, unless the best one leaves noise alone and the other significantly more.
const LOOK_ALIKE: f64 = 0.03;

/// Smallest RMS improvement of the predictions, relative to the motion within a window, for which an effect is named as a cause, given the RMS error
/// `first_gap`, relative to the same motion, before any cause. An improvement of consequence by itself (`CONSEQUENTIAL_ERROR`) always suffices.
pub fn min_relevance(first_gap: f64) -> f64 {
    (NOTICEABLE * first_gap).clamp(RELEVANT, CONSEQUENTIAL_ERROR)
}

impl<const N: usize, const P: usize> SearchNode<N, P> {
    /// Whether candidates `best` and `other` are look-alikes: the cost of `other` is higher by only a small part of the decrease that `best` brings,
    /// or by less than one standard error over the windows.
    pub fn is_alike(&self, best: &Candidate<P>, other: &Candidate<P>) -> bool {
        (self.costs_as_much(best, other) && !self.excludes(best, other)) || best.z_over(other) < 1.0
    }

    /// Whether the cost of candidate `other` is higher than that of candidate `best` by only a small part of the decrease that `best` brings.
    fn costs_as_much(&self, best: &Candidate<P>, other: &Candidate<P>) -> bool {
        let advantage = self.base.score() - best.score();
        other.score() - best.score() < (LOOK_ALIKE * advantage).max(3.0)
    }

    /// The node with an effect in first place that no motion distinguishes from its best candidate's and that is the commoner one, if it was fitted as
    /// well: which of the two costs less is a matter of rounding, and would change with the horizon.
    pub(crate) fn with_commoner_first(mut self) -> Self {
        let place = commoner_than_first(&self.candidates, N);
        if let Some(place) = place.filter(|i| self.costs_as_much(&self.candidates[0], &self.candidates[*i])) {
            self.candidates[..=place].rotate_right(1);
        }
        self
    }

    /// Whether candidate `best` shows that candidate `other` is not the cause: it leaves no more than noise, and `other` significantly more, on the mean of
    /// all windows or far out of the noise in some.
    pub fn excludes(&self, best: &Candidate<P>, other: &Candidate<P>) -> bool {
        let left = best.holdout.iter().sum();
        excludes(left, self.floor, best.z_over(other), self.takes_outliers(best, other))
    }

    /// Whether a candidate explains windows whose errors stand far out of the noise, in the training logs and in the holdout, while no other window
    /// gets worse.
    ///
    /// An effect that acts in a few windows only, such as a joint limit that is hardly touched, never lowers the mean cost by many standard errors.
    /// This is not required where all other windows are at the noise floor: the noise is known there, and the errors that the effect explains are not
    /// noise.
    fn settles_outliers(&self, candidate: &Candidate<P>) -> bool {
        self.is_typically_noise()
            && self.share(candidate) > MOST_OF_GAP
            && self.settles(&candidate.training, &self.base.training)
            && self.settles(&candidate.holdout, &self.base.holdout)
    }

    /// Whether candidate `fit` explains windows of the training logs or of the holdout whose errors stand far out of the noise under candidate
    /// `other`, while no other window gets worse.
    pub fn takes_outliers(&self, fit: &Candidate<P>, other: &Candidate<P>) -> bool {
        self.settles(&fit.training, &other.training) || self.settles(&fit.holdout, &other.holdout)
    }

    /// Whether the cost of a typical holdout window is about what measurement noise alone leaves.
    pub fn is_typically_noise(&self) -> bool {
        self.weights.holdout.typical < AT_FLOOR * self.floor / self.base.holdout.len() as f64
    }

    /// Whether window costs `mine` are far lower than `base` in some windows, so that these were outliers, and hardly higher in any other.
    fn settles(&self, mine: &[f64], base: &[f64]) -> bool {
        settles(mine, base, outlying(self.weights.holdout.typical, self.is_typically_noise()))
    }

    /// Factor by which the prior variances of the parameters are widened, because the gap that the current model leaves biases the fitted parameters;
    /// 1 where the gap is explained.
    pub fn prior_inflation(&self) -> f64 {
        if self.is_open() { inflation(self.relative_error()) } else { 1.0 }
    }

    /// Whether an effect can be told from errors of the numerical integrator at the size of the node's gap. In a gap below `RELEVANT`, an effect
    /// whose first parameter is a time or a shaft stiffness (delay, lag, joint elasticity) cannot: such errors resemble a shift in time or a stiff
    /// shaft.
    pub fn shows(&self, effect: Option<&EffectInstance>) -> bool {
        self.relative_error() > RELEVANT
            || effect.is_some_and(|e| {
                !matches!(e.law.spec().parameters[0].quantity, Quantity::Time | Quantity::ShaftStiffness)
            })
    }
}

/// Whether a candidate that leaves the cost `left` on the holdout, over a floor of `floor`, shows that another one is not the cause, whose windows'
/// costs are higher by `z` standard errors of their mean difference, or in some windows far out of the noise (`has_outliers`). Beside unmodelled torques a
/// small difference of the costs decides nothing: these torques are alike in all windows. Beside noise alone it does, and the noise is known there, so
/// that windows need not agree: a motion may tell two effects apart in a few of them.
fn excludes(left: f64, floor: f64, z: f64, has_outliers: bool) -> bool {
    left < AT_FLOOR * floor && (z > CLOSE || has_outliers)
}

/// Whether the window costs `mine` are lower than `base` by more than `least`, summed over the windows that improve, and hardly higher, summed over
/// the others.
fn settles(mine: &[f64], base: &[f64], least: f64) -> bool {
    let gains = || base.iter().zip(mine).map(|(b, m)| b - m);
    let gain: f64 = gains().filter(|g| *g > 0.0).sum();
    let loss: f64 = gains().filter(|g| *g < 0.0).sum();
    gain > least && -loss < HARMLESS * gain
}

/// Least decrease of the summed cost of windows that counts as an explanation of outliers, among windows of the typical cost `typical`. The cost of
/// noise is a sum of squares, whose variance is twice its mean; the cost of unmodelled torques scatters by as much as its mean.
fn outlying(typical: f64, is_noise: bool) -> f64 {
    OUTLYING * if is_noise { (2.0 * typical).sqrt() } else { typical }
}

/// Ground on which a candidate is accepted as a cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// Predictions with the candidate are closer to the measured positions.
    Motion,
    /// Fitted parameters that were implausible return to their prior values with the candidate.
    Trust,
}

/// Index of the candidate that is accepted as a cause at a search node, and the ground of its acceptance; none if no candidate is accepted. Friction
/// regularisation (a candidate without an effect) may be accepted unless friction is `regularised` already.
///
/// Of those that meet the criteria the one of lowest cost is accepted. A candidate of still lower cost that does not meet them is no ground to stop: on a
/// real arm with two effects on one joint, a third effect that imitates both at once may fit best and predict the holdout no better than before.
///
/// RMS improvements of the predictions below `min_relevance`, relative to the motion within a window, do not count.
pub fn choose<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    regularised: bool,
    min_relevance: f64,
) -> Option<(usize, Ground)> {
    let offer = |candidate: &Candidate<P>| Offer {
        advantage: node.base.score() - candidate.score(),
        values: free_values(candidate, regularised),
        share: node.share(candidate),
        moves: (candidate.effect.is_some() || !regularised) && moves(node, candidate, min_relevance),
    };
    let offers: Vec<Offer> = node.candidates.iter().map(offer).collect();
    if let Some(index) = accepted(&offers) {
        return Some((index, Ground::Motion));
    }
    let free = |i: usize| node.candidates[i].effect.as_ref().map_or(0, EffectInstance::len) as f64;
    let trust = |i: &usize| node.candidates[*i].fit.prior_cost + free(*i);
    (0..node.candidates.len())
        .filter(|i| restores(node, &node.candidates[*i]))
        .min_by(|a, b| trust(a).total_cmp(&trust(b)))
        .map(|index| (index, Ground::Trust))
}

/// Whether the fitted size of a candidate's effect is neither idle (near zero, for an effect with a threshold) nor the largest that the fit allows.
pub fn is_possible<const P: usize>(candidate: &Candidate<P>) -> bool {
    candidate.size < AT_BOUND && !candidate.is_idle()
}

/// Figures of one candidate from which the one that is accepted is chosen.
#[derive(Debug, Clone, Copy)]
struct Offer {
    /// Decrease of the cost by the candidate.
    advantage: f64,
    /// Share of the gap above the noise floor that the candidate removes on the holdout.
    share: f64,
    /// Number of free values that the candidate adds to the arm's parameters; zero if the candidate is not to be chosen for its simplicity.
    values: usize,
    /// Whether the candidate by itself meets the acceptance criteria on predicted motion.
    moves: bool,
}

/// Index in `offers`, which are in order of cost, lowest first, of the one that is accepted: the first that meets the acceptance criteria, or one with
/// fewer values that lowers the cost almost as much, since a spring with a far-off rest position is a torque offset, and a hysteresis over a very short
/// path is regularised friction. None if no offer meets the criteria.
fn accepted(offers: &[Offer]) -> Option<usize> {
    let best = offers.iter().position(|offer| offer.moves)?;
    let almost = if offers[best].share > MOST_OF_GAP { ALMOST } else { ALMOST_IN_DOUBT };
    Some(fewest_values(offers, best, almost))
}

/// Index in `offers` of the candidate with the fewest values, the first of several, among those that are accepted by themselves and lower the cost by
/// more than `almost` times the decrease by candidate `best`.
fn fewest_values(offers: &[Offer], best: usize, almost: f64) -> usize {
    let Offer { advantage, values, .. } = offers[best];
    if values == 0 {
        return best;
    }
    let as_good =
        |i: &usize| offers[*i].advantage > almost * advantage && offers[*i].moves && offers[*i].values > 0;
    (0..offers.len()).filter(as_good).min_by_key(|i| (offers[*i].values, *i)).unwrap_or(best)
}

/// Number of free values that a candidate adds to the arm's parameters: those of its effect, or one for the width of friction regularisation unless
/// friction is `regularised` already. Zero for a candidate that is not to be chosen for its simplicity.
fn free_values<const P: usize>(candidate: &Candidate<P>, regularised: bool) -> usize {
    let width = usize::from(!regularised && candidate.fit.hypothesis.is_rounded());
    candidate.effect.as_ref().map_or(width, EffectInstance::len)
}

/// Whether a candidate meets the acceptance criteria on predicted motion: it improves the RMS error by more than `min_relevance` (relative to the motion
/// within a window), is significant on all windows and on the holdout alone, and removes a share of the gap, a considerable one if the gap is of no
/// consequence.
pub fn moves<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    candidate: &Candidate<P>,
    min_relevance: f64,
) -> bool {
    let (matters, certain) = match node.relative_error() {
        _ if min_relevance <= FAINTEST => (MATTERS_IF_FAINT, CERTAIN_IF_FAINT),
        error if error > CONSEQUENTIAL_ERROR => (LEAST_SHARE, certain(candidate.effect.as_ref())),
        _ => (MATTERS_IN_SMALL, CERTAIN),
    };
    node.excess() > ABOVE_FLOOR
        && node.shows(candidate.effect.as_ref())
        && is_possible(candidate)
        && node.share(candidate) > matters
        && node.relevance(candidate) > min_relevance
        && (is_certain(node, candidate, certain) || node.settles_outliers(candidate))
}

/// Least mean decrease of the windows' cost by an effect, in standard errors of this mean, for the effect to be accepted and kept as a cause in a gap of
/// consequence; by friction regularisation, which has one value, where there is no effect.
pub fn certain(effect: Option<&EffectInstance>) -> f64 {
    let values = effect.map_or(1, EffectInstance::len);
    CERTAIN - CERTAIN_PER_VALUE * (MAX_PARAMETERS - values) as f64
}

/// Whether the mean decrease of the windows' cost by a candidate is significant: more than `certain` standard errors on all windows, and more than
/// `HOLDOUT_CERTAIN` on the holdout alone.
fn is_certain<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    candidate: &Candidate<P>,
    certain: f64,
) -> bool {
    candidate.z_over(&node.base) > certain && candidate.holdout_z_over(&node.base) > HOLDOUT_CERTAIN
}

/// Whether a candidate with friction regularisation, a nuisance that is never named, explains most of the gap with sufficient certainty.
pub fn is_regularisation<const N: usize, const P: usize>(
    node: &SearchNode<N, P>,
    candidate: &Candidate<P>,
) -> bool {
    node.share(candidate) > MOST_OF_GAP && is_certain(node, candidate, certain(None))
}

/// Whether a candidate adds an effect with which fitted parameters that were implausible return towards their prior values, which is a ground to
/// accept it: implausibly far without the candidate, much closer with it (prior cost lower by more than `TRUST_GAIN` and below 0.4 times), while
/// the total cost falls.
pub fn restores<const N: usize, const P: usize>(node: &SearchNode<N, P>, candidate: &Candidate<P>) -> bool {
    let [before, after] = [&node.base, candidate].map(|c| c.fit.prior_cost / node.prior_inflation());
    candidate.effect.is_some()
        && !is_plausible::<P>(before)
        && before - after > TRUST_GAIN
        && after < 0.4 * before
        && candidate.score() < node.base.score()
}

/// Factor by which the prior variances of the parameters are widened where a gap remains unexplained; `relative_error` is the RMS prediction error
/// relative to the motion within a window.
fn inflation(relative_error: f64) -> f64 {
    1.0 + (relative_error / MOVES_A_SIGMA).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    fn offer(advantage: f64, values: usize) -> Offer {
        Offer { advantage, values, share: 0.6, moves: true }
    }

    #[test]
    fn a_better_fit_that_the_holdout_does_not_confirm_is_no_ground_to_accept_none() {
        let [elasticity, lag, inertia] = [offer(641.0, 3), offer(516.0, 1), offer(425.0, 1)];
        let refused = |offer| Offer { moves: false, ..offer };
        assert_eq!(accepted(&[refused(elasticity), lag, refused(inertia)]), Some(1));
        assert_eq!(accepted(&[elasticity, lag, inertia]), Some(0));
        assert_eq!(accepted(&[refused(elasticity), refused(lag), refused(inertia)]), None);
        let small = |offer| Offer { share: 0.2, ..offer };
        assert_eq!(accepted(&[small(elasticity), lag, inertia]), Some(1), "most of the gap stays");
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
    fn a_small_difference_decides_beside_noise_alone() {
        assert!(excludes(110.0, 100.0, 5.0, false));
        assert!(!excludes(110.0, 100.0, 2.5, false), "no significant difference");
        assert!(excludes(110.0, 100.0, 2.5, true), "few windows, far out of the noise");
        assert!(!excludes(500.0, 100.0, 5.0, true), "beside unmodelled torques");
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
    fn the_more_values_an_effect_has_the_surer_it_has_to_be() {
        let of = |name| certain(Some(&EffectInstance::new(find::<f64>(name).unwrap(), 0, [1.0; 3])));
        assert_eq!(["rotor_inertia", "stribeck", "torque_ripple"].map(of), [2.5, 3.0, CERTAIN]);
        assert_eq!(certain(None), 2.5, "the width of rounded friction");
    }

    #[test]
    fn a_large_gap_may_have_moved_the_parameters_by_itself() {
        assert!((inflation(0.001) - 1.0).abs() < 0.01);
        assert_eq!(inflation(MOVES_A_SIGMA), 2.0);
        // A prior cost of 70 is evidence where the gap is 2 % of the motion, and none where it is 10 %.
        assert!(70.0 / inflation(0.02) > TRUST_GAIN && 70.0 / inflation(0.1) < TRUST_GAIN);
    }
}
