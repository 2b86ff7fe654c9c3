//! Estimator and monitor behind one type for every arm, for callers that choose the arm at run time: the C and Python interfaces.
//!
//! Vectors come as slices; a slice of the wrong length is an error, never a panic.

use crate::arm::{Arm, ArmKind, Axis, Pendulum, TwoLink};
use crate::filter::Cutoff;
use crate::identify::{Estimator, Outcome, Reading, Sample, Settings};
use crate::monitor::{Monitor, MonitorSettings};
use crate::real::{Real, lit};
use crate::regression::{Scheme, Variant};
use crate::rls::Form;
use nalgebra::SVector;

/// Largest number of parameters of any arm, asymmetries included.
pub const MOST_PARAMETERS: usize = 11;
/// Largest number of joints of any arm.
pub const MOST_JOINTS: usize = 2;

/// Settings of an online estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnlineSettings<T> {
    /// Kind of arm.
    pub kind: ArmKind,
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
    pub monitor: MonitorSettings<T>,
}

/// Why an estimator cannot be made or a sample cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnlineError {
    /// A setting is not finite or outside its range.
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
pub enum SampleStatus {
    /// Taken; not enough samples for a regression yet.
    Starting,
    /// The estimate was updated.
    Updated,
    /// Not used.
    Rejected,
}

impl<T: Real> OnlineSettings<T> {
    /// The filtered power model with consistent filters at 50 rad/s, without forgetting.
    pub fn new(kind: ArmKind) -> Self {
        Self {
            kind,
            scheme: Scheme::FilteredPower,
            variant: Variant::Exact,
            form: None,
            asymmetry: false,
            cutoff: lit(50.0),
            forgetting: T::one(),
            p0: lit(1000.0),
            monitor: MonitorSettings::default(),
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

    fn check(&self) -> Result<(), OnlineError> {
        let positive = |x: T, most: f64| x > T::zero() && x <= lit(most);
        let wrong = [
            (!positive(self.cutoff, 1e6), "cutoff"),
            (!positive(self.forgetting, 1.0), "forgetting"),
            (!positive(self.p0, 1e12), "p0"),
            (!positive(self.monitor.memory, 1e12) || self.monitor.memory < T::one(), "memory"),
            (!positive(self.monitor.between, 1e30) || self.monitor.between < lit(10.0), "between"),
            (self.monitor.learning < 2, "learning"),
            (!(self.monitor.floor >= T::zero() && self.monitor.floor <= lit(1e30)), "floor"),
        ];
        match wrong.into_iter().find(|(wrong, _)| *wrong) {
            Some((_, name)) => Err(OnlineError::Range(name)),
            None => Ok(()),
        }
    }
}

/// An estimator of any arm.
#[derive(Debug, Clone, Copy)]
pub struct Online<T: Real> {
    settings: OnlineSettings<T>,
    running: EstimatorOfArm<T>,
}

#[derive(Debug, Clone, Copy)]
enum EstimatorOfArm<T: Real> {
    Axis(MonitoredEstimator<T, Axis<T>, 1, 4, 4>),
    AxisAsymmetric(MonitoredEstimator<T, Axis<T>, 1, 4, 5>),
    Pendulum(MonitoredEstimator<T, Pendulum<T>, 1, 4, 4>),
    PendulumAsymmetric(MonitoredEstimator<T, Pendulum<T>, 1, 4, 5>),
    TwoLink(MonitoredEstimator<T, TwoLink<T>, 2, 9, 9>),
    TwoLinkAsymmetric(MonitoredEstimator<T, TwoLink<T>, 2, 9, 11>),
}

impl<T: Real> Online<T> {
    /// An estimator that has seen nothing yet; `theta0` has one entry per parameter, or none for zeros.
    pub fn new(settings: OnlineSettings<T>, theta0: &[T]) -> Result<Self, OnlineError> {
        settings.check()?;
        let expected = settings.parameters();
        if !(theta0.is_empty() || theta0.len() == expected) {
            return Err(OnlineError::Length { name: "theta0", expected });
        }
        if !theta0.iter().all(|x| x.abs() <= lit(1e9)) {
            return Err(OnlineError::Range("theta0"));
        }
        // Neither gravity nor lengths occur in the regressors.
        let (gravity, length1) = (lit(9.81), T::zero());
        let running = match (settings.kind, settings.asymmetry) {
            (ArmKind::Axis, false) => {
                EstimatorOfArm::Axis(MonitoredEstimator::new(Axis { gravity }, &settings, theta0))
            }
            (ArmKind::Axis, true) => {
                EstimatorOfArm::AxisAsymmetric(MonitoredEstimator::new(Axis { gravity }, &settings, theta0))
            }
            (ArmKind::Pendulum, false) => {
                EstimatorOfArm::Pendulum(MonitoredEstimator::new(Pendulum { gravity }, &settings, theta0))
            }
            (ArmKind::Pendulum, true) => EstimatorOfArm::PendulumAsymmetric(MonitoredEstimator::new(
                Pendulum { gravity },
                &settings,
                theta0,
            )),
            (ArmKind::TwoLink, false) => EstimatorOfArm::TwoLink(MonitoredEstimator::new(
                TwoLink { gravity, length1 },
                &settings,
                theta0,
            )),
            (ArmKind::TwoLink, true) => EstimatorOfArm::TwoLinkAsymmetric(MonitoredEstimator::new(
                TwoLink { gravity, length1 },
                &settings,
                theta0,
            )),
        };
        Ok(Self { settings, running })
    }

    /// The settings.
    pub fn settings(&self) -> &OnlineSettings<T> {
        &self.settings
    }

    /// Takes one sample: positions, velocities where they are known, and the torques that act until the next sample.
    #[inline]
    pub fn update(
        &mut self,
        when: When<T>,
        q: &[T],
        dq: Option<&[T]>,
        tau: &[T],
    ) -> Result<SampleStatus, OnlineError> {
        let expected = self.settings.kind.joints();
        for (name, x) in [("q", q), ("dq", dq.unwrap_or(q)), ("tau", tau)] {
            if x.len() != expected {
                return Err(OnlineError::Length { name, expected });
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
        errors.get(..self.settings.outputs()).unwrap_or(errors)
    }

    /// Writes the diagonal of `P` into `out` and returns how many entries it has.
    pub fn variances(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        self.running().variances(out)
    }

    /// Writes standard deviations of the parameters into `out`, as if errors were white, and returns how many there are.
    pub fn sigma(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        let count = self.variances(out);
        let outputs = self.settings.outputs();
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
    fn running(&self) -> &dyn DynEstimator<T> {
        match &self.running {
            EstimatorOfArm::Axis(x) => x,
            EstimatorOfArm::AxisAsymmetric(x) => x,
            EstimatorOfArm::Pendulum(x) => x,
            EstimatorOfArm::PendulumAsymmetric(x) => x,
            EstimatorOfArm::TwoLink(x) => x,
            EstimatorOfArm::TwoLinkAsymmetric(x) => x,
        }
    }

    #[inline]
    fn running_mut(&mut self) -> &mut dyn DynEstimator<T> {
        match &mut self.running {
            EstimatorOfArm::Axis(x) => x,
            EstimatorOfArm::AxisAsymmetric(x) => x,
            EstimatorOfArm::Pendulum(x) => x,
            EstimatorOfArm::PendulumAsymmetric(x) => x,
            EstimatorOfArm::TwoLink(x) => x,
            EstimatorOfArm::TwoLinkAsymmetric(x) => x,
        }
    }
}

/// What every monitored estimator can do.
trait DynEstimator<T: Real> {
    fn update(&mut self, when: When<T>, q: &[T], dq: Option<&[T]>, tau: &[T]) -> SampleStatus;
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
struct MonitoredEstimator<T: Real, A, const N: usize, const P: usize, const R: usize> {
    estimator: Estimator<T, A, N, P, R>,
    monitor: Monitor<T, N>,
    errors: SVector<T, N>,
    /// Samples after which the past no longer counts.
    memory: T,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize>
    MonitoredEstimator<T, A, N, P, R>
{
    fn new(arm: A, settings: &OnlineSettings<T>, theta0: &[T]) -> Self {
        let estimator_settings = Settings {
            scheme: settings.scheme,
            variant: settings.variant,
            cutoff: Cutoff { rad_per_s: settings.cutoff },
            forgetting: settings.forgetting,
            theta0: vector(theta0),
            p0: settings.p0,
        };
        let forgotten = T::one() - settings.forgetting;
        let estimator = Estimator::new(arm, estimator_settings);
        Self {
            estimator: match settings.form {
                Some(form) => estimator.with_form(form),
                None => estimator,
            },
            monitor: Monitor::new(settings.monitor),
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

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize> DynEstimator<T>
    for MonitoredEstimator<T, A, N, P, R>
{
    #[inline]
    fn update(&mut self, when: When<T>, q: &[T], dq: Option<&[T]>, tau: &[T]) -> SampleStatus {
        let (q, dq, tau) = (vector(q), dq.map(vector), vector(tau));
        let outcome = match when {
            When::At(t) => self.estimator.update(&Sample { t, q, dq, tau }),
            When::After(h) => self.estimator.update_after(h, &Reading { q, dq, tau }),
        };
        match outcome {
            Outcome::Starting => SampleStatus::Starting,
            Outcome::Rejected => SampleStatus::Rejected,
            Outcome::Updated(error) => {
                let rls = self.estimator.rls();
                let age = self.memory.min(lit(rls.updates() as f64));
                self.monitor.update(&error, rls.leverage(), R, age);
                self.errors = error;
                SampleStatus::Updated
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
