//! Several numbers side by side, which a processor's vector unit takes together.
//!
//! Lanes are arrays. Four or eight doubles are added or multiplied by one instruction where a function is compiled for it, others by plain loops,
//! which compilers turn into vector instructions where they can (see [`crate::cpu`]). All functions are inlined: one that is not would be compiled
//! for every processor.

use crate::cpu::{Cpu, vector, vector::Operation};
use crate::number::Number;
use crate::real::{Real, lit};
use core::marker::PhantomData;
use core::ops::{Add, Div, Mul, Neg, Sub};

/// `W` numbers side by side, one per lane; `C` is the processor whose multiply-add they use.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct Lanes<T, C, const W: usize>(pub [T; W], PhantomData<C>);

impl<T: Copy, C, const W: usize> Clone for Lanes<T, C, W> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<T: Copy, C, const W: usize> Copy for Lanes<T, C, W> {}

impl<T: Copy, C, const W: usize> Lanes<T, C, W> {
    /// Lanes with the numbers `x`.
    #[inline(always)]
    pub fn new(x: [T; W]) -> Self {
        Self(x, PhantomData)
    }
}

impl<T: Real, C, const W: usize> Lanes<T, C, W> {
    /// True if all lanes are <= 0; false if any is positive or NaN.
    #[inline(always)]
    pub fn none_positive(self) -> bool {
        let mut none = true;
        for l in 0..W {
            none &= self.0[l] <= T::zero();
        }
        none
    }
}

impl<T: Real, C: Cpu, const W: usize> Lanes<T, C, W> {
    /// The operation `O` in every lane, on these lanes, `b` and `c`.
    #[inline(always)]
    fn by<O: Operation>(self, b: Self, c: Self) -> Self {
        Self::new(C::each::<O, T, W>(self.0, b.0, c.0))
    }
}

/// Implements binary operators on lanes, lane by lane.
macro_rules! lane_by_lane {
    ($($operation:ident $function:ident $by:ident),*) => {
        $(impl<T: Real, C: Cpu, const W: usize> $operation for Lanes<T, C, W> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                self.by::<vector::$by>(other, other)
            }
        })*
    };
}

lane_by_lane!(Add add Sum, Sub sub Difference, Mul mul Product, Div div Quotient);

impl<T: Real, C: Cpu, const W: usize> Neg for Lanes<T, C, W> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.by::<vector::Negative>(self, self)
    }
}

impl<T: Real, C: Cpu, const W: usize> Number for Lanes<T, C, W> {
    type Real = T;
    const WIDTH: usize = W;

    #[inline(always)]
    fn of(x: T) -> Self {
        Self::new([x; W])
    }

    #[inline(always)]
    fn fused(self, a: Self, b: Self) -> Self {
        self.by::<vector::Fused>(a, b)
    }

    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        let (sine, cosine) = crate::trig::series_of(self);
        let largest = Self::of(lit(crate::trig::largest::<T>()));
        let excess = self.size().larger(largest) - largest;
        let within = excess.where_zero(Self::of(T::one()), Self::of(lit(f64::NAN)));
        (sine * within, cosine * within)
    }

    #[inline(always)]
    fn size(self) -> Self {
        self.by::<vector::Size>(self, self)
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.by::<vector::Larger>(other, other)
    }

    #[inline(always)]
    fn where_zero(self, zero: Self, other: Self) -> Self {
        self.by::<vector::WhereZero>(zero, other)
    }

    #[inline(always)]
    fn any_zero(self) -> bool {
        let mut any = false;
        for l in 0..W {
            any |= self.0[l] == T::zero();
        }
        any
    }
}
