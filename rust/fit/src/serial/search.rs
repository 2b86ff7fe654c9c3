//! Which terms a serial arm's model lacks: added one after another, swapped for rivals, dropped when idle.

use super::constants::{
    ALIKE, ALIKE_COST, ARM_WIDE, CONSEQUENCE, ENOUGH, FINALISTS, HOLDOUT_DEVIATIONS, ITERATIONS, LOOSE,
    MATTERS, NAMED, PRICE, RESAMPLES, RESTORES, RESTORES_EACH, SIGNIFICANT,
};
use super::rows::{Estimate, Prior, Regression, Rows, Signal, sum};
use super::term::{Term, TermKind};
use crate::progress::{Phase, ProgressReporter};
use crate::random::Random;
use armgap_core::effect::Trial;
use rayon::prelude::*;

/// Relative step of numerical derivatives of a term's torque.
const STEP: f64 = 1e-3;

/// A first-order test is not trusted farther than so many initial guesses.
const FARTHEST: f64 = 50.0;

/// Rows of an arm along some logs, and the torques of terms along them.
pub trait Motion: Sync {
    /// The rows.
    fn rows(&self) -> &Rows;
    /// Torque of a term, given the arm's parameters.
    fn signal(&self, term: &Term, theta: &[f64]) -> Signal;
    /// Mean inertia of every joint along the logs.
    fn inertia(&self, theta: &[f64]) -> Vec<f64>;
}

/// What a search works with.
pub struct Search<'a> {
    /// Logs that terms are fitted to.
    pub training: &'a dyn Motion,
    /// Logs that they are judged on.
    pub holdout: &'a dyn Motion,
    /// Prior of the arm's parameters.
    pub prior: &'a Prior,
    /// Every term at its initial guesses, grouped by place.
    pub candidates: Vec<Vec<Term>>,
    /// Whether each joint turns.
    pub rotary: Vec<bool>,
    /// Sample period, s. A delay or lag below it is the way in which torques and positions were sampled, and is not named.
    pub period: f64,
    /// Whether an arm with these parameters has a positive definite inertia matrix along its logs.
    pub is_feasible: &'a (dyn Fn(&[f64]) -> bool + Sync),
    /// Progress report and cancellation.
    pub progress: &'a ProgressReporter,
}

/// A term at an initial guess with the torques of its first-order test, along the training logs.
struct Guess {
    term: Term,
    columns: Vec<Signal>,
}

/// A model with terms, fitted to the training logs and judged on the holdout.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Its terms.
    pub terms: Vec<Term>,
    /// Parameters and what they leave of the training logs.
    pub estimate: Estimate,
    /// Weighted squared residuals by joint and block: training, holdout.
    pub costs: [Vec<Vec<f64>>; 2],
}

impl Fitted {
    fn holdout_cost(&self) -> f64 {
        self.costs[1].iter().flatten().sum()
    }

    /// What ranks models: cost of training logs, prior and holdout, and the price of its parameters.
    fn total(&self) -> f64 {
        let parameters: usize = self.terms.iter().map(|t| t.p.len()).sum();
        self.estimate.cost + self.holdout_cost() + 2.0 * parameters as f64
    }
}

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

/// A term of the final model with what it rests on.
#[derive(Debug, Clone)]
pub struct Named {
    /// The term.
    pub term: Term,
    /// Standard deviations of its parameters.
    pub sigma: Vec<f64>,
    /// What speaks for it.
    pub evidence: Evidence,
    /// Probability that it, or one of its look-alikes, is in the arm.
    pub probability: f64,
    /// Terms that explain the same.
    pub alike: Vec<Term>,
}

/// Tests of a place that is not in the final model.
#[derive(Debug, Clone)]
pub struct Tested {
    /// The term at its best guess.
    pub term: Term,
    /// Size and its robust standard deviation, relative to the term as given.
    pub size: [f64; 2],
    /// RMS of its torque beside that of the joint's, per unit of size.
    pub consequence: f64,
}

/// The end of a search.
pub struct Found {
    /// The arm's own parameters, without terms.
    pub refit: Fitted,
    /// The model with all terms.
    pub model: Fitted,
    /// Its terms, strongest first.
    pub named: Vec<Named>,
    /// The model with those of them alone that are probable enough to be named.
    pub reported: Fitted,
    /// All other places, tested beside the final model.
    pub tested: Vec<Tested>,
    /// Standard deviations of the arm's parameters: re-estimated, and with the terms.
    pub sigma: [Vec<f64>; 2],
}

impl Search<'_> {
    /// Runs the search for `most` decisions at most.
    pub fn run(&self, most: usize, seed: u64) -> Found {
        self.progress.begin(Phase::Refit, 1);
        let none = vec![None; self.rotary.len()];
        let mut regression = Regression::reweighted(self.training.rows(), self.prior, &none);
        let mut model = self.fit(&regression, Vec::new(), &self.prior.theta);
        let refit = model.clone();
        let sigma = regression.sigma();
        let guesses = self.guesses(&model.estimate.theta);
        for _ in 0..most {
            let Some(added) = self.best_addition(&guesses, &regression, &model) else { break };
            let mut terms = model.terms.clone();
            terms.extend(added);
            let beside = self.beside(self.training, &terms, &model.estimate.theta);
            regression = Regression::reweighted(self.training.rows(), self.prior, &beside);
            model = self.without_idle(&regression, self.fit(&regression, terms, &model.estimate.theta));
            model = self.swapped(&guesses, &regression, model);
        }
        if model.terms.iter().any(|term| self.is_sampling(term)) {
            let kept = model.terms.iter().filter(|term| !self.is_sampling(term)).cloned().collect();
            model = self.fit(&regression, kept, &model.estimate.theta);
        }
        self.concluded(&guesses, &regression, [refit, model], sigma, seed)
    }

    /// Torques of all terms together.
    fn beside(&self, motion: &dyn Motion, terms: &[Term], theta: &[f64]) -> Signal {
        if terms.is_empty() {
            return vec![None; self.rotary.len()];
        }
        let signals: Vec<Signal> = terms.iter().map(|t| motion.signal(t, theta)).collect();
        sum(motion.rows(), &signals)
    }

    /// Fits the arm's parameters and those of all terms to the training logs (variable projection, Golub and Pereyra 1973), and judges them on
    /// the holdout.
    pub fn fit(&self, regression: &Regression, terms: Vec<Term>, theta: &[f64]) -> Fitted {
        self.progress.check();
        let mut terms = terms;
        let mut estimate = self.estimated(regression, &terms, theta);
        for _ in 0..ITERATIONS {
            if terms.is_empty() {
                break;
            }
            let theta = estimate.theta.clone();
            let columns = self.derivatives(&terms, &theta);
            let Some(score) = regression.score(&estimate, &columns, &self.ridge(&terms)) else { break };
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
        let scaled = |motion: &dyn Motion, residual: &[Vec<f64>]| {
            let mut costs = motion.rows().costs(&regression.weights, residual);
            for (costs, scale) in costs.iter_mut().zip(self.scales(motion, &terms, &estimate.theta)) {
                for cost in costs {
                    *cost *= scale;
                }
            }
            costs
        };
        let costs = [scaled(self.training, &estimate.residual), scaled(self.holdout, &held)];
        Fitted { terms, estimate, costs }
    }

    /// Parameters beside these terms, and the cost in units of the torque that reaches the joints.
    fn estimated(&self, regression: &Regression, terms: &[Term], theta: &[f64]) -> Estimate {
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

    /// By joint, the factor between squared residuals with these terms and without, for terms that change what a command becomes: what they leave
    /// is to be seen beside the torque that reaches the joint, and beside the inertia that it moves. A term that makes torques smaller, and with them
    /// all parameters, makes what stays of them smaller too, and explains nothing by that.
    fn scales(&self, motion: &dyn Motion, terms: &[Term], theta: &[f64]) -> Vec<f64> {
        let mut scales = vec![1.0; self.rotary.len()];
        let changing: Vec<Signal> =
            terms.iter().filter(|t| t.changes_command()).map(|t| motion.signal(t, theta)).collect();
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

    fn rotary_of(&self, term: &Term) -> bool {
        term.joint().is_none_or(|j| self.rotary[j - 1])
    }

    /// Terms moved by part of a step, within their bounds.
    fn moved(&self, terms: &[Term], step: &[f64], part: f64) -> Vec<Term> {
        let mut rest = step.iter();
        terms
            .iter()
            .map(|term| {
                let bounds = term.parameters(self.rotary_of(term));
                let p = term
                    .p
                    .iter()
                    .zip(&bounds)
                    .map(|(p, b)| {
                        let by = part * rest.next().copied().unwrap_or(0.0);
                        // A shape or a threshold changes by no more than a factor of two in one step.
                        let by =
                            if *p == 0.0 || b.neutral == 0.0 && p.abs() < by.abs() && term.amplitudes() > 0 {
                                by
                            } else if term.amplitudes() == 0 && p.abs() > 0.0 {
                                by.clamp(-0.5 * p.abs(), p.abs())
                            } else {
                                by
                            };
                        (p + by).clamp(b.bounds[0], b.bounds[1])
                    })
                    .collect();
                term.with(p)
            })
            .collect()
    }

    /// Derivatives of the terms' torques by all their parameters.
    fn derivatives(&self, terms: &[Term], theta: &[f64]) -> Vec<Signal> {
        let places: Vec<(usize, usize)> =
            terms.iter().enumerate().flat_map(|(i, t)| (0..t.p.len()).map(move |k| (i, k))).collect();
        places
            .par_iter()
            .map(|&(i, k)| {
                let term = &terms[i];
                let step = STEP * if term.p[k] == 0.0 { 1.0 } else { term.p[k].abs() };
                let at = |sign: f64| {
                    let mut p = term.p.clone();
                    p[k] += sign * step;
                    self.training.signal(&term.with(p), theta)
                };
                difference(&at(1.0), &at(-1.0), 2.0 * step)
            })
            .collect()
    }

    /// Every candidate at every initial guess with the torques that test it.
    fn guesses(&self, theta: &[f64]) -> Vec<Vec<Guess>> {
        let columns = |term: &Term| -> Vec<Signal> {
            match term.kind {
                TermKind::Payload => {
                    let link = Term::neutral(TermKind::NominalLink(self.rotary.len() - 1));
                    (0..term.p.len()).map(|i| self.unit(&link, i, theta)).collect()
                }
                TermKind::Law(effect) if effect.is_periodic() => {
                    let at =
                        |phase: f64| self.training.signal(&term.with(vec![1.0, term.p[1], phase]), theta);
                    vec![at(0.0), at(std::f64::consts::FRAC_PI_2)]
                }
                _ if term.amplitudes() == 0 => vec![self.training.signal(term, theta)],
                _ => (0..term.amplitudes()).map(|i| self.unit(term, i, theta)).collect(),
            }
        };
        let guess = |term: &Term| Guess { term: term.clone(), columns: columns(term) };
        self.candidates.par_iter().map(|group| group.iter().map(guess).collect()).collect()
    }

    /// Tests a term to first order; returns it with the values that the test suggests, and the decrease of the cost.
    fn test(&self, regression: &Regression, at: &Estimate, guess: &Guess) -> Option<(Term, f64)> {
        let term = &guess.term;
        let bounds = term.parameters(self.rotary_of(term));
        let within = |p: &[f64]| p.iter().zip(&bounds).all(|(p, b)| *p >= b.bounds[0] && *p <= b.bounds[1]);
        let score = regression.score(at, &guess.columns, &self.ridge_of(term, guess.columns.len()))?;
        if let TermKind::Payload = term.kind {
            let mass = score.size[0];
            let p: Vec<f64> =
                score.size.iter().enumerate().map(|(i, x)| if i == 0 { *x } else { x / mass }).collect();
            return (mass > 0.0).then(|| (term.with(p), score.gain));
        }
        if matches!(term.kind, TermKind::Law(effect) if effect.is_periodic()) {
            let (sine, cosine) = (score.size[0], score.size[1]);
            return Some((term.with(vec![sine.hypot(cosine), term.p[1], cosine.atan2(sine)]), score.gain));
        }
        let count = term.amplitudes();
        if count > 0 {
            let mut p = term.p.clone();
            for i in 0..count {
                p[i] = bounds[i].neutral + score.size[i];
            }
            return within(&p).then(|| (term.with(p), score.gain));
        }
        let TermKind::Law(effect) = term.kind else { return None };
        let size = score.size[0];
        let information = score.gain / (size * size).max(f64::MIN_POSITIVE);
        let (p, size) = match effect.law.spec().trial {
            // A threshold has no small version of itself.
            Trial::Whole => (term.p.clone(), 1.0),
            Trial::Ray => {
                let share = size.clamp(0.0, FARTHEST);
                (term.p.iter().map(|p| p * share).collect(), share)
            }
            _ => {
                let neutral = bounds[0].neutral;
                let mut p = term.p.clone();
                p[0] = (neutral + size.clamp(-FARTHEST, FARTHEST) * (p[0] - neutral))
                    .clamp(bounds[0].bounds[0], bounds[0].bounds[1]);
                let share = (p[0] - neutral) / (term.p[0] - neutral);
                (p, share)
            }
        };
        let mut gain = (2.0 * score.size[0] - size) * size * information;
        let term = term.with(p);
        if term.changes_command() {
            let j = effect.joint;
            let before = regression.weights[j] * at.residual[j].iter().map(|r| r * r).sum::<f64>();
            gain = before
                - (before - gain) * self.scales(self.training, std::slice::from_ref(&term), &at.theta)[j];
        }
        (gain > 0.0 && within(&term.p)).then_some((term, gain))
    }

    /// Torque per unit of one amplitude, the others switched off.
    fn unit(&self, term: &Term, amplitude: usize, theta: &[f64]) -> Signal {
        let neutral = term.parameters(self.rotary_of(term));
        let mut p = term.p.clone();
        for (i, value) in p.iter_mut().enumerate().take(term.amplitudes()) {
            *value = neutral[i].neutral + if i == amplitude { 1.0 } else { 0.0 };
        }
        self.training.signal(&term.with(p), theta)
    }

    /// Best initial guess of every place that is not in the model, best first.
    fn screened(&self, guesses: &[Vec<Guess>], regression: &Regression, model: &Fitted) -> Vec<(Term, f64)> {
        let open: Vec<&Vec<Guess>> = guesses
            .iter()
            .filter(|group| !model.terms.iter().any(|t| group.first().is_some_and(|g| g.term.same_place(t))))
            .collect();
        self.progress.begin(Phase::Screen, open.len());
        let mut found: Vec<(Term, f64)> = open
            .par_iter()
            .filter_map(|group| {
                self.progress.unit();
                let tests = group.iter().filter_map(|guess| self.test(regression, &model.estimate, guess));
                tests.max_by(|a, b| a.1.total_cmp(&b.1))
            })
            .filter(|(_, gain)| gain.is_finite())
            .collect();
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found
    }

    /// Models with one more term each, fitted: the finalists of the screening.
    fn finalists(&self, regression: &Regression, model: &Fitted, screened: &[(Term, f64)]) -> Vec<Fitted> {
        let worth = |(term, gain): &&(Term, f64)| *gain > PRICE + 2.0 * term.p.len() as f64;
        let wanted: Vec<&(Term, f64)> = screened.iter().filter(worth).take(FINALISTS).collect();
        self.progress.begin(Phase::Candidates, wanted.len());
        wanted
            .par_iter()
            .map(|(term, _)| {
                self.progress.unit();
                let mut terms = model.terms.clone();
                terms.push(term.clone());
                self.fit(regression, terms, &model.estimate.theta)
            })
            .collect()
    }

    /// The terms of the best decision; none where no candidate is accepted.
    fn best_addition(
        &self,
        guesses: &[Vec<Guess>],
        regression: &Regression,
        model: &Fitted,
    ) -> Option<Vec<Term>> {
        let screened = self.screened(guesses, regression, model);
        let fitted = self.finalists(regression, model, &screened);
        let last = model.terms.len();
        let accepted: Vec<&Fitted> =
            fitted.iter().filter(|with| self.evidence(regression, model, with, last).is_accepted()).collect();
        let best = accepted.iter().min_by(|a, b| a.total().total_cmp(&b.total()))?;
        let term = &best.terms[last];
        Some(self.everywhere(regression, model, &screened, term).unwrap_or_else(|| vec![term.clone()]))
    }

    /// The same law on every joint where it is accepted, if these are enough to be one cause of the whole arm.
    fn everywhere(
        &self,
        regression: &Regression,
        model: &Fitted,
        screened: &[(Term, f64)],
        best: &Term,
    ) -> Option<Vec<Term>> {
        if !best.is_of_a_joint() {
            return None;
        }
        let last = model.terms.len();
        let moving = self.training.rows().joints.iter().filter(|r| !r.y.is_empty()).count();
        let alike: Vec<&Term> = screened
            .iter()
            .map(|(t, _)| t)
            .filter(|t| t.name() == best.name() && !t.same_place(best))
            .collect();
        let mut all: Vec<Term> = alike
            .par_iter()
            .filter_map(|term| {
                let mut terms = model.terms.clone();
                terms.push((*term).clone());
                let with = self.fit(regression, terms, &model.estimate.theta);
                let accepted = self.is_accepted(regression, [model, &with], last);
                accepted.then(|| with.terms[last].clone())
            })
            .collect();
        all.push(best.clone());
        let enough = (ARM_WIDE * moving as f64).max(2.0);
        (all.len() as f64 >= enough).then_some(all)
    }

    /// Precision that holds what motion does not tell of the values of these terms.
    fn ridge(&self, terms: &[Term]) -> Vec<f64> {
        terms.iter().flat_map(|term| self.ridge_of(term, term.p.len())).collect()
    }

    /// The same of one term with so many columns: of a link's ten numbers by the arm file's trust in them, of laws none.
    fn ridge_of(&self, term: &Term, columns: usize) -> Vec<f64> {
        match term.kind {
            TermKind::NominalLink(link) => {
                let sigma = &self.prior.sigma[10 * link..];
                (0..columns).map(|i| if sigma[i] > 0.0 { (LOOSE * sigma[i]).powi(-2) } else { 0.0 }).collect()
            }
            _ => vec![0.0; columns],
        }
    }

    /// Whether term `index` of the second model is accepted beside the first, which lacks it.
    fn is_accepted(&self, regression: &Regression, [without, with]: [&Fitted; 2], index: usize) -> bool {
        !self.is_sampling(&with.terms[index]) && self.evidence(regression, without, with, index).is_accepted()
    }

    /// Whether a term is a delay or lag of less than a sample period.
    fn is_sampling(&self, term: &Term) -> bool {
        ["actuator_delay", "actuator_lag"].contains(&term.name()) && term.p[0] < self.period
    }

    /// What speaks for term `index` of `with` beside the model `without` it.
    fn evidence(&self, regression: &Regression, without: &Fitted, with: &Fitted, index: usize) -> Evidence {
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

    /// The model without term `index`, fitted.
    fn without(&self, regression: &Regression, model: &Fitted, index: usize) -> Fitted {
        let mut terms = model.terms.clone();
        terms.remove(index);
        self.fit(regression, terms, &model.estimate.theta)
    }

    /// Drops terms that are not accepted beside the others.
    fn without_idle(&self, regression: &Regression, model: Fitted) -> Fitted {
        let mut model = model;
        let mut index = 0;
        while index + 1 < model.terms.len() {
            let without = self.without(regression, &model, index);
            if self.is_accepted(regression, [&without, &model], index) {
                index += 1;
            } else {
                model = without;
            }
        }
        model
    }

    /// Puts a rival in the place of a term where the others beside it leave less.
    fn swapped(&self, guesses: &[Vec<Guess>], regression: &Regression, model: Fitted) -> Fitted {
        let mut model = model;
        for index in 0..model.terms.len() {
            if model.terms.len() < 2 {
                break;
            }
            let without = self.without(regression, &model, index);
            let screened = self.screened(guesses, regression, &without);
            let last = without.terms.len();
            let rival = self
                .finalists(regression, &without, &screened)
                .into_iter()
                .filter(|with| self.is_accepted(regression, [&without, with], last))
                .min_by(|a, b| a.total().total_cmp(&b.total()));
            if let Some(rival) = rival
                && rival.total() < model.total() - ALIKE_COST
                && !rival.terms[last].same_place(&model.terms[index])
            {
                model = rival;
            }
        }
        model
    }

    /// Probabilities, look-alikes, and tests of what is not in the model.
    fn concluded(
        &self,
        guesses: &[Vec<Guess>],
        regression: &Regression,
        [refit, model]: [Fitted; 2],
        refit_sigma: Vec<f64>,
        seed: u64,
    ) -> Found {
        let mut named: Vec<Named> =
            (0..model.terms.len()).map(|i| self.named(guesses, regression, &model, i, seed)).collect();
        named.sort_by(|a, b| {
            (b.evidence.gain + b.evidence.holdout_gain)
                .total_cmp(&(a.evidence.gain + a.evidence.holdout_gain))
        });
        let tested = self.tested(guesses, regression, &model);
        // Re-estimated costs are comparable only under the same weights.
        let refit = if model.terms.is_empty() {
            refit
        } else {
            self.fit(regression, Vec::new(), &refit.estimate.theta)
        };
        let probable = named.iter().filter(|n| n.probability >= NAMED).map(|n| n.term.clone()).collect();
        let reported = self.feasible(regression, self.fit(regression, probable, &model.estimate.theta));
        let refit = self.feasible(regression, refit);
        Found { refit, named, reported, tested, sigma: [refit_sigma, regression.sigma()], model }
    }

    /// A model whose links are so near to those of the arm file that the inertia matrix is positive definite, with rotor inertias and friction
    /// estimated again.
    fn feasible(&self, regression: &Regression, model: Fitted) -> Fitted {
        if (self.is_feasible)(&model.estimate.theta) {
            return model;
        }
        let links = model.estimate.theta.len() - 3 * self.rotary.len();
        let mut prior = self.prior.clone();
        for part in [0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0] {
            for i in 0..links {
                let nominal = self.prior.theta[i];
                prior.theta[i] = nominal + part * (model.estimate.theta[i] - nominal);
                prior.sigma[i] = 0.0;
            }
            let near = Regression::new(self.training.rows(), &prior, regression.weights.clone());
            let fitted = self.fit(&near, model.terms.clone(), &prior.theta);
            if (self.is_feasible)(&fitted.estimate.theta) {
                return fitted;
            }
        }
        model
    }

    /// Cost that noisy positions alone put into the holdout's rows, by joint.
    fn floor(&self, regression: &Regression) -> Vec<f64> {
        let of =
            |(rows, w): (&super::rows::JointRows, &f64)| w * rows.floor.iter().map(|f| f * f).sum::<f64>();
        self.holdout.rows().joints.iter().zip(&regression.weights).map(of).collect()
    }

    fn named(
        &self,
        guesses: &[Vec<Guess>],
        regression: &Regression,
        model: &Fitted,
        index: usize,
        seed: u64,
    ) -> Named {
        let term = model.terms[index].clone();
        let without = self.without(regression, model, index);
        let evidence = self.evidence(regression, &without, model, index);
        let mut rivals = self.finalists(regression, &without, &self.screened(guesses, regression, &without));
        let last = without.terms.len();
        rivals.retain(|r| !r.terms[last].same_place(&term));
        let explained = without.total() - model.total();
        let alike = |rival: &Fitted| rival.total() - model.total() < (ALIKE * explained).max(ALIKE_COST);
        let (same, others): (Vec<Fitted>, Vec<Fitted>) = rivals.into_iter().partition(alike);
        let mut against: Vec<&Fitted> = others.iter().collect();
        against.push(&without);
        let wins = stability(model, &against, seed);
        let trust = trust(&without, model, &evidence, &self.floor(regression));
        let columns = self.derivatives(std::slice::from_ref(&term), &model.estimate.theta);
        let sigma =
            regression.score(&model.estimate, &columns, &self.ridge_of(&term, columns.len())).map_or_else(
                || vec![f64::INFINITY; term.p.len()],
                |score| {
                    let covariance = regression.sandwich(&model.estimate, &columns, &score);
                    // Blocks do not show how far the arm file's values are off; the information does, which holds their prior.
                    let variance = |i: usize| covariance[(i, i)].max(score.inverse()[(i, i)]).max(0.0);
                    (0..term.p.len()).map(|i| variance(i).sqrt()).collect()
                },
            );
        let alike = same.into_iter().map(|r| r.terms[last].clone()).collect();
        Named { term, sigma, evidence, probability: wins * trust, alike }
    }

    /// Tests of every place that is not in the model, beside it.
    fn tested(&self, guesses: &[Vec<Guess>], regression: &Regression, model: &Fitted) -> Vec<Tested> {
        let screened = self.screened(guesses, regression, model);
        let open = self.candidates.iter().filter_map(|group| group.first());
        open.filter(|term| !model.terms.iter().any(|t| t.same_place(term)))
            .map(|first| {
                let found = screened.iter().find(|(t, _)| t.same_place(first));
                let term = found.map_or_else(|| first.clone(), |(t, _)| t.clone());
                let signal = self.training.signal(&term, &model.estimate.theta);
                let column = std::slice::from_ref(&signal);
                let score = regression.score(&model.estimate, column, &[0.0]);
                let size = score.map_or([0.0, f64::INFINITY], |score| {
                    let sigma = regression.sandwich(&model.estimate, column, &score)[(0, 0)].max(0.0).sqrt();
                    [score.size[0], sigma]
                });
                let consequence = consequence(self.training.rows(), &signal);
                Tested { term, size, consequence }
            })
            .collect()
    }
}

/// Difference of two signals over a step.
fn difference(a: &Signal, b: &Signal, step: f64) -> Signal {
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

/// Largest RMS torque of a signal beside that of the joint it acts on.
fn consequence(rows: &Rows, signal: &Signal) -> f64 {
    let square = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>();
    let of = |(rows, s): (&super::rows::JointRows, &Option<Vec<f64>>)| match s {
        Some(s) if !s.is_empty() => (square(s) / square(&rows.y).max(f64::MIN_POSITIVE)).sqrt(),
        _ => 0.0,
    };
    rows.joints.iter().zip(signal).map(of).fold(0.0, f64::max)
}

/// Share of resamples of the blocks, of training and holdout, in which a model costs less than every rival.
fn stability(model: &Fitted, rivals: &[&Fitted], seed: u64) -> f64 {
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
fn trust(without: &Fitted, with: &Fitted, evidence: &Evidence, floor: &[f64]) -> f64 {
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
    use crate::model::EffectInstance;
    use crate::progress::{Control, Observer};
    use crate::serial::rows::JointRows;
    use armgap_core::effect::find;

    const ROWS: usize = 600;
    const SIGMA: f64 = 0.02;

    /// Two joints, one parameter each; every law is a sine of its own rate along the joint it acts on.
    struct Sines {
        rows: Rows,
    }

    fn rate(term: &Term) -> f64 {
        0.2 + 0.01 * term.name().bytes().map(usize::from).sum::<usize>() as f64 % 1.7
    }

    fn sine(term: &Term, phase: f64) -> Signal {
        let wave = (0..ROWS).map(|k| term.p[0] * (rate(term) * k as f64 + phase).sin()).collect();
        (0..2).map(|j| (term.joint() == Some(j + 1)).then(|| Vec::clone(&wave))).collect()
    }

    impl Sines {
        /// With these terms in the data; `seed` of the noise.
        fn with(terms: &[Term], seed: u64) -> Self {
            let mut random = Random(seed);
            let joint = |j: usize, random: &mut Random| {
                let psi: Vec<f64> = (0..ROWS).map(|k| (0.05 * k as f64).cos()).collect();
                let mut y: Vec<f64> = psi.iter().map(|p| 2.0 * p + SIGMA * random.normal()).collect();
                for term in terms {
                    if let Some(s) = &sine(term, 0.0)[j] {
                        y.iter_mut().zip(s).for_each(|(y, s)| *y += s);
                    }
                }
                let psi = psi.iter().flat_map(|p| if j == 0 { [*p, 0.0] } else { [0.0, *p] }).collect();
                JointRows { y, psi, block: (0..ROWS).map(|k| k / 30).collect(), floor: vec![SIGMA; ROWS] }
            };
            let joints = (0..2).map(|j| joint(j, &mut random)).collect();
            Self { rows: Rows { joints, parameters: 2, blocks: ROWS / 30 } }
        }
    }

    impl Motion for Sines {
        fn rows(&self) -> &Rows {
            &self.rows
        }

        fn signal(&self, term: &Term, _theta: &[f64]) -> Signal {
            sine(term, 0.0)
        }

        fn inertia(&self, _theta: &[f64]) -> Vec<f64> {
            vec![1.0; 2]
        }
    }

    fn offset(joint: usize, size: f64) -> Term {
        law("torque_offset", joint, size)
    }

    fn law(name: &str, joint: usize, size: f64) -> Term {
        Term::of_law(EffectInstance::new(find(name).unwrap(), joint, [size, 0.0, 0.0]))
    }

    fn found(truth: &[Term], most: usize) -> Found {
        let (training, holdout) = (Sines::with(truth, 1), Sines::with(truth, 2));
        let prior = Prior { theta: vec![1.8; 2], sigma: vec![0.5; 2], positive: vec![false; 2] };
        let observer: Observer = std::sync::Arc::new(|_| Control::Go);
        let progress = ProgressReporter::new(observer);
        let names = [
            "torque_offset",
            "quadratic_drag",
            "viscous_asymmetry",
            "load_dependent_friction",
            "actuator_delay",
        ];
        let candidates = names.iter().flat_map(|name| (0..2).map(|j| vec![law(name, j, 0.05)])).collect();
        let search = Search {
            training: &training,
            holdout: &holdout,
            prior: &prior,
            candidates,
            rotary: vec![true; 2],
            period: 0.0025,
            is_feasible: &|_| true,
            progress: &progress,
        };
        search.run(most, 1)
    }

    fn names(found: &Found) -> Vec<(&'static str, Option<usize>)> {
        found.named.iter().map(|n| (n.term.name(), n.term.joint())).collect()
    }

    #[test]
    fn nothing_is_found_where_nothing_is_missing() {
        assert!(names(&found(&[], 4)).is_empty());
    }

    #[test]
    fn a_term_is_found_with_its_size() {
        let found = found(&[offset(1, 0.3)], 4);
        assert_eq!(names(&found), [("torque_offset", Some(2))]);
        let cause = &found.named[0];
        assert!((cause.term.p[0] - 0.3).abs() < 4.0 * cause.sigma[0] && cause.sigma[0] < 0.01);
        assert!(cause.probability > 0.9, "{}", cause.probability);
    }

    #[test]
    fn two_terms_are_found_strongest_first() {
        let found = found(&[offset(0, 0.2), law("quadratic_drag", 1, 0.6)], 4);
        assert_eq!(names(&found), [("quadratic_drag", Some(2)), ("torque_offset", Some(1))]);
    }

    #[test]
    fn no_more_decisions_are_taken_than_allowed() {
        assert!(found(&[offset(0, 0.5)], 0).named.is_empty());
        let truth = [offset(0, 0.5), law("quadratic_drag", 1, 0.6)];
        assert_eq!(found(&truth, 1).named.len(), 1);
    }

    #[test]
    fn a_law_on_all_joints_is_one_decision() {
        let found = found(&[offset(0, 0.5), offset(1, 0.6)], 1);
        assert_eq!(found.named.len(), 2);
    }

    #[test]
    fn a_delay_below_the_sample_period_is_not_named() {
        let period = 0.0025;
        assert!(found(&[law("actuator_delay", 0, 0.5 * period)], 4).named.is_empty());
    }

    #[test]
    fn a_term_below_consequence_is_not_named() {
        let tiny = 0.001;
        assert!(found(&[offset(0, tiny)], 4).named.is_empty());
    }

    #[test]
    fn acceptance_needs_every_part_of_the_evidence() {
        let good = Evidence {
            parameters: 1,
            gain: 100.0,
            relief: 0.0,
            statistic: 90.0,
            holdout_gain: 60.0,
            deviations: 5.0,
            share: 0.5,
            consequence: 0.1,
        };
        assert!(good.is_accepted());
        for weak in [
            Evidence { statistic: 10.0, ..good },
            Evidence { gain: 10.0, ..good },
            Evidence { deviations: 1.0, ..good },
            Evidence { share: 0.05, ..good },
            Evidence { consequence: 1e-3, ..good },
        ] {
            assert!(!weak.is_accepted(), "{weak:?}");
        }
        let restoring = Evidence { relief: 30.0, statistic: 0.0, deviations: 0.0, share: 0.0, ..good };
        assert!(restoring.is_accepted());
        assert!(!Evidence { deviations: -3.0, ..restoring }.is_accepted());
    }
}
