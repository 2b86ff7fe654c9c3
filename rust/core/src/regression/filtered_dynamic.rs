//! Filtered dynamic model (Reyes and Kelly 1997, equations (23) and (24)): `F[tau] = (D[Pm] + F[B]) theta`.
//!
//! `Pm theta = M(q) dq` is the momentum and `B theta = g - dK/dq + f` the remaining torque, so `tau = d/dt(Pm theta) + B theta` needs no
//! acceleration once filtered.

use super::friction::Friction;
use super::{Columns, SampleInterval, SegmentCoefficients, Snapshot, Variant};
use crate::arm::{Arm, MomentumColumns};
use crate::cpu::{Cpu, Portable};
use crate::filter::{Cutoff, FilterCoefficients};
use crate::real::Real;
use core::marker::PhantomData;
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
        let (step, mut whole) = (self.steps.whole(interval.h), SMatrix::zeros());
        match variant {
            Variant::Paper => {
                arm.momentum_columns::<C>(&now.q, &now.dq, &mut self.filters::<C, true>(&step, &mut whole));
                self.friction.hold_torques::<C>(&step, &self.last.dq);
                for i in 0..N {
                    self.torque[i] = step.held::<C>(self.torque[i], interval.second[i]);
                }
            }
            Variant::Exact => {
                arm.momentum_columns::<C>(&now.q, &now.dq, &mut self.filters::<C, false>(&step, &mut whole));
                self.friction.filter_torques::<C>(&step, &self.last.dq, &now.dq);
                let parts = self.steps.parts(interval);
                for i in 0..N {
                    let middle = parts[0].held::<C>(self.torque[i], interval.first[i]);
                    self.torque[i] = parts[1].held::<C>(middle, interval.second[i]);
                }
            }
        }
        self.last = *now;
        columns.rows(&whole, A::INERTIAL, &self.friction, &self.torque)
    }

    /// Filters of the regressors' columns, which write the row of every joint into `whole`.
    #[inline(always)]
    fn filters<'a, C: Cpu, const PAPER: bool>(
        &'a mut self,
        step: &'a FilterCoefficients<T>,
        whole: &'a mut SMatrix<T, N, P>,
    ) -> ColumnFilters<'a, T, C, PAPER, N, P> {
        ColumnFilters {
            step,
            last: [&mut self.last_momentum.data.0, &mut self.last_potential.data.0],
            filtered: [&mut self.momentum.data.0, &mut self.potential.data.0],
            whole: &mut whole.data.0,
            cpu: PhantomData,
        }
    }
}

/// Filters of the columns of the regressors of momentum and of the remaining torque, by column, over one interval.
struct ColumnFilters<'a, T, C, const PAPER: bool, const N: usize, const P: usize> {
    step: &'a FilterCoefficients<T>,
    /// Regressors of momentum and of the remaining torque at the last state.
    last: [&'a mut [[T; N]; P]; 2],
    /// Outputs of the filters of both.
    filtered: [&'a mut [[T; N]; P]; 2],
    whole: &'a mut [[T; N]; P],
    cpu: PhantomData<C>,
}

impl<T: Real, C: Cpu, const PAPER: bool, const N: usize, const P: usize> MomentumColumns<T, N>
    for ColumnFilters<'_, T, C, PAPER, N, P>
{
    #[inline(always)]
    fn put(&mut self, first: usize, momentum: &[[T; N]], potential: &[[T; N]]) {
        let (step, count) = (self.step, momentum.len());
        let [last_momentum, last_potential] = &mut self.last;
        let [low_momentum, low_potential] = &mut self.filtered;
        let new = momentum.as_flattened().iter().zip(potential.as_flattened());
        let last = span(last_momentum, first, count).iter_mut().zip(span(last_potential, first, count));
        let filtered = span(low_momentum, first, count).iter_mut().zip(span(low_potential, first, count));
        let whole = span(self.whole, first, count);
        for (((new, last), filtered), whole) in new.zip(last).zip(filtered).zip(whole) {
            let (momentum, potential) = (*new.0, *new.1);
            if PAPER {
                *filtered.0 = step.paper_derivative::<C>(*filtered.0, *last.0, momentum);
                *filtered.1 = step.held::<C>(*filtered.1, *last.1);
                *whole = *filtered.0 + *filtered.1;
            } else {
                *filtered.0 = step.ramp::<C>(*filtered.0, *last.0, momentum);
                *filtered.1 = step.ramp::<C>(*filtered.1, *last.1, potential);
                *whole = (momentum - *filtered.0) * step.lambda + *filtered.1;
            }
            (*last.0, *last.1) = (momentum, potential);
        }
    }
}

/// Entries of `count` columns of a matrix from column `first`; none if there are not as many.
#[inline(always)]
fn span<T, const N: usize, const P: usize>(matrix: &mut [[T; N]; P], first: usize, count: usize) -> &mut [T] {
    matrix.get_mut(first..first + count).unwrap_or_default().as_flattened_mut()
}
