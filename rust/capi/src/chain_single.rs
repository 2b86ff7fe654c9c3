//! Online estimators of serial arms in C: functions in single precision.

use crate::chain::{armgap_chain_settings, armgap_joint};
use crate::chain_slot as slot;
use crate::settings::{armgap_report, armgap_status};
use armgap_core::online::When;
use core::ffi::c_void;

/// Bytes of memory, aligned to 8, of an estimator of a serial arm in single precision; 0 if there is none for this number of joints and parameters.
#[unsafe(no_mangle)]
pub extern "C" fn armgap_chain_size_f32(joints: u32, parameters: u32) -> usize {
    slot::size::<f32>(joints, parameters)
}

/// Starts an estimator of a serial arm in `size` bytes of the caller's memory, at least `armgap_chain_size_f32`. `joints` has one entry per joint,
/// `columns` one per estimated parameter, strictly ascending: indices from 0 into ten numbers of each link (mass, first moments x, y, z, second
/// moments xx, xy, yy, xz, yz, zz about the origin of the link's frame), then rotor inertias, viscous, Coulomb, and constant torques of all joints.
/// `known` holds values of the first 13 numbers per joint, SI, used for those that are not estimated; optional, zeros by default. `theta0` holds one
/// start value per estimated parameter; optional, zeros by default. Starting again is allowed at any time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_start_f32(
    memory: *mut c_void,
    size: usize,
    settings: *const armgap_chain_settings,
    joints: *const armgap_joint,
    columns: *const u32,
    known: *const f64,
    theta0: *const f32,
) -> armgap_status {
    unsafe { slot::start::<f32>(memory, size, settings, joints, columns, known, theta0) }
}

/// Takes one sample of a serial arm at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, SI, each of
/// `joints` entries. Whether velocities are given is settled by the first sample.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_update_f32(
    memory: *mut c_void,
    t: f32,
    q: *const f32,
    dq: *const f32,
    tau: *const f32,
    joints: usize,
) -> armgap_status {
    unsafe { slot::update(memory, When::At(t), q, dq, tau, joints) }
}

/// Takes one sample of a serial arm `h` seconds after the last one. Arguments as for `armgap_chain_update_f32`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_update_after_f32(
    memory: *mut c_void,
    h: f32,
    q: *const f32,
    dq: *const f32,
    tau: *const f32,
    joints: usize,
) -> armgap_status {
    unsafe { slot::update(memory, When::After(h), q, dq, tau, joints) }
}

/// Copies the estimated parameters of a serial arm, SI; `count` is their number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_theta_f32(
    memory: *const c_void,
    theta: *mut f32,
    count: usize,
) -> armgap_status {
    unsafe { slot::theta(memory, theta, count) }
}

/// Copies the `count` diagonal entries of the covariance of the estimate, for a prediction error of unit variance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_variances_f32(
    memory: *const c_void,
    variances: *mut f32,
    count: usize,
) -> armgap_status {
    unsafe { slot::variances(memory, variances, count) }
}

/// Copies the `count` standard deviations of the estimated parameters, SI, as if prediction errors were white.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_sigma_f32(
    memory: *const c_void,
    sigma: *mut f32,
    count: usize,
) -> armgap_status {
    unsafe { slot::sigma(memory, sigma, count) }
}

/// Copies the prediction errors of the last sample that was used, N m, J or W by scheme; `count` is `outputs` of the report.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_errors_f32(
    memory: *const c_void,
    errors: *mut f32,
    count: usize,
) -> armgap_status {
    unsafe { slot::errors(memory, errors, count) }
}

/// Fills `report` with counts of samples, excitation and alarm of an estimator of a serial arm.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_report_of_f32(
    memory: *const c_void,
    report: *mut armgap_report,
) -> armgap_status {
    unsafe { slot::report::<f32>(memory, report) }
}
