//! Update of the covariance as Reyes and Kelly (1997) print it in equation (21), `P - P Psi (mu I + Psi' P Psi)^-1 Psi' P`, error by error.
//!
//! The subtracted matrix is rounded symmetrically, so `P` stays exactly symmetric although every entry is computed on its own, as suits
//! vector instructions. Of rows beyond the last whole group of four only the diagonal block is kept; their further entries are those of the
//! columns.

use super::lanes::{LANES, dot, lead};
use super::{Count, Forgetting, wide};
use crate::cpu::Cpu;
use crate::real::{Real, lit};
use nalgebra::SMatrix;

/// Covariance `P`, column by column, and a copy of its diagonal for the check that it stays positive.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(super) struct Plain<T, A, const R: usize> {
    p: [[T; R]; R],
    diagonal: [T; R],
    /// Nothing; its type aligns `p`.
    align: [A; 0],
}

impl<T: Real, A: Copy, const R: usize> Plain<T, A, R> {
    pub(super) fn of(p: &SMatrix<T, R, R>) -> Self {
        Self {
            p: core::array::from_fn(|j| core::array::from_fn(|i| p[(i.min(j), i.max(j))])),
            diagonal: core::array::from_fn(|i| p[(i, i)]),
            align: [],
        }
    }

    /// The same covariance in another alignment.
    pub(super) fn aligned<B>(&self) -> Plain<T, B, R> {
        Plain { p: self.p, diagonal: self.diagonal, align: [] }
    }

    pub(super) fn matrix(&self) -> SMatrix<T, R, R> {
        SMatrix::from_fn(|i, j| self.p[i.max(j)][i.min(j)])
    }

    pub(super) fn diagonal(&self) -> [T; R] {
        self.diagonal
    }

    /// Updates covariance and estimate by rows of `Psi'` and their prediction errors; returns the leverage, or `None`, with nothing changed, if `P`
    /// would not stay positive definite.
    #[inline(always)]
    pub(super) fn learn<C: Cpu, N: Count, const M: usize>(
        &mut self,
        theta: &mut [T; R],
        rows: &[[T; R]; M],
        error: &[T; M],
        count: N,
        forgetting: &Forgetting<T, R>,
    ) -> Option<T> {
        if N::in_blocks(R) {
            return self.learn_many::<C, N, M>(theta, rows, error, count, forgetting);
        }
        let r = count.of(R);
        let (mut gain, mut rate, mut inverse) = (self.times::<C, M>(rows, r), *error, [T::zero(); M]);
        // `mu I + Psi' P Psi`, of which the upper triangle counts.
        let (mut total, mut sound) = ([[T::zero(); M]; M], true);
        for l in 0..M {
            for m in l..M {
                total[l][m] = dot::<C, T, R>(&gain[l], &rows[m], r);
            }
            total[l][l] += forgetting.mu;
            // Beyond this limit the updated `P` in the direction of the row would consist of rounding errors.
            sound &= total[l][l] * T::default_epsilon() <= forgetting.mu * lit(0.125);
        }
        let mut leverage = T::zero();
        for m in 0..M {
            sound &= total[m][m] > T::zero();
            inverse[m] = T::one() / total[m][m];
            for n in m + 1..M {
                let share = total[m][n] * inverse[m];
                for k in n..M {
                    total[n][k] = C::fused(-share, total[m][k], total[n][k]);
                }
                for i in 0..r {
                    gain[n][i] = C::fused(-share, gain[m][i], gain[n][i]);
                }
                rate[n] = C::fused(-share, rate[m], rate[n]);
            }
            rate[m] *= inverse[m];
            leverage += T::one() - forgetting.mu * inverse[m];
        }
        let (diagonal, positive) = self.shrunk::<C, M>(&gain, &inverse, r);
        if !(sound & positive) {
            return None;
        }
        self.diagonal = diagonal;
        for m in 0..M {
            for i in 0..r {
                theta[i] = C::fused(gain[m][i], rate[m], theta[i]);
            }
        }
        self.take_off::<C, M>(&gain, &inverse, r);
        if forgetting.mu < T::one() {
            self.forget(forgetting, r);
        }
        Some(leverage)
    }

    /// Same as [`Self::learn`] for many parameters: `mu I + Psi' P Psi = L L'`, `H = P Psi L'^-1`, and `P - H H'`.
    #[inline(always)]
    fn learn_many<C: Cpu, N: Count, const M: usize>(
        &mut self,
        theta: &mut [T; R],
        rows: &[[T; R]; M],
        error: &[T; M],
        count: N,
        forgetting: &Forgetting<T, R>,
    ) -> Option<T> {
        let r = count.of(R);
        let mut h = wide::times::<C, T, M, R>(&self.p, rows, r);
        let mut total = wide::products::<C, T, M, R>(&h, rows, r);
        let (mut rate, mut inverse, mut leverage, mut sound) = (*error, [T::zero(); M], T::zero(), true);
        for m in 0..M {
            total[m][m] += forgetting.mu;
            // Beyond this limit the updated `P` in the direction of the row would consist of rounding errors.
            sound &= total[m][m] * T::default_epsilon() <= forgetting.mu * lit(0.125);
        }
        for m in 0..M {
            // Row `m` of `total` becomes column `m` of `L`, its diagonal stays that of `L` squared.
            sound &= total[m][m] > T::zero();
            inverse[m] = T::one() / total[m][m].sqrt();
            rate[m] *= inverse[m];
            leverage += T::one() - forgetting.mu * (inverse[m] * inverse[m]);
            for n in m + 1..M {
                total[m][n] *= inverse[m];
                rate[n] = C::fused(-total[m][n], rate[m], rate[n]);
            }
            for n in m + 1..M {
                for k in n..M {
                    total[n][k] = C::fused(-total[m][n], total[m][k], total[n][k]);
                }
            }
        }
        let mut positive = true;
        for i in 0..r {
            let mut variance = self.diagonal[i];
            for m in 0..M {
                let mut entry = h[m][i];
                for k in 0..m {
                    entry = C::fused(-total[k][m], h[k][i], entry);
                }
                entry *= inverse[m];
                h[m][i] = entry;
                variance = C::fused(-entry, entry, variance);
            }
            positive &= variance > T::zero();
        }
        if !(sound & positive) {
            return None;
        }
        for i in 0..r {
            for m in 0..M {
                self.diagonal[i] = C::fused(-h[m][i], h[m][i], self.diagonal[i]);
                theta[i] = C::fused(h[m][i], rate[m], theta[i]);
            }
        }
        wide::take_off::<C, T, M, R>(&mut self.p, &h, r);
        if forgetting.mu < T::one() {
            self.forget(forgetting, r);
        }
        Some(leverage)
    }

    /// Product `P psi` of the covariance and each of the rows `psi`.
    #[inline(always)]
    fn times<C: Cpu, const M: usize>(&self, rows: &[[T; R]; M], r: usize) -> [[T; R]; M] {
        let mut product = [[T::zero(); R]; M];
        for c in 0..r / LANES {
            // Two independent sums, so that additions need not wait for each other.
            let (mut even, mut odd) = ([[T::zero(); LANES]; M], [[T::zero(); LANES]; M]);
            for k in 0..r / 2 {
                self.add_column::<C, M>(&mut even, c, 2 * k, rows);
                self.add_column::<C, M>(&mut odd, c, 2 * k + 1, rows);
            }
            for j in r / 2 * 2..r {
                self.add_column::<C, M>(&mut even, c, j, rows);
            }
            for m in 0..M {
                for l in 0..LANES {
                    product[m][c * LANES + l] = even[m][l] + odd[m][l];
                }
            }
        }
        for i in lead(r)..r {
            for m in 0..M {
                product[m][i] = dot::<C, T, R>(&self.p[i], &rows[m], r);
            }
        }
        product
    }

    /// Adds to `sums` the product of entries `4 c` to `4 c + 3` of column `j` of `P` and entry `j` of each row.
    #[inline(always)]
    fn add_column<C: Cpu, const M: usize>(
        &self,
        sums: &mut [[T; LANES]; M],
        c: usize,
        j: usize,
        rows: &[[T; R]; M],
    ) {
        for m in 0..M {
            for l in 0..LANES {
                sums[m][l] = C::fused(self.p[j][c * LANES + l], rows[m][j], sums[m][l]);
            }
        }
    }

    /// Diagonal of `P` after the update, and whether all of its entries stay positive; they do unless `P` is no longer positive definite up to
    /// rounding.
    #[inline(always)]
    fn shrunk<C: Cpu, const M: usize>(
        &self,
        gain: &[[T; R]; M],
        inverse: &[T; M],
        r: usize,
    ) -> ([T; R], bool) {
        let (mut diagonal, mut positive) = (self.diagonal, true);
        for m in 0..M {
            for i in 0..r {
                diagonal[i] = C::fused(gain[m][i] * gain[m][i], -inverse[m], diagonal[i]);
            }
        }
        for i in 0..r {
            positive &= diagonal[i] > T::zero();
        }
        (diagonal, positive)
    }

    /// Subtracts the sum of `gain gain' / total` from `P`, with products of two gains first: they are equal for `(i, j)` and `(j, i)`, so `P` stays
    /// symmetric, and do not depend on the reciprocal of `total`.
    #[inline(always)]
    fn take_off<C: Cpu, const M: usize>(&mut self, gain: &[[T; R]; M], inverse: &[T; M], r: usize) {
        for j in 0..r {
            for i in 0..lead(r) {
                for m in 0..M {
                    self.p[j][i] = C::fused(-(gain[m][i] * gain[m][j]), inverse[m], self.p[j][i]);
                }
            }
        }
        for j in lead(r)..r {
            for i in lead(r)..r {
                for m in 0..M {
                    self.p[j][i] = C::fused(-(gain[m][i] * gain[m][j]), inverse[m], self.p[j][i]);
                }
            }
        }
    }

    fn forget(&mut self, forgetting: &Forgetting<T, R>, r: usize) {
        let (lift, limited) = forgetting.lift(&self.diagonal);
        let (grow, r) = (T::one() / forgetting.mu, r.min(R));
        for j in 0..r {
            for i in 0..r {
                self.p[j][i] *= if limited { lift[i] * lift[j] } else { grow };
            }
            self.diagonal[j] = self.p[j][j];
        }
    }
}
