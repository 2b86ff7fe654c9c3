//! Filtered dynamic model, equations (23) and (24): `F[tau] = (D[Pm] + F[B]) theta`.
//!
//! `Pm theta = M(q) dq` is the momentum and `B theta = g - dK/dq + f` the rest, so `tau = d/dt(Pm theta) + B theta` needs no acceleration
//! once filtered.

use super::{Passage, Snapshot, Variant, dynamic_rows};
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
}

impl<T: Real, const N: usize, const R: usize> FilteredDynamic<T, N, R> {
    /// The scheme at its first state; `tau` is the torque that acts from then on.
    pub fn new<A: Arm<T, N, P>, const P: usize>(
        arm: &A,
        variant: Variant,
        now: &Snapshot<T, N>,
        tau: &SVector<T, N>,
    ) -> Self {
        let (momentum, rest) = dynamic_rows::<T, A, N, P, R>(arm, now);
        let derivative = |x| {
            if variant == Variant::Paper {
                State::from_zero(x)
            } else {
                State::steady(x)
            }
        };
        Self {
            momentum: momentum.map(derivative),
            rest: rest.map(State::from_zero),
            torque: tau.map(State::from_zero),
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
        let step = cutoff.step(passage.h);
        let parts = [cutoff.step(passage.split), cutoff.step(passage.h - passage.split)];
        let (momentum, rest) = dynamic_rows::<T, A, N, P, R>(arm, now);
        let (mut psi, mut y) = (SMatrix::zeros(), SVector::zeros());
        for i in 0..N {
            for j in 0..R {
                let (m, r) = (&mut self.momentum[(i, j)], &mut self.rest[(i, j)]);
                psi[(i, j)] = match variant {
                    Variant::Paper => {
                        m.paper_derivative(&step, momentum[(i, j)]) + r.paper_low(&step, rest[(i, j)])
                    }
                    Variant::Exact => m.derivative(&step, momentum[(i, j)]) + r.low(&step, rest[(i, j)]),
                };
            }
            y[i] = match variant {
                Variant::Paper => self.torque[i].paper_low(&step, tau[i]),
                Variant::Exact => {
                    self.torque[i].low_held(&parts[0], passage.first[i]);
                    self.torque[i].low_held(&parts[1], passage.second[i])
                }
            };
        }
        (psi, y)
    }
}
