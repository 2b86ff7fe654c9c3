//! Sums and products of small vectors, four entries at a time.
//!
//! The loops are written so that a compiler finds vector instructions for neighbouring entries; of `n` entries the largest multiple of four
//! is the `lead`, the rest the tail.

use crate::cpu::Cpu;
use crate::real::Real;
use core::fmt::Debug;

/// Number of entries of a small vector that recursive least squares takes together: four doubles fill a vector of AVX2.
pub(super) const LANES: usize = 4;

/// Smallest room for parameters for which a covariance is worked on in blocks of rows.
const MANY: usize = 16;

/// Number of entries, of `n`, that fill whole groups of four.
#[inline(always)]
pub(super) const fn lead(n: usize) -> usize {
    n / LANES * LANES
}

/// Scalar product of the first `n` entries of `a` and `b`.
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

/// Whether every entry of `a` is a number of at most the size `limit`.
#[inline(always)]
pub(super) fn all_within<T: Real, const R: usize>(a: &[T; R], limit: T) -> bool {
    let mut all = true;
    for x in a {
        all &= x.abs() <= limit;
    }
    all
}

/// Number of parameters in use, at most the number that the estimator has room for.
pub trait Count: Copy + Debug + PartialEq {
    /// Type whose alignment columns of the covariance get: of a cache line for many parameters, so that no vector is spread over two lines.
    type Align: Copy + Debug + PartialEq;

    /// Whether a covariance with room for `room` parameters is worked on in blocks of rows, with vectors as wide as the processor has.
    fn in_blocks(room: usize) -> bool;

    /// Number of parameters in use in an estimator with room for `room` parameters.
    fn of(self, room: usize) -> usize;

    /// Calls `call(i)` for each of the first `n` entries of a column, and perhaps for entries after them, which are zero and stay zero.
    fn each(n: usize, room: usize, call: impl FnMut(usize));
}

/// All parameters that there is room for, a number known to the compiler.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct All;

impl Count for All {
    type Align = ();

    /// False: with a number that they know, compilers find vectors by themselves, and lose those of blocks.
    #[inline(always)]
    fn in_blocks(_: usize) -> bool {
        false
    }

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

/// Type with the alignment of a cache line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(align(64))]
pub struct CacheLine;

/// The first parameters, in a number chosen at run time; columns are worked on in whole groups of four.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct First(usize);

impl First {
    /// The first `n` parameters, rounded up to whole groups of four if there is room for them: parameters beyond `n` are not excited.
    pub fn new(n: usize) -> Self {
        Self(n.next_multiple_of(LANES))
    }
}

impl Count for First {
    type Align = CacheLine;

    #[inline(always)]
    fn in_blocks(room: usize) -> bool {
        room >= MANY
    }

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
