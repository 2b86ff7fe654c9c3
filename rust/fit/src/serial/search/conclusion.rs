//! Results of a model search: probabilities of the found terms, their look-alikes, and tests of the terms that are not in the model.

use crate::serial::constants::{ALIKE, ALIKE_COST, ARM_WIDE_RIVALS, RIVAL_POWER};
use crate::serial::search::evidence::{consequence, floor, stability, trust};
use crate::serial::search::fitting::Fitted;
use crate::serial::search::screening::Guess;
use crate::serial::search::tables::{beside_rival, left_by_rival};
use crate::serial::search::{Found, Named, Search, Tested};
use crate::serial::term::{Term, TermKind};
use crate::serial::weak_form::rows::Regression;
use armgap_core::chain::LINK_PARAMETERS;
use rayon::prelude::*;

impl Search<'_> {
    /// Results of a model search: probabilities and look-alikes of the model's terms, and tests of the terms that are not in the model.
    pub(in crate::serial) fn concluded(
        &self,
        guesses: &[Vec<Guess>],
        regression: &Regression,
        [refit, refit_feasible, model]: [Fitted; 3],
        refit_sigma: Vec<f64>,
        seed: u64,
    ) -> Found {
        let mut named: Vec<Named> =
            (0..model.terms.len()).map(|i| self.named(guesses, regression, &model, i, seed)).collect();
        named.sort_by(|a, b| b.explained.total_cmp(&a.explained));
        let tested = self.tested(guesses, regression, &model);
        let probable = named.iter().filter(|n| n.unfit.is_none()).map(|n| n.term.clone()).collect();
        let probable = self.fit(regression, probable, &model.estimate.theta);
        let unnamed = self.unnamed(regression, &probable);
        let reported = self.feasible(regression, probable);
        // Causes have the values with which the reported model predicts, as its parameters have.
        for named in &mut named {
            if let Some(term) = reported.terms.iter().find(|term| term.same_place(&named.term)) {
                named.sigma = self.sigma_of(regression, &reported, term);
                named.term = term.clone();
            }
        }
        Found {
            refit,
            refit_feasible,
            named,
            reported,
            unnamed,
            tested,
            sigma: [refit_sigma, regression.sigma()],
            model,
        }
    }

    /// The model with its links' parameters moved towards the arm file's until the inertia matrix is well conditioned ([`Search::is_feasible`]), and
    /// with rotor inertias and friction estimated again.
    pub(in crate::serial) fn feasible(&self, regression: &Regression, model: Fitted) -> Fitted {
        let apart: Vec<usize> = model.terms.iter().flat_map(Term::own_motors).collect();
        if (self.is_feasible)(&model.estimate.theta, &apart) {
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
            if (self.is_feasible)(&fitted.estimate.theta, &apart) {
                return fitted;
            }
        }
        model
    }

    /// Holdout cost (weighted squared residuals) that the noise of positions alone gives, by joint.
    pub(in crate::serial) fn floor(&self, regression: &Regression) -> Vec<f64> {
        floor(self.holdout.rows(), &regression.weights)
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
        let screened = self.screened(guesses, regression, &without);
        let mut rivals = self.finalists(regression, &without, &screened);
        if term.is_on_several_joints() {
            rivals.extend(self.on_several_joints(regression, &without, &screened, ARM_WIDE_RIVALS));
        }
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
        let signal = self.training.signal(&term, &model.estimate.theta);
        let acts_on: Vec<usize> = (0..self.rotary.len()).filter(|j| signal[*j].is_some()).collect();
        let wins = stability(model, &against, seed);
        let trust = trust(&without, model, &evidence, &self.floor(regression));
        let sigma = self.sigma_of(regression, model, &term);
        let mut alike: Vec<Term> = same.into_iter().map(|r| r.terms[last].clone()).collect();
        let including = self.candidates.iter().filter_map(|group| group.first());
        let same_motion =
            |other: &&Term| other.includes(&term, self.rotary.len()) || self.is_inverse_gain(other, &term);
        for other in including.filter(same_motion) {
            if !alike.iter().any(|t| t.same_place(other)) {
                alike.push(other.clone());
            }
        }
        let rival = self.rival_table(regression, &without, &acts_on);
        let left = rival.map_or(1.0, |rival| left_by_rival(model, &rival, &self.floor(regression), &acts_on));
        let probability = wins * beside_rival(trust, left, RIVAL_POWER);
        let explained = without.estimate.cost - model.estimate.cost + evidence.holdout_gain;
        let mut named = Named { term, unfit: None, sigma, evidence, explained, probability, alike };
        named.unfit = named.reason_against(&self.rotary, &self.steps);
        named
    }

    /// Whether `other` is the torque gain of the one other joint that moves, where `term` is a torque gain too: with all of the arm's parameters in
    /// proportion, the inverse gain there gives the same motion.
    fn is_inverse_gain(&self, other: &Term, term: &Term) -> bool {
        let rows = &self.training.rows().joints;
        let moving: Vec<usize> = (0..rows.len()).filter(|j| !rows[*j].y.is_empty()).map(|j| j + 1).collect();
        let of_one = |t: &Term| t.is_gain() && t.joint().is_some_and(|joint| moving.contains(&joint));
        moving.len() == 2 && of_one(other) && of_one(term) && other.joint() != term.joint()
    }

    /// Standard deviations of the parameters of `term`, one of the terms of `model`, SI; infinite where the logs do not determine them.
    fn sigma_of(&self, regression: &Regression, model: &Fitted, term: &Term) -> Vec<f64> {
        let columns = self.derivatives(std::slice::from_ref(term), &model.estimate.theta);
        let ridge = self.ridge_of(term, columns.len(), regression);
        let Some(score) = regression.score(&model.estimate, &columns, &ridge) else {
            return vec![f64::INFINITY; term.p.len()];
        };
        let covariance = regression.sandwich(&model.estimate.residual, &columns, &score);
        // The scatter over blocks does not contain the uncertainty of the arm file's values; the inverse of the information with their prior does.
        let variance = |i: usize| covariance[(i, i)].max(score.inverse()[(i, i)]).max(0.0);
        (0..term.p.len()).map(|i| variance(i).sqrt()).collect()
    }

    /// First-order tests, in addition to the terms of the model, of every candidate whose joint and effect are not in the model.
    fn tested(&self, guesses: &[Vec<Guess>], regression: &Regression, model: &Fitted) -> Vec<Tested> {
        let screened = self.screened(guesses, regression, model);
        let tested = |term: Term| {
            let signal = self.training.signal(&term, &model.estimate.theta);
            let column = std::slice::from_ref(&signal);
            let score = regression.score(&model.estimate, column, &[0.0]);
            let size = score.map_or([0.0, f64::INFINITY], |score| {
                let residual = regression.with_torques(&model.estimate, column, &score);
                let variance =
                    regression.sandwich(&residual, column, &score)[(0, 0)].max(score.inverse()[(0, 0)]);
                let sigma = variance.max(0.0).sqrt();
                [score.size[0], sigma]
            });
            let consequence = consequence(self.training.rows(), &signal);
            Tested { term, size, consequence }
        };
        let open = |first: &Term| !model.terms.iter().any(|t| t.same_place(first));
        let of_group = |group: &Vec<Term>| -> Option<Tested> {
            let first = group.first().filter(|first| open(first))?;
            if let Some((term, _)) = screened.iter().find(|(t, _)| t.same_place(first)) {
                return Some(tested(term.clone()));
            }
            if !matches!(first.kind, TermKind::Transmission(_)) {
                return Some(tested(first.clone()));
            }
            // Deflections at different stiffnesses and gaps are different motions: the least certain one counts.
            let uncertain = |t: &Tested| t.size[1] * t.consequence;
            let all = group.iter().map(|term| tested(term.clone())).filter(|t| t.consequence > 0.0);
            all.max_by(|a, b| uncertain(a).total_cmp(&uncertain(b))).or_else(|| Some(tested(first.clone())))
        };
        self.candidates.par_iter().filter_map(of_group).collect()
    }
}
