//! Estimators of serial arms: what is chosen before the first sample, and the functions in double precision.

use crate::chain_slot as slot;
use crate::settings::{armgap_filters, armgap_form, armgap_report, armgap_status};
use armgap_core::monitor::MonitorSettings;
use armgap_core::online::{EstimatorSettings, When};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use core::ffi::c_void;

/// Version of the functions and types of serial arms.
pub const ARMGAP_CHAIN_VERSION: u32 = 2;

/// Kinds of joint.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum armgap_joint_kind {
    /// Turns about its axis: rad, N m.
    ARMGAP_REVOLUTE = 0,
    /// Slides along its axis: m, N.
    ARMGAP_PRISMATIC = 1,
}

/// A joint of a serial arm, in the frame of the link before it, or of the base. The link's frame is the joint's, moved by the joint.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct armgap_joint {
    /// An `armgap_joint_kind`.
    pub kind: u32,
    /// Not used; 0.
    pub reserved: u32,
    /// Rotation matrix, row by row, from the joint's frame into that of the link before, at position 0.
    pub rotation: [f64; 9],
    /// Origin of the joint's frame in that of the link before [m].
    pub translation: [f64; 3],
    /// Unit vector along the axis, in the joint's frame.
    pub axis: [f64; 3],
}

/// Settings of an estimator of a serial arm; `armgap_chain_settings_default` fills them.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct armgap_chain_settings {
    /// `ARMGAP_CHAIN_VERSION`.
    pub version: u32,
    /// Number of joints, 1 to 7.
    pub joints: u32,
    /// Number of parameters that are estimated, 1 to 72.
    pub parameters: u32,
    /// An `armgap_scheme`.
    pub scheme: u32,
    /// An `armgap_filters`.
    pub filters: u32,
    /// An `armgap_form`.
    pub form: u32,
    /// Samples used before the alarm begins to learn.
    pub settling: u32,
    /// Samples from which the alarm learns the errors' sizes, at least 2.
    pub learning: u32,
    /// Acceleration of gravity in the frame of the base [m/s^2].
    pub gravity: [f64; 3],
    /// Cut-off of the filters, rad/s.
    pub cutoff: f64,
    /// Forgetting factor, above 0 and at most 1.
    pub forgetting: f64,
    /// Initial covariance, times the unit matrix; forgetting lifts no variance above it.
    pub p0: f64,
    /// Samples over which spread and excitation are averaged, at least 1.
    pub memory: f64,
    /// Mean samples between false alarms, at least 10.
    pub between: f64,
    /// Smallest standard deviation of an error that matters, in the error's unit.
    pub floor: f64,
}

impl armgap_chain_settings {
    /// The settings as the core takes them.
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

/// Fills `settings` for an arm with so many joints and estimated parameters on a level base: filtered power, exact filters at 50 rad/s, no
/// forgetting, gravity of 9.81 against z.
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

/// Bytes of memory that an estimator in double precision needs, aligned to 8; 0 if there is none of so many joints and parameters.
#[unsafe(no_mangle)]
pub extern "C" fn armgap_chain_size(joints: u32, parameters: u32) -> usize {
    slot::size::<f64>(joints, parameters)
}

/// Starts an estimator in `size` bytes of the caller's memory, at least `armgap_chain_size`. `joints` has one entry per joint, `columns` one per
/// estimated parameter, strictly ascending: indices from 0 into ten numbers of each link (mass, first moments x, y, z, second moments xx,
/// xy, yy, xz, yz, zz about the origin of its frame), then rotor inertias, viscous, Coulomb, and constant torques of all joints. `known`
/// holds the values of the first 13 numbers per joint, of which those count that are not estimated; optional, zeros by default. `theta0`
/// holds one start value per estimated parameter; optional, zeros by default. Starting again is allowed at any time.
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

/// Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, each of `joints`
/// entries. Whether velocities are given is settled by the first sample.
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

/// Takes one sample `h` seconds after the last one. Arguments as for `armgap_chain_update`.
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

/// Copies the estimate; `count` is the number of estimated parameters.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_theta(
    memory: *const c_void,
    theta: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::theta(memory, theta, count) }
}

/// Copies the diagonal of the covariance for an error of unit variance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_variances(
    memory: *const c_void,
    variances: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::variances(memory, variances, count) }
}

/// Copies the standard deviations of the estimate, as if errors were white.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_sigma(
    memory: *const c_void,
    sigma: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::sigma(memory, sigma, count) }
}

/// Copies the prediction errors of the last sample that was used; `count` is the number of outputs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_errors(
    memory: *const c_void,
    errors: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::errors(memory, errors, count) }
}

/// Fills `report`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_report_of(
    memory: *const c_void,
    report: *mut armgap_report,
) -> armgap_status {
    unsafe { slot::report::<f64>(memory, report) }
}
