//! What speaks for a term: the model with it against the model without, and what probability that makes.

use super::constants::{
    CONSEQUENCE, HOLDOUT_DEVIATIONS, MATTERS, PRICE, RESAMPLES, RESTORES, RESTORES_EACH, SIGNIFICANT,
};
use super::fitting::Fitted;
use super::rows::{JointRows, Regression, Rows, Signal};
use super::search::Search;
use crate::random::Random;

/// What speaks for a term: the model with it against the model without.
#[derive(Debug, Clone, Copy)]
pub struct Evidence {
    /// Number of its parameters.
    pub parameters: usize,
    /// Decrease of the training cost, prior included.
    pub gain: f64,
    /// Of it, decrease of the distance from the prior.
    pub relief: f64,
    /// Squared robust test statistic.
    pub statistic: f64,
    /// Decrease of the holdout's cost.
    pub holdout_gain: f64,
    /// Its mean over blocks in standard deviations.
    pub deviations: f64,
    /// Largest share of one joint's holdout cost that it takes.
    pub share: f64,
    /// Largest RMS torque beside that of the joint.
    pub consequence: f64,
}

impl Evidence {
    /// Whether the logs ask for the term by what it explains.
    pub fn explains(&self) -> bool {
        self.statistic > SIGNIFICANT
            && self.gain > PRICE * self.parameters as f64
            && self.deviations > HOLDOUT_DEVIATIONS
            && self.share > MATTERS
            && self.consequence > CONSEQUENCE
    }

    /// Whether it brings the arm's parameters back to where the arm file has them, and the holdout does not speak against it.
    pub fn restores(&self) -> bool {
        self.relief > RESTORES + RESTORES_EACH * self.parameters as f64
            && self.gain > PRICE + 2.0 * self.parameters as f64
            && self.deviations > -HOLDOUT_DEVIATIONS
            && self.consequence > CONSEQUENCE
    }

    /// Whether the term is accepted.
    pub fn is_accepted(&self) -> bool {
        self.explains() || self.restores()
    }
}

impl Search<'_> {
    /// What speaks for term `index` of `with` beside the model `without` it.
    pub(super) fn evidence(
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
            1.0 / regression.sandwich(&with.estimate, column, &score)[(0, 0)].max(f64::MIN_POSITIVE)
        });
        let joints = self.rotary.len();
        let blocks = without.costs[1].first().map_or(0, Vec::len);
        let fell: Vec<f64> = (0..blocks)
            .map(|b| (0..joints).map(|j| without.costs[1][j][b] - with.costs[1][j][b]).sum())
            .collect();
        let used = fell.iter().filter(|d| **d != 0.0).count().max(1) as f64;
        let total: f64 = fell.iter().sum();
        let mean = total / used;
        let variance = fell.iter().filter(|d| **d != 0.0).map(|d| (d - mean).powi(2)).sum::<f64>() / used;
        let share = (0..joints)
            .map(|j| {
                let before: f64 = without.costs[1][j].iter().sum();
                let after: f64 = with.costs[1][j].iter().sum();
                if before > 0.0 { (before - after) / before } else { 0.0 }
            })
            .fold(0.0, f64::max);
        Evidence {
            parameters: term.p.len(),
            gain: without.estimate.cost - with.estimate.cost,
            relief: without.estimate.prior_cost - with.estimate.prior_cost,
            statistic,
            holdout_gain: total,
            deviations: mean * used.sqrt() / variance.sqrt().max(f64::MIN_POSITIVE),
            share,
            consequence: consequence(self.training.rows(), &signal),
        }
    }
}

/// Largest RMS torque of a signal beside that of the joint it acts on.
pub(super) fn consequence(rows: &Rows, signal: &Signal) -> f64 {
    let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let of = |(rows, s): (&JointRows, &Option<Vec<f64>>)| match s {
        Some(s) if !s.is_empty() => (square(s) / square(&rows.y).max(f64::MIN_POSITIVE)).sqrt(),
        _ => 0.0,
    };
    rows.joints.iter().zip(signal).map(of).fold(0.0, f64::max)
}

/// Share of resamples of the blocks, of training and holdout, in which a model costs less than every rival.
pub(super) fn stability(model: &Fitted, rivals: &[&Fitted], seed: u64) -> f64 {
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
    let price = |fitted: &Fitted| {
        fitted.estimate.prior_cost + 2.0 * fitted.terms.iter().map(|t| t.p.len()).sum::<usize>() as f64
    };
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

/// Probability that what a term explains is not something that no term of the library is: its own part of the joint's holdout cost over
/// that and what stays beyond noise; of a term that restores the arm file's values, by how much it does.
pub(super) fn trust(without: &Fitted, with: &Fitted, evidence: &Evidence, floor: &[f64]) -> f64 {
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
