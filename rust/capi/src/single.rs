//! The functions in single precision.

use crate::settings::{armgap_report, armgap_settings, armgap_status};
use crate::slot;
use armgap_core::online::When;

/// An estimator in single precision; its contents are nobody's business.
#[repr(C)]
pub struct armgap_estimator_f32 {
    /// Not to be touched.
    pub opaque: [u64; 256],
}

/// Starts an estimator in the caller's memory; `size` is `sizeof(*estimator)`. `theta0` has `count` entries, one per parameter, or is
/// optional with `count` 0, which means zeros. Starting again is allowed at any time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_start_f32(
    estimator: *mut armgap_estimator_f32,
    size: usize,
    settings: *const armgap_settings,
    theta0: *const f32,
    count: usize,
) -> armgap_status {
    unsafe { slot::start::<f32, _>(estimator, size, settings, theta0, count) }
}

/// Takes one sample at time `t` [s]: positions, optional velocities, and the torques that act until the next sample, each of `joints`
/// entries. Whether velocities are given is settled by the first sample.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_update_f32(
    estimator: *mut armgap_estimator_f32,
    t: f32,
    q: *const f32,
    dq: *const f32,
    tau: *const f32,
    joints: usize,
) -> armgap_status {
    unsafe { slot::update(estimator, When::At(t), q, dq, tau, joints) }
}

/// Takes one sample `h` seconds after the last one; `h` keeps its resolution however long the controller runs. Arguments as for
/// `armgap_update_f32`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_update_after_f32(
    estimator: *mut armgap_estimator_f32,
    h: f32,
    q: *const f32,
    dq: *const f32,
    tau: *const f32,
    joints: usize,
) -> armgap_status {
    unsafe { slot::update(estimator, When::After(h), q, dq, tau, joints) }
}

/// Copies the estimate; `count` is the number of parameters.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_theta_f32(
    estimator: *const armgap_estimator_f32,
    theta: *mut f32,
    count: usize,
) -> armgap_status {
    unsafe { slot::theta(estimator, theta, count) }
}

/// Copies the standard deviations of the estimate, as if errors were white.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_sigma_f32(
    estimator: *const armgap_estimator_f32,
    sigma: *mut f32,
    count: usize,
) -> armgap_status {
    unsafe { slot::sigma(estimator, sigma, count) }
}

/// Copies the prediction errors of the last sample that was used; `count` is the number of outputs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_errors_f32(
    estimator: *const armgap_estimator_f32,
    errors: *mut f32,
    count: usize,
) -> armgap_status {
    unsafe { slot::errors(estimator, errors, count) }
}

/// Fills `report`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_report_of_f32(
    estimator: *const armgap_estimator_f32,
    report: *mut armgap_report,
) -> armgap_status {
    unsafe { slot::report::<f32, _>(estimator, report) }
}
