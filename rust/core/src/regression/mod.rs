//! The regression models, sample by sample: what a scheme makes of positions, velocities and torques.
//!
//! Each scheme turns one sample into rows `psi` and outputs `y` with `y = psi theta`. Estimated are ([`Columns`]) the arm's `P` parameters,
//! or some of them, and one constant torque per joint, `f_j = … + asymmetry_j`, which while the joint moves is what Coulomb friction of
//! different levels in the two directions adds.
//!
//! Two variants differ in the filters and in when signals are taken to be valid:
//!
//! * [`Variant::Paper`]: the filters as printed, and `q(k), dq(k), tau(k)` all of one sample.
//! * [`Variant::Exact`]: consistent filters, the torque that really acted between two states ([`SampleInterval`]), and Coulomb friction that
//!   changes sign where the velocity does (`friction`), not half-way to the next sample.
//!
//! Adding a scheme is one file here and one line in [`Scheme::ALL`].

mod columns;
mod filtered_dynamic;
mod filtered_power;
mod friction;
mod supplied_energy;

pub use columns::{AllColumns, ChosenColumns, Columns};
pub use filtered_dynamic::FilteredDynamic;
pub use filtered_power::FilteredPower;
pub use friction::Friction;
pub use supplied_energy::SuppliedEnergy;

use crate::filter::{CachedCoefficients, Cutoff, FilterCoefficients};
use crate::real::{Real, lit};
use nalgebra::SVector;

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

/// Interval from one state to the next in two parts, each under a constant torque.
///
/// With states at the samples both parts have the same torque; with states half-way between samples, where a difference of positions
/// is the velocity to second order, the sample in the middle is where the torque changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleInterval<T, const N: usize> {
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

/// Filter coefficients of a sample interval and of its two parts, cached while their lengths stay the same.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SegmentCoefficients<T> {
    whole: CachedCoefficients<T>,
    first: CachedCoefficients<T>,
    second: CachedCoefficients<T>,
}

impl<T: Real> SegmentCoefficients<T> {
    #[inline(always)]
    fn new(cutoff: &Cutoff<T>) -> Self {
        let none = CachedCoefficients::new(cutoff);
        Self { whole: none, first: none, second: none }
    }

    #[inline(always)]
    fn whole(&mut self, h: T) -> FilterCoefficients<T> {
        self.whole.step(h)
    }

    #[inline(always)]
    fn parts<const N: usize>(&mut self, interval: &SampleInterval<T, N>) -> [FilterCoefficients<T>; 2] {
        [self.first.step(interval.split), self.second.step(interval.h - interval.split)]
    }
}

impl<T: Real, const N: usize> Snapshot<T, N> {
    /// The state half-way to another one `h` seconds later, velocity linear in between.
    #[inline(always)]
    fn half_way(&self, to: &Self, h: T) -> Self {
        let half: T = lit(0.5);
        Self {
            q: (self.q + to.q) * half - (to.dq - self.dq) * (h * lit(0.125)),
            dq: (self.dq + to.dq) * half,
        }
    }
}
