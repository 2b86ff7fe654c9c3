//! Model search of serial arms: terms are added to the model one after another, and terms that become idle are dropped.

pub(in crate::serial) mod arm_wide;
pub(in crate::serial) mod conclusion;
pub(in crate::serial) mod evidence;
pub(in crate::serial) mod fitting;
pub(in crate::serial) mod naming;
pub(in crate::serial) mod screening;
pub(in crate::serial) mod tables;

use crate::locate::dependence::Dependence;
use crate::locate::table_form::TableForm;
use crate::progress::{Phase, ProgressReporter};
use crate::serial::constants::ARM_WIDE_FINALISTS;
use crate::serial::search::{evidence::Evidence, fitting::Fitted, screening::Guess};
use crate::serial::term::Term;
use crate::serial::term::table::Table;
use crate::serial::weak_form::rows::{Prior, Regression, Rows, Signal};

/// Rows of an arm's weak equation of motion along a set of logs, and torques of terms along these logs.
pub trait Motion: Sync {
    /// Rows of the weak equation of motion along the logs.
    fn rows(&self) -> &Rows;
    /// Torque of a term along the logs at the arm's parameters `theta`, by joint and row, N m or N.
    fn signal(&self, term: &Term, theta: &[f64]) -> Signal;
    /// Torque of a term like [`Self::signal`], without what the logged torques contain of disturbances; `None` for terms that do not depend on them.
    fn instrument(&self, _term: &Term, _theta: &[f64]) -> Option<Signal> {
        None
    }
    /// Factor and variable of a table's form in the middle of every sample interval, log after log.
    fn table_variable(&self, form: TableForm) -> Vec<[f64; 2]>;
    /// Torques of a table per unit of the torque of each class, by joint and row.
    fn columns_of_table(&self, table: &Table) -> Vec<Signal>;
    /// Mean inertia of every joint along the logs at the arm's parameters `theta`, kg m^2 or kg.
    fn inertia(&self, theta: &[f64]) -> Vec<f64>;
}

/// Data, prior, candidates and settings of a model search on a serial arm.
pub struct Search<'a> {
    /// Training logs, which terms are fitted to.
    pub training: &'a dyn Motion,
    /// Holdout logs, which fitted terms are judged on.
    pub holdout: &'a dyn Motion,
    /// Prior of the arm's parameters: the arm file's values and standard deviations.
    pub prior: &'a Prior,
    /// Candidate terms at their initial guesses; a group holds those of one effect on one joint or pair of joints, or on the whole arm.
    pub candidates: Vec<Vec<Term>>,
    /// Whether each joint is rotary; a joint that is not is linear.
    pub rotary: Vec<bool>,
    /// Encoder step of each joint, rad or m; empty where the steps are unknown.
    pub steps: Vec<f64>,
    /// Sample period, s: a shorter delay or lag is an artefact of sampling, and is not named.
    pub period: f64,
    /// Function that tells whether the inertia matrix along the logs, at given parameters of the arm and without the rotors of given joints (from 0),
    /// is conditioned well enough for simulation (`CONDITIONED`).
    pub is_feasible: &'a (dyn Fn(&[f64], &[usize]) -> bool + Sync),
    /// Reporter of the search's progress, through which the search may be cancelled.
    pub progress: &'a ProgressReporter,
}

/// A term of the final model with its standard deviations, the comparison of the models with and without the term, its probability and its
/// look-alikes.
#[derive(Debug, Clone)]
pub struct Named {
    /// Term of the final model, with the values of [`Found::reported`] if it is named, else those of the final model.
    pub term: Term,
    /// Reason why the term is not named; `None` if it is.
    pub unfit: Option<String>,
    /// Standard deviations of the term's parameters at these values, SI.
    pub sigma: Vec<f64>,
    /// Evidence for the term: comparison of the models with and without it.
    pub evidence: Evidence,
    /// Decrease of the cost (weighted squared residuals and squared distance from the prior) by the term, on training logs and holdout.
    pub explained: f64,
    /// Probability that the term, or one of its look-alikes, is in the arm.
    pub probability: f64,
    /// Look-alikes of the term: terms that explain the logs about as well in its stead.
    pub alike: Vec<Term>,
}

/// Result of the first-order test of a candidate that is not in the final model.
#[derive(Debug, Clone)]
pub struct Tested {
    /// Candidate term at the values of its best first-order test, or at its first initial guess where no test lowers the cost.
    pub term: Term,
    /// Estimated size of the candidate and the size's robust standard deviation, both as factors on the torque of the term at its values.
    pub size: [f64; 2],
    /// RMS torque of the candidate at its values relative to the RMS torque of its joint; of several joints, the largest ratio.
    pub consequence: f64,
}

/// Result of a model search on a serial arm.
pub struct Found {
    /// The model without terms, with the arm's parameters re-estimated.
    pub refit: Fitted,
    /// The model without terms, re-estimated such that its inertia matrix is well conditioned ([`Search::is_feasible`]), for predictions.
    pub refit_feasible: Fitted,
    /// The final model with all terms that the search accepted.
    pub model: Fitted,
    /// Terms of the final model, by the decrease of the cost on training logs and holdout that each brings, largest first.
    pub named: Vec<Named>,
    /// The model with only those terms that are probable enough to be named, for predictions.
    pub reported: Fitted,
    /// Laws without a name that explain what the model with the probable terms leaves, those that explain most first.
    pub unnamed: Vec<Dependence>,
    /// First-order tests, in addition to the terms of the final model, of all candidates that are not in this model.
    pub tested: Vec<Tested>,
    /// Standard deviations of the arm's parameters, SI: of the re-estimated model without terms, and of the final model.
    pub sigma: [Vec<f64>; 2],
}

impl Search<'_> {
    /// Runs the model search with at most `most` additions of a term; `seed` is of the random numbers with which blocks of the logs are resampled.
    pub fn run(&self, most: usize, seed: u64) -> Found {
        self.progress.begin(Phase::Refit, 1);
        let none = vec![None; self.rotary.len()];
        let mut regression = Regression::reweighted(self.training.rows(), self.prior, &none);
        let mut model = self.fit(&regression, Vec::new(), &self.prior.theta);
        let refit = model.clone();
        let refit_feasible = self.feasible(&regression, refit.clone());
        let sigma = regression.sigma();
        let guesses = self.guesses(&regression, &model.estimate);
        for _ in 0..most {
            let Some(added) = self.best_addition(&guesses, &regression, &model) else { break };
            let terms = self.joined(model.terms.clone(), added);
            let beside = self.beside(self.training, &terms, &model.estimate.theta);
            regression = Regression::reweighted(self.training.rows(), self.prior, &beside);
            model = self.without_idle(&regression, self.fit(&regression, terms, &model.estimate.theta));
        }
        if model.terms.iter().any(|term| self.is_sampling(term)) {
            let kept = model.terms.iter().filter(|term| !self.is_sampling(term)).cloned().collect();
            model = self.fit(&regression, kept, &model.estimate.theta);
        }
        self.concluded(&guesses, &regression, [refit, refit_feasible, model], sigma, seed)
    }

    /// The term whose addition gives the accepted model of least [`Fitted::total`]; `None` where no candidate is accepted.
    fn best_addition(&self, guesses: &[Vec<Guess>], regression: &Regression, model: &Fitted) -> Option<Term> {
        let screened = self.screened_by_likelihood(guesses, regression, model);
        let single = self.finalists(regression, model, &screened);
        let last = model.terms.len();
        let on_several = self.on_several_joints(regression, model, &screened, ARM_WIDE_FINALISTS);
        let single = single.into_iter().filter(|with| self.stands(regression, [model, with], last));
        let best = single.chain(on_several).min_by(|a, b| a.total().total_cmp(&b.total()))?;
        Some(best.terms[last].clone())
    }

    /// Whether the term of index `index` in the model `with` is accepted, compared with the model `without` that term.
    pub(in crate::serial) fn is_accepted(
        &self,
        regression: &Regression,
        [without, with]: [&Fitted; 2],
        index: usize,
    ) -> bool {
        !self.is_sampling(&with.terms[index]) && self.evidence(regression, without, with, index).is_accepted()
    }

    /// Whether a term is a delay or lag of less than a sample period on all of its joints.
    fn is_sampling(&self, term: &Term) -> bool {
        term.is_delay() && term.members().iter().all(|member| member.p[0] < self.period)
    }

    /// The model without its term of index `index`, fitted again.
    pub(in crate::serial) fn without(&self, regression: &Regression, model: &Fitted, index: usize) -> Fitted {
        let mut terms = model.terms.clone();
        terms.remove(index);
        self.fit(regression, terms, &model.estimate.theta)
    }

    /// The model without those of its terms, the last one excepted, that are no longer accepted in addition to the model's other terms.
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::dependence::MotionVariable;
    use crate::locate::variable_classes::CLASSES;
    use crate::model::hypothesis::EffectInstance;
    use crate::numeric::random::Random;
    use crate::progress::{Control, Observer};
    use crate::serial::term::TermKind;
    use crate::serial::term::row_term::{self, RowLaw, RowTerm};
    use crate::serial::weak_form::rows::JointRows;
    use armgap_core::chain::JointKind;
    use armgap_core::effect::find;

    const ROWS: usize = 600;
    const SIGMA: f64 = 0.02;

    /// Rows of two simulated joints, one parameter each; the torque of every law is a sine over the rows with a rate of the law's own.
    struct Sines {
        rows: Rows,
    }

    fn rate(term: &Term) -> f64 {
        0.2 + 0.01 * term.name().bytes().map(usize::from).sum::<usize>() as f64 % 1.7
    }

    fn sine(term: &Term, phase: f64) -> Signal {
        if let TermKind::Row(row) = term.kind {
            // Each amplitude has a rate of its own; the second joint's torque is the first's times the row's factor.
            let wave = |k: usize| (1..=3).map(|i| term.p[i - 1] * (0.31 * (i * k) as f64).sin()).sum::<f64>();
            return [1.0, row.factor].map(|by| Some((0..ROWS).map(|k| by * wave(k)).collect())).into();
        }
        if let TermKind::Table(table) = &term.kind {
            let torque = || (0..ROWS).map(|k| term.p[table.class(k as f64)]).collect();
            return (0..2).map(|j| (j == table.joint).then(torque)).collect();
        }
        if term.is_on_several_joints() {
            return (0..2).map(|j| term.members().iter().find_map(|m| sine(m, phase)[j].clone())).collect();
        }
        let wave = (0..ROWS).map(|k| term.p[0] * (rate(term) * k as f64 + phase).sin()).collect();
        (0..2).map(|j| (term.joint() == Some(j + 1)).then(|| Vec::clone(&wave))).collect()
    }

    impl Sines {
        /// Simulated rows whose torques hold those of `terms`; `seed` is of the noise.
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
            Self { rows: Rows { joints, parameters: 2, blocks: ROWS / 30, independent: 10 } }
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

        /// Row by row; only the time has values.
        fn table_variable(&self, form: TableForm) -> Vec<[f64; 2]> {
            let is_time = form == TableForm::over(MotionVariable::Time);
            (0..if is_time { ROWS } else { 0 }).map(|k| [1.0, k as f64]).collect()
        }

        fn columns_of_table(&self, table: &Table) -> Vec<Signal> {
            let column = |class: usize| -> Vec<f64> {
                (0..ROWS).map(|k| f64::from(u8::from(table.class(k as f64) == class))).collect()
            };
            let of = |class: usize| (0..2).map(|j| (j == table.joint).then(|| column(class))).collect();
            (0..CLASSES).map(of).collect()
        }
    }

    fn offset(joint: usize, size: f64) -> Term {
        law("torque_offset", joint, size)
    }

    fn law(name: &str, joint: usize, size: f64) -> Term {
        Term::of_law(EffectInstance::new(find(name).unwrap(), joint, [size, 0.0, 0.0]))
    }

    fn prior() -> Prior {
        Prior { theta: vec![1.8; 2], sigma: vec![0.5; 2], positive: vec![false; 2] }
    }

    fn progress() -> ProgressReporter {
        let observer: Observer = std::sync::Arc::new(|_| Control::Go);
        ProgressReporter::new(observer)
    }

    fn search<'a>(
        training: &'a Sines,
        holdout: &'a Sines,
        prior: &'a Prior,
        candidates: Vec<Vec<Term>>,
        progress: &'a ProgressReporter,
    ) -> Search<'a> {
        Search {
            training,
            holdout,
            prior,
            candidates,
            rotary: vec![true; 2],
            steps: Vec::new(),
            period: 0.0025,
            is_feasible: &|_, _| true,
            progress,
        }
    }

    fn found(truth: &[Term], most: usize) -> Found {
        let (training, holdout) = (Sines::with(truth, 1), Sines::with(truth, 2));
        let (prior, progress) = (prior(), progress());
        let names = [
            "torque_offset",
            "quadratic_drag",
            "viscous_asymmetry",
            "load_dependent_friction",
            "actuator_delay",
        ];
        let on_joints = names.iter().flat_map(|name| (0..2).map(|j| vec![law(name, j, 0.05)]));
        let rows = row_term::candidates(&[JointKind::Revolute; 2]);
        let rows = rows.into_iter().filter(|group| group[0].name() == "coupled_transmission");
        let candidates = on_joints.chain(rows).collect();
        search(&training, &holdout, &prior, candidates, &progress).run(most, 1)
    }

    fn names(found: &Found) -> Vec<(&'static str, Option<usize>)> {
        found.named.iter().map(|n| (n.term.name(), n.term.joint())).collect()
    }

    #[test]
    fn rivals_of_a_cause_are_screened_by_the_cost_that_they_explain() {
        let cause = offset(0, 0.6);
        let (training, prior, progress) = (Sines::with(std::slice::from_ref(&cause), 1), prior(), progress());
        let search = search(&training, &training, &prior, vec![vec![offset(0, 0.05)]], &progress);
        let regression =
            Regression::reweighted(training.rows(), &prior, &training.signal(&cause, &prior.theta));
        let without = search.fit(&regression, Vec::new(), &prior.theta);
        let guesses = search.guesses(&regression, &without.estimate);
        let (term, gain) = search.screened(&guesses, &regression, &without).remove(0);
        let with = search.fit(&regression, vec![term], &without.estimate.theta);
        assert!((gain / (without.estimate.cost - with.estimate.cost) - 1.0).abs() < 1e-3, "{gain}");
        // At these weights the cost is far above the number of rows, which any likelihood ratio with re-estimated noise follows.
        assert!(gain > 10.0 * ROWS as f64);
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
    fn causes_have_the_values_of_the_model_that_predicts() {
        let found = found(&[offset(0, 0.5), law("quadratic_drag", 1, 0.3)], 4);
        let predicts = |t: &Term| found.reported.terms.iter().any(|r| r.same_place(t) && r.p == t.p);
        assert!(found.named.iter().all(|named| predicts(&named.term)));
        assert_eq!((found.named.len(), found.reported.terms.len()), (2, 2));
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
        assert_eq!(names(&found), [("torque_offset", None)]);
        let term = &found.named[0].term;
        assert_eq!((term.joints(), term.degrees), (vec![1, 2], 2.0));
        assert!((term.p[0] - 0.5).abs() < 0.01 && (term.p[1] - 0.6).abs() < 0.01, "{:?}", term.p);
        assert!(found.named[0].probability > 0.9);
    }

    #[test]
    fn a_delay_of_all_joints_is_one_value() {
        let found = found(&[law("actuator_delay", 0, 0.3), law("actuator_delay", 1, 0.3)], 1);
        assert_eq!(names(&found), [("actuator_delay", None)]);
        let term = &found.named[0].term;
        assert!(term.has_common_value() && (term.p[0] - 0.3).abs() < 0.01, "{:?}", term.p);
    }

    #[test]
    fn delays_that_differ_have_a_value_each() {
        let found = found(&[law("actuator_delay", 0, 0.2), law("actuator_delay", 1, 0.4)], 1);
        assert_eq!(names(&found), [("actuator_delay", None)]);
        assert_eq!(found.named[0].term.p.len(), 2);
    }

    #[test]
    fn a_law_found_on_one_joint_after_another_is_one_cause() {
        let (training, prior) = (Sines::with(&[], 1), prior());
        let progress = progress();
        let search = search(&training, &training, &prior, Vec::new(), &progress);
        let joined = search.joined(vec![offset(0, 0.5)], offset(1, 0.1));
        assert_eq!((joined.len(), joined[0].joints()), (1, vec![1, 2]));
        let apart = search.joined(vec![offset(0, 0.5)], law("quadratic_drag", 1, 0.1));
        assert_eq!(apart.len(), 2);
    }

    #[test]
    fn friction_along_a_row_over_two_joints_is_one_cause_that_is_not_negative() {
        let row = RowTerm { first: 0, factor: -1.0, law: RowLaw::Transmission([true; 3]) };
        let truth = Term::neutral(TermKind::Row(row)).with(vec![-0.3, 0.2, 0.4]);
        let found = found(&[truth], 1);
        let term = &found.named[0].term;
        assert_eq!(
            (term.name(), term.joints(), term.row()),
            ("coupled_transmission", vec![1, 2], Some([1, -1]))
        );
        assert_eq!((term.p[0], term.degrees), (0.0, 2.0));
        assert!((term.p[1] - 0.2).abs() < 0.01 && (term.p[2] - 0.4).abs() < 0.01, "{:?}", term.p);
    }

    /// A torque on the second joint that depends on the time in a form that no candidate has.
    fn drift() -> Term {
        let form = TableForm::over(MotionVariable::Time);
        let along: Vec<[f64; 2]> = (0..ROWS).map(|k| [1.0, k as f64]).collect();
        let torques = (0..CLASSES).map(|c| if (c / 3).is_multiple_of(2) { 0.2 } else { -0.1 }).collect();
        Table::new(1, form, &along).unwrap().term().with(torques)
    }

    #[test]
    fn a_torque_that_no_candidate_explains_is_a_table() {
        let found = found(&[drift()], 4);
        assert!(names(&found).is_empty());
        let [law] = &found.unnamed[..] else { panic!("{:?}", found.unnamed) };
        assert_eq!((law.joint, law.variable.as_str(), law.law.x.len()), (2, "t", CLASSES));
        assert!(law.share > 0.9, "{}", law.share);
        for (torque, true_torque) in law.law.torque.iter().zip(drift().p) {
            // The arm needs the term's torque, so the law is the opposite, less its mean.
            assert!((law.law.constant[0] + torque + true_torque).abs() < 0.02, "{:?}", law.law);
        }
    }

    #[test]
    fn nothing_is_listed_where_nothing_or_only_a_named_effect_is_missing() {
        assert!(found(&[], 4).unnamed.is_empty());
        let found = found(&[law("quadratic_drag", 1, 0.6)], 4);
        assert!(found.unnamed.is_empty() && found.named[0].probability > 0.9);
    }

    #[test]
    fn a_delay_below_the_sample_period_is_not_named() {
        let period = 0.0025;
        assert!(found(&[law("actuator_delay", 0, 0.5 * period)], 4).named.is_empty());
    }

    #[test]
    fn a_term_below_consequence_is_not_named() {
        assert!(found(&[offset(0, 0.001)], 4).named.is_empty());
    }
}
