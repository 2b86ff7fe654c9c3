//! Filtered power model, equations (29) and (30): `F[tau.dq] = (D[E] + F[W]) theta`, the paper's own proposal.

use super::reversal::Pieces;
use super::{Passage, Snapshot, Variant, energy_row, power_row};
use crate::arm::Arm;
use crate::filter::{Cutoff, State};
use crate::real::{Real, lit};
use nalgebra::{SMatrix, SVector};

/// State of the scheme.
#[derive(Debug, Clone, Copy)]
pub struct FilteredPower<T: Real, const N: usize, const R: usize> {
    energy: SMatrix<State<T>, 1, R>,
    dissipation: SMatrix<State<T>, 1, R>,
    supplied: State<T>,
    last: Snapshot<T, N>,
}

impl<T: Real, const N: usize, const R: usize> FilteredPower<T, N, R> {
    /// The scheme at its first state; `tau` is the torque that acts from then on.
    pub fn new<A: Arm<T, N, P>, const P: usize>(
        arm: &A,
        variant: Variant,
        now: &Snapshot<T, N>,
        tau: &SVector<T, N>,
    ) -> Self {
        let energy = energy_row::<T, A, N, P, R>(arm, now);
        let power = power_row::<T, A, N, P, R>(arm, &now.dq);
        Self {
            energy: energy.map(|x| variant.derivative_state(x)),
            dissipation: power.map(State::from_zero),
            supplied: State::from_zero(tau.dot(&now.dq)),
            last: *now,
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
        let result = match variant {
            Variant::Paper => self.paper(arm, cutoff, now, passage.h, tau),
            Variant::Exact => {
                (self.exact(arm, cutoff, now, passage.h), self.exact_supply(cutoff, now, passage))
            }
        };
        self.last = *now;
        (result.0, SVector::<T, 1>::new(result.1))
    }

    #[inline]
    fn paper<A: Arm<T, N, P>, const P: usize>(
        &mut self,
        arm: &A,
        cutoff: &Cutoff<T>,
        now: &Snapshot<T, N>,
        h: T,
        tau: &SVector<T, N>,
    ) -> (SMatrix<T, 1, R>, T) {
        let step = cutoff.step(h);
        let energy = energy_row::<T, A, N, P, R>(arm, now);
        let power = power_row::<T, A, N, P, R>(arm, &now.dq);
        let mut psi = SMatrix::zeros();
        for j in 0..R {
            psi[j] = self.energy[j].paper_derivative(&step, energy[j])
                + self.dissipation[j].paper_low(&step, power[j]);
        }
        (psi, self.supplied.paper_low(&step, tau.dot(&now.dq)))
    }

    #[inline]
    fn exact<A: Arm<T, N, P>, const P: usize>(
        &mut self,
        arm: &A,
        cutoff: &Cutoff<T>,
        now: &Snapshot<T, N>,
        h: T,
    ) -> SMatrix<T, 1, R> {
        let step = cutoff.step(h);
        let energy = energy_row::<T, A, N, P, R>(arm, now);
        let middle = energy_row::<T, A, N, P, R>(arm, &self.last.half_way(now, h));
        Pieces::of(&self.last.dq, &now.dq).each(
            |dq| power_row::<T, A, N, P, R>(arm, dq),
            |start, end, from, to| {
                let part = step.part(cutoff, h, end - start);
                for j in 0..R {
                    self.dissipation[j].low_ramp(&part, from[j], to[j]);
                }
            },
        );
        let mut psi = SMatrix::zeros();
        for j in 0..R {
            let height = middle[j] - (energy[j] + self.energy[j].input) * lit(0.5);
            psi[j] = self.energy[j].derivative_curved(&step, energy[j], height) + self.dissipation[j].y;
        }
        psi
    }

    /// `F` of the power of torques that are held in two parts, velocity linear over the whole.
    #[inline]
    fn exact_supply(&mut self, cutoff: &Cutoff<T>, now: &Snapshot<T, N>, passage: &Passage<T, N>) -> T {
        let parts = passage.steps(cutoff);
        let from = self.last.dq;
        let middle = from + (now.dq - from) * (passage.split / passage.h);
        let (first, second) = (&passage.first, &passage.second);
        self.supplied.low_ramp(&parts[0], first.dot(&from), first.dot(&middle));
        self.supplied.low_ramp(&parts[1], second.dot(&middle), second.dot(&now.dq))
    }
}
