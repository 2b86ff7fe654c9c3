//! Supplied energy model, equations (27) and (28): `int tau.dq = [E - E(0), int W] theta`.
//!
//! A torque that is held does exactly the work `tau (q_end - q_begin)`; the paper's variant takes the trapezoidal rule for that integral
//! as for the others. The integrals have infinite gain at zero frequency: any constant error grows without bound.

use super::{Passage, Snapshot, Variant, energy_rows};
use crate::arm::Arm;
use crate::real::{Real, lit};
use nalgebra::{SMatrix, SVector};

/// State of the scheme.
#[derive(Debug, Clone, Copy)]
pub struct SuppliedEnergy<T: Real, const N: usize, const R: usize> {
    first: SMatrix<T, 1, R>,
    dissipated: SMatrix<T, 1, R>,
    last_power: SMatrix<T, 1, R>,
    work: T,
    last_supplied: T,
    last_q: SVector<T, N>,
}

impl<T: Real, const N: usize, const R: usize> SuppliedEnergy<T, N, R> {
    /// The scheme at its first state; `tau` is the torque that acts from then on.
    pub fn new<A: Arm<T, N, P>, const P: usize>(arm: &A, now: &Snapshot<T, N>, tau: &SVector<T, N>) -> Self {
        let (first, last_power) = energy_rows::<T, A, N, P, R>(arm, now);
        let last_supplied = tau.dot(&now.dq);
        Self {
            first,
            dissipated: SMatrix::zeros(),
            last_power,
            work: T::zero(),
            last_supplied,
            last_q: now.q,
        }
    }

    /// The row and output at the next state, reached by `passage`; `tau` is the torque that acts from then on.
    #[inline]
    pub fn update<A: Arm<T, N, P>, const P: usize>(
        &mut self,
        arm: &A,
        variant: Variant,
        now: &Snapshot<T, N>,
        passage: &Passage<T, N>,
        tau: &SVector<T, N>,
    ) -> (SMatrix<T, 1, R>, SVector<T, 1>) {
        let (energy, power) = energy_rows::<T, A, N, P, R>(arm, now);
        let half: T = lit::<T>(0.5) * passage.h;
        self.dissipated += (power + self.last_power) * half;
        self.work += match variant {
            Variant::Paper => (tau.dot(&now.dq) + self.last_supplied) * half,
            Variant::Exact => {
                passage.first.dot(&(passage.middle - self.last_q))
                    + passage.second.dot(&(now.q - passage.middle))
            }
        };
        self.last_power = power;
        self.last_supplied = tau.dot(&now.dq);
        self.last_q = now.q;
        (
            energy - self.first + self.dissipated,
            SVector::<T, 1>::new(self.work),
        )
    }
}
