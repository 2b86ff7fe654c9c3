//! Product with, and update of, a covariance of many parameters, in blocks of rows whose sums stay in a processor's vector registers.
//!
//! A small covariance fits into a few cache lines, and what its update costs is the chain from one result to the next; one of many parameters is read
//! and written as a whole for every sample, and the number of multiplications and memory accesses decides. So the subtracted matrix is a product
//! `h h'` of gains already divided by the square root of their denominator: one multiplication per entry, exactly symmetric.

use super::lanes::LANES;
use crate::cpu::Cpu;
use crate::real::Real;

/// Number of doubles in a cache line and in a vector of AVX-512.
const EIGHT: usize = 8;

/// Product of the first `r` rows and columns of `p` and each of the rows `psi`.
#[inline(always)]
pub(super) fn times<C: Cpu, T: Real, const M: usize, const R: usize>(
    p: &[[T; R]; R],
    psi: &[[T; R]; M],
    r: usize,
) -> [[T; R]; M] {
    let mut product = [[T::zero(); R]; M];
    let mut done = 0;
    if C::DOUBLES == 8 {
        if M == 1 {
            done = times_blocks::<C, T, 32, M, R>(p, psi, &mut product, done, r);
        }
        done = times_blocks::<C, T, 8, M, R>(p, psi, &mut product, done, r);
    } else if M == 1 {
        done = times_blocks::<C, T, 16, M, R>(p, psi, &mut product, done, r);
    }
    done = times_blocks::<C, T, LANES, M, R>(p, psi, &mut product, done, r);
    for i in done..r {
        for m in 0..M {
            let mut sum = T::zero();
            for j in 0..r {
                sum = C::fused(p[j][i], psi[m][j], sum);
            }
            product[m][i] = sum;
        }
    }
    product
}

/// Rows of the product from row `done`, a multiple of `W`, in whole blocks of `W`; returns the first row that is left.
#[inline(always)]
fn times_blocks<C: Cpu, T: Real, const W: usize, const M: usize, const R: usize>(
    p: &[[T; R]; R],
    psi: &[[T; R]; M],
    product: &mut [[T; R]; M],
    done: usize,
    r: usize,
) -> usize {
    for c in done / W..r / W {
        // Two independent sums, so that additions need not wait for each other.
        let (mut even, mut odd) = ([[T::zero(); W]; M], [[T::zero(); W]; M]);
        for k in 0..r / 2 {
            add_column::<C, T, W, M, R>(&mut even, p, psi, c, 2 * k);
            add_column::<C, T, W, M, R>(&mut odd, p, psi, c, 2 * k + 1);
        }
        for j in r / 2 * 2..r {
            add_column::<C, T, W, M, R>(&mut even, p, psi, c, j);
        }
        for m in 0..M {
            if let Some(block) = product[m].as_chunks_mut::<W>().0.get_mut(c) {
                for l in 0..W {
                    block[l] = even[m][l] + odd[m][l];
                }
            }
        }
    }
    r / W * W
}

/// Adds to `sums` the product of block `c` of column `j` of `p` and entry `j` of each row.
#[inline(always)]
fn add_column<C: Cpu, T: Real, const W: usize, const M: usize, const R: usize>(
    sums: &mut [[T; W]; M],
    p: &[[T; R]; R],
    psi: &[[T; R]; M],
    c: usize,
    j: usize,
) {
    let Some(block) = p[j].as_chunks::<W>().0.get(c) else { return };
    for m in 0..M {
        for l in 0..W {
            sums[m][l] = C::fused(block[l], psi[m][j], sums[m][l]);
        }
    }
}

/// Scalar products of the first `r` entries of each of `gain` and each of the rows `psi`, of which the upper triangle counts.
#[inline(always)]
pub(super) fn products<C: Cpu, T: Real, const M: usize, const R: usize>(
    gain: &[[T; R]; M],
    psi: &[[T; R]; M],
    r: usize,
) -> [[T; M]; M] {
    let mut products = [[T::zero(); M]; M];
    for l in 0..M {
        for m in l..M {
            products[l][m] = dot::<C, T, R>(&gain[l], &psi[m], r);
        }
    }
    products
}

/// Scalar product of the first `r` entries of `a` and `b`, by sums of every eighth product.
#[inline(always)]
pub(super) fn dot<C: Cpu, T: Real, const R: usize>(a: &[T; R], b: &[T; R], r: usize) -> T {
    let mut sums = [T::zero(); EIGHT];
    let blocks = a.as_chunks::<EIGHT>().0.iter().zip(b.as_chunks::<EIGHT>().0);
    for (a, b) in blocks.take(r / EIGHT) {
        for l in 0..EIGHT {
            sums[l] = C::fused(a[l], b[l], sums[l]);
        }
    }
    let mut rest = T::zero();
    for i in r / EIGHT * EIGHT..r {
        rest = C::fused(a[i], b[i], rest);
    }
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7])) + rest
}

/// Subtracts the sum of `h h'` over the rows `h` from the first `r` rows and columns of `p`.
#[inline(always)]
pub(super) fn take_off<C: Cpu, T: Real, const M: usize, const R: usize>(
    p: &mut [[T; R]; R],
    h: &[[T; R]; M],
    r: usize,
) {
    for j in 0..r {
        for i in 0..r {
            for m in 0..M {
                p[j][i] = C::fused(-h[m][i], h[m][j], p[j][i]);
            }
        }
    }
}
