//! Estimator and monitor behind one type for every arm, for callers that choose the arm at run time: the C and Python interfaces.
//!
//! Vectors come as slices; a slice of the wrong length is an error, never a panic.

use crate::arm::{Arm, Axis, Kind, Pendulum, TwoLink};
use crate::filter::Cutoff;
use crate::identify::{Estimator, Outcome, Reading, Sample, Settings};
use crate::monitor::{Monitor, Watch};
use crate::real::{Real, lit};
use crate::regression::{Scheme, Variant};
use crate::rls::Form;
use nalgebra::SVector;

/// Largest number of parameters of any arm, asymmetries included.
pub const MOST_PARAMETERS: usize = 11;
/// Largest number of joints of any arm.
pub const MOST_JOINTS: usize = 2;

/// Everything that is chosen before the first sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice<T> {
    /// Kind of arm.
    pub kind: Kind,
    /// Regression model.
    pub scheme: Scheme,
    /// Filters and alignment.
    pub variant: Variant,
    /// How the covariance is kept; by default as suits the precision and `p0`.
    pub form: Option<Form>,
    /// Whether one constant torque per joint is estimated too.
    pub asymmetry: bool,
    /// Cut-off of the filters, rad/s.
    pub cutoff: T,
    /// Forgetting factor in `(0, 1]`.
    pub forgetting: T,
    /// `P(0) = p0 I`; forgetting lifts no variance above it.
    pub p0: T,
    /// Monitor.
    pub watch: Watch<T>,
}

/// Why an estimator cannot be made or a sample cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Problem {
    /// A number of the choice is not finite or outside its range.
    Range(&'static str),
    /// A slice has another length than the arm needs.
    Length {
        /// Which one.
        name: &'static str,
        /// Length it needs.
        expected: usize,
    },
}

/// When a sample was taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum When<T> {
    /// At a time, s.
    At(T),
    /// A period after the last one, s.
    After(T),
}

/// What became of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Result {
    /// Taken; not enough samples for a regression yet.
    Starting,
    /// The estimate was updated.
    Updated,
    /// Not used.
    Rejected,
}

impl<T: Real> Choice<T> {
    /// The filtered power model with consistent filters at 50 rad/s, without forgetting.
    pub fn new(kind: Kind) -> Self {
        Self {
            kind,
            scheme: Scheme::FilteredPower,
            variant: Variant::Exact,
            form: None,
            asymmetry: false,
            cutoff: lit(50.0),
            forgetting: T::one(),
            p0: lit(1000.0),
            watch: Watch::default(),
        }
    }

    /// Number of parameters that are estimated.
    pub fn parameters(&self) -> usize {
        let extra = if self.asymmetry { self.kind.joints() } else { 0 };
        self.kind.parameters().len() + extra
    }

    /// Number of prediction errors per sample.
    pub fn outputs(&self) -> usize {
        if self.scheme == Scheme::FilteredDynamic { self.kind.joints() } else { 1 }
    }

    fn check(&self) -> core::result::Result<(), Problem> {
        let positive = |x: T, most: f64| x > T::zero() && x <= lit(most);
        let wrong = [
            (!positive(self.cutoff, 1e6), "cutoff"),
            (!positive(self.forgetting, 1.0), "forgetting"),
            (!positive(self.p0, 1e12), "p0"),
            (!positive(self.watch.memory, 1e12) || self.watch.memory < T::one(), "memory"),
            (!positive(self.watch.between, 1e30) || self.watch.between < lit(10.0), "between"),
            (self.watch.learning < 2, "learning"),
            (!(self.watch.floor >= T::zero() && self.watch.floor <= lit(1e30)), "floor"),
        ];
        match wrong.into_iter().find(|(wrong, _)| *wrong) {
            Some((_, name)) => Err(Problem::Range(name)),
            None => Ok(()),
        }
    }
}

/// An estimator of any arm.
#[derive(Debug, Clone, Copy)]
pub struct Online<T: Real> {
    choice: Choice<T>,
    running: Running<T>,
}

#[derive(Debug, Clone, Copy)]
enum Running<T: Real> {
    Axis(Watched<T, Axis<T>, 1, 4, 4>),
    AxisAsymmetric(Watched<T, Axis<T>, 1, 4, 5>),
    Pendulum(Watched<T, Pendulum<T>, 1, 4, 4>),
    PendulumAsymmetric(Watched<T, Pendulum<T>, 1, 4, 5>),
    TwoLink(Watched<T, TwoLink<T>, 2, 9, 9>),
    TwoLinkAsymmetric(Watched<T, TwoLink<T>, 2, 9, 11>),
}

impl<T: Real> Online<T> {
    /// An estimator that has seen nothing yet; `theta0` has one entry per parameter, or none for zeros.
    pub fn new(choice: Choice<T>, theta0: &[T]) -> core::result::Result<Self, Problem> {
        choice.check()?;
        let expected = choice.parameters();
        if !(theta0.is_empty() || theta0.len() == expected) {
            return Err(Problem::Length { name: "theta0", expected });
        }
        if !theta0.iter().all(|x| x.abs() <= lit(1e9)) {
            return Err(Problem::Range("theta0"));
        }
        // Neither gravity nor lengths occur in the regressors.
        let (gravity, length1) = (lit(9.81), T::zero());
        let running = match (choice.kind, choice.asymmetry) {
            (Kind::Axis, false) => Running::Axis(Watched::new(Axis { gravity }, &choice, theta0)),
            (Kind::Axis, true) => Running::AxisAsymmetric(Watched::new(Axis { gravity }, &choice, theta0)),
            (Kind::Pendulum, false) => Running::Pendulum(Watched::new(Pendulum { gravity }, &choice, theta0)),
            (Kind::Pendulum, true) => {
                Running::PendulumAsymmetric(Watched::new(Pendulum { gravity }, &choice, theta0))
            }
            (Kind::TwoLink, false) => {
                Running::TwoLink(Watched::new(TwoLink { gravity, length1 }, &choice, theta0))
            }
            (Kind::TwoLink, true) => {
                Running::TwoLinkAsymmetric(Watched::new(TwoLink { gravity, length1 }, &choice, theta0))
            }
        };
        Ok(Self { choice, running })
    }

    /// What was chosen.
    pub fn choice(&self) -> &Choice<T> {
        &self.choice
    }

    /// Takes one sample: positions, velocities where they are known, and the torques that act until the next sample.
    #[inline]
    pub fn update(
        &mut self,
        when: When<T>,
        q: &[T],
        dq: Option<&[T]>,
        tau: &[T],
    ) -> core::result::Result<Result, Problem> {
        let expected = self.choice.kind.joints();
        for (name, x) in [("q", q), ("dq", dq.unwrap_or(q)), ("tau", tau)] {
            if x.len() != expected {
                return Err(Problem::Length { name, expected });
            }
        }
        Ok(self.running_mut().update(when, q, dq, tau))
    }

    /// Estimate.
    #[inline]
    pub fn theta(&self) -> &[T] {
        self.running().theta()
    }

    /// Prediction errors of the last sample used, one per output.
    pub fn errors(&self) -> &[T] {
        let errors = self.running().errors();
        errors.get(..self.choice.outputs()).unwrap_or(errors)
    }

    /// Writes the diagonal of `P` into `out` and returns how many entries it has.
    pub fn variances(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        self.running().variances(out)
    }

    /// Writes standard deviations of the parameters into `out`, as if errors were white, and returns how many there are.
    pub fn sigma(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        let count = self.variances(out);
        let outputs = self.choice.outputs();
        let squares = self.running().mean_square().iter().take(outputs);
        let spread = squares.fold(T::zero(), |sum, x| sum + *x) / lit(outputs as f64);
        for x in out {
            *x = (*x * spread).max(T::zero()).sqrt();
        }
        count
    }

    /// Share of a full excitation, from 0 to about 1.
    pub fn excitation(&self) -> T {
        self.running().excitation()
    }

    /// Largest alarm sum as a share of its limit: above 1 the model no longer explains the arm.
    pub fn alarm_level(&self) -> T {
        self.running().alarm_level()
    }

    /// Samples used.
    pub fn updates(&self) -> u64 {
        self.running().updates()
    }

    /// Samples rejected.
    pub fn rejected(&self) -> u64 {
        self.running().rejected()
    }

    #[inline]
    fn running(&self) -> &dyn Run<T> {
        match &self.running {
            Running::Axis(x) => x,
            Running::AxisAsymmetric(x) => x,
            Running::Pendulum(x) => x,
            Running::PendulumAsymmetric(x) => x,
            Running::TwoLink(x) => x,
            Running::TwoLinkAsymmetric(x) => x,
        }
    }

    #[inline]
    fn running_mut(&mut self) -> &mut dyn Run<T> {
        match &mut self.running {
            Running::Axis(x) => x,
            Running::AxisAsymmetric(x) => x,
            Running::Pendulum(x) => x,
            Running::PendulumAsymmetric(x) => x,
            Running::TwoLink(x) => x,
            Running::TwoLinkAsymmetric(x) => x,
        }
    }
}

/// What every watched estimator can do.
trait Run<T: Real> {
    fn update(&mut self, when: When<T>, q: &[T], dq: Option<&[T]>, tau: &[T]) -> Result;
    fn theta(&self) -> &[T];
    fn errors(&self) -> &[T];
    fn variances(&self, out: &mut [T; MOST_PARAMETERS]) -> usize;
    fn mean_square(&self) -> &[T];
    fn excitation(&self) -> T;
    fn alarm_level(&self) -> T;
    fn updates(&self) -> u64;
    fn rejected(&self) -> u64;
}

/// An estimator with its monitor.
#[derive(Debug, Clone, Copy)]
struct Watched<T: Real, A, const N: usize, const P: usize, const R: usize> {
    estimator: Estimator<T, A, N, P, R>,
    monitor: Monitor<T, N>,
    errors: SVector<T, N>,
    /// Samples after which the past no longer counts.
    memory: T,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize> Watched<T, A, N, P, R> {
    fn new(arm: A, choice: &Choice<T>, theta0: &[T]) -> Self {
        let settings = Settings {
            scheme: choice.scheme,
            variant: choice.variant,
            cutoff: Cutoff { rad_per_s: choice.cutoff },
            forgetting: choice.forgetting,
            theta0: vector(theta0),
            p0: choice.p0,
        };
        let forgotten = T::one() - choice.forgetting;
        let estimator = Estimator::new(arm, settings);
        Self {
            estimator: match choice.form {
                Some(form) => estimator.with_form(form),
                None => estimator,
            },
            monitor: Monitor::new(choice.watch),
            errors: SVector::zeros(),
            memory: if forgotten > T::zero() { T::one() / forgotten } else { lit(1e30) },
        }
    }
}

/// The entries of a slice, zeros where it ends.
#[inline]
fn vector<T: Real, const N: usize>(x: &[T]) -> SVector<T, N> {
    let mut v = SVector::<T, N>::zeros();
    for (entry, value) in v.iter_mut().zip(x) {
        *entry = *value;
    }
    v
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize> Run<T>
    for Watched<T, A, N, P, R>
{
    #[inline]
    fn update(&mut self, when: When<T>, q: &[T], dq: Option<&[T]>, tau: &[T]) -> Result {
        let (q, dq, tau) = (vector(q), dq.map(vector), vector(tau));
        let outcome = match when {
            When::At(t) => self.estimator.update(&Sample { t, q, dq, tau }),
            When::After(h) => self.estimator.update_after(h, &Reading { q, dq, tau }),
        };
        match outcome {
            Outcome::Starting => Result::Starting,
            Outcome::Rejected => Result::Rejected,
            Outcome::Updated(error) => {
                let rls = self.estimator.rls();
                let age = self.memory.min(lit(rls.updates() as f64));
                self.monitor.update(&error, rls.leverage(), R, age);
                self.errors = error;
                Result::Updated
            }
        }
    }

    #[inline]
    fn theta(&self) -> &[T] {
        self.estimator.rls().theta().as_slice()
    }

    fn errors(&self) -> &[T] {
        self.errors.as_slice()
    }

    fn variances(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        let variances = self.estimator.rls().variances();
        *out = [T::zero(); MOST_PARAMETERS];
        for (x, v) in out.iter_mut().zip(variances.iter()) {
            *x = *v;
        }
        R
    }

    fn mean_square(&self) -> &[T] {
        self.monitor.mean_square().as_slice()
    }

    fn excitation(&self) -> T {
        self.monitor.excitation()
    }

    fn alarm_level(&self) -> T {
        self.monitor.alarm_level()
    }

    fn updates(&self) -> u64 {
        self.estimator.rls().updates()
    }

    fn rejected(&self) -> u64 {
        self.estimator.rejected()
    }
}
