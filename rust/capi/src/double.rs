//! Online estimators of arms of one or two joints in C: functions in double precision.

use crate::settings::{armgap_report, armgap_settings, armgap_status};
use crate::slot;
use armgap_core::online::When;

/// Online estimator in double precision; opaque memory of the caller.
#[repr(C)]
pub struct armgap_estimator {
    /// Opaque contents of the estimator, not to be read or written.
    pub opaque: [u64; 512],
}

/// Starts an estimator in the caller's memory; `size` is `sizeof(*estimator)`. `theta0` has `count` start values, SI, one per parameter, or is
/// optional with `count` 0, which means zeros. Starting again is allowed at any time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_start(
    estimator: *mut armgap_estimator,
    size: usize,
    settings: *const armgap_settings,
    theta0: *const f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::start::<f64, _>(estimator, size, settings, theta0, count) }
}

/// Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, SI, each of `joints` entries.
/// Whether velocities are given is settled by the first sample.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_update(
    estimator: *mut armgap_estimator,
    t: f64,
    q: *const f64,
    dq: *const f64,
    tau: *const f64,
    joints: usize,
) -> armgap_status {
    unsafe { slot::update(estimator, When::At(t), q, dq, tau, joints) }
}

/// Takes one sample `h` seconds after the last one; `h` keeps its resolution however long the controller runs. Arguments as for
/// `armgap_update`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_update_after(
    estimator: *mut armgap_estimator,
    h: f64,
    q: *const f64,
    dq: *const f64,
    tau: *const f64,
    joints: usize,
) -> armgap_status {
    unsafe { slot::update(estimator, When::After(h), q, dq, tau, joints) }
}

/// Copies the estimated parameters, SI; `count` is their number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_theta(
    estimator: *const armgap_estimator,
    theta: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::theta(estimator, theta, count) }
}

/// Copies the `count` standard deviations of the estimated parameters, SI, as if prediction errors were white.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_sigma(
    estimator: *const armgap_estimator,
    sigma: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::sigma(estimator, sigma, count) }
}

/// Copies the prediction errors of the last sample that was used, N m, J or W by scheme; `count` is `outputs` of the report.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_errors(
    estimator: *const armgap_estimator,
    errors: *mut f64,
    count: usize,
) -> armgap_status {
    unsafe { slot::errors(estimator, errors, count) }
}

/// Fills `report` with counts of samples, excitation and alarm of an estimator.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_report_of(
    estimator: *const armgap_estimator,
    report: *mut armgap_report,
) -> armgap_status {
    unsafe { slot::report::<f64, _>(estimator, report) }
}
