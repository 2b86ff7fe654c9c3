//! One cause after another: what is accepted, what is dropped again, and with what probability.
//!
//! A cause is accepted when it removes a part of the gap that matters, on windows of other motions too, and by more than the
//! windows' own scatter. After every addition all causes are fitted together again, and one that has become idle is dropped.

use crate::attribute::{Contender, Stage, is_plausible};
use crate::equivalent;
use crate::model::{Hypothesis, Placed};
use crate::solve::{Effort, Fit};
use crate::study::{Study, Weights};
use armgap_core::arm::Arm;
use armgap_core::effect::{Quantity, Trial};

/// Mean advantage per window, in standard errors, below which a cause is not accepted.
pub const CERTAIN: f64 = 3.5;

/// The same on the holdout alone, where a cause must at least not fail.
const HOLDOUT_CERTAIN: f64 = 1.0;

/// Share of the gap above the floor below which an improvement does not matter.
pub const MATTERS: f64 = 0.1;

/// The same where the gap itself is of no consequence: only an effect that explains most of it counts.
const MATTERS_IN_SMALL: f64 = 0.5;

/// Cost above the floor, as a factor, below which there is nothing left to explain.
pub const ABOVE_FLOOR: f64 = 1.25;

/// Cost of a typical window, relative to what noise alone leaves, up to which a gap is that of a few windows.
const AT_FLOOR: f64 = 1.5;

/// What a contender must take off those few, in costs of a typical window, and what others may lose by it, as a part of that.
const OUTLYING: f64 = 25.0;
const HARMLESS: f64 = 0.05;

/// Decrease of the distance from trusted values, in squared sigmas, that makes a cause on its own.
const TRUST_GAIN: f64 = 16.0;

/// Beside an unexplained gap larger than this part of the motion, implausible values are no evidence: the gap may have moved them.
const TRUSTWORTHY: f64 = 0.01;

/// Contenders whose distance from trusted values differs by less, in squared sigmas, are look-alikes.
const ALIKE_TRUST: f64 = 6.0;

/// Cost above the floor, as a factor, beyond which a gap without a cause is called unexplained.
const UNEXPLAINED: f64 = 4.0;

/// Error relative to the motion within a window below which a gap is of no consequence, whatever the encoders resolve.
pub const CONSEQUENCE: f64 = 1e-3;

/// Improvement relative to the motion within a window below which an effect is of no consequence.
const RELEVANT: f64 = 1e-4;

/// A gap that is not worth a name by itself is looked into down to this size if it stands this far above the floor.
const FAINTEST: f64 = 5e-6;
const CLEAR: f64 = 2.75;

/// There a cause must explain this part of it, with this certainty, as no error of an integrator does.
const MATTERS_IF_FAINT: f64 = 0.7;
const CERTAIN_IF_FAINT: f64 = 5.0;

/// Probability left to a cause beside a remainder that it does not touch at all.
const REMAINDER_DOUBT: f64 = 0.2;

/// How fast a remainder takes the probability from causes that leave it: effects that are in no library were seen to be imitated by
/// two or three that are, for up to eight tenths of the gap.
const REMAINDER_POWER: i32 = 6;

/// The same relative to the first gap: what lies below it is no cause of that gap.
const NOTICEABLE: f64 = 0.02;

/// A fit that ends this close to the largest possible size has found no effect.
const AT_BOUND: f64 = 0.98;

/// Resamples of the windows.
const RESAMPLES: usize = 400;

/// A contender with fewer parameters is preferred if it reaches this part of the best one's advantage.
const ALMOST: f64 = 0.95;

/// The same where even the best leaves most of the gap: there, further parameters are taken up by what they are not about.
const ALMOST_IN_DOUBT: f64 = 0.6;

/// A contender that explains more than this part of the gap is about it.
const MOST: f64 = 0.5;

/// A contender whose cost is within this part of the winner's advantage is a look-alike.
const LOOK_ALIKE: f64 = 0.03;

/// A cause that was accepted.
#[derive(Debug, Clone)]
pub struct Cause {
    /// The effect with its values in the final model.
    pub effect: Placed,
    /// Standard deviations of its values.
    pub sigma: Vec<f64>,
    /// Probability that it, or an effect that no motion tells from it, is what the windows show.
    pub probability: f64,
    /// Share of the holdout's gap above the floor that it removed when it was added.
    pub share: f64,
    /// RMS improvement on the holdout when it was added, relative to the motion.
    pub relevance: f64,
    /// Effects that this log does not tell from it.
    pub look_alikes: Vec<Placed>,
}

/// The whole course of an attribution.
pub struct Attribution<const N: usize, const P: usize> {
    /// Parameters re-estimated, no effects.
    pub refit: Fit<P>,
    /// The final model.
    pub model: Fit<P>,
    /// Accepted causes, strongest first.
    pub causes: Vec<Cause>,
    /// Every stage, the last one being the one that accepted nothing.
    pub stages: Vec<Stage<N, P>>,
}

impl<const N: usize, const P: usize> Attribution<N, P> {
    /// Whether the final model leaves a gap of consequence that is more than noise.
    pub fn is_unexplained(&self) -> bool {
        let last = self.stages.last();
        last.is_some_and(|s| s.excess() > UNEXPLAINED && s.relative_error() > CONSEQUENCE)
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Study<A, N, P> {
    /// Attributes the gap to at most `max_causes` effects.
    pub fn attribute(&self, max_causes: usize, seed: u64) -> Attribution<N, P> {
        let nominal = Hypothesis::rigid(self.prior.theta);
        let mut scale = self.rough_scale(&nominal);
        let settled = self.settle(&nominal, scale);
        let mut stage = self.stage_around(settled.clone(), RELEVANT);
        let refit = stage.settled.clone();
        let mut model = refit.clone();
        let (mut causes, mut stages): (Vec<Cause>, Vec<Stage<N, P>>) = (Vec::new(), Vec::new());
        let mut smoothed = false;
        let noticeable = noticeable(stage.relative_error());
        let mut threshold = self.look_closer(&mut stage, settled, noticeable, CLEAR);
        while causes.len() < max_causes {
            let Some((choice, ground)) = choose(&stage, smoothed, threshold) else {
                let Some(both) = (causes.len() + 2 <= max_causes)
                    .then(|| self.together(&stage, threshold, seed))
                    .flatten()
                else {
                    break;
                };
                model = both.stage.contenders[both.choice].fit.clone();
                causes.extend(both.causes);
                stages.push(stage);
                scale = both.stage.weights.training.scale;
                stages.push(both.stage);
                let settled = self.settle(&model.hypothesis, scale);
                stage = self.stage_around(settled.clone(), noticeable);
                threshold = self.look_closer(&mut stage, settled, noticeable, UNEXPLAINED);
                model = stage.settled.clone();
                continue;
            };
            let best = &stage.contenders[choice];
            model = best.fit.clone();
            match best.effect {
                Some(_) => causes.push(name(&stage, choice, ground, seed)),
                None => smoothed = true,
            }
            scale = stage.weights.training.scale;
            let settled = self.settle(&model.hypothesis, scale);
            let next = self.stage_around(settled.clone(), noticeable);
            stages.push(std::mem::replace(&mut stage, next));
            threshold = self.look_closer(&mut stage, settled, noticeable, UNEXPLAINED);
            model = stage.settled.clone();
        }
        self.prune(&mut model, &mut causes, &stage);
        self.widen(&mut model, &stage.weights);
        stages.push(stage);
        refresh(&model, &mut causes);
        temper(&stages, &mut causes);
        Attribution { refit, model, causes, stages }
    }

    /// Looks into a gap that is too small to matter by itself, and yet stands above the floor by the factor `clear`; returns which
    /// improvements count. `settled` is what the stage was made around.
    fn look_closer(
        &self,
        stage: &mut Stage<N, P>,
        settled: (Fit<P>, Weights<N>),
        noticeable: f64,
        clear: f64,
    ) -> f64 {
        if !(FAINTEST..=noticeable).contains(&stage.relative_error()) || stage.excess() <= clear {
            return noticeable;
        }
        *stage = self.stage_around(settled, FAINTEST);
        FAINTEST
    }

    /// Drops causes that the others have made idle.
    fn prune(&self, model: &mut Fit<P>, causes: &mut Vec<Cause>, stage: &Stage<N, P>) {
        let mut i = 0;
        while causes.len() > 1 && i < causes.len() {
            let full = self.judged(stage, model.clone(), None);
            let mut without = model.hypothesis.clone();
            without.effects.remove(i);
            let fit = self.problem(&stage.weights.training).solve(&without, Effort::FULL);
            let reduced = self.judged(stage, fit, None);
            let idle =
                full.z_over(&reduced) < CERTAIN && reduced.fit.prior_cost - full.fit.prior_cost < TRUST_GAIN;
            if idle {
                *model = reduced.fit;
                causes.remove(i);
                i = 0;
            } else {
                i += 1;
            }
        }
    }

    fn judged(&self, stage: &Stage<N, P>, fit: Fit<P>, effect: Option<Placed>) -> Contender<P> {
        let training = self.problem(&stage.weights.training).window_costs(&fit.hypothesis);
        let (holdout, error) = self.judged_on_holdout(&stage.weights, &fit);
        Contender { effect, size: 0.0, fit, training, holdout, error }
    }
}

/// Improvement relative to the motion below which a cause is not worth a name, given the first gap; what is of consequence by itself
/// always is.
pub fn noticeable(first_gap: f64) -> f64 {
    (NOTICEABLE * first_gap).clamp(RELEVANT, CONSEQUENCE)
}

impl<const N: usize, const P: usize> Stage<N, P> {
    /// Whether the data hardly prefer `best` to another contender.
    pub fn is_alike(&self, best: &Contender<P>, other: &Contender<P>) -> bool {
        let advantage = self.base.score() - best.score();
        other.score() - best.score() < (LOOK_ALIKE * advantage).max(3.0) || best.z_over(other) < 1.0
    }

    /// Whether a contender explains windows that stand far out of noise, in training and holdout, at no cost to any other.
    ///
    /// An effect that shows in a few windows, such as a stop that is hardly touched, never has a mean advantage of many standard errors.
    /// Where all other windows are at the floor, it needs none: their noise is known, and it is not noise that it takes away.
    fn settles_outliers(&self, contender: &Contender<P>) -> bool {
        let windows = self.base.holdout.len() as f64;
        let typical = self.weights.holdout.typical;
        let settles = |mine: &[f64], base: &[f64]| {
            let gains = || base.iter().zip(mine).map(|(b, m)| b - m);
            let gain: f64 = gains().filter(|g| *g > 0.0).sum();
            let loss: f64 = gains().filter(|g| *g < 0.0).sum();
            gain > OUTLYING * typical && -loss < HARMLESS * gain
        };
        typical < AT_FLOOR * self.floor / windows
            && self.share(contender) > MOST
            && settles(&contender.training, &self.base.training)
            && settles(&contender.holdout, &self.base.holdout)
    }

    /// Whether no log of motion tells the effects of two contenders apart.
    fn are_equivalent(&self, a: usize, b: usize) -> bool {
        match (self.contenders[a].effect, self.contenders[b].effect) {
            (Some(a), Some(b)) => equivalent::are(&a, &b, N),
            _ => false,
        }
    }

    /// Whether an effect would show in this gap: a small one may be an integrator's error, which is like a shift in time or a stiff shaft.
    pub fn shows(&self, effect: Option<&Placed>) -> bool {
        self.relative_error() > RELEVANT
            || effect.is_some_and(|e| {
                let spec = e.law.spec();
                spec.trial != Trial::Whole && spec.parameters[0].quantity != Quantity::Time
            })
    }
}

/// Why a contender deserves to be adopted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// It moves predictions closer to the measurement.
    Motion,
    /// It brings the parameters back to their trusted values.
    Trust,
}

/// Index of the contender to adopt, and why, if any deserves it; smoother friction is adopted once.
///
/// Improvements below `noticeable`, relative to the motion, do not count.
pub fn choose<const N: usize, const P: usize>(
    stage: &Stage<N, P>,
    smoothed: bool,
    noticeable: f64,
) -> Option<(usize, Ground)> {
    let by_motion = best(stage, smoothed).filter(|i| moves(stage, &stage.contenders[*i], noticeable));
    if let Some(best) = by_motion {
        return Some((simplest(stage, best, noticeable), Ground::Motion));
    }
    let free = |i: usize| stage.contenders[i].effect.as_ref().map_or(0, Placed::len) as f64;
    let trust = |i: &usize| stage.contenders[*i].fit.prior_cost + free(*i);
    (0..stage.contenders.len())
        .filter(|i| restores(stage, &stage.contenders[*i]))
        .min_by(|a, b| trust(a).total_cmp(&trust(b)))
        .map(|index| (index, Ground::Trust))
}

/// The best contender that describes an arm; one with a value at its bound gives way to one that does almost as well without.
pub fn best<const N: usize, const P: usize>(stage: &Stage<N, P>, smoothed: bool) -> Option<usize> {
    let open = |i: &usize| stage.contenders[*i].effect.is_some() || !smoothed;
    let first = (0..stage.contenders.len()).find(open)?;
    let advantage = |i: usize| stage.base.score() - stage.contenders[i].score();
    let as_good = |i: &usize| open(i) && advantage(*i) >= ALMOST * advantage(first);
    (first..stage.contenders.len()).filter(as_good).find(|i| is_possible(&stage.contenders[*i]))
}

/// Whether a contender's effect is neither idle nor at the largest size.
pub fn is_possible<const P: usize>(contender: &Contender<P>) -> bool {
    contender.size < AT_BOUND && !contender.is_idle()
}

/// The contender with the fewest parameters among those that do almost as well as the best: a spring with a far-off rest position is
/// an offset.
fn simplest<const N: usize, const P: usize>(stage: &Stage<N, P>, best: usize, noticeable: f64) -> usize {
    let advantage = |i: usize| stage.base.score() - stage.contenders[i].score();
    let size = |i: usize| stage.contenders[i].effect.as_ref().map_or(0, Placed::len);
    let almost = if stage.share(&stage.contenders[best]) > MOST { ALMOST } else { ALMOST_IN_DOUBT };
    let enough = almost * advantage(best);
    let as_good =
        |i: &usize| advantage(*i) > enough && moves(stage, &stage.contenders[*i], noticeable) && size(*i) > 0;
    if size(best) == 0 {
        return best;
    }
    (0..stage.contenders.len()).filter(as_good).min_by_key(|i| (size(*i), *i)).unwrap_or(best)
}

/// Whether a contender closes a part of the gap that matters, on the holdout too.
pub fn moves<const N: usize, const P: usize>(
    stage: &Stage<N, P>,
    contender: &Contender<P>,
    noticeable: f64,
) -> bool {
    let (matters, certain) = match stage.relative_error() {
        _ if noticeable <= FAINTEST => (MATTERS_IF_FAINT, CERTAIN_IF_FAINT),
        error if error > CONSEQUENCE => (MATTERS, CERTAIN),
        _ => (MATTERS_IN_SMALL, CERTAIN),
    };
    stage.excess() > ABOVE_FLOOR
        && stage.shows(contender.effect.as_ref())
        && is_possible(contender)
        && stage.share(contender) > matters
        && stage.relevance(contender) > noticeable
        && (is_certain(stage, contender, certain) || stage.settles_outliers(contender))
}

/// Whether a contender's advantage exceeds the windows' scatter, on the holdout alone too.
fn is_certain<const N: usize, const P: usize>(
    stage: &Stage<N, P>,
    contender: &Contender<P>,
    certain: f64,
) -> bool {
    contender.z_over(&stage.base) > certain && contender.holdout_z_over(&stage.base) > HOLDOUT_CERTAIN
}

/// Whether a contender explains implausible parameters by one effect.
fn restores<const N: usize, const P: usize>(stage: &Stage<N, P>, contender: &Contender<P>) -> bool {
    let before = stage.base.fit.prior_cost;
    contender.effect.is_some()
        && (stage.relative_error() < TRUSTWORTHY || !stage.is_open())
        && !is_plausible::<P>(before)
        && before - contender.fit.prior_cost > TRUST_GAIN
        && contender.fit.prior_cost < 0.4 * before
        && contender.score() < stage.base.score()
}

/// The chosen contender as a cause, with its look-alikes and probability.
pub fn name<const N: usize, const P: usize>(
    stage: &Stage<N, P>,
    choice: usize,
    ground: Ground,
    seed: u64,
) -> Cause {
    let best = &stage.contenders[choice];
    let alike = |c: &&Contender<P>| match ground {
        Ground::Motion => stage.is_alike(best, c),
        Ground::Trust => restores(stage, c) && c.fit.prior_cost - best.fit.prior_cost < ALIKE_TRUST,
    };
    let others = stage.contenders.iter().enumerate().filter(|(i, c)| *i != choice && c.effect.is_some());
    let look_alikes: Vec<Placed> =
        others.map(|(_, c)| c).filter(alike).filter_map(|c| c.effect).take(3).collect();
    let effect = best.effect.unwrap_or_else(|| unreachable!("only effects are named"));
    Cause {
        effect,
        sigma: Vec::new(),
        probability: match ground {
            Ground::Motion => probability(stage, choice, seed),
            Ground::Trust => trust_probability(stage, choice),
        },
        share: stage.share(best).clamp(0.0, 1.0),
        relevance: stage.relevance(best),
        look_alikes,
    }
}

/// How often the chosen contender, or one that no motion tells from it, has the lowest cost when the windows are drawn again.
fn probability<const N: usize, const P: usize>(stage: &Stage<N, P>, choice: usize, seed: u64) -> f64 {
    let advantages: Vec<Vec<f64>> = stage.contenders.iter().map(|c| c.advantages(&stage.base)).collect();
    let own: Vec<f64> =
        stage.contenders.iter().map(|c| stage.base.fit.prior_cost - c.fit.prior_cost).collect();
    // A law with more values that does no better is no evidence against one with fewer.
    let size = |i: usize| stage.contenders[i].effect.as_ref().map_or(0, Placed::len);
    let richer =
        |i: usize| size(i) > size(choice) && stage.is_alike(&stage.contenders[choice], &stage.contenders[i]);
    let ours = |i: usize| i == choice || stage.are_equivalent(i, choice) || richer(i);
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

/// Probability of the chosen contender, or one that no motion tells from it, among all effects that would restore the trusted values, from their distances.
fn trust_probability<const N: usize, const P: usize>(stage: &Stage<N, P>, choice: usize) -> f64 {
    let best = stage.contenders[choice].fit.prior_cost;
    let free = |c: &Contender<P>| c.effect.as_ref().map_or(0, Placed::len) as f64;
    // Every value of its own takes one squared sigma of the distance off by chance.
    let mass = |c: &Contender<P>| (-0.5 * (c.fit.prior_cost + free(c) - best)).exp();
    let (mut ours, mut all) = (0.0, 0.0);
    for (i, contender) in stage.contenders.iter().enumerate() {
        if contender.effect.is_none() {
            continue;
        }
        all += mass(contender);
        if i == choice || stage.are_equivalent(i, choice) {
            ours += mass(contender);
        }
    }
    // What is left over by the best effect must itself be plausible, or the values are simply wrong.
    let plausible = (-0.5 * (best - P as f64).max(0.0) / (2.0 * P as f64).sqrt()).exp();
    (ours / all) * plausible
}

/// Part of the first gap that the final model leaves without explanation.
pub fn left_over<const N: usize, const P: usize>(stages: &[Stage<N, P>]) -> f64 {
    let (Some(first), Some(last)) = (stages.first(), stages.last()) else { return 0.0 };
    if last.excess() < if last.is_open() { ABOVE_FLOOR } else { UNEXPLAINED } {
        return 0.0;
    }
    // As it is, the error may be that of one window that ran away; with its tail cut, it is that of all of them. Where it is of no
    // consequence by itself, both must say so.
    let as_it_is = (last.relative_error() / first.relative_error()).powi(2);
    let cut = last.excess() / first.excess();
    let left = if last.is_open() { as_it_is.max(cut) } else { as_it_is.min(cut) };
    left.min(1.0)
}

/// Lowers the probabilities where a gap of consequence remains that no candidate explains: what leaves it may also be what the named
/// causes stand in for.
fn temper<const N: usize, const P: usize>(stages: &[Stage<N, P>], causes: &mut [Cause]) {
    let belief = belief_beside(left_over(stages), REMAINDER_DOUBT);
    for cause in causes {
        cause.probability *= belief;
    }
}

/// What a probability is multiplied by beside a part `left` of the gap that nothing explains: one for none, `least` for all of it.
pub fn belief_beside(left: f64, least: f64) -> f64 {
    least + (1.0 - least) * (1.0 - left).powi(REMAINDER_POWER)
}

/// Values and standard deviations of the causes from the final model.
fn refresh<const P: usize>(model: &Fit<P>, causes: &mut [Cause]) {
    for cause in causes.iter_mut() {
        let mut first = P;
        for effect in &model.hypothesis.effects {
            if effect.same_place(&cause.effect) {
                cause.effect = *effect;
                cause.sigma = (first..first + effect.len()).map(|i| model.sigma(i)).collect();
            }
            first += effect.len();
        }
    }
    causes.sort_by(|a, b| b.relevance.total_cmp(&a.relevance));
}

/// A small generator of uniform numbers (splitmix64, Steele, Lea and Flood 2014), so that a seed gives the same result everywhere.
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number from 0 to `n - 1`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }
}
