//! Screening of candidate terms: first-order tests of all candidates, and fits of the candidates that pass.

use crate::progress::Phase;
use crate::serial::constants::{PRICE, TERM_FINALISTS};
use crate::serial::search::Search;
use crate::serial::search::evidence::likelihood_gain;
use crate::serial::search::fitting::{Fitted, difference};
use crate::serial::term::row_term::{RowLaw, RowTerm};
use crate::serial::term::{Term, TermKind};
use crate::serial::weak_form::rows::{Estimate, Regression, Signal};
use armgap_core::effect::Trial;
use rayon::prelude::*;

/// Largest factor that a first-order test may suggest on the distance of a term's initial guess from the values at which the term has no effect.
const FARTHEST: f64 = 50.0;

/// Tilt of the base over which the first-order test of a tilt takes numerical derivatives of torques, rad; these torques are smooth functions of the
/// tilt.
const TILT_STEP: f64 = 1e-3;

/// A candidate term at an initial guess, with the torque signals of its first-order test along the training logs.
pub struct Guess {
    pub(in crate::serial) term: Term,
    pub(in crate::serial) columns: Vec<Signal>,
}

impl Search<'_> {
    /// For each candidate term its initial guesses, each with the torque signals whose share in the residual torque at the estimate `at` a
    /// first-order (score) test measures.
    pub(in crate::serial) fn guesses(&self, regression: &Regression, at: &Estimate) -> Vec<Vec<Guess>> {
        let theta = &at.theta;
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
                TermKind::Row(RowTerm { law: RowLaw::Spring, .. }) => {
                    let [far, near] =
                        [-1.0, 0.0].map(|q0| self.training.signal(&term.with(vec![1.0, q0]), theta));
                    let preload = difference(&far, &near, 1.0);
                    vec![near, preload]
                }
                TermKind::BaseTilt(_) => {
                    let none = self.training.signal(&term.with(vec![0.0; 2]), theta);
                    let at = |p: [f64; 2]| {
                        difference(&self.training.signal(&term.with(p.to_vec()), theta), &none, TILT_STEP)
                    };
                    vec![at([TILT_STEP, 0.0]), at([0.0, TILT_STEP])]
                }
                _ if term.amplitudes() == 0 => vec![self.training.signal(term, theta)],
                _ => (0..term.amplitudes()).map(|i| self.unit(term, i, theta)).collect(),
            }
        };
        let guess = |term: &Term| {
            let columns = columns(term);
            let degrees = self.degrees(regression, at, term, &columns);
            Guess { term: Term { degrees, ..term.clone() }, columns }
        };
        self.candidates.par_iter().map(|group| group.iter().map(guess).collect()).collect()
    }

    /// Effective number of a term's parameters (Moody 1992). Of a link or payload, which the arm's parameters can imitate, only directions that the
    /// logs determine better than the arm file count: `trace(I diag(sigma)^2)` with `sigma` the arm file's standard deviations and `I` the
    /// information on the term's parameters when the arm's parameters are estimated too.
    fn degrees(&self, regression: &Regression, at: &Estimate, term: &Term, columns: &[Signal]) -> f64 {
        let link = match term.kind {
            TermKind::NominalLink(link) => link,
            TermKind::Payload => self.rotary.len() - 1,
            _ => return term.degrees,
        };
        let sigma = &self.prior.sigma[10 * link..][..columns.len()];
        let ridge: Vec<f64> =
            sigma.iter().map(|s| if *s > 0.0 { s.powi(-2) } else { f64::MAX.sqrt() }).collect();
        regression.score(at, columns, &ridge).map_or(term.degrees, |score| {
            sigma.iter().enumerate().map(|(i, s)| (score.information(i) * s * s).clamp(0.0, 1.0)).sum()
        })
    }

    /// Tests a term to first order; returns the term with the values that the test suggests, and by how much these values lower the cost, or `None`
    /// if they are out of bounds or do not lower the cost.
    pub(in crate::serial) fn test(
        &self,
        regression: &Regression,
        at: &Estimate,
        guess: &Guess,
    ) -> Option<(Term, f64)> {
        let term = &guess.term;
        let bounds = term.parameters(self.rotary_of(term));
        let within = |p: &[f64]| p.iter().zip(&bounds).all(|(p, b)| *p >= b.bounds[0] && *p <= b.bounds[1]);
        let score =
            regression.score(at, &guess.columns, &self.ridge_of(term, guess.columns.len(), regression))?;
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
        match term.kind {
            TermKind::Row(RowTerm { law: RowLaw::Spring, .. }) => {
                let (k, preload) = (score.size[0], score.size[1]);
                return (k != 0.0).then(|| (term.with(vec![k, -preload / k]), score.gain));
            }
            TermKind::Row(row) => {
                let (free, p, gain) = test_positive(regression, at, guess)?;
                let law = RowLaw::Transmission(std::array::from_fn(|i| free.contains(&i)));
                let kind = TermKind::Row(RowTerm { law, ..row });
                return Some((Term { kind, p, degrees: free.len() as f64 }, gain));
            }
            _ => {}
        }
        let count = term.amplitudes();
        if count > 0 {
            let mut p = term.p.clone();
            for i in 0..count {
                p[i] = bounds[i].neutral + score.size[i];
            }
            return within(&p).then(|| (term.with(p), score.gain));
        }
        let trial = match term.kind {
            TermKind::Law(effect) => effect.law.spec().trial,
            TermKind::Transmission(_) => Trial::Whole,
            _ => Trial::Amplitudes(1),
        };
        let size = score.size[0];
        let information = score.gain / (size * size).max(f64::MIN_POSITIVE);
        let (p, size) = match trial {
            // The torque of a joint limit is in proportion to its stiffness and damping.
            Trial::Whole if matches!(term.kind, TermKind::Law(effect) if effect.is_contact()) => {
                let share = size.clamp(0.0, FARTHEST);
                (vec![term.p[0], share * term.p[1], share * term.p[2]], share)
            }
            // The torque of an effect with a threshold, or of a deflection, is not in proportion to its values, which stay at the initial guess.
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
        if term.changes_command()
            && let Some(joint) = term.joint()
        {
            gain = self.scaled_gain(regression, at, &term, joint - 1, gain);
        }
        (gain > 0.0 && within(&term.p)).then_some((term, gain))
    }

    /// Decrease of the cost by a term on `joint` (from 0) that changes the command, from the decrease `gain` without regard to how much torque
    /// reaches the joint ([`Search::scales`]).
    pub(in crate::serial) fn scaled_gain(
        &self,
        regression: &Regression,
        at: &Estimate,
        term: &Term,
        joint: usize,
        gain: f64,
    ) -> f64 {
        let before = regression.weights[joint] * at.residual[joint].iter().map(|r| r * r).sum::<f64>();
        before - (before - gain) * self.scales(self.training, std::slice::from_ref(term), &at.theta)[joint]
    }

    /// Torque of a term along the training logs per unit of one of its amplitudes, with its other amplitudes at their neutral values.
    pub(in crate::serial) fn unit(&self, term: &Term, amplitude: usize, theta: &[f64]) -> Signal {
        let neutral = term.parameters(self.rotary_of(term));
        let (mut p, unit) = (term.p.clone(), term.unit());
        for (i, value) in p.iter_mut().enumerate().take(term.amplitudes()) {
            *value = neutral[i].neutral + if i == amplitude { unit } else { 0.0 };
        }
        let mut signal = self.training.signal(&term.with(p), theta);
        if unit != 1.0 {
            signal.iter_mut().flatten().flatten().for_each(|torque| *torque /= unit);
        }
        signal
    }

    /// Candidates that are not in the model, each with the values and the decrease of the cost of its best first-order test, largest decrease first.
    /// The cost counts at the noise that the weights of `regression` are made for.
    pub(in crate::serial) fn screened(
        &self,
        guesses: &[Vec<Guess>],
        regression: &Regression,
        model: &Fitted,
    ) -> Vec<(Term, f64)> {
        self.screened_by(guesses, regression, model, |_, gain| gain)
    }

    /// Candidates as of [`Self::screened`], each with twice the logarithm of the likelihood ratio that its best first-order test promises
    /// ([`likelihood_gain`]), largest first; the weights of `regression` are made for the residuals of `model`.
    pub(in crate::serial) fn screened_by_likelihood(
        &self,
        guesses: &[Vec<Guess>],
        regression: &Regression,
        model: &Fitted,
    ) -> Vec<(Term, f64)> {
        let costs: Vec<f64> = model.costs[0].iter().map(|joint| joint.iter().sum()).collect();
        self.screened_by(guesses, regression, model, |guess, gain| {
            let acts_on = (0..costs.len()).filter(|j| guess.columns.iter().any(|c| c[*j].is_some()));
            likelihood_gain(gain, acts_on.map(|j| costs[j]).sum())
        })
    }

    fn screened_by(
        &self,
        guesses: &[Vec<Guess>],
        regression: &Regression,
        model: &Fitted,
        worth: impl Fn(&Guess, f64) -> f64 + Sync,
    ) -> Vec<(Term, f64)> {
        let open: Vec<&Vec<Guess>> = guesses
            .iter()
            .filter(|group| !model.terms.iter().any(|t| group.first().is_some_and(|g| g.term.same_place(t))))
            .collect();
        self.progress.begin(Phase::Screen, open.len());
        let mut found: Vec<(Term, f64)> = open
            .par_iter()
            .filter_map(|group| {
                self.progress.unit();
                let tests = group.iter().filter_map(|guess| {
                    let (term, gain) = self.test(regression, &model.estimate, guess)?;
                    Some((term, worth(guess, gain)))
                });
                tests.max_by(|a, b| a.1.total_cmp(&b.1))
            })
            .filter(|(_, gain)| gain.is_finite())
            .collect();
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found
    }

    /// Models with one more term each, fitted: one for each of the candidates that promise most in the first-order tests `screened`.
    pub(in crate::serial) fn finalists(
        &self,
        regression: &Regression,
        model: &Fitted,
        screened: &[(Term, f64)],
    ) -> Vec<Fitted> {
        let worth = |(term, gain): &&(Term, f64)| *gain > PRICE + 2.0 * term.degrees;
        let wanted: Vec<&(Term, f64)> = screened.iter().filter(worth).take(TERM_FINALISTS).collect();
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
}

/// First-order test of a term none of whose amplitudes may be negative: indices of those that are not held at zero, the amplitudes that the test
/// suggests, and by how much they lower the cost; `None` where all of them would be negative.
fn test_positive(
    regression: &Regression,
    at: &Estimate,
    guess: &Guess,
) -> Option<(Vec<usize>, Vec<f64>, f64)> {
    let mut free: Vec<usize> = (0..guess.columns.len()).collect();
    loop {
        let columns: Vec<Signal> = free.iter().map(|i| guess.columns[*i].clone()).collect();
        let score = regression.score(at, &columns, &vec![0.0; columns.len()])?;
        let (least, size) = score.size.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
        if *size < 0.0 {
            free.remove(least);
            continue;
        }
        let mut p = vec![0.0; guess.columns.len()];
        free.iter().zip(&score.size).for_each(|(i, size)| p[*i] = *size);
        return Some((free, p, score.gain));
    }
}
