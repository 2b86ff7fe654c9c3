//! Online estimator of an arm's parameters, sample by sample.
//!
//! Each call takes the position read at a sample and the torque that acts from the sample on. The velocity is the caller's, or comes from
//! the positions: [`Variant::Paper`] takes the backward difference as the velocity of the sample, half a period late; [`Variant::Exact`]
//! takes it as the velocity half-way between two samples, and aligns position and torque with the same instant. Whether
//! velocities are given is settled by the first sample.
//!
//! A sample comes with its time ([`Estimator::update`]), or with the period since the last one ([`Estimator::update_after`]), which in
//! single precision is the only way to keep its resolution: after three hours a time in `f32` has steps of a millisecond.

use crate::arm::Arm;
use crate::cpu::{Cpu, Kernel, Level};
use crate::filter::Cutoff;
use crate::real::{Real, lit};
use crate::regression::{
    AllColumns, Columns, FilteredDynamic, FilteredPower, SampleInterval, Scheme, Snapshot, SuppliedEnergy,
    Variant,
};
use crate::rls::{Form, Rls, Update};
use nalgebra::SVector;

/// Largest size, in SI units, of positions, velocities, torques and intervals that the online estimator takes: larger ones belong to no arm, and
/// their squares would stay in filters and integrals for good.
const LARGEST_INPUT: f64 = 1e9;
/// Largest time of a sample that the online estimator takes, s; seconds since any epoch stay below.
const LATEST: f64 = 1e11;

/// Settings of an online estimator of `R` parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings<T, const R: usize> {
    /// Regression model: filtered dynamic, supplied energy or filtered power.
    pub scheme: Scheme,
    /// Filters and alignment of signals: as in Reyes and Kelly (1997), or consistent.
    pub variant: Variant,
    /// Cut-off of the first-order filters.
    pub cutoff: Cutoff<T>,
    /// Forgetting factor of recursive least squares, in `(0, 1]`.
    pub forgetting: T,
    /// Initial estimate `theta(0)`, SI.
    pub theta0: SVector<T, R>,
    /// Initial variance of every parameter: `P(0) = p0 I`.
    pub p0: T,
}

/// Sample of a motion with its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<T, const N: usize> {
    /// Time of the sample, s.
    pub t: T,
    /// Joint positions read at `t`, rad or m.
    pub q: SVector<T, N>,
    /// Joint velocities at `t`, rad/s or m/s, where they are known.
    pub dq: Option<SVector<T, N>>,
    /// Joint torques that act from `t` until the next sample, N m (N).
    pub tau: SVector<T, N>,
}

/// Sample of a motion without its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading<T, const N: usize> {
    /// Joint positions, rad or m.
    pub q: SVector<T, N>,
    /// Joint velocities, rad/s or m/s, where they are known.
    pub dq: Option<SVector<T, N>>,
    /// Joint torques that act until the next sample, N m (N).
    pub tau: SVector<T, N>,
}

/// What an online estimator did with a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome<T, const N: usize> {
    /// The sample was taken, but there are not enough samples yet for a regression.
    Starting,
    /// The estimate was updated; holds the prediction error, N m, J or W by scheme, in the first entry only for scalar schemes.
    Updated(SVector<T, N>),
    /// Either the sample is not finite, of impossible size, not later than the last, or has a velocity where the first had none, or none where the
    /// first had one; nothing but the count of rejected samples has changed. Or least squares rejected its regressor; the estimate is unchanged, and
    /// filters and integrals start again at this sample.
    Rejected,
}

#[derive(Debug, Clone, Copy)]
enum Regression<T: Real, const N: usize, const P: usize> {
    Dynamic(FilteredDynamic<T, N, P>),
    Energy(SuppliedEnergy<T, N, P>),
    Power(FilteredPower<T, N, P>),
}

/// Last sample that the online estimator used, with position and torque of the sample before; `seen` says which of the fields are set.
#[derive(Debug, Clone, Copy)]
struct Past<T, const N: usize> {
    seen: Seen,
    t: T,
    q: SVector<T, N>,
    tau: SVector<T, N>,
    sensor: bool,
    /// Length of the interval that ended with the last sample, s; `inverse` is its reciprocal, `tau_before` the torque over it.
    h: T,
    inverse: T,
    tau_before: SVector<T, N>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Seen {
    Nothing,
    One,
    More,
}

/// Online estimator of an arm's parameters, without allocation; `S` says which of the `P` parameters are estimated.
#[derive(Debug, Clone, Copy)]
pub struct Estimator<T: Real, A, const N: usize, const P: usize, const R: usize, S = AllColumns>
where
    S: Columns<T, N, P, R>,
{
    arm: A,
    columns: S,
    settings: Settings<T, R>,
    rls: Rls<T, R, S::Count>,
    past: Past<T, N>,
    regression: Option<Regression<T, N, P>>,
    rejected: u64,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize> Estimator<T, A, N, P, R> {
    /// Estimator of all parameters of `arm`, before its first sample.
    pub fn new(arm: A, settings: Settings<T, R>) -> Self {
        Self::of_columns(arm, AllColumns, settings)
    }
}

impl<T: Real, A: Arm<T, N, P>, S: Columns<T, N, P, R>, const N: usize, const P: usize, const R: usize>
    Estimator<T, A, N, P, R, S>
{
    /// Estimator of the parameters `columns` of `arm`, before its first sample.
    pub fn of_columns(arm: A, columns: S, settings: Settings<T, R>) -> Self {
        let rls = Rls::new(settings.theta0, settings.p0, settings.forgetting).with_count(columns.count());
        let (zero, none) = (SVector::zeros(), T::zero());
        let past = Past {
            seen: Seen::Nothing,
            t: none,
            q: zero,
            tau: zero,
            sensor: false,
            h: none,
            inverse: none,
            tau_before: zero,
        };
        Self { arm, columns, settings, rls, past, regression: None, rejected: 0 }
    }

    /// Changes the form in which the covariance is kept; the default depends on precision and `p0`.
    pub fn with_form(mut self, form: Form) -> Self {
        self.rls = self.rls.with_form(form);
        self
    }

    /// Changes the instruction set that samples are processed with; the default is that of [`Rls::with_level`].
    pub fn with_level(mut self, level: Level) -> Self {
        self.rls = self.rls.with_level(level);
        self
    }

    /// Recursive least squares of the estimator: estimate and covariance.
    #[inline]
    pub fn rls(&self) -> &Rls<T, R, S::Count> {
        &self.rls
    }

    /// Number of samples rejected so far.
    pub fn rejected(&self) -> u64 {
        self.rejected + self.rls.rejected()
    }

    /// Takes one sample of the arm's motion with its time, and updates the estimate.
    #[inline]
    pub fn update(&mut self, sample: &Sample<T, N>) -> Outcome<T, N> {
        let Sample { t, q, dq, tau } = sample;
        let h = if self.past.seen == Seen::Nothing { T::one() } else { *t - self.past.t };
        let level = self.rls.level();
        Rls::<T, R, S::Count>::run(level, SampleKernel { estimator: self, t: *t, h, q, dq: dq.as_ref(), tau })
    }

    /// Takes one sample of the arm's motion `h` seconds after the last one, and updates the estimate; `h` of the first sample may be any positive
    /// number.
    #[inline]
    pub fn update_after(&mut self, h: T, reading: &Reading<T, N>) -> Outcome<T, N> {
        let Reading { q, dq, tau } = reading;
        let t = self.past.t + h;
        let level = self.rls.level();
        Rls::<T, R, S::Count>::run(level, SampleKernel { estimator: self, t, h, q, dq: dq.as_ref(), tau })
    }

    #[inline(always)]
    fn take<C: Cpu>(
        &mut self,
        t: T,
        h: T,
        q: &SVector<T, N>,
        dq: Option<&SVector<T, N>>,
        tau: &SVector<T, N>,
    ) -> Outcome<T, N> {
        if !self.acceptable(t, h, q, dq, tau) {
            self.rejected += 1;
            return Outcome::Rejected;
        }
        let outcome = if self.past.seen == Seen::Nothing {
            if dq.is_some() || self.settings.variant == Variant::Paper {
                self.start(Snapshot { q: *q, dq: dq.copied().unwrap_or_else(SVector::zeros) }, *tau);
            }
            Outcome::Starting
        } else {
            self.advance::<C>(h, q, dq, tau)
        };
        let past = &mut self.past;
        past.seen = if past.seen == Seen::Nothing { Seen::One } else { Seen::More };
        past.tau_before = past.tau;
        if h != past.h {
            (past.h, past.inverse) = (h, T::one() / h);
        }
        (past.t, past.sensor) = (t, dq.is_some());
        past.q = *q;
        past.tau = *tau;
        outcome
    }

    /// Whether a sample can be used: finite, of possible size, later than the last sample, and reachable from its position at a possible speed.
    #[inline(always)]
    fn acceptable(
        &self,
        t: T,
        h: T,
        q: &SVector<T, N>,
        dq: Option<&SVector<T, N>>,
        tau: &SVector<T, N>,
    ) -> bool {
        let limit: T = lit(LARGEST_INPUT);
        let possible = |x: &SVector<T, N>, limit: T| x.iter().fold(true, |all, x| all & (x.abs() <= limit));
        let mut fine = possible(q, limit) & possible(tau, limit) & (t.abs() <= lit(LATEST));
        if let Some(dq) = dq {
            fine &= possible(dq, limit);
        }
        fine &= (h > T::zero()) & (h <= limit);
        if self.past.seen != Seen::Nothing {
            fine &= possible(&(q - self.past.q), limit * h) & (self.past.sensor == dq.is_some());
        }
        fine
    }

    /// Starts the regression model (scheme) at the state `now`. Arguments are copied, so that hot code can keep its own in registers.
    #[cold]
    #[inline(never)]
    fn start(&mut self, now: Snapshot<T, N>, tau: SVector<T, N>) {
        let Settings { scheme, variant, cutoff, .. } = &self.settings;
        let (arm, variant, now, tau) = (&self.arm, *variant, &now, &tau);
        self.regression = Some(match scheme {
            Scheme::FilteredDynamic => Regression::Dynamic(FilteredDynamic::new(arm, variant, cutoff, now)),
            Scheme::SuppliedEnergy => Regression::Energy(SuppliedEnergy::new(arm, now, tau)),
            Scheme::FilteredPower => Regression::Power(FilteredPower::new(arm, variant, cutoff, now, tau)),
        });
    }

    #[inline(always)]
    fn advance<C: Cpu>(
        &mut self,
        h: T,
        q: &SVector<T, N>,
        dq: Option<&SVector<T, N>>,
        tau: &SVector<T, N>,
    ) -> Outcome<T, N> {
        let half: T = lit(0.5);
        let past = &self.past;
        let inverse = if h == past.h { past.inverse } else { T::one() / h };
        let difference = (q - past.q) * inverse;
        let between = (past.q + q) * half;
        let (now, interval, tau) = if dq.is_some() || self.settings.variant == Variant::Paper {
            let now = Snapshot { q: *q, dq: dq.copied().unwrap_or(difference) };
            let interval =
                SampleInterval { h, split: h * half, first: past.tau, second: past.tau, middle: between };
            (now, interval, *tau)
        } else {
            // State half-way between the last sample and this one; since the half-way state before it, the torque has changed at the last sample.
            let (now, held, split) = (Snapshot { q: between, dq: difference }, past.tau, past.h * half);
            if past.seen == Seen::One {
                self.start(now, held);
                return Outcome::Starting;
            }
            let interval = SampleInterval {
                h: split + h * half,
                split,
                first: past.tau_before,
                second: held,
                middle: past.q,
            };
            (now, interval, held)
        };
        self.regress::<C>(&now, &interval, &tau)
    }

    #[inline(always)]
    fn regress<C: Cpu>(
        &mut self,
        now: &Snapshot<T, N>,
        interval: &SampleInterval<T, N>,
        tau: &SVector<T, N>,
    ) -> Outcome<T, N> {
        let (arm, columns, variant) = (&self.arm, &self.columns, self.settings.variant);
        let outcome = match &mut self.regression {
            None => Outcome::Starting,
            Some(Regression::Dynamic(scheme)) => {
                let (psi, y) = scheme.update::<C, A, S, R>(arm, columns, variant, now, interval);
                match self.rls.learn::<C, _>(&psi, &y) {
                    Update::Used(error) => Outcome::Updated(error),
                    Update::Rejected => Outcome::Rejected,
                }
            }
            Some(Regression::Energy(scheme)) => {
                let (psi, y) = scheme.update::<C, A, S, R>(arm, columns, variant, now, interval, tau);
                scalar(self.rls.learn::<C, _>(&psi, &y))
            }
            Some(Regression::Power(scheme)) => {
                let (psi, y) = scheme.update::<C, A, S, R>(arm, columns, variant, now, interval, tau);
                scalar(self.rls.learn::<C, _>(&psi, &y))
            }
        };
        if outcome == Outcome::Rejected {
            // Filters and integrals contain values that least squares cannot use; the regression equations are valid from any initial state.
            self.start(*now, *tau);
        }
        outcome
    }
}

/// Arguments of one call of [`Estimator::update`], compiled for each instruction set.
struct SampleKernel<'a, T: Real, A, S: Columns<T, N, P, R>, const N: usize, const P: usize, const R: usize> {
    estimator: &'a mut Estimator<T, A, N, P, R, S>,
    t: T,
    h: T,
    q: &'a SVector<T, N>,
    dq: Option<&'a SVector<T, N>>,
    tau: &'a SVector<T, N>,
}

impl<T: Real, A: Arm<T, N, P>, S: Columns<T, N, P, R>, const N: usize, const P: usize, const R: usize> Kernel
    for SampleKernel<'_, T, A, S, N, P, R>
{
    type Output = Outcome<T, N>;

    #[inline(always)]
    fn run<C: Cpu>(self) -> Self::Output {
        self.estimator.take::<C>(self.t, self.h, self.q, self.dq, self.tau)
    }
}

#[inline(always)]
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
