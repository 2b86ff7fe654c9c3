//! Simulation of an arm by one sample, for tests of a controller without its arm.

use crate::settings::{armgap_status, kind_of};
use armgap_core::arm::{Arm, ArmKind, Axis, Pendulum, TwoLink};
use armgap_core::effect::InputSegment;
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use armgap_status::{ARMGAP_LENGTH, ARMGAP_NULL, ARMGAP_OK, ARMGAP_RANGE, ARMGAP_UNALIGNED};
use nalgebra::SVector;

/// Moves an `armgap_arm` with the parameters `theta` by `h` seconds under held torques `tau`, SI; positions `q` and velocities `dq` are read and
/// written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_advance(
    arm: u32,
    theta: *const f64,
    parameters: usize,
    h: f64,
    q: *mut f64,
    dq: *mut f64,
    tau: *const f64,
    joints: usize,
) -> armgap_status {
    let Some(kind) = kind_of(arm) else {
        return ARMGAP_RANGE;
    };
    for pointer in [theta, q.cast_const(), dq.cast_const(), tau] {
        if pointer.is_null() {
            return ARMGAP_NULL;
        }
        if !pointer.is_aligned() {
            return ARMGAP_UNALIGNED;
        }
    }
    if joints != kind.joints() || parameters != kind.parameters().len() {
        return ARMGAP_LENGTH;
    }
    if !(h > 0.0 && h <= 1.0) {
        return ARMGAP_RANGE;
    }
    let gravity = 9.81;
    // SAFETY: not null, aligned; that they hold as many numbers as stated is the caller's promise.
    unsafe {
        match kind {
            ArmKind::Axis => moved(|_| Axis { gravity }, theta.cast(), h, q.cast(), dq.cast(), tau.cast()),
            ArmKind::Pendulum => {
                moved(|_| Pendulum { gravity }, theta.cast(), h, q.cast(), dq.cast(), tau.cast())
            }
            ArmKind::TwoLink => {
                moved(|p| TwoLink::new(gravity, None, p), theta.cast(), h, q.cast(), dq.cast(), tau.cast())
            }
        }
    }
}

unsafe fn moved<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: impl Fn(&[f64; P]) -> A,
    theta: *const [f64; P],
    h: f64,
    q: *mut [f64; N],
    dq: *mut [f64; N],
    tau: *const [f64; N],
) -> armgap_status {
    let (theta, tau, from, speed) = unsafe { (*theta, *tau, *q, *dq) };
    let numbers = theta.iter().chain(&tau).chain(&from).chain(&speed);
    if !numbers.into_iter().all(|x| x.abs() <= 1e9) {
        return ARMGAP_RANGE;
    }
    let plant = Plant::new(arm(&theta), theta);
    let mut state = State::new(SVector::from(from), SVector::from(speed));
    advance(&plant, &mut state, &Interval { t: 0.0, h, torque: &tau.map(InputSegment::held) }, 2);
    if !state.is_finite() {
        return ARMGAP_RANGE;
    }
    unsafe {
        q.write(state.q.into());
        dq.write(state.dq.into());
    }
    ARMGAP_OK
}
