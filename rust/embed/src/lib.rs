//! Proof that `armgap-core` runs without an operating system: `no_std`, no allocator, and no path that can panic.
//!
//! Any reachable panic would need `armgap_panicked`, which is nowhere defined; any allocation would need an allocator, which this library
//! does not have. `check.sh` links the exported functions with all unreachable code removed and looks for symbols of both kinds.
#![no_std]

use armgap_core::arm::TwoLink;
use armgap_core::chain::{Chain, ChainJoint, JointKind, TorqueDerivatives};
use armgap_core::effect::InputSegment;
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Outcome, Sample, Settings};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use armgap_core::regression::{Scheme, Variant};
use nalgebra::{SVector, Vector2};

unsafe extern "C" {
    fn armgap_panicked() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe { armgap_panicked() }
}

type Online<T> = Estimator<T, TwoLink<T>, 2, 9, 9>;

macro_rules! controller {
    ($real:ty, $start:ident, $update:ident) => {
        /// Writes an online estimator of the two-link arm, before its first sample, into the caller's memory.
        ///
        /// # Safety
        /// `at` points to writable memory of the estimator's size and alignment.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $start(at: *mut Online<$real>, scheme: u32, exact: bool) {
            let settings = Settings {
                scheme: match scheme {
                    0 => Scheme::FilteredDynamic,
                    1 => Scheme::SuppliedEnergy,
                    _ => Scheme::FilteredPower,
                },
                variant: if exact { Variant::Exact } else { Variant::Paper },
                cutoff: Cutoff { rad_per_s: 50.0 },
                forgetting: 1.0,
                theta0: SVector::zeros(),
                p0: 1000.0,
            };
            unsafe { at.write(Estimator::new(TwoLink { gravity: 9.81, length1: 0.45 }, settings)) };
        }

        /// Takes one sample of the two-link arm and writes the estimate; returns 1 if the sample was used, else 0.
        ///
        /// # Safety
        /// `at` was written by the start function; `q` and `tau` hold two numbers, `theta` has room for nine.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $update(
            at: *mut Online<$real>,
            t: $real,
            q: *const [$real; 2],
            tau: *const [$real; 2],
            theta: *mut [$real; 9],
        ) -> u32 {
            let estimator = unsafe { &mut *at };
            let (q, tau) = unsafe { (*q, *tau) };
            let sample = Sample { t, q: Vector2::from(q), dq: None, tau: Vector2::from(tau) };
            let outcome = estimator.update(&sample);
            unsafe { theta.write((*estimator.rls().theta()).into()) };
            u32::from(matches!(outcome, Outcome::Updated(_)))
        }
    };
}

controller!(f64, armgap_start_f64, armgap_update_f64);
controller!(f32, armgap_start_f32, armgap_update_f32);

/// Moves the two-link arm with the parameters `theta` by `h` seconds under held torques `tau`, SI.
///
/// # Safety
/// `q`, `dq` and `tau` point to two numbers each, `theta` to nine.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_advance_f64(
    q: *mut [f64; 2],
    dq: *mut [f64; 2],
    t: f64,
    h: f64,
    tau: *const [f64; 2],
    theta: *const [f64; 9],
) {
    let (tau, theta) = unsafe { (*tau, *theta) };
    let plant = Plant::new(TwoLink::new(9.81, None, &theta), theta);
    let mut state = unsafe { State::new(Vector2::from(*q), Vector2::from(*dq)) };
    advance(&plant, &mut state, &Interval { t, h, torque: &tau.map(InputSegment::held) }, 1);
    unsafe {
        q.write(state.q.into());
        dq.write(state.dq.into());
    }
}

/// Moves a serial arm of six joints, with dry friction, by `h` seconds under held torques `tau`, SI.
///
/// # Safety
/// `joints` holds six joints, `theta` 78 parameters, `state` was written before, and `tau` holds six numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_advance_chain_f64(
    joints: *const [ChainJoint<f64>; 6],
    theta: *const [f64; 78],
    state: *mut State<f64, 6>,
    tau: *const [f64; 6],
    t: f64,
    h: f64,
) {
    let (state, tau, joints) = unsafe { (&mut *state, *tau, *joints) };
    let plant = Plant::new(Chain::new(joints, [0.0, 0.0, -9.81]), unsafe { *theta });
    let torque = tau.map(InputSegment::held);
    advance(&plant, state, &Interval { t, h, torque: &torque }, 1);
}

/// Joint torques of a motion of a chain of one linear and five rotary joints, with their derivatives and the regressor.
///
/// # Safety
/// `joint` holds a joint, `links` ten parameters of each link, `motion` positions, velocities and accelerations; `derivatives` and
/// `regressor` are writable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armgap_chain_torques_f64(
    joint: *const ChainJoint<f64>,
    links: *const [[f64; 10]; 6],
    motion: *const [[f64; 6]; 3],
    derivatives: *mut TorqueDerivatives<f64, 6>,
    regressor: *mut [[[f64; 10]; 6]; 6],
) {
    let (joint, links, [q, dq, ddq], regressor) = unsafe { (*joint, &*links, &*motion, &mut *regressor) };
    let mut joints = [joint; 6];
    joints[0].kind = JointKind::Prismatic;
    let chain = Chain::new(joints, [0.0, 0.0, -9.81]);
    unsafe { *derivatives = chain.torque_derivatives(links, [q, dq, ddq]) };
    chain.torque_regressor([q, dq, ddq], |i, k, row| {
        if let Some(entry) = regressor.get_mut(i).and_then(|rows| rows.get_mut(k)) {
            *entry = row;
        }
    });
}
