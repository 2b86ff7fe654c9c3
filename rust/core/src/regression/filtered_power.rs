//! Filtered power model (Reyes and Kelly 1997, equations (29) and (30), their own proposal): `F[tau.dq] = (D[E] + F[W]) theta`.

use super::friction::Friction;
use super::{Columns, SampleInterval, SegmentCoefficients, Snapshot, Variant};
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::filter::Cutoff;
use crate::real::{Real, lit};
use nalgebra::{SMatrix, SVector};

/// State of the filtered power model: its filters, and the last sample. Of rows over all parameters only the inertial entries are used.
#[derive(Debug, Clone, Copy)]
pub struct FilteredPower<T: Real, const N: usize, const P: usize> {
    steps: SegmentCoefficients<T>,
    last: Snapshot<T, N>,
    last_energy: SVector<T, P>,
    last_supply: T,
    /// Output of a filter for the energy regressor: derivative filter `D` with [`Variant::Paper`], low-pass `F` with [`Variant::Exact`].
    energy: SVector<T, P>,
    friction: Friction<T, N>,
    supply: T,
}

impl<T: Real, const N: usize, const P: usize> FilteredPower<T, N, P> {
    /// Filtered power model at its first state; `tau`, N m (N), is the torque that acts from the state on.
    pub fn new<A: Arm<T, N, P>>(
        arm: &A,
        variant: Variant,
        cutoff: &Cutoff<T>,
        now: &Snapshot<T, N>,
        tau: &SVector<T, N>,
    ) -> Self {
        let last_energy = arm.energy_regressor(&now.q, &now.dq);
        let energy = match variant {
            Variant::Paper => SVector::zeros(),
            Variant::Exact => last_energy,
        };
        Self {
            steps: SegmentCoefficients::new(cutoff),
            last: *now,
            last_energy,
            last_supply: tau.dot(&now.dq),
            energy,
            friction: Friction::zero(),
            supply: T::zero(),
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
        let mut whole = SMatrix::zeros();
        let energy = match variant {
            Variant::Paper => self.paper::<C, A>(arm, now, interval, &mut whole),
            Variant::Exact => self.exact::<C, A>(arm, now, interval, &mut whole),
        };
        (self.last, self.last_energy, self.last_supply) = (*now, energy, tau.dot(&now.dq));
        columns.rows(&whole, A::INERTIAL, &self.friction, &SVector::from([self.supply]))
    }

    /// Writes the inertial part of the regressor row into `whole`, and returns the energy regressor at the state `now`.
    #[inline(always)]
    fn paper<C: Cpu, A: Arm<T, N, P>>(
        &mut self,
        arm: &A,
        now: &Snapshot<T, N>,
        interval: &SampleInterval<T, N>,
        whole: &mut SMatrix<T, 1, P>,
    ) -> SVector<T, P> {
        let energy = arm.energy_regressor_on::<C>(&now.q, &now.dq);
        let step = self.steps.whole(interval.h);
        for j in 0..A::INERTIAL {
            self.energy[j] = step.paper_derivative::<C>(self.energy[j], self.last_energy[j], energy[j]);
            whole[j] = self.energy[j];
        }
        self.friction.hold_powers::<C>(&step, &self.last.dq);
        self.supply = step.held::<C>(self.supply, self.last_supply);
        energy
    }

    /// Writes the inertial part of the regressor row into `whole`, and returns the energy regressor at the state `now`.
    #[inline(always)]
    fn exact<C: Cpu, A: Arm<T, N, P>>(
        &mut self,
        arm: &A,
        now: &Snapshot<T, N>,
        interval: &SampleInterval<T, N>,
        whole: &mut SMatrix<T, 1, P>,
    ) -> SVector<T, P> {
        let step = self.steps.whole(interval.h);
        let half_way = self.last.half_way(now, interval.h);
        let [energy, middle] =
            arm.energy_regressors_on::<C>([[&now.q, &now.dq], [&half_way.q, &half_way.dq]]);
        for j in 0..A::INERTIAL {
            let height = middle[j] - (energy[j] + self.last_energy[j]) * lit(0.5);
            self.energy[j] = step.curve::<C>(self.energy[j], self.last_energy[j], energy[j], height);
            whole[j] = (energy[j] - self.energy[j]) * step.lambda;
        }
        self.friction.filter_powers::<C>(&step, &self.last.dq, &now.dq);
        self.supply = self.exact_supply::<C>(now, interval);
        energy
    }

    /// Output of the low-pass filter `F`, W, for the power of torques held in each part of the interval, with velocities linear over the whole.
    #[inline(always)]
    fn exact_supply<C: Cpu>(&mut self, now: &Snapshot<T, N>, interval: &SampleInterval<T, N>) -> T {
        let parts = self.steps.parts(interval);
        let from = self.last.dq;
        let middle = from + (now.dq - from) * (interval.split / interval.h);
        let (first, second) = (&interval.first, &interval.second);
        let half_way = parts[0].ramp::<C>(self.supply, first.dot(&from), first.dot(&middle));
        parts[1].ramp::<C>(half_way, second.dot(&middle), second.dot(&now.dq))
    }
}
