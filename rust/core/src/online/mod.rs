//! Online estimator and monitor behind one trait for every arm, for callers that choose the arm at run time: the C and Python interfaces.
//! [`Online`] is an estimator of one of the arms of [`ArmKind`], [`ChainEstimator`] one of a serial arm.
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

/// Largest number of estimated parameters of any of the arms of [`ArmKind`], constant torques included.
pub const MOST_PARAMETERS: usize = 11;
/// Largest number of joints of any of the arms of [`ArmKind`].
pub const MOST_JOINTS: usize = 2;

/// Settings of an online estimator of one of the arms of [`ArmKind`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnlineSettings<T> {
    /// Kind of arm.
    pub kind: ArmKind,
    /// Regression model: filtered dynamic, supplied energy or filtered power.
    pub scheme: Scheme,
    /// Filters and alignment of signals: as in Reyes and Kelly (1997), or consistent.
    pub variant: Variant,
    /// Form in which the covariance is kept; `None` for the default by precision and `p0` ([`Form::default_for`]).
    pub form: Option<Form>,
    /// Whether one constant torque per joint is estimated in addition to the arm's parameters.
    pub asymmetry: bool,
    /// Cut-off of the filters, rad/s.
    pub cutoff: T,
    /// Forgetting factor of recursive least squares, in `(0, 1]`.
    pub forgetting: T,
    /// Initial variance of every parameter, `P(0) = p0 I`; forgetting lifts no variance above it.
    pub p0: T,
    /// Settings of the monitor.
    pub monitor: MonitorSettings<T>,
}

/// Settings of an online estimator that do not depend on the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimatorSettings<T> {
    /// Regression model: filtered dynamic, supplied energy or filtered power.
    pub scheme: Scheme,
    /// Filters and alignment of signals: as in Reyes and Kelly (1997), or consistent.
    pub variant: Variant,
    /// Form in which the covariance is kept; `None` for the default by precision and `p0` ([`Form::default_for`]).
    pub form: Option<Form>,
    /// Cut-off of the filters, rad/s.
    pub cutoff: T,
    /// Forgetting factor of recursive least squares, in `(0, 1]`.
    pub forgetting: T,
    /// Initial variance of every parameter, `P(0) = p0 I`; forgetting lifts no variance above it.
    pub p0: T,
    /// Settings of the monitor.
    pub monitor: MonitorSettings<T>,
}

/// Error that prevents an online estimator from being made or a sample from being read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnlineError {
    /// The named setting is not finite or outside its range.
    Range(&'static str),
    /// A slice has another length than the arm needs.
    Length {
        /// Name of the slice.
        name: &'static str,
        /// Length that the arm needs.
        expected: usize,
    },
}

/// Time of a sample, absolute or from the last sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum When<T> {
    /// Time of the sample, s.
    At(T),
    /// Time since the last sample, s.
    After(T),
}

/// What an online estimator did with a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SampleStatus {
    /// The sample was taken, but there are not enough samples yet for a regression.
    Starting,
    /// The estimate was updated.
    Updated,
    /// The sample was not used: not finite, of impossible size or not later than the last.
    Rejected,
}

impl<T: Real> Default for EstimatorSettings<T> {
    /// Filtered power model with consistent filters at 50 rad/s, without forgetting.
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
    /// Number of prediction errors per sample for an arm with this number of joints.
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
    /// The defaults of [`EstimatorSettings`] for an arm of this kind, without constant torques.
    pub fn new(kind: ArmKind) -> Self {
        Self::of(kind, false, EstimatorSettings::default())
    }

    /// The settings `common` for an arm of this kind; `asymmetry` estimates one constant torque per joint in addition to the arm's parameters.
    pub fn of(kind: ArmKind, asymmetry: bool, common: EstimatorSettings<T>) -> Self {
        let EstimatorSettings { scheme, variant, form, cutoff, forgetting, p0, monitor } = common;
        Self { kind, scheme, variant, form, asymmetry, cutoff, forgetting, p0, monitor }
    }

    /// Settings that do not depend on the kind of arm.
    fn common(&self) -> EstimatorSettings<T> {
        let Self { scheme, variant, form, cutoff, forgetting, p0, monitor, .. } = *self;
        EstimatorSettings { scheme, variant, form, cutoff, forgetting, p0, monitor }
    }

    /// Number of estimated parameters, constant torques included.
    pub fn parameters(&self) -> usize {
        let extra = if self.asymmetry { self.kind.joints() } else { 0 };
        self.kind.parameters().len() + extra
    }

    /// Number of prediction errors per sample.
    pub fn outputs(&self) -> usize {
        self.common().outputs(self.kind.joints())
    }
}

/// Error unless the initial estimate `theta0` is empty or of the expected length, and its values are of possible size.
fn check_start<T: Real>(theta0: &[T], expected: usize) -> Result<(), OnlineError> {
    if !(theta0.is_empty() || theta0.len() == expected) {
        return Err(OnlineError::Length { name: "theta0", expected });
    }
    if !theta0.iter().all(|x| x.abs() <= lit(1e9)) {
        return Err(OnlineError::Range("theta0"));
    }
    Ok(())
}

/// Online estimator, with monitor, of one of the arms of [`ArmKind`].
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
    /// Estimator before its first sample; the initial estimate `theta0` has one entry per estimated parameter, or is empty for zeros.
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

    /// Settings that the estimator was made with.
    pub fn settings(&self) -> &OnlineSettings<T> {
        &self.settings
    }

    /// Estimator of the arm that was chosen at run time, behind the common trait, for reading.
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

    /// Estimator of the arm that was chosen at run time, behind the common trait, for taking samples.
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

    /// Estimated parameters, SI.
    #[inline]
    pub fn theta(&self) -> &[T] {
        self.estimator().theta()
    }

    /// Prediction errors of the last sample used, N m, J or W by scheme: one per joint for the filtered dynamic model, else one.
    pub fn errors(&self) -> &[T] {
        self.estimator().errors()
    }

    /// Writes the diagonal of the covariance `P`, for an error of unit variance, into `out`, and returns the number of estimated parameters.
    pub fn variances(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        self.estimator().variances(out)
    }

    /// Writes standard deviations of the parameters, SI, into `out`, as if prediction errors were white, and returns their number.
    pub fn sigma(&self, out: &mut [T; MOST_PARAMETERS]) -> usize {
        self.estimator().sigma(out)
    }

    /// Writes the covariance `P`, for an error of unit variance, into `out`, row by row, and returns the number of parameters.
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

    /// Excitation by the recent motion, from 0 (none) to about 1 (every parameter).
    pub fn excitation(&self) -> T {
        self.estimator().excitation()
    }

    /// Largest cumulative sum of the alarm test as a share of its limit: above 1 the model no longer explains the arm.
    pub fn alarm_level(&self) -> T {
        self.estimator().alarm_level()
    }

    /// Number of samples used.
    pub fn updates(&self) -> u64 {
        self.estimator().updates()
    }

    /// Number of samples rejected.
    pub fn rejected(&self) -> u64 {
        self.estimator().rejected()
    }
}
