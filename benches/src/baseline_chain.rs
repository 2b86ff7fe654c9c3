//! Interface to the plain C online estimator of serial arms, `baselines/online_chain.c`.

// Calls into C.
#![allow(unsafe_code)]

use crate::baseline::Build;
use armgap_bench::serial::{JOINTS, Sample};
use armgap_core::chain::Chain;
use std::ffi::{c_int, c_long};

type Start =
    unsafe extern "C" fn(*mut f64, c_int, *const f64, *const f64, *const c_int, c_int, f64, f64, f64);
type Run = unsafe extern "C" fn(*mut f64, *const f64, *const f64, c_long);

unsafe extern "C" {
    fn chain_start(
        p: *mut f64,
        power: c_int,
        joints: *const f64,
        gravity: *const f64,
        columns: *const c_int,
        r: c_int,
        h: f64,
        cutoff: f64,
        p0: f64,
    );
    fn chain_start_native(
        p: *mut f64,
        power: c_int,
        joints: *const f64,
        gravity: *const f64,
        columns: *const c_int,
        r: c_int,
        h: f64,
        cutoff: f64,
        p0: f64,
    );
    fn chain_run(p: *mut f64, q: *const f64, tau: *const f64, samples: c_long);
    fn chain_run_native(p: *mut f64, q: *const f64, tau: *const f64, samples: c_long);
    fn chain_size() -> c_long;
}

/// Cache line of the C estimator's state: aligned as that of `armgap-core` is, so that chance of an address does not decide.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Line([f64; 8]);

/// Joints, gravity, estimated parameters, and positions, rad, and torques, N m, of a motion as arrays for the C estimator.
#[derive(Debug, Clone)]
pub struct ChainArrays {
    joints: Vec<f64>,
    gravity: [f64; 3],
    columns: Vec<c_int>,
    q: Vec<f64>,
    tau: Vec<f64>,
}

impl ChainArrays {
    /// Arrays from an arm of rotary joints, indices of estimated parameters, and the samples of a motion.
    pub fn of(chain: &Chain<f64, JOINTS>, columns: &[usize], samples: &[Sample]) -> Self {
        let numbers = |j: usize| {
            let joint = &chain.joints()[j];
            joint.rotation.into_iter().flatten().chain(joint.translation).chain(joint.axis)
        };
        Self {
            joints: (0..JOINTS).flat_map(numbers).collect(),
            gravity: *chain.gravity_vector(),
            columns: columns.iter().map(|c| c_int::try_from(*c).expect("a small index")).collect(),
            q: samples.iter().flat_map(|s| s.0).collect(),
            tau: samples.iter().flat_map(|s| s.1).collect(),
        }
    }

    /// Parameters estimated over the whole motion with the period `h`, s, by the filtered power model, or without `power` by the filtered dynamic one.
    pub fn estimate(&self, build: Build, power: bool, h: f64) -> Vec<f64> {
        let (start, run): (Start, Run) = match build {
            Build::Portable => (chain_start, chain_run),
            Build::Native => (chain_start_native, chain_run_native),
        };
        let count = self.columns.len();
        let samples = c_long::try_from(self.q.len() / JOINTS).expect("a motion of some seconds");
        // SAFETY: the state is as large as the C code says, and the arrays hold what it reads.
        let state: Vec<Line> = unsafe {
            let bytes = usize::try_from(chain_size()).expect("a size");
            let mut state: Vec<Line> = vec![Line([0.0; 8]); bytes.div_ceil(size_of::<Line>())];
            let (joints, columns) = (self.joints.as_ptr(), self.columns.as_ptr());
            let r = c_int::try_from(count).expect("a small count");
            start(
                state.as_mut_ptr().cast(),
                c_int::from(power),
                joints,
                self.gravity.as_ptr(),
                columns,
                r,
                h,
                50.0,
                1000.0,
            );
            run(state.as_mut_ptr().cast(), self.q.as_ptr(), self.tau.as_ptr(), samples);
            state
        };
        state.iter().flat_map(|line: &Line| line.0).take(count).collect()
    }
}
