//! The online estimator: a sample in, an estimate out.
//!
//! Each call takes the position read at a sample and the torque that acts from it on. The velocity is the caller's, or comes from the
//! positions: the paper's variant takes the backward difference as the velocity of the sample, half a period late; the exact variant
//! takes it for what it is, the velocity half-way between the two samples, and aligns everything else with that instant.

use crate::arm::Arm;
use crate::filter::Cutoff;
use crate::real::{Real, lit};
use crate::regression::{FilteredDynamic, FilteredPower, Passage, Scheme, Snapshot, SuppliedEnergy, Variant};
use crate::rls::{Rls, Update};
use nalgebra::SVector;

/// Positions, velocities, torques and intervals beyond this belong to no arm, and their squares would stay in filters and integrals for good.
const LARGEST: f64 = 1e9;
/// The same for times; seconds since any epoch stay below.
const LATEST: f64 = 1e11;

/// Settings of an estimator of `R` parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings<T, const R: usize> {
    /// Regression model.
    pub scheme: Scheme,
    /// Filters and alignment.
    pub variant: Variant,
    /// Cut-off of the filters.
    pub cutoff: Cutoff<T>,
    /// Forgetting factor in `(0, 1]`.
    pub forgetting: T,
    /// `theta(0)`.
    pub theta0: SVector<T, R>,
    /// `P(0) = p0 I`.
    pub p0: T,
}

/// One sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<T, const N: usize> {
    /// Time, s.
    pub t: T,
    /// Positions read at `t`.
    pub q: SVector<T, N>,
    /// Velocities at `t`, where they are known.
    pub dq: Option<SVector<T, N>>,
    /// Torques held from `t` on.
    pub tau: SVector<T, N>,
}

/// What a sample led to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome<T, const N: usize> {
    /// Not enough samples yet for a regression.
    Starting,
    /// The estimate was updated; the prediction error, its first entry only for scalar schemes.
    Updated(SVector<T, N>),
    /// The sample is not finite, of impossible size, or not later than the last; nothing but the count has changed.
    Rejected,
}

#[derive(Debug, Clone, Copy)]
enum Regression<T: Real, const N: usize, const R: usize> {
    Dynamic(FilteredDynamic<T, N, R>),
    Energy(SuppliedEnergy<T, N, R>),
    Power(FilteredPower<T, N, R>),
}

/// A running estimator: settings, arm, and state in one value without allocation.
#[derive(Debug, Clone, Copy)]
pub struct Estimator<T: Real, A, const N: usize, const P: usize, const R: usize> {
    arm: A,
    settings: Settings<T, R>,
    rls: Rls<T, R>,
    last: Option<Sample<T, N>>,
    before: Option<Sample<T, N>>,
    regression: Option<Regression<T, N, R>>,
    rejected: u64,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize> Estimator<T, A, N, P, R> {
    /// An estimator that has seen nothing yet.
    pub fn new(arm: A, settings: Settings<T, R>) -> Self {
        const {
            assert!(R == P || R == P + N, "R is the arm's parameters, or those and one asymmetry per joint");
        }
        let rls = Rls::new(settings.theta0, settings.p0, settings.forgetting);
        Self { arm, settings, rls, last: None, before: None, regression: None, rejected: 0 }
    }

    /// Estimate and covariance.
    pub fn rls(&self) -> &Rls<T, R> {
        &self.rls
    }

    /// Samples rejected so far.
    pub fn rejected(&self) -> u64 {
        self.rejected + self.rls.rejected()
    }

    /// Takes one sample.
    #[inline]
    pub fn update(&mut self, sample: &Sample<T, N>) -> Outcome<T, N> {
        if !self.acceptable(sample) {
            self.rejected += 1;
            return Outcome::Rejected;
        }
        let Some(last) = self.last else {
            self.last = Some(*sample);
            if sample.dq.is_some() || self.settings.variant == Variant::Paper {
                let dq = sample.dq.unwrap_or_else(SVector::zeros);
                self.start(&Snapshot { q: sample.q, dq }, &sample.tau);
            }
            return Outcome::Starting;
        };
        let outcome = self.advance(&last, sample);
        self.before = Some(last);
        self.last = Some(*sample);
        outcome
    }

    /// Whether a sample can be used: finite, of possible size, later than the last and reachable from it.
    fn acceptable(&self, sample: &Sample<T, N>) -> bool {
        let numbers = sample.q.iter().chain(sample.tau.iter()).chain(sample.dq.iter().flatten());
        let limit: T = lit(LARGEST);
        let possible = sample.t.abs() <= lit(LATEST) && numbers.into_iter().all(|x| x.abs() <= limit);
        possible
            && self.last.is_none_or(|last| {
                let h = sample.t - last.t;
                h > T::zero() && h <= limit && (sample.q - last.q).amax() <= limit * h
            })
    }

    fn start(&mut self, now: &Snapshot<T, N>, tau: &SVector<T, N>) {
        let variant = self.settings.variant;
        self.regression = Some(match self.settings.scheme {
            Scheme::FilteredDynamic => {
                Regression::Dynamic(FilteredDynamic::new(&self.arm, variant, now, tau))
            }
            Scheme::SuppliedEnergy => Regression::Energy(SuppliedEnergy::new(&self.arm, now, tau)),
            Scheme::FilteredPower => Regression::Power(FilteredPower::new(&self.arm, variant, now, tau)),
        });
    }

    #[inline]
    fn advance(&mut self, last: &Sample<T, N>, sample: &Sample<T, N>) -> Outcome<T, N> {
        let half: T = lit(0.5);
        let difference = (sample.q - last.q) / (sample.t - last.t);
        let between = (last.q + sample.q) * half;
        let at_samples = sample.dq.is_some() || self.settings.variant == Variant::Paper;
        if at_samples {
            let now = Snapshot { q: sample.q, dq: sample.dq.unwrap_or(difference) };
            let h = sample.t - last.t;
            let passage = Passage { h, split: h * half, first: last.tau, second: last.tau, middle: between };
            return self.regress(&now, &passage, &sample.tau);
        }
        // The state half-way between the two samples; on the way there from the one before, the torque changed at `last`.
        let now = Snapshot { q: between, dq: difference };
        let Some(before) = self.before else {
            self.start(&now, &last.tau);
            return Outcome::Starting;
        };
        let h = (sample.t - before.t) * half;
        let split = (last.t - before.t) * half;
        let passage = Passage { h, split, first: before.tau, second: last.tau, middle: last.q };
        self.regress(&now, &passage, &last.tau)
    }

    #[inline]
    fn regress(
        &mut self,
        now: &Snapshot<T, N>,
        passage: &Passage<T, N>,
        tau: &SVector<T, N>,
    ) -> Outcome<T, N> {
        let Settings { variant, cutoff, .. } = self.settings;
        let arm = &self.arm;
        match &mut self.regression {
            None => Outcome::Starting,
            Some(Regression::Dynamic(scheme)) => {
                let (psi, y) = scheme.update(arm, variant, &cutoff, now, passage, tau);
                match self.rls.update(&psi, &y) {
                    Update::Used(error) => Outcome::Updated(error),
                    Update::Rejected => Outcome::Rejected,
                }
            }
            Some(Regression::Energy(scheme)) => {
                let (psi, y) = scheme.update(arm, variant, now, passage, tau);
                scalar(self.rls.update(&psi, &y))
            }
            Some(Regression::Power(scheme)) => {
                let (psi, y) = scheme.update(arm, variant, &cutoff, now, passage, tau);
                scalar(self.rls.update(&psi, &y))
            }
        }
    }
}

#[inline]
fn scalar<T: Real, const N: usize>(update: Update<T, 1>) -> Outcome<T, N> {
    match update {
        Update::Used(error) => {
            let mut padded = SVector::<T, N>::zeros();
            if let Some(first) = padded.iter_mut().next() {
                *first = error[0];
            }
            Outcome::Updated(padded)
        }
        Update::Rejected => Outcome::Rejected,
    }
}
