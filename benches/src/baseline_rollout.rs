//! Interface to the plain C rollout of the two-link arm, `baselines/rollout.c`.

// Calls into C.
#![allow(unsafe_code)]

use crate::baseline::Build;
use std::ffi::c_long;

type Rollout = unsafe extern "C" fn(*const f64, *const f64, *const f64, f64, c_long, *mut f64);

unsafe extern "C" {
    fn baseline_rollout(
        theta: *const f64,
        x: *const f64,
        tau: *const f64,
        h: f64,
        periods: c_long,
        q: *mut f64,
    );
    fn baseline_rollout_native(
        theta: *const f64,
        x: *const f64,
        tau: *const f64,
        h: f64,
        periods: c_long,
        q: *mut f64,
    );
    fn baseline_rollout_smooth(
        theta: *const f64,
        x: *const f64,
        tau: *const f64,
        h: f64,
        periods: c_long,
        q: *mut f64,
    );
    fn baseline_rollout_smooth_native(
        theta: *const f64,
        x: *const f64,
        tau: *const f64,
        h: f64,
        periods: c_long,
        q: *mut f64,
    );
}

/// Writes into `q` the positions, rad, after every period of `h` seconds, from positions and velocities `x`, under held torques `tau`, N m, two for
/// each period; with dry friction, or, if `theta` has none, without friction modes.
pub fn rollout(build: Build, theta: &[f64; 9], x: &[f64; 4], tau: &[f64], h: f64, q: &mut [f64]) {
    let dry = theta[7] > 0.0 || theta[8] > 0.0;
    let function: Rollout = match (build, dry) {
        (Build::Portable, true) => baseline_rollout,
        (Build::Portable, false) => baseline_rollout_smooth,
        (Build::Native, true) => baseline_rollout_native,
        (Build::Native, false) => baseline_rollout_smooth_native,
    };
    let periods = tau.len().min(q.len()) / 2;
    let count = c_long::try_from(periods).expect("a run of some seconds");
    // SAFETY: both arrays hold two numbers for every period, as just counted.
    unsafe { function(theta.as_ptr(), x.as_ptr(), tau.as_ptr(), h, count, q.as_mut_ptr()) }
}
