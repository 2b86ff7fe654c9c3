//! Filtered power model, equations (29) and (30): `F[tau.dq] = (D[E] + F[W]) theta`, the paper's own proposal.

use super::{Passage, Snapshot, Variant, energy_rows};
use crate::arm::Arm;
use crate::filter::{Cutoff, State};
use crate::real::Real;
use nalgebra::{SMatrix, SVector};

/// State of the scheme.
#[derive(Debug, Clone, Copy)]
pub struct FilteredPower<T: Real, const N: usize, const R: usize> {
    energy: SMatrix<State<T>, 1, R>,
    dissipation: SMatrix<State<T>, 1, R>,
    supplied: State<T>,
    last_dq: SVector<T, N>,
}

impl<T: Real, const N: usize, const R: usize> FilteredPower<T, N, R> {
    /// The scheme at its first state; `tau` is the torque that acts from then on.
    pub fn new<A: Arm<T, N, P>, const P: usize>(
        arm: &A,
        variant: Variant,
        now: &Snapshot<T, N>,
        tau: &SVector<T, N>,
    ) -> Self {
        let (energy, power) = energy_rows::<T, A, N, P, R>(arm, now);
        let derivative = |x| {
            if variant == Variant::Paper {
                State::from_zero(x)
            } else {
                State::steady(x)
            }
        };
        Self {
            energy: energy.map(derivative),
            dissipation: power.map(State::from_zero),
            supplied: State::from_zero(tau.dot(&now.dq)),
            last_dq: now.dq,
        }
    }

    /// The row and output at the next state, reached by `passage`; `tau` is the torque that acts from then on.
    #[inline]
    pub fn update<A: Arm<T, N, P>, const P: usize>(
        &mut self,
        arm: &A,
        variant: Variant,
        cutoff: &Cutoff<T>,
        now: &Snapshot<T, N>,
        passage: &Passage<T, N>,
        tau: &SVector<T, N>,
    ) -> (SMatrix<T, 1, R>, SVector<T, 1>) {
        let step = cutoff.step(passage.h);
        let (energy, power) = energy_rows::<T, A, N, P, R>(arm, now);
        let mut psi = SMatrix::zeros();
        for j in 0..R {
            let (e, w) = (&mut self.energy[(0, j)], &mut self.dissipation[(0, j)]);
            psi[(0, j)] = match variant {
                Variant::Paper => {
                    e.paper_derivative(&step, energy[(0, j)]) + w.paper_low(&step, power[(0, j)])
                }
                Variant::Exact => e.derivative(&step, energy[(0, j)]) + w.low(&step, power[(0, j)]),
            };
        }
        let y = match variant {
            Variant::Paper => self.supplied.paper_low(&step, tau.dot(&now.dq)),
            Variant::Exact => {
                let parts = [cutoff.step(passage.split), cutoff.step(passage.h - passage.split)];
                let middle = self.last_dq + (now.dq - self.last_dq) * (passage.split / passage.h);
                self.supplied.low_ramp(
                    &parts[0],
                    passage.first.dot(&self.last_dq),
                    passage.first.dot(&middle),
                );
                self.supplied.low_ramp(
                    &parts[1],
                    passage.second.dot(&middle),
                    passage.second.dot(&now.dq),
                )
            }
        };
        self.last_dq = now.dq;
        (psi, SVector::<T, 1>::new(y))
    }
}
