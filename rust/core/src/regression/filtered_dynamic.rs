//! Filtered dynamic model, equations (23) and (24): `F[tau] = (D[Pm] + F[B]) theta`.
//!
//! `Pm theta = M(q) dq` is the momentum and `B theta = g - dK/dq + f` the rest, so `tau = d/dt(Pm theta) + B theta` needs no acceleration
//! once filtered.

use super::reversal::Pieces;
use super::{Passage, Snapshot, Variant, friction_rows, inertial_rows};
use crate::arm::Arm;
use crate::filter::{Cutoff, State};
use crate::real::Real;
use nalgebra::{SMatrix, SVector};

/// State of the scheme.
#[derive(Debug, Clone, Copy)]
pub struct FilteredDynamic<T: Real, const N: usize, const R: usize> {
    momentum: SMatrix<State<T>, N, R>,
    rest: SMatrix<State<T>, N, R>,
    torque: SVector<State<T>, N>,
    last_potential: SMatrix<T, N, R>,
    last_dq: SVector<T, N>,
}

impl<T: Real, const N: usize, const R: usize> FilteredDynamic<T, N, R> {
    /// The scheme at its first state; `tau` is the torque that acts from then on.
    pub fn new<A: Arm<T, N, P>, const P: usize>(
        arm: &A,
        variant: Variant,
        now: &Snapshot<T, N>,
        tau: &SVector<T, N>,
    ) -> Self {
        let (momentum, potential) = inertial_rows::<T, A, N, P, R>(arm, now);
        let rest = potential + friction_rows::<T, A, N, P, R>(arm, &now.dq);
        Self {
            momentum: momentum.map(|x| variant.derivative_state(x)),
            rest: rest.map(State::from_zero),
            torque: tau.map(State::from_zero),
            last_potential: potential,
            last_dq: now.dq,
        }
    }

    /// The rows and outputs at the next state, reached by `passage`; `tau` is the torque that acts from then on.
    #[inline]
    pub fn update<A: Arm<T, N, P>, const P: usize>(
        &mut self,
        arm: &A,
        variant: Variant,
        cutoff: &Cutoff<T>,
        now: &Snapshot<T, N>,
        passage: &Passage<T, N>,
        tau: &SVector<T, N>,
    ) -> (SMatrix<T, N, R>, SVector<T, N>) {
        let rows = inertial_rows::<T, A, N, P, R>(arm, now);
        let result = match variant {
            Variant::Paper => self.paper(arm, cutoff, now, &rows, passage.h, tau),
            Variant::Exact => self.exact(arm, cutoff, now, &rows, passage),
        };
        self.last_dq = now.dq;
        self.last_potential = rows.1;
        result
    }

    #[inline]
    fn paper<A: Arm<T, N, P>, const P: usize>(
        &mut self,
        arm: &A,
        cutoff: &Cutoff<T>,
        now: &Snapshot<T, N>,
        (momentum, potential): &(SMatrix<T, N, R>, SMatrix<T, N, R>),
        h: T,
        tau: &SVector<T, N>,
    ) -> (SMatrix<T, N, R>, SVector<T, N>) {
        let step = cutoff.step(h);
        let rest = potential + friction_rows::<T, A, N, P, R>(arm, &now.dq);
        let (mut psi, mut y) = (SMatrix::zeros(), SVector::zeros());
        for i in 0..N {
            for j in 0..R {
                psi[(i, j)] = self.momentum[(i, j)].paper_derivative(&step, momentum[(i, j)])
                    + self.rest[(i, j)].paper_low(&step, rest[(i, j)]);
            }
            y[i] = self.torque[i].paper_low(&step, tau[i]);
        }
        (psi, y)
    }

    #[inline]
    fn exact<A: Arm<T, N, P>, const P: usize>(
        &mut self,
        arm: &A,
        cutoff: &Cutoff<T>,
        now: &Snapshot<T, N>,
        (momentum, potential): &(SMatrix<T, N, R>, SMatrix<T, N, R>),
        passage: &Passage<T, N>,
    ) -> (SMatrix<T, N, R>, SVector<T, N>) {
        let step = cutoff.step(passage.h);
        let rise = potential - self.last_potential;
        Pieces::of(&self.last_dq, &now.dq).each(
            |dq| friction_rows::<T, A, N, P, R>(arm, dq),
            |start, end, from, to| {
                let part = step.part(cutoff, passage.h, end - start);
                for i in 0..N {
                    for j in 0..R {
                        let (base, rise) = (self.last_potential[(i, j)], rise[(i, j)]);
                        let (from, to) = (from[(i, j)] + start * rise, to[(i, j)] + end * rise);
                        self.rest[(i, j)].low_ramp(&part, base + from, base + to);
                    }
                }
            },
        );
        let parts = passage.steps(cutoff);
        let (mut psi, mut y) = (SMatrix::zeros(), SVector::zeros());
        for i in 0..N {
            for j in 0..R {
                psi[(i, j)] = self.momentum[(i, j)].derivative(&step, momentum[(i, j)]) + self.rest[(i, j)].y;
            }
            self.torque[i].low_held(&parts[0], passage.first[i]);
            y[i] = self.torque[i].low_held(&parts[1], passage.second[i]);
        }
        (psi, y)
    }
}
