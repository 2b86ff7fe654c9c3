//! Sums and products of small vectors, four entries at a time.
//!
//! Written so that a compiler finds vector instructions for entries that lie side by side; of `n` entries the first multiple of four are
//! the `lead`, the rest the tail.

use crate::cpu::Cpu;
use crate::real::Real;
use core::fmt::Debug;

/// Entries per vector.
pub(super) const LANES: usize = 4;

/// How many of `n` entries fill whole lanes.
#[inline(always)]
pub(super) const fn lead(n: usize) -> usize {
    n / LANES * LANES
}

/// `a . b` of the first `n` entries.
#[inline(always)]
pub(super) fn dot<C: Cpu, T: Real, const R: usize>(a: &[T; R], b: &[T; R], n: usize) -> T {
    let mut sums = [T::zero(); LANES];
    for c in 0..n / LANES {
        for l in 0..LANES {
            sums[l] = C::fused(a[c * LANES + l], b[c * LANES + l], sums[l]);
        }
    }
    let mut rest = T::zero();
    for i in lead(n)..n {
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

/// How many of the parameters that there is room for are in use.
pub trait Count: Copy + Debug + PartialEq {
    /// The number for `room` parameters, at most `room`.
    fn of(self, room: usize) -> usize;

    /// Calls for each of the first `n` entries of a column, and perhaps for some after them, which are zero and stay so.
    fn each(n: usize, room: usize, call: impl FnMut(usize));
}

/// All of them, a number known to the compiler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct All;

impl Count for All {
    #[inline(always)]
    fn of(self, room: usize) -> usize {
        room
    }

    #[inline(always)]
    fn each(n: usize, _: usize, mut call: impl FnMut(usize)) {
        for i in 0..n {
            call(i);
        }
    }
}

/// The first so many, a number chosen at run time; columns are worked on in whole lanes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct First(usize);

impl First {
    /// At least `n`, in whole lanes if there is room for them: what is beyond `n` is not excited.
    pub fn new(n: usize) -> Self {
        Self(n.next_multiple_of(LANES))
    }
}

impl Count for First {
    #[inline(always)]
    fn of(self, room: usize) -> usize {
        self.0.min(room)
    }

    #[inline(always)]
    fn each(n: usize, room: usize, mut call: impl FnMut(usize)) {
        for c in 0..(n / LANES + 1).min(room / LANES) {
            for l in 0..LANES {
                call(c * LANES + l);
            }
        }
    }
}
