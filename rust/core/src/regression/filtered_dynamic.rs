//! Filtered dynamic model (Reyes and Kelly 1997, equations (23) and (24)): `F[tau] = (D[Pm] + F[B]) theta`.
//!
//! `Pm theta = M(q) dq` is the momentum and `B theta = g - dK/dq + f` the remaining torque, so `tau = d/dt(Pm theta) + B theta` needs no
//! acceleration once filtered.

use super::friction::Friction;
use super::{Columns, SampleInterval, SegmentCoefficients, Snapshot, Variant};
use crate::arm::Arm;
use crate::cpu::{Cpu, Portable};
use crate::filter::Cutoff;
use crate::real::Real;
use nalgebra::{SMatrix, SVector};

/// State of the filtered dynamic model: its filters, and the last sample. Of matrices over all parameters only the inertial columns are used.
#[derive(Debug, Clone, Copy)]
pub struct FilteredDynamic<T: Real, const N: usize, const P: usize> {
    steps: SegmentCoefficients<T>,
    last: Snapshot<T, N>,
    last_momentum: SMatrix<T, N, P>,
    last_potential: SMatrix<T, N, P>,
    /// Output of a filter for the momentum regressor: derivative filter `D` with [`Variant::Paper`], low-pass `F` with [`Variant::Exact`].
    momentum: SMatrix<T, N, P>,
    potential: SMatrix<T, N, P>,
    friction: Friction<T, N>,
    torque: SVector<T, N>,
}

impl<T: Real, const N: usize, const P: usize> FilteredDynamic<T, N, P> {
    /// Filtered dynamic model at its first state.
    pub fn new<A: Arm<T, N, P>>(arm: &A, variant: Variant, cutoff: &Cutoff<T>, now: &Snapshot<T, N>) -> Self {
        let (last_momentum, last_potential) = arm.momentum_and_potential::<Portable>(&now.q, &now.dq);
        let momentum = match variant {
            Variant::Paper => SMatrix::zeros(),
            Variant::Exact => last_momentum,
        };
        Self {
            steps: SegmentCoefficients::new(cutoff),
            last: *now,
            last_momentum,
            last_potential,
            momentum,
            potential: SMatrix::zeros(),
            friction: Friction::zero(),
            torque: SVector::zeros(),
        }
    }

    /// Regressor rows `psi` and outputs `y`, one per joint, at the next state, reached by `interval`.
    #[inline(always)]
    pub fn update<C: Cpu, A: Arm<T, N, P>, S: Columns<T, N, P, R>, const R: usize>(
        &mut self,
        arm: &A,
        columns: &S,
        variant: Variant,
        now: &Snapshot<T, N>,
        interval: &SampleInterval<T, N>,
    ) -> ([[T; R]; N], [T; N]) {
        let (momentum, potential) = arm.momentum_and_potential::<C>(&now.q, &now.dq);
        let mut whole = SMatrix::zeros();
        match variant {
            Variant::Paper => self.paper::<C, A>(&momentum, interval, &mut whole),
            Variant::Exact => self.exact::<C, A>(&momentum, &potential, now, interval, &mut whole),
        }
        (self.last, self.last_momentum, self.last_potential) = (*now, momentum, potential);
        columns.rows(&whole, A::INERTIAL, &self.friction, &self.torque)
    }

    #[inline(always)]
    fn paper<C: Cpu, A: Arm<T, N, P>>(
        &mut self,
        momentum: &SMatrix<T, N, P>,
        interval: &SampleInterval<T, N>,
        whole: &mut SMatrix<T, N, P>,
    ) {
        let step = self.steps.whole(interval.h);
        for j in 0..A::INERTIAL {
            for i in 0..N {
                let (from, to) = (self.last_momentum[(i, j)], momentum[(i, j)]);
                let derivative = step.paper_derivative::<C>(self.momentum[(i, j)], from, to);
                let rest = step.held::<C>(self.potential[(i, j)], self.last_potential[(i, j)]);
                (self.momentum[(i, j)], self.potential[(i, j)]) = (derivative, rest);
                whole[(i, j)] = derivative + rest;
            }
        }
        self.friction.hold_torques::<C>(&step, &self.last.dq);
        for i in 0..N {
            self.torque[i] = step.held::<C>(self.torque[i], interval.second[i]);
        }
    }

    #[inline(always)]
    fn exact<C: Cpu, A: Arm<T, N, P>>(
        &mut self,
        momentum: &SMatrix<T, N, P>,
        potential: &SMatrix<T, N, P>,
        now: &Snapshot<T, N>,
        interval: &SampleInterval<T, N>,
        whole: &mut SMatrix<T, N, P>,
    ) {
        let step = self.steps.whole(interval.h);
        for j in 0..A::INERTIAL {
            for i in 0..N {
                let low = step.ramp::<C>(self.momentum[(i, j)], self.last_momentum[(i, j)], momentum[(i, j)]);
                let rest =
                    step.ramp::<C>(self.potential[(i, j)], self.last_potential[(i, j)], potential[(i, j)]);
                (self.momentum[(i, j)], self.potential[(i, j)]) = (low, rest);
                whole[(i, j)] = (momentum[(i, j)] - low) * step.lambda + rest;
            }
        }
        self.friction.filter_torques::<C>(&step, &self.last.dq, &now.dq);
        let parts = self.steps.parts(interval);
        for i in 0..N {
            let middle = parts[0].held::<C>(self.torque[i], interval.first[i]);
            self.torque[i] = parts[1].held::<C>(middle, interval.second[i]);
        }
    }
}
