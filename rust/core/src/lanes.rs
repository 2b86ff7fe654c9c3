//! Several numbers side by side, which a processor's vector unit takes together.
//!
//! Lanes are arrays, worked on by plain loops, which compilers turn into vector instructions wherever a function is compiled for them (see
//! [`crate::cpu`]). All functions are inlined: one that is not would be compiled for every processor.

use crate::cpu::Cpu;
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

/// Implements binary operators on lanes, lane by lane.
macro_rules! lane_by_lane {
    ($($operation:ident $function:ident),*) => {
        $(impl<T: Real, C: Cpu, const W: usize> $operation for Lanes<T, C, W> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                let mut x = self.0;
                for l in 0..W {
                    x[l] = x[l].$function(other.0[l]);
                }
                Self::new(x)
            }
        })*
    };
}

lane_by_lane!(Add add, Sub sub, Mul mul, Div div);

impl<T: Real, C: Cpu, const W: usize> Neg for Lanes<T, C, W> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        let mut x = self.0;
        for l in 0..W {
            x[l] = -x[l];
        }
        Self::new(x)
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
        let mut x = self.0;
        for l in 0..W {
            x[l] = C::fused(x[l], a.0[l], b.0[l]);
        }
        Self::new(x)
    }

    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        let (sine, cosine) = crate::trig::series_of(self);
        let largest = lit(crate::trig::largest::<T>());
        let mut within = self.0;
        for l in 0..W {
            within[l] = if within[l].abs() <= largest { T::one() } else { lit(f64::NAN) };
        }
        let within = Self::new(within);
        (sine * within, cosine * within)
    }

    #[inline(always)]
    fn size(self) -> Self {
        let mut x = self.0;
        for l in 0..W {
            x[l] = x[l].abs();
        }
        Self::new(x)
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        let mut x = self.0;
        for l in 0..W {
            x[l] = if x[l] > other.0[l] { x[l] } else { other.0[l] };
        }
        Self::new(x)
    }

    #[inline(always)]
    fn where_zero(self, zero: Self, other: Self) -> Self {
        let mut x = self.0;
        for l in 0..W {
            x[l] = if x[l] == T::zero() { zero.0[l] } else { other.0[l] };
        }
        Self::new(x)
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
