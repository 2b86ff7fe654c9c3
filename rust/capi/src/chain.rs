//! Online estimators of serial arms in C: settings, and functions in double precision.

use crate::chain_slot as slot;
use crate::settings::{armgap_filters, armgap_form, armgap_report, armgap_status};
use armgap_core::monitor::MonitorSettings;
use armgap_core::online::{EstimatorSettings, When};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use core::ffi::c_void;

/// Version of the C functions and types of serial arms.
pub const ARMGAP_CHAIN_VERSION: u32 = 2;

/// Kind of a joint: revolute or prismatic.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum armgap_joint_kind {
    /// The joint turns about its axis: rad, N m.
    ARMGAP_REVOLUTE = 0,
    /// The joint slides along its axis: m, N.
    ARMGAP_PRISMATIC = 1,
}

/// Joint of a serial arm, in the frame of the previous link, or of the base. At position 0 the link's frame is the joint's frame.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct armgap_joint {
    /// Kind of the joint, an `armgap_joint_kind`.
    pub kind: u32,
    /// Unused field, must be 0.
    pub reserved: u32,
    /// Rotation matrix, row by row, from the joint's frame into the frame of the previous link, at position 0.
    pub rotation: [f64; 9],
    /// Origin of the joint's frame in the frame of the previous link [m].
    pub translation: [f64; 3],
    /// Unit vector along the joint's axis, in the joint's frame.
    pub axis: [f64; 3],
}

/// Settings of an online estimator of a serial arm; `armgap_chain_settings_default` fills them.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct armgap_chain_settings {
    /// Version of the interface, `ARMGAP_CHAIN_VERSION`.
    pub version: u32,
    /// Number of joints of the arm, 1 to 7.
    pub joints: u32,
    /// Number of estimated parameters, 1 to 72.
    pub parameters: u32,
    /// Regression model, an `armgap_scheme`.
    pub scheme: u32,
    /// Filters, an `armgap_filters`.
    pub filters: u32,
    /// Form in which the covariance is kept, an `armgap_form`.
    pub form: u32,
    /// Number of samples used before the alarm begins to learn.
    pub settling: u32,
    /// Number of samples from which the alarm learns the sizes of the prediction errors, at least 2.
    pub learning: u32,
    /// Acceleration of gravity in the frame of the base [m/s^2].
    pub gravity: [f64; 3],
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

impl armgap_chain_settings {
    /// Settings as `armgap-core` takes them; `None` if a choice is unknown.
    pub(crate) fn common<T: Real>(&self) -> Option<EstimatorSettings<T>> {
        Some(EstimatorSettings {
            scheme: *Scheme::ALL.get(self.scheme as usize)?,
            variant: *[Variant::Exact, Variant::Paper].get(self.filters as usize)?,
            form: *[None, Some(Form::Plain), Some(Form::Factorized)].get(self.form as usize)?,
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

/// Fills `settings` for an arm with this number of joints and estimated parameters on a level base: filtered power model, exact filters at 50 rad/s,
/// no forgetting, gravity of 9.81 m/s^2 against z.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_settings_default(
    settings: *mut armgap_chain_settings,
    joints: u32,
    parameters: u32,
) -> armgap_status {
    if settings.is_null() {
        return armgap_status::ARMGAP_NULL;
    }
    if !settings.is_aligned() {
        return armgap_status::ARMGAP_UNALIGNED;
    }
    if slot::size::<f64>(joints, parameters) == 0 {
        return armgap_status::ARMGAP_RANGE;
    }
    let defaults = EstimatorSettings::<f64>::default();
    let filled = armgap_chain_settings {
        version: ARMGAP_CHAIN_VERSION,
        joints,
        parameters,
        scheme: defaults.scheme as u32,
        filters: armgap_filters::ARMGAP_EXACT as u32,
        form: armgap_form::ARMGAP_DEFAULT_FORM as u32,
        settling: defaults.monitor.settling,
        learning: defaults.monitor.learning,
        gravity: [0.0, 0.0, -9.81],
        cutoff: defaults.cutoff,
        forgetting: defaults.forgetting,
        p0: defaults.p0,
        memory: defaults.monitor.memory,
        between: defaults.monitor.between,
        floor: defaults.monitor.floor,
    };
    // SAFETY: not null, aligned; that it points to the caller's settings is the caller's promise.
    unsafe { settings.write(filled) };
    armgap_status::ARMGAP_OK
}

/// Bytes of memory, aligned to 8, of an estimator of a serial arm in double precision; 0 if there is none for this number of joints and parameters.
#[unsafe(no_mangle)]
pub extern "C" fn armgap_chain_size(joints: u32, parameters: u32) -> usize {
    slot::size::<f64>(joints, parameters)
}

/// Starts an estimator of a serial arm in `size` bytes of the caller's memory, at least `armgap_chain_size`. `joints` has one entry per joint,
/// `columns` one per estimated parameter, strictly ascending: indices from 0 into ten numbers of each link (mass, first moments x, y, z, second
/// moments xx, xy, yy, xz, yz, zz about the origin of the link's frame), then rotor inertias, viscous, Coulomb, and constant torques of all joints.
/// `known` holds values of the first 13 numbers per joint, SI, used for those that are not estimated; optional, zeros by default. `theta0` holds one
/// start value per estimated parameter; optional, zeros by default. Starting again is allowed at any time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_start(
    memory: *mut c_void,
    size: usize,
    settings: *const armgap_chain_settings,
    joints: *const armgap_joint,
    columns: *const u32,
    known: *const f64,
    theta0: *const f64,
) -> armgap_status {
    unsafe { slot::start::<f64>(memory, size, settings, joints, columns, known, theta0) }
}

/// Takes one sample of a serial arm at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, SI, each of
/// `joints` entries. Whether velocities are given is settled by the first sample.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_update(
    memory: *mut c_void,
    t: f64,
    q: *const f64,
    dq: *const f64,
    tau: *const f64,
    joints: usize,
) -> armgap_status {
    unsafe { slot::update(memory, When::At(t), q, dq, tau, joints) }
}

/// Takes one sample of a serial arm `h` seconds after the last one. Arguments as for `armgap_chain_update`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_update_after(
    memory: *mut c_void,
    h: f64,
    q: *const f64,
    dq: *const f64,
    tau: *const f64,
    joints: usize,
) -> armgap_status {
    unsafe { slot::update(memory, When::After(h), q, dq, tau, joints) }
}

/// Copies the estimated parameters of a serial arm, SI; `count` is their number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_theta(
    memory: *const c_void,
    theta: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::theta(memory, theta, count) }
}

/// Copies the `count` diagonal entries of the covariance of the estimate, for a prediction error of unit variance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_variances(
    memory: *const c_void,
    variances: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::variances(memory, variances, count) }
}

/// Copies the `count` standard deviations of the estimated parameters, SI, as if prediction errors were white.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_sigma(
    memory: *const c_void,
    sigma: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::sigma(memory, sigma, count) }
}

/// Copies the prediction errors of the last sample that was used, N m, J or W by scheme; `count` is `outputs` of the report.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_errors(
    memory: *const c_void,
    errors: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::errors(memory, errors, count) }
}

/// Fills `report` with counts of samples, excitation and alarm of an estimator of a serial arm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_report_of(
    memory: *const c_void,
    report: *mut armgap_report,
) -> armgap_status {
    unsafe { slot::report::<f64>(memory, report) }
}
