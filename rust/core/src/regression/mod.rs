//! Regression models (schemes) of Reyes and Kelly (1997): from positions, velocities and torques to regressor rows, sample by sample.
//!
//! Each scheme turns one sample into rows `psi` and outputs `y` with `y = psi theta`. Estimated are ([`Columns`]) the arm's `P` parameters,
//! or some of them, and one constant torque per joint, `f_j = … + asymmetry_j`, to which Coulomb friction of different levels in the two
//! directions amounts while the joint moves.
//!
//! Two variants differ in the filters and in when signals are taken to be valid:
//!
//! * [`Variant::Paper`]: the filters as printed, and `q(k), dq(k), tau(k)` all of one sample.
//! * [`Variant::Exact`]: consistent filters, the torque that really acted between two states ([`SampleInterval`]), and Coulomb friction that
//!   changes sign where the velocity does (`friction`), not half-way to the next sample.
//!
//! Adding a scheme is one file in this folder and one line in [`Scheme::ALL`].

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

/// Schemes of Reyes and Kelly (1997): recursive estimators by their regression models.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheme {
    /// Filtered dynamic model, Reyes and Kelly (1997), equation (24): one prediction error per joint, N m (N).
    FilteredDynamic,
    /// Supplied energy model, Reyes and Kelly (1997), equation (28): one prediction error, J.
    SuppliedEnergy,
    /// Filtered power model, Reyes and Kelly (1997), equation (30): one prediction error, W.
    FilteredPower,
}

impl Scheme {
    /// All schemes, in the order of the documentation.
    pub const ALL: [Self; 3] = [Self::FilteredDynamic, Self::SuppliedEnergy, Self::FilteredPower];

    /// Name of the scheme on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FilteredDynamic => "filtered-dynamic",
            Self::SuppliedEnergy => "supplied-energy",
            Self::FilteredPower => "filtered-power",
        }
    }

    /// The scheme that the command line calls `name`.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|scheme| scheme.name() == name)
    }
}

/// Filters and alignment of signals of a scheme.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// Filters as Reyes and Kelly (1997) print them; position, velocity and torque all of one sample.
    Paper,
    /// Filters consistent with each other; position, velocity and torque aligned in time.
    Exact,
}

/// Joint positions and velocities at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot<T, const N: usize> {
    /// Joint positions, rad or m.
    pub q: SVector<T, N>,
    /// Joint velocities, rad/s or m/s.
    pub dq: SVector<T, N>,
}

/// Interval from one state to the next in two parts, each under a constant torque.
///
/// With states at the samples both parts have one torque; with states half-way between samples, where a difference of positions is the velocity to
/// second order, the torque changes at the sample in the middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleInterval<T, const N: usize> {
    /// Duration of the interval, s.
    pub h: T,
    /// Duration of the first part of the interval, s.
    pub split: T,
    /// Joint torques over the first part of the interval, N m (N).
    pub first: SVector<T, N>,
    /// Joint torques over the second part of the interval, N m (N).
    pub second: SVector<T, N>,
    /// Joint positions between the parts of the interval, rad or m.
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
    /// State half-way in time to the state `to`, `h` seconds later, with velocities linear in time.
    #[inline(always)]
    fn half_way(&self, to: &Self, h: T) -> Self {
        let half: T = lit(0.5);
        Self {
            q: (self.q + to.q) * half - (to.dq - self.dq) * (h * lit(0.125)),
            dq: (self.dq + to.dq) * half,
        }
    }
}
