//! Supplied energy model (Reyes and Kelly 1997, equations (27) and (28)): `int tau.dq = [E - E(0), int W] theta`.
//!
//! A held torque does exactly the work `tau (q_end - q_begin)`; [`Variant::Paper`] takes the trapezoidal rule for all
//! integrals. The integrals have infinite gain at zero frequency: any constant error grows without bound.

use super::friction::Friction;
use super::{Columns, SampleInterval, Snapshot, Variant};
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::real::{Real, lit};
use nalgebra::{SMatrix, SVector};

/// State of the supplied energy model: integrals since the first sample, and the last sample.
#[derive(Debug, Clone, Copy)]
pub struct SuppliedEnergy<T: Real, const N: usize, const P: usize> {
    first: SVector<T, P>,
    friction: Friction<T, N>,
    work: T,
    last_supply: T,
    last: Snapshot<T, N>,
}

impl<T: Real, const N: usize, const P: usize> SuppliedEnergy<T, N, P> {
    /// Supplied energy model at its first state; `tau`, N m (N), is the torque that acts from the state on.
    pub fn new<A: Arm<T, N, P>>(arm: &A, now: &Snapshot<T, N>, tau: &SVector<T, N>) -> Self {
        Self {
            first: arm.energy_regressor(&now.q, &now.dq),
            friction: Friction::zero(),
            work: T::zero(),
            last_supply: tau.dot(&now.dq),
            last: *now,
        }
    }

    /// Regressor row `psi` and output `y` at the next state, reached by `interval`; `tau`, N m (N), is the torque that acts from the state on.
    #[inline(always)]
    pub fn update<C: Cpu, A: Arm<T, N, P>, S: Columns<T, N, P, R>, const R: usize>(
        &mut self,
        arm: &A,
        columns: &S,
        variant: Variant,
        now: &Snapshot<T, N>,
        interval: &SampleInterval<T, N>,
        tau: &SVector<T, N>,
    ) -> ([[T; R]; 1], [T; 1]) {
        let supply = tau.dot(&now.dq);
        match variant {
            Variant::Paper => {
                self.friction.add_trapezes(interval.h, &self.last.dq, &now.dq);
                self.work += (self.last_supply + supply) * (interval.h * lit(0.5));
            }
            Variant::Exact => {
                self.friction.add_energies(interval.h, &self.last.dq, &now.dq);
                self.work += interval.first.dot(&(interval.middle - self.last.q))
                    + interval.second.dot(&(now.q - interval.middle));
            }
        }
        (self.last, self.last_supply) = (*now, supply);
        let energy = arm.energy_regressor_on::<C>(&now.q, &now.dq);
        let mut whole = SMatrix::<T, 1, P>::zeros();
        for j in 0..A::INERTIAL {
            whole[j] = energy[j] - self.first[j];
        }
        columns.rows(&whole, A::INERTIAL, &self.friction, &SVector::from([self.work]))
    }
}
