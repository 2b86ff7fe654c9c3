//! Equation (21) as printed: `P - P Psi (mu I + Psi' P Psi)^-1 Psi' P`, the errors eliminated one by one.
//!
//! What is taken off is rounded symmetrically, so `P` stays exactly symmetric although every entry is computed on its own, which is
//! what vector instructions like. Of the rows beyond the last whole lane only the diagonal block is kept; their other entries are those
//! of the columns.

use super::Forgetting;
use super::lanes::{LANES, dot, lead};
use crate::real::{Real, lit};
use nalgebra::SMatrix;

/// The matrix, column by column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plain<T, const R: usize> {
    p: [[T; R]; R],
}

impl<T: Real, const R: usize> Plain<T, R> {
    pub(super) fn of(p: &SMatrix<T, R, R>) -> Self {
        Self { p: core::array::from_fn(|j| core::array::from_fn(|i| p[(i.min(j), i.max(j))])) }
    }

    pub(super) fn matrix(&self) -> SMatrix<T, R, R> {
        SMatrix::from_fn(|i, j| self.p[i.max(j)][i.min(j)])
    }

    pub(super) fn diagonal(&self) -> [T; R] {
        core::array::from_fn(|i| self.p[i][i])
    }

    /// Learns from rows of `Psi'` and their errors; the leverage, or nothing changed because `P` would not stay positive definite.
    #[inline(always)]
    pub(super) fn learn<const M: usize>(
        &mut self,
        theta: &mut [T; R],
        rows: &[[T; R]; M],
        error: &[T; M],
        forgetting: &Forgetting<T, R>,
    ) -> Option<T> {
        let (mut gain, mut rate, mut inverse) = (self.times(rows), *error, [T::zero(); M]);
        let mut leverage = T::zero();
        let mut sound = true;
        for m in 0..M {
            for l in 0..m {
                let overlap = dot(&gain[l], &rows[m]);
                let share = overlap * inverse[l];
                for i in 0..R {
                    let step = gain[l][i] * share;
                    gain[m][i] -= step;
                }
                let step = overlap * rate[l];
                rate[m] -= step;
            }
            let total = forgetting.mu + dot(&gain[m], &rows[m]);
            // Beyond this what is left of `P` in the direction of the row would be rounding; less than nothing cannot be.
            sound &= (total > T::zero()) & (total * T::default_epsilon() <= forgetting.mu * lit(0.125));
            inverse[m] = T::one() / total;
            rate[m] *= inverse[m];
            leverage += T::one() - forgetting.mu * inverse[m];
        }
        if !(sound & self.stays_positive(&gain, &inverse)) {
            return None;
        }
        for m in 0..M {
            for i in 0..R {
                theta[i] += gain[m][i] * rate[m];
            }
        }
        self.take_off(gain, &inverse);
        if forgetting.mu < T::one() {
            self.forget(forgetting);
        }
        Some(leverage)
    }

    /// `P psi` for each row.
    #[inline(always)]
    fn times<const M: usize>(&self, rows: &[[T; R]; M]) -> [[T; R]; M] {
        let mut product = [[T::zero(); R]; M];
        for c in 0..R / LANES {
            // Two strands, so that additions need not wait for each other.
            let mut sums = [[[T::zero(); LANES]; 2]; M];
            for j in 0..R {
                for m in 0..M {
                    for l in 0..LANES {
                        sums[m][j & 1][l] += self.p[j][c * LANES + l] * rows[m][j];
                    }
                }
            }
            for m in 0..M {
                for l in 0..LANES {
                    product[m][c * LANES + l] = sums[m][0][l] + sums[m][1][l];
                }
            }
        }
        for i in lead::<R>()..R {
            for m in 0..M {
                product[m][i] = dot(&self.p[i], &rows[m]);
            }
        }
        product
    }

    /// Whether the diagonal stays positive, which no rounding short of lost definiteness would change.
    #[inline(always)]
    fn stays_positive<const M: usize>(&self, gain: &[[T; R]; M], inverse: &[T; M]) -> bool {
        let mut positive = true;
        for i in 0..R {
            let mut off = T::zero();
            for m in 0..M {
                off += gain[m][i] * gain[m][i] * inverse[m];
            }
            positive &= self.p[i][i] > off;
        }
        positive
    }

    /// Takes the sum of `gain gain' / total` off. The product of two gains is the same for `(i, j)` and `(j, i)`; with one error it need
    /// not wait for the reciprocal, with more a root of it in the gains saves half the products.
    #[inline(always)]
    fn take_off<const M: usize>(&mut self, mut gain: [[T; R]; M], inverse: &[T; M]) {
        if M > 1 {
            for m in 0..M {
                let scale = inverse[m].sqrt();
                for x in &mut gain[m] {
                    *x *= scale;
                }
            }
        }
        let step = |i: usize, j: usize| {
            let mut sum = gain[0][i] * gain[0][j];
            for gain in &gain[1..] {
                sum += gain[i] * gain[j];
            }
            if M > 1 { sum } else { sum * inverse[0] }
        };
        for j in 0..R {
            for c in 0..R / LANES {
                for l in 0..LANES {
                    let i = c * LANES + l;
                    self.p[j][i] -= step(i, j);
                }
            }
        }
        for j in lead::<R>()..R {
            for i in lead::<R>()..R {
                self.p[j][i] -= step(i, j);
            }
        }
    }

    fn forget(&mut self, forgetting: &Forgetting<T, R>) {
        let (lift, limited) = forgetting.lift(&self.diagonal());
        let grow = T::one() / forgetting.mu;
        for j in 0..R {
            for i in 0..R {
                self.p[j][i] *= if limited { lift[i] * lift[j] } else { grow };
            }
        }
    }
}
