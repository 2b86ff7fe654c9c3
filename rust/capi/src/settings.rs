//! Settings of online estimators in C, reports, and status codes.

use armgap_core::arm::ArmKind;
use armgap_core::monitor::MonitorSettings;
use armgap_core::online::{OnlineError, OnlineSettings};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;

/// Status that a function of the C interface returns.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum armgap_status {
    /// The call succeeded; an update has moved the estimate.
    ARMGAP_OK = 0,
    /// The sample was taken; there are not enough samples for an estimate yet.
    ARMGAP_STARTING = 1,
    /// The sample was not used: not finite, of impossible size, or not later than the last one. The estimate has not changed.
    ARMGAP_REJECTED = 2,
    /// A pointer is null.
    ARMGAP_NULL = -1,
    /// A pointer is not aligned for its type.
    ARMGAP_UNALIGNED = -2,
    /// An array has another length than the arm needs.
    ARMGAP_LENGTH = -3,
    /// A setting or a number is not finite or outside its range.
    ARMGAP_RANGE = -4,
    /// The estimator was never started, or its memory was overwritten.
    ARMGAP_NOT_STARTED = -5,
    /// The caller was compiled with another version of armgap.h.
    ARMGAP_VERSION = -6,
}

/// Kind of arm with dynamics in closed form, with the order of its parameters.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum armgap_arm {
    /// One linear joint; parameters: moving mass, weight along the axis, viscous, Coulomb.
    ARMGAP_AXIS = 0,
    /// One rotary joint under gravity; parameters: inertia, largest gravity torque, viscous, Coulomb.
    ARMGAP_PENDULUM = 1,
    /// The vertical two-link arm of Reyes and Kelly (1997); parameters: theta1 to theta5, viscous 1 and 2, Coulomb 1 and 2.
    ARMGAP_TWO_LINK = 2,
}

/// Regression model of an estimator, after Reyes and Kelly (1997).
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum armgap_scheme {
    /// Filtered dynamic model, Reyes and Kelly (1997), equation (24): one prediction error per joint [N m or N].
    ARMGAP_FILTERED_DYNAMIC = 0,
    /// Supplied energy model, Reyes and Kelly (1997), equation (28): one prediction error [J].
    ARMGAP_SUPPLIED_ENERGY = 1,
    /// Filtered power model, Reyes and Kelly (1997), equation (30): one prediction error [W].
    ARMGAP_FILTERED_POWER = 2,
}

/// Filters of an estimator.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum armgap_filters {
    /// Filters consistent with each other and with held torques.
    ARMGAP_EXACT = 0,
    /// Filters as printed by Reyes and Kelly (1997).
    ARMGAP_PAPER = 1,
}

/// Form in which an estimator keeps its covariance.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum armgap_form {
    /// Full matrix in double precision with p0 up to 1e6, factors U D U' otherwise.
    ARMGAP_DEFAULT_FORM = 0,
    /// Full matrix, updated by equation (21) of Reyes and Kelly (1997) as printed.
    ARMGAP_PLAIN = 1,
    /// Factors U D U' of the covariance, positive definite whatever the rounding.
    ARMGAP_FACTORIZED = 2,
}

/// Settings of an online estimator; `armgap_settings_default` fills them.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct armgap_settings {
    /// Kind of arm, an `armgap_arm`.
    pub arm: u32,
    /// Regression model, an `armgap_scheme`.
    pub scheme: u32,
    /// Filters, an `armgap_filters`.
    pub filters: u32,
    /// Form in which the covariance is kept, an `armgap_form`.
    pub form: u32,
    /// Whether one constant torque per joint is estimated after all other parameters: 0 or 1.
    pub asymmetry: u32,
    /// Number of samples used before the alarm begins to learn.
    pub settling: u32,
    /// Number of samples from which the alarm learns the sizes of the prediction errors, at least 2.
    pub learning: u32,
    /// Unused field, must be 0.
    pub reserved: u32,
    /// Cut-off of the filters, rad/s.
    pub cutoff: f64,
    /// Forgetting factor of recursive least squares, above 0 and at most 1.
    pub forgetting: f64,
    /// Initial variance of every parameter, at an error of unit variance; forgetting lifts no variance above it.
    pub p0: f64,
    /// Number of samples over which mean square error and excitation are averaged, at least 1.
    pub memory: f64,
    /// Mean number of samples between false alarms, at least 10.
    pub between: f64,
    /// Smallest standard deviation of a prediction error that matters, in the unit of the error.
    pub floor: f64,
}

/// Counts of samples, excitation and alarm of an estimator.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct armgap_report {
    /// Number of samples used.
    pub updates: u64,
    /// Number of samples rejected.
    pub rejected: u64,
    /// Excitation: near 1 while the motion excites every parameter, near 0 while it teaches nothing new.
    pub excitation: f64,
    /// Alarm level: above 1 the model no longer explains the arm.
    pub alarm: f64,
    /// Number of estimated parameters.
    pub parameters: u32,
    /// Number of prediction errors per sample.
    pub outputs: u32,
}

impl armgap_settings {
    /// Default settings for a kind of arm.
    pub(crate) fn of(kind: ArmKind) -> Self {
        let defaults = OnlineSettings::<f64>::new(kind);
        Self {
            arm: kind as u32,
            scheme: defaults.scheme as u32,
            filters: armgap_filters::ARMGAP_EXACT as u32,
            form: armgap_form::ARMGAP_DEFAULT_FORM as u32,
            asymmetry: 0,
            settling: defaults.monitor.settling,
            learning: defaults.monitor.learning,
            reserved: 0,
            cutoff: defaults.cutoff,
            forgetting: defaults.forgetting,
            p0: defaults.p0,
            memory: defaults.monitor.memory,
            between: defaults.monitor.between,
            floor: defaults.monitor.floor,
        }
    }

    /// Settings as `armgap-core` takes them; `None` if a choice is unknown.
    pub(crate) fn online_settings<T: Real>(&self) -> Option<OnlineSettings<T>> {
        let kind = kind_of(self.arm)?;
        Some(OnlineSettings {
            kind,
            scheme: *Scheme::ALL.get(self.scheme as usize)?,
            variant: *[Variant::Exact, Variant::Paper].get(self.filters as usize)?,
            form: *[None, Some(Form::Plain), Some(Form::Factorized)].get(self.form as usize)?,
            asymmetry: *[false, true].get(self.asymmetry as usize)?,
            cutoff: lit(self.cutoff),
            forgetting: lit(self.forgetting),
            p0: lit(self.p0),
            monitor: MonitorSettings {
                memory: lit(self.memory),
                settling: self.settling,
                learning: self.learning,
                between: lit(self.between),
                floor: lit(self.floor),
            },
        })
    }
}

/// Kind of arm by the number of an `armgap_arm`.
pub(crate) fn kind_of(arm: u32) -> Option<ArmKind> {
    ArmKind::ALL.get(arm as usize).copied()
}

/// Status code for an error of `armgap-core`.
pub(crate) fn status_of(error: OnlineError) -> armgap_status {
    match error {
        OnlineError::Range(_) => armgap_status::ARMGAP_RANGE,
        OnlineError::Length { .. } => armgap_status::ARMGAP_LENGTH,
    }
}

/// Fills `settings` with the defaults for an `armgap_arm`: filtered power model, exact filters at 50 rad/s, no forgetting.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_settings_default(settings: *mut armgap_settings, arm: u32) -> armgap_status {
    if settings.is_null() {
        return armgap_status::ARMGAP_NULL;
    }
    if !settings.is_aligned() {
        return armgap_status::ARMGAP_UNALIGNED;
    }
    let Some(kind) = kind_of(arm) else {
        return armgap_status::ARMGAP_RANGE;
    };
    // SAFETY: not null, aligned; that it points to the caller's settings is the caller's promise.
    unsafe { settings.write(armgap_settings::of(kind)) };
    armgap_status::ARMGAP_OK
}

/// Number of joints of an `armgap_arm`; 0 if `arm` is not one.
#[unsafe(no_mangle)]
pub extern "C" fn armgap_joints(arm: u32) -> usize {
    kind_of(arm).map_or(0, ArmKind::joints)
}

/// Number of parameters of an `armgap_arm` without constant torques; 0 if `arm` is not one.
#[unsafe(no_mangle)]
pub extern "C" fn armgap_parameters(arm: u32) -> usize {
    kind_of(arm).map_or(0, |kind| kind.parameters().len())
}

/// Message of one line for an `armgap_status`, never null.
#[unsafe(no_mangle)]
pub extern "C" fn armgap_message(status: i32) -> *const core::ffi::c_char {
    let text = match status {
        0 => c"done",
        1 => c"the sample was taken; there are not enough samples for an estimate yet",
        2 => c"the sample was not used: not finite, of impossible size, or not later than the last one",
        -1 => c"a pointer is null",
        -2 => c"a pointer is not aligned for its type",
        -3 => c"an array has another length than the arm needs",
        -4 => c"a setting or a number is not finite or outside its range",
        -5 => c"the estimator was never started, or its memory was overwritten",
        -6 => c"the caller was compiled with another version of armgap.h",
        _ => c"no armgap_status",
    };
    text.as_ptr()
}
