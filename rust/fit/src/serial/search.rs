//! Which terms a serial arm's model lacks: added one after another, dropped when idle.

use super::constants::{ALIKE, ALIKE_COST, ARM_WIDE, NAMED};
use super::evidence::{Evidence, consequence, stability, trust};
use super::fitting::Fitted;
use super::rows::{JointRows, Prior, Regression, Rows, Signal};
use super::screening::Guess;
use super::term::Term;
use crate::progress::{Phase, ProgressReporter};
use armgap_core::chain::LINK_PARAMETERS;
use rayon::prelude::*;

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
    /// The same where the inertia matrix is positive definite, for predictions.
    pub refit_feasible: Fitted,
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
        let guesses = self.guesses(&regression, &model.estimate);
        for _ in 0..most {
            let Some(added) = self.best_addition(&guesses, &regression, &model) else { break };
            let mut terms = model.terms.clone();
            terms.extend(added);
            let beside = self.beside(self.training, &terms, &model.estimate.theta);
            regression = Regression::reweighted(self.training.rows(), self.prior, &beside);
            model = self.without_idle(&regression, self.fit(&regression, terms, &model.estimate.theta));
        }
        if model.terms.iter().any(|term| self.is_sampling(term)) {
            let kept = model.terms.iter().filter(|term| !self.is_sampling(term)).cloned().collect();
            model = self.fit(&regression, kept, &model.estimate.theta);
        }
        self.concluded(&guesses, &regression, [refit, model], sigma, seed)
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

    /// Whether term `index` of the second model is accepted beside the first, which lacks it.
    fn is_accepted(&self, regression: &Regression, [without, with]: [&Fitted; 2], index: usize) -> bool {
        !self.is_sampling(&with.terms[index]) && self.evidence(regression, without, with, index).is_accepted()
    }

    /// Whether a term is a delay or lag of less than a sample period.
    fn is_sampling(&self, term: &Term) -> bool {
        term.is_delay() && term.p[0] < self.period
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
        let refit_feasible = self.feasible(regression, refit.clone());
        Found {
            refit,
            refit_feasible,
            named,
            reported,
            tested,
            sigma: [refit_sigma, regression.sigma()],
            model,
        }
    }

    /// A model whose links are so near to those of the arm file that the inertia matrix is positive definite, with rotor inertias and friction
    /// estimated again.
    fn feasible(&self, regression: &Regression, model: Fitted) -> Fitted {
        if (self.is_feasible)(&model.estimate.theta) {
            return model;
        }
        let links = LINK_PARAMETERS * self.rotary.len();
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
        let of = |(rows, w): (&JointRows, &f64)| w * rows.floor.iter().map(|f| f * f).sum::<f64>();
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
        let alike = |rival: &Fitted| {
            rival.total() - model.total() < (ALIKE * explained).max(ALIKE_COST)
                || rival.terms[last].includes(&term, self.rotary.len())
        };
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
        let mut alike: Vec<Term> = same.into_iter().map(|r| r.terms[last].clone()).collect();
        let including = self.candidates.iter().filter_map(|group| group.first());
        for other in including.filter(|other| other.includes(&term, self.rotary.len())) {
            if !alike.iter().any(|t| t.same_place(other)) {
                alike.push(other.clone());
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::hypothesis::EffectInstance;
    use crate::numeric::random::Random;
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
            parameters: 1.0,
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
            Evidence { statistic: 8.0, ..good },
            Evidence { statistic: 20.0, deviations: 3.5, ..good },
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
