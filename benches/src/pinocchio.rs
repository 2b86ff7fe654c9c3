//! Interface to Pinocchio in C++, `baselines/pinocchio.cpp`.

// The only unsafe code of the benchmarks: calls into C++.
#![allow(unsafe_code)]

use armgap_core::chain::Chain;
use std::ffi::{c_int, c_void};

unsafe extern "C" {
    fn pinocchio_arm(
        joints: usize,
        placements: *const f64,
        links: *const f64,
        gravity: *const f64,
        count: usize,
        states: *const f64,
    ) -> *mut c_void;
    fn pinocchio_arm_free(arm: *mut c_void);
    fn pinocchio_aba(arm: *mut c_void, world: c_int, passes: usize, out: *mut f64);
    fn pinocchio_regressor(arm: *mut c_void, passes: usize, out: *mut f64);
    fn pinocchio_rnea(arm: *mut c_void, passes: usize, out: *mut f64);
}

/// Computation of Pinocchio.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Algorithm {
    /// `aba`: joint accelerations, rad/s^2, by the articulated-body algorithm in the links' frames (`Convention::LOCAL`).
    AbaLocal,
    /// `aba`, in the base frame (`Convention::WORLD`).
    AbaWorld,
    /// `computeJointTorqueRegressor`.
    Regressor,
    /// `rnea`: joint torques, N m, by inverse dynamics.
    Rnea,
}

/// Serial arm of `N` joints in Pinocchio, with a ring of states.
#[derive(Debug)]
pub struct Arm<const N: usize>(*mut c_void);

impl<const N: usize> Arm<N> {
    /// The arm `chain`, all of whose joints turn about the z axes of their frames, with the links' inertial parameters and a ring of states:
    /// positions, velocities, and torques or accelerations, SI.
    pub fn new(chain: &Chain<f64, N>, links: &[[f64; 10]; N], states: &[[[f64; N]; 3]]) -> Self {
        let mut placements = Vec::with_capacity(12 * N);
        for joint in chain.joints() {
            assert_eq!(joint.axis, [0.0, 0.0, 1.0]);
            placements.extend(joint.rotation.as_flattened());
            placements.extend(joint.translation);
        }
        let (links, states) = (links.as_flattened(), states.as_flattened().as_flattened());
        let count = states.len() / (3 * N);
        // SAFETY: the arrays have the sizes that the C++ function documents, and it copies what it keeps.
        Self(unsafe {
            pinocchio_arm(
                N,
                placements.as_ptr(),
                links.as_ptr(),
                chain.gravity_vector().as_ptr(),
                count,
                states.as_ptr(),
            )
        })
    }

    /// Runs `algorithm` on the first `passes` states of the ring, and returns the numbers of the last: `N`, or the regressor's `10 N^2` by rows.
    pub fn run(&self, algorithm: Algorithm, passes: usize) -> Vec<f64> {
        let mut out = vec![0.0; if algorithm == Algorithm::Regressor { 10 * N * N } else { N }];
        let to = out.as_mut_ptr();
        // SAFETY: `self` holds an arm, and `out` has the size that the C++ functions document.
        unsafe {
            match algorithm {
                Algorithm::AbaLocal => pinocchio_aba(self.0, 0, passes, to),
                Algorithm::AbaWorld => pinocchio_aba(self.0, 1, passes, to),
                Algorithm::Regressor => pinocchio_regressor(self.0, passes, to),
                Algorithm::Rnea => pinocchio_rnea(self.0, passes, to),
            }
        }
        out
    }
}

impl<const N: usize> Drop for Arm<N> {
    fn drop(&mut self) {
        // SAFETY: made by `pinocchio_arm`, freed here alone.
        unsafe { pinocchio_arm_free(self.0) }
    }
}
