//! Evidence for a term of the model: comparison of the model with the term and the model without it, and the term's probability.

use crate::numeric::random::Random;
use crate::serial::constants::{
    AN_EVENT, CONSEQUENCE, HOLDOUT_DEVIATIONS, INSTRUMENTED_DEVIATIONS, INSTRUMENTED_DIFFERENCE, MATTERS,
    NOTICED, PRICE, RESAMPLES, RESTORES, RESTORES_EACH, SIGNIFICANT, WHOLE_EVENT,
};
use crate::serial::search::Search;
use crate::serial::search::fitting::Fitted;
use crate::serial::search::tables::table_price;
use crate::serial::term::TermKind;
use crate::serial::weak_form::rows::{JointRows, Regression, Rows, Signal};

/// Share of a cost from which [`likelihood_gain`] is linear.
const LINEAR_FROM: f64 = 0.95;

/// Evidence for a term: comparison of the model with the term and the model without it.
#[derive(Debug, Clone, Copy)]
pub struct Evidence {
    /// Effective number of the term's parameters.
    pub parameters: f64,
    /// `gain` from which the term is accepted.
    pub price: f64,
    /// Twice the logarithm of the likelihood ratio of the models with and without the term on the training logs
    /// ([`Search::likelihood_ratio`]), plus `relief`.
    pub gain: f64,
    /// Decrease, by the term, of the parameters' squared distance from the arm file's values, counted in standard deviations.
    pub relief: f64,
    /// Squared test statistic of the term on the training logs: estimated size over its standard deviation, robust to residuals correlated within
    /// blocks.
    pub statistic: f64,
    /// Decrease of the holdout's cost (weighted squared residuals) by the term, on the joints that are judged: those that it acts on, or all.
    pub holdout_gain: f64,
    /// Size of the term in the holdout, relative to the training logs, over the size's standard deviation (see [`Search::evidence`]).
    pub deviations: f64,
    /// Share of a joint's holdout cost (weighted squared residuals) that the term removes, 0 to 1, for the joint with the largest share.
    pub share: f64,
    /// RMS torque of the term where it acts ([`where_it_acts`]) relative to the RMS torque of the joint, for the joint with the largest ratio.
    pub consequence: f64,
    /// Size of the term on the training logs by its instrument ([`Motion::instrument`]), relative to the fitted size, and the standard deviation; `None` for
    /// terms without an instrument.
    pub instrumented: Option<[f64; 2]>,
    /// Number of stretches of two seconds that the decrease of the cost by a law comes from, counted by their shares of it, and the part of the cost of the
    /// first of them that the law removes ([`stretches`]); `None` for other terms.
    pub stretches: Option<[f64; 2]>,
}

impl Evidence {
    /// Whether the term is accepted because of the residuals that it explains in training logs and holdout.
    pub fn explains(&self) -> bool {
        self.statistic > NOTICED
            && self.statistic + self.deviations.max(0.0).powi(2) > SIGNIFICANT
            && self.gain > self.price
            && self.holdout_gain > 0.0
            && self.deviations > HOLDOUT_DEVIATIONS
            && self.share > MATTERS
            && self.consequence > CONSEQUENCE
    }

    /// Whether the term is accepted because it brings the arm's parameters back to the arm file's values, without contradiction by the holdout.
    pub fn restores(&self) -> bool {
        self.relief > RESTORES + RESTORES_EACH * self.parameters
            && self.gain > PRICE + 2.0 * self.parameters
            && self.deviations > -HOLDOUT_DEVIATIONS
            && self.consequence > CONSEQUENCE
    }

    /// Whether the term is accepted, for what it explains or for the arm file's values that it restores.
    pub fn is_accepted(&self) -> bool {
        self.is_exogenous() && self.recurs() && (self.explains() || self.restores())
    }

    /// Whether a law acts more than once, or explains all of the one event in which it acts.
    fn recurs(&self) -> bool {
        self.stretches.is_none_or(|[stretches, removed]| stretches > AN_EVENT || removed > WHOLE_EVENT)
    }

    /// Whether the term explains more than the disturbances that its own torque contains.
    fn is_exogenous(&self) -> bool {
        let beyond = |[size, sigma]: [f64; 2]| {
            size > INSTRUMENTED_DEVIATIONS * sigma && (size - 1.0).abs() < INSTRUMENTED_DIFFERENCE
        };
        self.instrumented.is_none_or(beyond)
    }
}

impl Search<'_> {
    /// Evidence for the term of index `index` in the model `with`, compared with the model `without` the term.
    ///
    /// On the holdout, the residuals of the model without the term are regressed on the part of them that the term removes: a slope of one says that
    /// the effect has the size that the training logs gave it, a slope of zero that it is absent. The joints that the term acts on count, as the
    /// scatter of the other joints' parameters says nothing about the term; or all joints, where these say more: a wrong torque gain of an outer joint
    /// shows on an inner one, whose torque holds the same links. The slope's standard deviation comes from the scatter of the blocks'
    /// scores. How unevenly an effect is spread over the blocks does not count against the effect, unless it acts once: a joint limit may be reached only twice
    /// in a log.
    pub(in crate::serial) fn evidence(
        &self,
        regression: &Regression,
        without: &Fitted,
        with: &Fitted,
        index: usize,
    ) -> Evidence {
        let term = &with.terms[index];
        let signal = self.training.signal(term, &with.estimate.theta);
        let column = std::slice::from_ref(&signal);
        let statistic = regression.score(&with.estimate, column, &[0.0]).map_or(0.0, |score| {
            1.0 / regression.sandwich(&with.estimate.residual, column, &score)[(0, 0)].max(f64::MIN_POSITIVE)
        });
        let joints = self.rotary.len();
        let acts_on: Vec<usize> = (0..joints).filter(|j| signal[*j].is_some()).collect();
        let all: Vec<usize> = (0..joints).collect();
        let cost = |set: &Fitted, j: usize| set.costs[1][j].iter().sum::<f64>();
        let share = (0..joints)
            .map(|j| (1.0 - cost(with, j) / cost(without, j)).max(0.0))
            .filter(|share| share.is_finite())
            .fold(0.0, f64::max);
        let relief = without.estimate.prior_cost - with.estimate.prior_cost;
        let judged = |on: &[usize]| {
            let gain: f64 = on.iter().map(|j| cost(without, *j) - cost(with, *j)).sum();
            (confirmed(on, &regression.weights, self.holdout.rows(), [without, with]), gain)
        };
        let (deviations, holdout_gain) = [judged(&acts_on), judged(&all)]
            .into_iter()
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((0.0, 0.0));
        Evidence {
            parameters: term.degrees,
            price: match term.kind {
                TermKind::Table(_) => table_price(term),
                _ => PRICE * term.degrees,
            },
            gain: relief + self.likelihood_ratio(regression, [without, with]),
            relief,
            statistic,
            holdout_gain,
            deviations,
            share,
            consequence: where_it_acts(self.training.rows(), &signal),
            instrumented: self
                .training
                .instrument(term, &with.estimate.theta)
                .and_then(|instrument| regression.instrumented(&with.estimate, &signal, &instrument)),
            stretches: matches!(term.kind, TermKind::Law(_)).then(|| {
                let cost = |fit: &Fitted, set: usize, block: usize| -> f64 {
                    acts_on.iter().filter_map(|j| fit.costs[set][*j].get(block)).sum()
                };
                let blocks = [self.training.rows().blocks, self.holdout.rows().blocks];
                let of = |set: usize| (0..blocks[set]).map(move |block| (set, block));
                let costs: Vec<[f64; 2]> = of(0)
                    .chain(of(1))
                    .map(|(set, block)| [cost(without, set, block), cost(with, set, block)])
                    .collect();
                stretches(&costs)
            }),
        }
    }

    /// Twice the logarithm of the likelihood ratio of the models `with` and `without` a term on the training logs, where the variance of each joint's
    /// residuals is estimated with either model, at least as that of the position noise: `n log(v0 / v1)` over the joints (Seber and Lee 2003,
    /// section 4.2), with `n` the number of independent rows of the model without the term.
    fn likelihood_ratio(&self, regression: &Regression, [without, with]: [&Fitted; 2]) -> f64 {
        let rows = self.training.rows();
        let floor = floor(rows, &regression.weights);
        let cost =
            |set: &Fitted, j: usize| set.costs[0][j].iter().sum::<f64>().max(floor[j]).max(f64::MIN_POSITIVE);
        let independent = rows.independent_rows(&without.estimate.residual);
        let of = |(j, n): (usize, &f64)| n * (cost(without, j) / cost(with, j)).ln();
        independent.iter().enumerate().map(of).filter(|x| !x.is_nan()).sum()
    }
}

/// Number of stretches of two blocks that the decrease of a cost comes from: one over the sum of the squared shares of the stretches in it; and the part of the
/// cost of the stretch with the largest share that is removed. `costs` are those of each block, before and after. An event that two blocks share is
/// one stretch; blocks in which the cost rises have no share.
fn stretches(costs: &[[f64; 2]]) -> [f64; 2] {
    let from = |first: usize| {
        let pairs = costs[..first].chunks(2).chain(costs[first..].chunks(2));
        let (mut sum, mut squares, mut largest) = (0.0, 0.0, [0.0, 1.0]);
        for pair in pairs {
            let gain: f64 = pair.iter().map(|[before, after]| (before - after).max(0.0)).sum();
            sum += gain;
            squares += gain * gain;
            if gain > largest[0] {
                largest = [gain, pair.iter().map(|[before, _]| before).sum()];
            }
        }
        let count = if squares > 0.0 { sum * sum / squares } else { f64::INFINITY };
        [count, largest[0] / largest[1]]
    };
    let [one, other] = [from(0), from(costs.len().min(1))];
    if one[0] <= other[0] { one } else { other }
}

/// Twice the logarithm of a likelihood ratio, by the decrease `gain` of a cost (weighted squared residuals) that is `before`, where the weights were
/// made for residuals as large as before: `-before log(1 - gain / before)`, linear from [`LINEAR_FROM`] of the cost on, as first-order tests may
/// promise more than there is.
pub(in crate::serial) fn likelihood_gain(gain: f64, before: f64) -> f64 {
    let most = LINEAR_FROM * before;
    if gain <= 0.0 || most <= 0.0 {
        gain
    } else {
        (gain - most).max(0.0) - before * (1.0 - gain.min(most) / before).ln()
    }
}

/// Cost (weighted squared residuals) that the noise of positions alone gives, by joint.
pub(in crate::serial) fn floor(rows: &Rows, weights: &[f64]) -> Vec<f64> {
    let of = |(rows, w): (&JointRows, &f64)| w * rows.floor.iter().map(|f| f * f).sum::<f64>();
    rows.joints.iter().zip(weights).map(of).collect()
}

/// Slope of a regression, over `joints`, of the holdout residuals without a term on the part of them that the term removes, divided by the slope's
/// standard deviation from the scatter over blocks.
fn confirmed(joints: &[usize], weights: &[f64], rows: &Rows, [without, with]: [&Fitted; 2]) -> f64 {
    let mut information = 0.0;
    let mut product = 0.0;
    let mut blocks = vec![[0.0; 2]; rows.blocks];
    for j in joints.iter().copied() {
        for ((left, stays), block) in without.held[j].iter().zip(&with.held[j]).zip(&rows.joints[j].block) {
            let taken = left - stays;
            let [own, square] = [weights[j] * left * taken, weights[j] * taken * taken];
            product += own;
            information += square;
            blocks[*block][0] += own;
            blocks[*block][1] += square;
        }
    }
    let slope = product / information.max(f64::MIN_POSITIVE);
    let scores = blocks.iter().filter(|b| b[1] > 0.0).map(|[own, square]| own - slope * square);
    let (used, scatter) = scores.fold((0.0, 0.0), |(n, total), score| (n + 1.0, total + score * score));
    let small_sample = used / (used - 1.0_f64).max(1.0);
    slope * information / (small_sample * scatter).sqrt().max(f64::MIN_POSITIVE)
}

/// RMS of a torque signal relative to the RMS torque of the joint that it acts on, for the joint with the largest ratio.
pub(in crate::serial) fn consequence(rows: &Rows, signal: &Signal) -> f64 {
    relative(rows, signal, |s| mean_square(s).sqrt())
}

/// RMS of a torque signal where it acts, relative to the RMS torque of the joint that it acts on, for the joint with the largest ratio. Rows count by
/// the signal's square: friction at rest, or a joint limit, acts for a small part of the time.
pub(in crate::serial) fn where_it_acts(rows: &Rows, signal: &Signal) -> f64 {
    let fourth = |s: &[f64]| s.iter().map(|s| s.powi(4)).sum::<f64>() / s.len() as f64;
    relative(rows, signal, |s| (fourth(s) / mean_square(s).max(f64::MIN_POSITIVE)).sqrt())
}

fn mean_square(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64
}

/// A measure of a torque signal relative to the RMS torque of the joint that it acts on, for the joint with the largest ratio.
fn relative(rows: &Rows, signal: &Signal, measure: impl Fn(&[f64]) -> f64) -> f64 {
    let of = |(rows, s): (&JointRows, &Option<Vec<f64>>)| match s {
        Some(s) if !s.is_empty() => measure(s) / mean_square(&rows.y).max(f64::MIN_POSITIVE).sqrt(),
        _ => 0.0,
    };
    rows.joints.iter().zip(signal).map(of).fold(0.0, f64::max)
}

/// Share of resamples of the blocks of training logs and holdout in which the cost of a model, plus two per effective parameter, is below that of
/// each of the models `rivals`, 0 to 1.
pub(in crate::serial) fn stability(model: &Fitted, rivals: &[&Fitted], seed: u64) -> f64 {
    let by_block = |fitted: &Fitted| -> Vec<f64> {
        fitted
            .costs
            .iter()
            .flat_map(|set| {
                let blocks = set.first().map_or(0, Vec::len);
                (0..blocks).map(move |b| set.iter().map(|joint| joint[b]).sum::<f64>()).collect::<Vec<f64>>()
            })
            .collect()
    };
    let price = |fitted: &Fitted| fitted.estimate.prior_cost + 2.0 * fitted.parameters();
    let own = by_block(model);
    let apart: Vec<(Vec<f64>, f64)> = rivals
        .iter()
        .map(|r| (by_block(r).iter().zip(&own).map(|(a, b)| a - b).collect(), price(r) - price(model)))
        .collect();
    let mut random = Random(seed);
    let wins = (0..RESAMPLES)
        .filter(|_| {
            let draw: Vec<usize> = (0..own.len()).map(|_| random.below(own.len())).collect();
            apart.iter().all(|(d, fixed)| draw.iter().map(|b| d[*b]).sum::<f64>() + fixed > 0.0)
        })
        .count();
    wins as f64 / RESAMPLES as f64
}

/// Probability that a term is not merely a substitute for an effect missing in the library: the larger of two numbers. One is the part of a joint's
/// holdout cost that the term removes, over this part plus the cost left above that of noise (`floor`, by joint); the other grows with the decrease
/// of the parameters' distance from the arm file's values.
pub(in crate::serial) fn trust(without: &Fitted, with: &Fitted, evidence: &Evidence, floor: &[f64]) -> f64 {
    let joint = |set: &Fitted, j: usize| set.costs[1][j].iter().sum::<f64>();
    let own = (0..floor.len()).max_by(|a, b| {
        let fell = |j: usize| joint(without, j) - joint(with, j);
        fell(*a).total_cmp(&fell(*b))
    });
    let explains = own.map_or(0.0, |j| {
        let (fell, left) = (joint(without, j) - joint(with, j), (joint(with, j) - floor[j]).max(0.0));
        if fell > 0.0 { fell / (fell + left) } else { 0.0 }
    });
    let restores = 1.0 - (-evidence.relief.max(0.0) / RESTORES).exp();
    explains.max(restores)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;
    use crate::serial::weak_form::rows::Estimate;

    const ROWS: usize = 240;

    /// Test statistic of a term on simulated holdout residuals: `truth` plus noise without the term, less `taken` with the term, by index of the row.
    fn deviations(truth: impl Fn(usize) -> f64, taken: impl Fn(usize) -> f64) -> f64 {
        let mut random = Random(7);
        let noise: Vec<f64> = (0..ROWS).map(|_| 0.1 * random.normal()).collect();
        let fitted = |left: Vec<f64>| Fitted {
            terms: Vec::new(),
            estimate: Estimate { theta: vec![], residual: vec![], cost: 0.0, prior_cost: 0.0 },
            costs: [vec![], vec![]],
            held: vec![left],
        };
        let without = fitted((0..ROWS).map(|k| truth(k) + noise[k]).collect());
        let with = fitted((0..ROWS).map(|k| truth(k) + noise[k] - taken(k)).collect());
        let joint = JointRows {
            y: vec![0.0; ROWS],
            psi: vec![],
            block: (0..ROWS).map(|k| k / 20).collect(),
            floor: vec![0.1; ROWS],
        };
        let rows = Rows { joints: vec![joint], parameters: 0, blocks: ROWS / 20, independent: 10 };
        confirmed(&[0], &[1.0], &rows, [&without, &with])
    }

    #[test]
    fn small_gains_count_as_they_are_and_large_ones_by_the_likelihood() {
        assert!((likelihood_gain(1.0, 1e4) - 1.0).abs() < 1e-3);
        assert!((likelihood_gain(9.0, 10.0) - 10.0 * 10.0_f64.ln()).abs() < 1e-12);
        assert!(likelihood_gain(12.0, 10.0) > likelihood_gain(9.6, 10.0));
        assert!(likelihood_gain(12.0, 10.0).is_finite());
        assert_eq!((likelihood_gain(-3.0, 10.0), likelihood_gain(2.0, 0.0)), (-3.0, 2.0));
    }

    #[test]
    fn a_torque_counts_where_it_acts() {
        let signal = |torque: fn(usize) -> f64| vec![Some((0..ROWS).map(torque).collect::<Vec<f64>>())];
        let joint =
            JointRows { y: vec![1.0; ROWS], psi: vec![], block: vec![0; ROWS], floor: vec![0.1; ROWS] };
        let rows = Rows { joints: vec![joint], parameters: 0, blocks: 1, independent: 10 };
        let (always, at_times) = (signal(|_| 0.1), signal(|k| if k % 24 == 0 { 0.1 } else { 0.0 }));
        for of in [&always, &at_times] {
            assert!((where_it_acts(&rows, of) - 0.1).abs() < 1e-12);
        }
        assert!(consequence(&rows, &at_times) < 0.3 * consequence(&rows, &always));
        assert_eq!(where_it_acts(&rows, &vec![None]), 0.0);
    }

    #[test]
    fn an_effect_in_two_blocks_of_twelve_is_confirmed() {
        let stop = |k: usize| if k / 20 == 3 || k / 20 == 8 { 0.5 } else { 0.0 };
        assert!(deviations(stop, stop) > HOLDOUT_DEVIATIONS);
    }

    #[test]
    fn what_is_not_in_the_holdout_is_not_confirmed() {
        let wave = |k: usize| 0.1 * (0.4 * k as f64).sin();
        assert!(deviations(|_| 0.0, wave).abs() < HOLDOUT_DEVIATIONS);
    }

    #[test]
    fn one_block_alone_confirms_nothing() {
        let wave = |k: usize| (0.4 * k as f64).sin();
        assert!(deviations(|k| if k / 20 == 5 { 0.3 * wave(k) } else { 0.0 }, wave) < HOLDOUT_DEVIATIONS);
    }

    #[test]
    fn acceptance_needs_every_part_of_the_evidence() {
        let good = Evidence {
            parameters: 1.0,
            price: 12.0,
            gain: 100.0,
            relief: 0.0,
            statistic: 90.0,
            holdout_gain: 60.0,
            deviations: 5.0,
            share: 0.5,
            consequence: 0.1,
            instrumented: None,
            stretches: None,
        };
        assert!(good.is_accepted());
        for weak in [
            Evidence { statistic: 8.0, ..good },
            Evidence { statistic: 20.0, deviations: 3.5, ..good },
            Evidence { gain: 10.0, ..good },
            Evidence { deviations: 1.0, ..good },
            Evidence { share: 0.05, ..good },
            Evidence { consequence: 1e-3, ..good },
            // A torque that is computed from logged torques, and without the disturbances in them explains nothing.
            Evidence { instrumented: Some([0.1, 0.05]), ..good },
            Evidence { instrumented: Some([0.9, 0.3]), ..good },
            Evidence { stretches: Some([1.2, 0.6]), ..good },
        ] {
            assert!(!weak.is_accepted(), "{weak:?}");
        }
        assert!(Evidence { instrumented: Some([0.9, 0.1]), ..good }.is_accepted());
        assert!(Evidence { stretches: Some([1.2, 0.99]), ..good }.is_accepted());
        let restoring = Evidence { relief: 30.0, statistic: 0.0, deviations: 0.0, share: 0.0, ..good };
        assert!(restoring.is_accepted());
        assert!(!Evidence { deviations: -3.0, ..restoring }.is_accepted());
    }

    #[test]
    fn an_event_that_two_blocks_share_is_one_stretch() {
        let of = |gains: &[f64]| stretches(&gains.iter().map(|gain| [10.0, 10.0 - gain]).collect::<Vec<_>>());
        assert_eq!(of(&[0.0, 0.0, 5.0, 5.0, -1.0, 0.0]), [1.0, 0.5]);
        assert_eq!(of(&[0.0, 9.0, 9.0, 0.0]), [1.0, 0.9]);
        assert_eq!(of(&[5.0, 0.0, 0.0, 0.0, 5.0, 0.0])[0], 2.0);
        assert_eq!(of(&[1.0; 20])[0], 10.0);
        assert!(of(&[-1.0; 4])[0].is_infinite() && of(&[])[0].is_infinite());
    }
}
