//! Sums and products of small vectors, four entries at a time.
//!
//! Written so that a compiler finds vector instructions for entries that lie side by side; of `R` entries the first multiple of four are
//! the `lead`, the rest the tail.

use crate::cpu::Cpu;
use crate::real::Real;

/// Entries per vector.
pub(super) const LANES: usize = 4;

/// How many of `R` entries fill whole lanes.
#[inline(always)]
pub(super) const fn lead<const R: usize>() -> usize {
    R / LANES * LANES
}

/// `a . b`.
#[inline(always)]
pub(super) fn dot<C: Cpu, T: Real, const R: usize>(a: &[T; R], b: &[T; R]) -> T {
    let mut sums = [T::zero(); LANES];
    for c in 0..R / LANES {
        for l in 0..LANES {
            sums[l] = C::fused(a[c * LANES + l], b[c * LANES + l], sums[l]);
        }
    }
    let mut rest = T::zero();
    for i in lead::<R>()..R {
        rest = C::fused(a[i], b[i], rest);
    }
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

/// Whether every entry is a number of at most this size.
#[inline(always)]
pub(super) fn all_within<T: Real, const R: usize>(a: &[T; R], limit: T) -> bool {
    let mut all = true;
    for x in a {
        all &= x.abs() <= limit;
    }
    all
}
