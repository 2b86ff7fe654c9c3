//! Interface to the plain C online estimator of the two-link arm, `baselines/online.c`.

// The only unsafe code of the benchmarks: calls into C.
#![allow(unsafe_code)]

use armgap_core::identify::Sample;
use armgap_core::regression::{Scheme, Variant};
use std::ffi::{c_int, c_long, c_uint};

/// Number of doubles reserved for the state of the C estimator.
const WORDS: usize = 256;
/// Number of estimated parameters, which come first in the state of the C estimator.
const PARAMETERS: usize = 9;

type Start = unsafe extern "C" fn(*mut f64, c_uint, c_int, f64, f64, f64, f64);
type Run = unsafe extern "C" fn(*mut f64, *const f64, *const f64, c_long);

unsafe extern "C" {
    fn baseline_start(
        p: *mut f64,
        scheme: c_uint,
        exact: c_int,
        h: f64,
        cutoff: f64,
        p0: f64,
        forgetting: f64,
    );
    fn baseline_start_native(
        p: *mut f64,
        scheme: c_uint,
        exact: c_int,
        h: f64,
        cutoff: f64,
        p0: f64,
        forgetting: f64,
    );
    fn baseline_run(p: *mut f64, q: *const f64, tau: *const f64, samples: c_long);
    fn baseline_run_native(p: *mut f64, q: *const f64, tau: *const f64, samples: c_long);
    fn baseline_size() -> c_long;
}

/// Compiler options of the plain C baselines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Build {
    /// `cc -O3`: for any processor.
    Portable,
    /// `cc -O3 -march=native`: for this machine's processor.
    Native,
}

impl Build {
    fn functions(self) -> (Start, Run) {
        match self {
            Self::Portable => (baseline_start, baseline_run),
            Self::Native => (baseline_start_native, baseline_run_native),
        }
    }
}

/// Positions, rad, and torques, N m, of a run as arrays for the C estimator.
#[derive(Debug, Clone)]
pub struct Arrays {
    q: Vec<f64>,
    tau: Vec<f64>,
}

impl Arrays {
    /// Positions and torques of a run's samples as arrays.
    pub fn of(samples: &[Sample<f64, 2>]) -> Self {
        let flat = |of: fn(&Sample<f64, 2>) -> [f64; 2]| samples.iter().flat_map(of).collect();
        Self { q: flat(|s| s.q.into()), tau: flat(|s| s.tau.into()) }
    }

    /// Parameters estimated over the whole run by the C estimator, which keeps its covariance by equation (21) of Reyes and Kelly (1997).
    pub fn estimate(&self, build: Build, scheme: Scheme, variant: Variant, h: f64) -> [f64; PARAMETERS] {
        let mut state = [0.0_f64; WORDS];
        let (start, run) = build.functions();
        let samples = c_long::try_from(self.q.len() / 2).expect("a run of some seconds");
        // SAFETY: the state is large enough, as asserted, and the arrays hold two numbers per sample.
        unsafe {
            assert!(usize::try_from(baseline_size()).is_ok_and(|size| size <= size_of_val(&state)));
            start(
                state.as_mut_ptr(),
                scheme as c_uint,
                c_int::from(variant == Variant::Exact),
                h,
                50.0,
                1000.0,
                1.0,
            );
            run(state.as_mut_ptr(), self.q.as_ptr(), self.tau.as_ptr(), samples);
        }
        std::array::from_fn(|i| state[i])
    }
}
