//! Fits of a serial arm's model with terms to the training logs, and their costs on the holdout.

use crate::serial::constants::{ENOUGH, LOOSE, MAX_TERM_ITERATIONS};
use crate::serial::search::{Motion, Search};
use crate::serial::term::row_term::{RowLaw, RowTerm};
use crate::serial::term::{Term, TermKind};
use crate::serial::weak_form::rows::{Estimate, Regression, Signal, sum};
use armgap_core::chain::LINK_PARAMETERS;
use rayon::prelude::*;

/// Relative step of a parameter in numerical derivatives of a term's torque.
const PARAMETER_STEP: f64 = 1e-3;

/// Prior precision (inverse variance) by which an amplitude that is not estimated is held at zero.
const HELD: f64 = 1e30;

/// A serial arm's model with terms, fitted to the training logs, with its costs on training logs and holdout.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Terms of the model, with fitted values.
    pub terms: Vec<Term>,
    /// Estimated parameters of the arm, with the residuals and the cost of the training logs.
    pub estimate: Estimate,
    /// Weighted squared residuals by joint and block: of the training logs, and of the holdout.
    pub costs: [Vec<Vec<f64>>; 2],
    /// Residuals of the holdout by joint and row, N m or N, scaled to the torque that reaches the joint ([`Search::scales`]).
    pub held: Vec<Vec<f64>>,
}

impl Fitted {
    /// Effective number of parameters of all terms of the model.
    pub(in crate::serial) fn parameters(&self) -> f64 {
        self.terms.iter().map(|t| t.degrees).sum()
    }

    pub(in crate::serial) fn holdout_cost(&self) -> f64 {
        self.costs[1].iter().flatten().sum()
    }

    /// Criterion that ranks models, less is better: cost of training logs, prior and holdout, plus two per effective parameter of the terms.
    pub(in crate::serial) fn total(&self) -> f64 {
        self.estimate.cost + self.holdout_cost() + 2.0 * self.parameters()
    }
}

impl Search<'_> {
    /// Whether the evidence accepts the term of index `index` in the model `with`, and friction with it dissipates ([`Term::dissipates`]).
    pub(in crate::serial) fn stands(
        &self,
        regression: &Regression,
        [without, with]: [&Fitted; 2],
        index: usize,
    ) -> bool {
        let coulomb = with.estimate.theta.get((LINK_PARAMETERS + 2) * self.rotary.len()..);
        self.evidence(regression, without, with, index).is_accepted()
            && with.terms[index].dissipates(coulomb.unwrap_or_default())
    }

    /// Sum of the torques of `terms` along the logs of `motion` at the arm's parameters `theta`, by joint and row, N m or N.
    pub(in crate::serial) fn beside(&self, motion: &dyn Motion, terms: &[Term], theta: &[f64]) -> Signal {
        if terms.is_empty() {
            return vec![None; self.rotary.len()];
        }
        let signals: Vec<Signal> = terms.iter().map(|t| motion.signal(t, theta)).collect();
        sum(motion.rows(), &signals)
    }

    /// Fits the parameters of the arm and of all terms to the training logs (variable projection, Golub and Pereyra 1973), from `theta`, and
    /// computes the costs on the holdout.
    pub fn fit(&self, regression: &Regression, terms: Vec<Term>, theta: &[f64]) -> Fitted {
        self.progress.check();
        let mut terms = terms;
        let mut estimate = self.estimated(regression, &terms, theta);
        for _ in 0..MAX_TERM_ITERATIONS {
            if terms.is_empty() {
                break;
            }
            let theta = estimate.theta.clone();
            // Torques of terms may depend on the parameters: costs are compared at the same ones.
            estimate = self.estimated(regression, &terms, &theta);
            let columns = self.derivatives(&terms, &theta);
            let Some(score) = regression.score(&estimate, &columns, &self.ridge(&terms, regression)) else {
                break;
            };
            let mut better = None;
            for part in [1.0, 0.5, 0.2, 0.05] {
                let moved = self.moved(&terms, &score.size, part);
                let there = self.estimated(regression, &moved, &theta);
                if there.cost < estimate.cost {
                    better = Some((moved, there));
                    break;
                }
            }
            let Some((moved, there)) = better else { break };
            let fell = estimate.cost - there.cost;
            let is_enough = fell < ENOUGH * estimate.cost;
            (terms, estimate) = (moved, there);
            if is_enough {
                break;
            }
        }
        let beside = self.beside(self.holdout, &terms, &estimate.theta);
        let held = self.holdout.rows().residual(&estimate.theta, &beside);
        let scaled = |motion: &dyn Motion, residual: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let scales = self.scales(motion, &terms, &estimate.theta);
            residual
                .iter()
                .zip(scales)
                .map(|(r, scale)| r.iter().map(|r| scale.sqrt() * r).collect())
                .collect()
        };
        let held = scaled(self.holdout, &held);
        let costs =
            |motion: &dyn Motion, residual: &[Vec<f64>]| motion.rows().costs(&regression.weights, residual);
        let costs =
            [costs(self.training, &scaled(self.training, &estimate.residual)), costs(self.holdout, &held)];
        Fitted { terms, estimate, costs, held }
    }

    /// Estimate of the arm's parameters with terms added at fixed values, with the cost scaled to the torque that reaches the joints.
    pub(in crate::serial) fn estimated(
        &self,
        regression: &Regression,
        terms: &[Term],
        theta: &[f64],
    ) -> Estimate {
        let mut estimate = regression.estimate(&self.beside(self.training, terms, theta));
        let scales = self.scales(self.training, terms, &estimate.theta);
        if scales.iter().any(|scale| *scale != 1.0) {
            let data = |(j, r): (usize, &Vec<f64>)| {
                scales[j] * regression.weights[j] * r.iter().map(|r| r * r).sum::<f64>()
            };
            estimate.cost = estimate.prior_cost + estimate.residual.iter().enumerate().map(data).sum::<f64>();
        }
        estimate
    }

    /// Factor on the squared residuals of each joint, for terms that change the torque that a command gives: residuals are compared relative to
    /// the torque that reaches the joint and to the inertia that it moves. A term that makes torques, and with them all parameters, smaller also
    /// makes the residuals smaller, and explains nothing by that.
    pub(in crate::serial) fn scales(&self, motion: &dyn Motion, terms: &[Term], theta: &[f64]) -> Vec<f64> {
        let mut scales = vec![1.0; self.rotary.len()];
        let taken = |term: &Term| match (term.share_of_command(), term.joint()) {
            (Some(share), Some(joint)) => {
                let y = &motion.rows().joints[joint - 1].y;
                let mut taken: Signal = vec![None; self.rotary.len()];
                taken[joint - 1] = Some(y.iter().map(|y| (1.0 - share) * y).collect());
                taken
            }
            _ => motion.signal(term, theta),
        };
        let members = terms.iter().filter(|t| t.changes_command()).flat_map(Term::members);
        let changing: Vec<Signal> = members.map(|term| taken(&term)).collect();
        if changing.is_empty() {
            return scales;
        }
        let square = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x * x).sum::<f64>();
        let moved = [&self.prior.theta[..], theta].map(|theta| motion.inertia(theta));
        for (j, signal) in sum(motion.rows(), &changing).iter().enumerate() {
            let Some(signal) = signal else { continue };
            let y = &motion.rows().joints[j].y;
            let reaching = square(&mut y.iter().zip(signal).map(|(y, s)| y - s));
            let torque = square(&mut y.iter().copied()) / reaching.max(f64::MIN_POSITIVE);
            let inertia = (moved[0][j] / moved[1][j]).powi(2);
            scales[j] = if inertia.is_finite() { torque.max(inertia) } else { torque };
        }
        scales
    }

    pub(in crate::serial) fn rotary_of(&self, term: &Term) -> bool {
        term.joints().first().is_none_or(|j| self.rotary[j - 1])
    }

    /// Terms with their parameters changed by the fraction `part` of `step`, which holds a value per parameter, term after term; the parameters stay
    /// within their bounds.
    pub(in crate::serial) fn moved(&self, terms: &[Term], step: &[f64], part: f64) -> Vec<Term> {
        let mut rest = step;
        terms
            .iter()
            .map(|term| {
                let (own, others) = rest.split_at(term.p.len().min(rest.len()));
                rest = others;
                self.moved_one(term, own, part)
            })
            .collect()
    }

    /// A term with its parameters changed by the fraction `part` of `step`, which holds a value per parameter; the parameters stay within their
    /// bounds.
    fn moved_one(&self, term: &Term, step: &[f64], part: f64) -> Term {
        let bounds = term.parameters(self.rotary_of(term));
        let p = term.p.iter().zip(&bounds).enumerate().map(|(i, (p, b))| {
            let by = part * step.get(i).copied().unwrap_or(0.0);
            // A shape or a threshold changes by no more than a factor of two in one step.
            let by = if *p == 0.0 || b.neutral == 0.0 && p.abs() < by.abs() && term.amplitudes() > 0 {
                by
            } else if term.amplitudes() == 0 && p.abs() > 0.0 {
                p.signum() * (p.signum() * by).clamp(-0.5 * p.abs(), p.abs())
            } else {
                by
            };
            (p + by).clamp(b.bounds[0], b.bounds[1])
        });
        term.with(p.collect())
    }

    /// Derivatives of the terms' torques along the training logs, one for each parameter of the terms, each by joint and row of the weak form.
    pub(in crate::serial) fn derivatives(&self, terms: &[Term], theta: &[f64]) -> Vec<Signal> {
        let places: Vec<(usize, usize)> =
            terms.iter().enumerate().flat_map(|(i, t)| (0..t.p.len()).map(move |k| (i, k))).collect();
        places
            .par_iter()
            .map(|&(i, k)| {
                let (term, k) = terms[i].moved_by(k);
                let step = PARAMETER_STEP * if term.p[k] == 0.0 { 1.0 } else { term.p[k].abs() };
                let at = |sign: f64| {
                    let mut p = term.p.clone();
                    p[k] += sign * step;
                    self.training.signal(&term.with(p), theta)
                };
                difference(&at(1.0), &at(-1.0), 2.0 * step)
            })
            .collect()
    }

    /// Prior precision (inverse variance) of each parameter of the terms, for parameters that motion does not determine.
    pub(in crate::serial) fn ridge(&self, terms: &[Term], regression: &Regression) -> Vec<f64> {
        terms.iter().flat_map(|term| self.ridge_of(term, term.p.len(), regression)).collect()
    }

    /// Prior precision (inverse variance) of the first `columns` parameters of a term: for a changed link from the arm file's standard deviations,
    /// for parameters that are not estimated so large that they stay zero, for the steps of a table's torques as if each class had one further row
    /// with a typical factor, else zero.
    pub(in crate::serial) fn ridge_of(
        &self,
        term: &Term,
        columns: usize,
        regression: &Regression,
    ) -> Vec<f64> {
        match term.kind {
            TermKind::NominalLink(link) => {
                let sigma = &self.prior.sigma[10 * link..];
                (0..columns).map(|i| if sigma[i] > 0.0 { (LOOSE * sigma[i]).powi(-2) } else { 0.0 }).collect()
            }
            TermKind::Row(RowTerm { law: RowLaw::Transmission(free), .. }) => {
                free.iter().map(|free| if *free { 0.0 } else { HELD }).take(columns).collect()
            }
            TermKind::Table(ref table) => {
                vec![(regression.weights[table.joint] * table.factor_square).max(f64::MIN_POSITIVE); columns]
            }
            _ => vec![0.0; columns],
        }
    }
}

/// Difference of two torque signals divided by a step; a missing signal counts as zero.
pub(in crate::serial) fn difference(a: &Signal, b: &Signal, step: f64) -> Signal {
    a.iter()
        .zip(b)
        .map(|(a, b)| match (a, b) {
            (Some(a), Some(b)) => Some(a.iter().zip(b).map(|(a, b)| (a - b) / step).collect()),
            (Some(a), None) => Some(a.iter().map(|a| a / step).collect()),
            (None, Some(b)) => Some(b.iter().map(|b| -b / step).collect()),
            (None, None) => None,
        })
        .collect()
}
