//! Supplied energy model, equations (27) and (28): `int tau.dq = [E - E(0), int W] theta`.
//!
//! A torque that is held does exactly the work `tau (q_end - q_begin)`; the paper's variant takes the trapezoidal rule for that integral
//! as for the others. The integrals have infinite gain at zero frequency: any constant error grows without bound.

use super::reversal::Pieces;
use super::{Passage, Snapshot, Variant, energy_row, power_row};
use crate::arm::Arm;
use crate::real::{Real, lit};
use nalgebra::{SMatrix, SVector};

/// State of the scheme.
#[derive(Debug, Clone, Copy)]
pub struct SuppliedEnergy<T: Real, const N: usize, const R: usize> {
    first: SMatrix<T, 1, R>,
    dissipated: SMatrix<T, 1, R>,
    work: T,
    last_supplied: T,
    last: Snapshot<T, N>,
}

impl<T: Real, const N: usize, const R: usize> SuppliedEnergy<T, N, R> {
    /// The scheme at its first state; `tau` is the torque that acts from then on.
    pub fn new<A: Arm<T, N, P>, const P: usize>(arm: &A, now: &Snapshot<T, N>, tau: &SVector<T, N>) -> Self {
        Self {
            first: energy_row::<T, A, N, P, R>(arm, now),
            dissipated: SMatrix::zeros(),
            work: T::zero(),
            last_supplied: tau.dot(&now.dq),
            last: *now,
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
        let half = passage.h * lit(0.5);
        let power = |dq: &SVector<T, N>| power_row::<T, A, N, P, R>(arm, dq);
        let supplied = tau.dot(&now.dq);
        match variant {
            Variant::Paper => {
                self.dissipated += (power(&self.last.dq) + power(&now.dq)) * half;
                self.work += (self.last_supplied + supplied) * half;
            }
            Variant::Exact => {
                Pieces::of(&self.last.dq, &now.dq).each(power, |start, end, from, to| {
                    self.dissipated += (from + to) * (half * (end - start));
                });
                self.work += passage.first.dot(&(passage.middle - self.last.q))
                    + passage.second.dot(&(now.q - passage.middle));
            }
        }
        (self.last, self.last_supplied) = (*now, supplied);
        let psi = energy_row::<T, A, N, P, R>(arm, now) - self.first + self.dissipated;
        (psi, SVector::<T, 1>::new(self.work))
    }
}
