//! Number type of the equations of motion: one real number, or several side by side.
//!
//! An arm's equation is written once over [`Number`]; with a [`Real`] it moves one arm, with [`crate::lanes::Lanes`] several at once. The equations
//! do not branch on comparisons: cases are distinguished by arithmetic, or by a choice between two computed values in each lane.

use crate::cpu::{Cpu, Portable};
use crate::real::Real;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// One real number, or several side by side (lanes).
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Type of the number in one lane, `f32` or `f64`.
    type Real: Real;

    /// Number of lanes: how many real numbers are side by side.
    const WIDTH: usize;

    /// The number `x` in every lane.
    fn of(x: Self::Real) -> Self;

    /// `self a + b`, rounded once where the processor has one instruction for it.
    fn fused(self, a: Self, b: Self) -> Self;

    /// Sine and cosine of an angle, rad; lanes may give NaN beyond [`crate::trig::LARGEST`].
    fn sine_cosine(self) -> (Self, Self);

    /// Absolute value.
    fn size(self) -> Self;

    /// The larger of `self` and `other`; `other` where `self` is NaN.
    fn larger(self, other: Self) -> Self;

    /// `zero` where `self` is zero, `other` where it is not.
    fn where_zero(self, zero: Self, other: Self) -> Self;

    /// Whether the number in any lane is zero.
    fn any_zero(self) -> bool;
}

impl<T: Real> Number for T {
    type Real = T;
    const WIDTH: usize = 1;

    #[inline(always)]
    fn of(x: T) -> Self {
        x
    }

    #[inline(always)]
    fn fused(self, a: Self, b: Self) -> Self {
        Portable::fused(self, a, b)
    }

    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        crate::trig::sin_cos(self)
    }

    #[inline(always)]
    fn size(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn where_zero(self, zero: Self, other: Self) -> Self {
        if self == T::zero() { zero } else { other }
    }

    #[inline(always)]
    fn any_zero(self) -> bool {
        self == T::zero()
    }
}
