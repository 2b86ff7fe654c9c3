//! The regression models, sample by sample: what a scheme makes of positions, velocities and torques.
//!
//! Each scheme turns one sample into rows `psi` and outputs `y` with `y = psi theta`. `R` parameters are estimated: the arm's `P`, or
//! with `R = P + N` also one constant torque per joint, `f_j = … + asymmetry_j`, which while the joint moves is what Coulomb friction
//! of different levels in the two directions adds.
//!
//! Two variants differ in the filters and in when signals are taken to be valid:
//!
//! * [`Variant::Paper`]: the filters as printed, and `q(k), dq(k), tau(k)` all of one sample.
//! * [`Variant::Exact`]: consistent filters, the torque that really acted between two states ([`Passage`]), and Coulomb friction that
//!   changes sign where the velocity does (`reversal`), not half-way to the next sample.
//!
//! Adding a scheme is one file here and one line in [`Scheme::ALL`].

mod filtered_dynamic;
mod filtered_power;
mod reversal;
mod supplied_energy;

pub use filtered_dynamic::FilteredDynamic;
pub use filtered_power::FilteredPower;
pub use supplied_energy::SuppliedEnergy;

use crate::arm::Arm;
use crate::filter::{Cutoff, State, Step};
use crate::real::{Real, lit};
use nalgebra::{SMatrix, SVector};

/// The schemes of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheme {
    /// Equation (24), one error per joint.
    FilteredDynamic,
    /// Equation (28), a scalar error.
    SuppliedEnergy,
    /// Equation (30), a scalar error.
    FilteredPower,
}

impl Scheme {
    /// Every scheme.
    pub const ALL: [Self; 3] = [Self::FilteredDynamic, Self::SuppliedEnergy, Self::FilteredPower];

    /// Name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FilteredDynamic => "filtered-dynamic",
            Self::SuppliedEnergy => "supplied-energy",
            Self::FilteredPower => "filtered-power",
        }
    }

    /// The scheme with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scheme| scheme.name() == name)
    }
}

/// How signals are filtered and aligned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// As printed.
    Paper,
    /// Consistent.
    Exact,
}

/// A state at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot<T, const N: usize> {
    /// Positions.
    pub q: SVector<T, N>,
    /// Velocities.
    pub dq: SVector<T, N>,
}

/// The way from one state to the next in two parts, each under a constant torque.
///
/// With states at the samples both parts have the same torque; with states half-way between samples, where a difference of positions
/// is the velocity to second order, the sample in the middle is where the torque changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage<T, const N: usize> {
    /// Duration, s.
    pub h: T,
    /// Duration of the first part, s.
    pub split: T,
    /// Torque over the first part.
    pub first: SVector<T, N>,
    /// Torque over the second part.
    pub second: SVector<T, N>,
    /// Positions between the parts.
    pub middle: SVector<T, N>,
}

impl Variant {
    /// A `D` channel at its first input: the paper's starts at rest, the consistent one in the steady state.
    #[inline]
    fn derivative_state<T: Real>(self, input: T) -> State<T> {
        match self {
            Self::Paper => State::from_zero(input),
            Self::Exact => State::steady(input),
        }
    }
}

impl<T: Real, const N: usize> Passage<T, N> {
    /// Coefficients of the two parts.
    #[inline]
    fn steps(&self, cutoff: &Cutoff<T>) -> [Step<T>; 2] {
        let first = cutoff.step(self.split);
        let rest = self.h - self.split;
        let second = if rest == self.split { first } else { cutoff.step(rest) };
        [first, second]
    }
}

impl<T: Real, const N: usize> Snapshot<T, N> {
    /// The state half-way to another one `h` seconds later, velocity linear in between.
    #[inline]
    fn half_way(&self, to: &Self, h: T) -> Self {
        let half: T = lit(0.5);
        Self {
            q: (self.q + to.q) * half - (to.dq - self.dq) * (h * lit(0.125)),
            dq: (self.dq + to.dq) * half,
        }
    }
}

/// Momentum, and gravity with the rest of what is not friction, as rows over all `R` parameters.
#[inline]
pub(crate) fn inertial_rows<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize>(
    arm: &A,
    now: &Snapshot<T, N>,
) -> (SMatrix<T, N, R>, SMatrix<T, N, R>) {
    let momentum = arm.momentum_regressor(&now.q, &now.dq);
    let potential = arm.potential_regressor(&now.q, &now.dq);
    (widened::<T, N, P, R>(&momentum), widened::<T, N, P, R>(&potential))
}

/// Friction as rows over all `R` parameters.
#[inline]
pub(crate) fn friction_rows<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize>(
    arm: &A,
    dq: &SVector<T, N>,
) -> SMatrix<T, N, R> {
    let mut rows = widened::<T, N, P, R>(&arm.friction_regressor(dq));
    for j in 0..N {
        if P + j < R {
            rows[(j, P + j)] = T::one();
        }
    }
    rows
}

/// Energy as a row over all `R` parameters.
#[inline]
pub(crate) fn energy_row<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize>(
    arm: &A,
    now: &Snapshot<T, N>,
) -> SMatrix<T, 1, R> {
    widened::<T, 1, P, R>(&arm.energy_regressor(&now.q, &now.dq).transpose())
}

/// Dissipated power as a row over all `R` parameters.
#[inline]
pub(crate) fn power_row<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize, const R: usize>(
    arm: &A,
    dq: &SVector<T, N>,
) -> SMatrix<T, 1, R> {
    let mut power = widened::<T, 1, P, R>(&arm.dissipation_regressor(dq).transpose());
    for j in 0..N {
        if P + j < R {
            power[(0, P + j)] = dq[j];
        }
    }
    power
}

#[inline]
fn widened<T: Real, const M: usize, const P: usize, const R: usize>(
    rows: &SMatrix<T, M, P>,
) -> SMatrix<T, M, R> {
    let mut wide = SMatrix::zeros();
    for i in 0..M {
        for j in 0..P {
            if j < R {
                wide[(i, j)] = rows[(i, j)];
            }
        }
    }
    wide
}
