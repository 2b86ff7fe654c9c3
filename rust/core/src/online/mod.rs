//! Estimator and monitor behind one trait for every arm, for callers that choose the arm at run time: the C and Python interfaces.
//! [`Online`] is an estimator of one of the arms of [`ArmKind`]; `chain` has those of serial arms.
//!
//! Vectors come as slices; a slice of the wrong length is an error, never a panic.

mod chain;
mod monitored;

pub use chain::{ChainEstimator, ChainSettings, ChainSize, LargeChain, MediumChain, SmallChain};
pub use monitored::{MonitoredEstimator, OnlineEstimator};

use crate::arm::{ArmKind, Axis, Pendulum, TwoLink};
use crate::monitor::MonitorSettings;
use crate::real::{Real, lit};
use crate::regression::{Scheme, Variant};
use crate::rls::Form;

/// Largest number of parameters of any of the arms of [`ArmKind`], asymmetries included.
pub const MOST_PARAMETERS: usize = 11;
/// Largest number of joints of any of them.
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

/// Settings of an estimator of any arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimatorSettings<T> {
    /// Regression model.
    pub scheme: Scheme,
    /// Filters and alignment.
    pub variant: Variant,
    /// How the covariance is kept; by default as suits the precision and `p0`.
    pub form: Option<Form>,
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

impl<T: Real> Default for EstimatorSettings<T> {
    /// The filtered power model with consistent filters at 50 rad/s, without forgetting.
    fn default() -> Self {
        Self {
            scheme: Scheme::FilteredPower,
            variant: Variant::Exact,
            form: None,
            cutoff: lit(50.0),
            forgetting: T::one(),
            p0: lit(1000.0),
            monitor: MonitorSettings::default(),
        }
    }
}

impl<T: Real> EstimatorSettings<T> {
    /// Number of prediction errors per sample of an arm with so many joints.
    pub fn outputs(&self, joints: usize) -> usize {
        if self.scheme == Scheme::FilteredDynamic { joints } else { 1 }
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

impl<T: Real> OnlineSettings<T> {
    /// The defaults of [`EstimatorSettings`].
    pub fn new(kind: ArmKind) -> Self {
        Self::of(kind, false, EstimatorSettings::default())
    }

    /// These settings for a kind of arm.
    pub fn of(kind: ArmKind, asymmetry: bool, common: EstimatorSettings<T>) -> Self {
        let EstimatorSettings { scheme, variant, form, cutoff, forgetting, p0, monitor } = common;
        Self { kind, scheme, variant, form, asymmetry, cutoff, forgetting, p0, monitor }
    }

    /// What does not depend on the kind of arm.
    fn common(&self) -> EstimatorSettings<T> {
        let Self { scheme, variant, form, cutoff, forgetting, p0, monitor, .. } = *self;
        EstimatorSettings { scheme, variant, form, cutoff, forgetting, p0, monitor }
    }

    /// Number of parameters that are estimated.
    pub fn parameters(&self) -> usize {
        let extra = if self.asymmetry { self.kind.joints() } else { 0 };
        self.kind.parameters().len() + extra
    }

    /// Number of prediction errors per sample.
    pub fn outputs(&self) -> usize {
        self.common().outputs(self.kind.joints())
    }
}

/// A start of the right length, or none, and of possible size.
fn check_start<T: Real>(theta0: &[T], expected: usize) -> Result<(), OnlineError> {
    if !(theta0.is_empty() || theta0.len() == expected) {
        return Err(OnlineError::Length { name: "theta0", expected });
    }
    if !theta0.iter().all(|x| x.abs() <= lit(1e9)) {
        return Err(OnlineError::Range("theta0"));
    }
    Ok(())
}

/// An estimator of one of the arms of [`ArmKind`].
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
        let common = settings.common();
        common.check()?;
        let expected = settings.parameters();
        check_start(theta0, expected)?;
        // Neither gravity nor lengths occur in the regressors.
        let (gravity, length1) = (lit(9.81), T::zero());
        let running = match (settings.kind, settings.asymmetry) {
            (ArmKind::Axis, false) => {
                EstimatorOfArm::Axis(MonitoredEstimator::new(Axis { gravity }, &common, theta0))
            }
            (ArmKind::Axis, true) => {
                let arm = Axis { gravity };
                EstimatorOfArm::AxisAsymmetric(MonitoredEstimator::new(arm, &common, theta0))
            }
            (ArmKind::Pendulum, false) => {
                let arm = Pendulum { gravity };
                EstimatorOfArm::Pendulum(MonitoredEstimator::new(arm, &common, theta0))
            }
            (ArmKind::Pendulum, true) => {
                let arm = Pendulum { gravity };
                EstimatorOfArm::PendulumAsymmetric(MonitoredEstimator::new(arm, &common, theta0))
            }
            (ArmKind::TwoLink, false) => {
                let arm = TwoLink { gravity, length1 };
                EstimatorOfArm::TwoLink(MonitoredEstimator::new(arm, &common, theta0))
            }
            (ArmKind::TwoLink, true) => {
                let arm = TwoLink { gravity, length1 };
                EstimatorOfArm::TwoLinkAsymmetric(MonitoredEstimator::new(arm, &common, theta0))
            }
        };
        Ok(Self { settings, running })
    }

    /// The settings.
    pub fn settings(&self) -> &OnlineSettings<T> {
        &self.settings
    }

    /// The estimator, whatever its arm.
    #[inline]
    pub fn estimator(&self) -> &dyn OnlineEstimator<T> {
        match &self.running {
            EstimatorOfArm::Axis(x) => x,
            EstimatorOfArm::AxisAsymmetric(x) => x,
            EstimatorOfArm::Pendulum(x) => x,
            EstimatorOfArm::PendulumAsymmetric(x) => x,
            EstimatorOfArm::TwoLink(x) => x,
            EstimatorOfArm::TwoLinkAsymmetric(x) => x,
        }
    }

    /// The estimator, whatever its arm, to take samples.
    #[inline]
    pub fn estimator_mut(&mut self) -> &mut dyn OnlineEstimator<T> {
        match &mut self.running {
            EstimatorOfArm::Axis(x) => x,
            EstimatorOfArm::AxisAsymmetric(x) => x,
            EstimatorOfArm::Pendulum(x) => x,
            EstimatorOfArm::PendulumAsymmetric(x) => x,
            EstimatorOfArm::TwoLink(x) => x,
            EstimatorOfArm::TwoLinkAsymmetric(x) => x,
        }
    }

    /// Takes one sample; see [`OnlineEstimator::update`].
    #[inline]
    pub fn update(
        &mut self,
        when: When<T>,
        q: &[T],
        dq: Option<&[T]>,
        tau: &[T],
    ) -> Result<SampleStatus, OnlineError> {
        self.estimator_mut().update(when, q, dq, tau)
    }

    /// Estimate.
    #[inline]
    pub fn theta(&self) -> &[T] {
        self.estimator().theta()
    }

    /// Prediction errors of the last sample used, one per output.
    pub fn errors(&self) -> &[T] {
        self.estimator().errors()
    }

    /// Writes the diagonal of `P` into `out` and returns how many entries it has.
    pub fn variances(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        self.estimator().variances(out)
    }

    /// Writes standard deviations of the parameters into `out`, as if errors were white, and returns how many there are.
    pub fn sigma(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        self.estimator().sigma(out)
    }

    /// Writes the covariance for an error of unit variance into `out`, row by row, and returns the number of parameters.
    pub fn covariance(&self, out: &mut [T]) -> usize {
        match &self.running {
            EstimatorOfArm::Axis(x) => x.covariance(out),
            EstimatorOfArm::AxisAsymmetric(x) => x.covariance(out),
            EstimatorOfArm::Pendulum(x) => x.covariance(out),
            EstimatorOfArm::PendulumAsymmetric(x) => x.covariance(out),
            EstimatorOfArm::TwoLink(x) => x.covariance(out),
            EstimatorOfArm::TwoLinkAsymmetric(x) => x.covariance(out),
        }
    }

    /// Share of a full excitation, from 0 to about 1.
    pub fn excitation(&self) -> T {
        self.estimator().excitation()
    }

    /// Largest alarm sum as a share of its limit: above 1 the model no longer explains the arm.
    pub fn alarm_level(&self) -> T {
        self.estimator().alarm_level()
    }

    /// Samples used.
    pub fn updates(&self) -> u64 {
        self.estimator().updates()
    }

    /// Samples rejected.
    pub fn rejected(&self) -> u64 {
        self.estimator().rejected()
    }
}
