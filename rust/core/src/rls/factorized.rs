//! Covariance `P` of recursive least squares as `U D U'`, `U` unit upper triangular and `D` diagonal, updated row by row of `Psi'`.
//!
//! Bierman 1977, *Factorization methods for discrete sequential estimation*, chapter V, with all that does not depend on the
//! previous column taken out of the loop over columns: with `f = U' psi`, `v = D f` and `alpha_j = mu + sum_(k < j) f_k v_k`,
//!
//! ```text
//! d_j  <- d_j alpha_j / alpha_(j+1)
//! u_ij <- u_ij - k_i f_j / alpha_j,    k_i <- k_i + u_ij v_j       column by column, k_i = v_i at first
//! ```
//!
//! Each entry of `D` is multiplied by a positive number, so `P` is symmetric and positive definite whatever the rounding. With entries
//! of `psi` within bounds nothing overflows: `k_i^2 <= P_ii psi' P psi`, and `u_ij^2 <= P_ii / d_j`.

use super::lanes::{LANES, all_within, dot, lead};
use super::{Count, Forgetting, is_double, largest};
use crate::cpu::Cpu;
use crate::real::{Real, lit};
use nalgebra::SMatrix;

/// Factors of the covariance `P = U D U'`; `u` column by column with ones on the diagonal and zeros below.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub(super) struct Factorized<T, A, const R: usize> {
    u: [[T; R]; R],
    d: [T; R],
    /// Nothing; its type aligns `u`.
    align: [A; 0],
}

impl<T: Real, A: Copy, const R: usize> Factorized<T, A, R> {
    /// The same covariance in another alignment.
    pub(super) fn aligned<B>(&self) -> Factorized<T, B, R> {
        Factorized { u: self.u, d: self.d, align: [] }
    }

    pub(super) fn of(p: &SMatrix<T, R, R>) -> Self {
        let mut p = *p;
        let mut u = [[T::zero(); R]; R];
        let mut d = [T::zero(); R];
        for j in (0..R).rev() {
            d[j] = p[(j, j)];
            u[j][j] = T::one();
            for i in 0..j {
                u[j][i] = p[(i, j)] / d[j];
            }
            for k in 0..j {
                for i in 0..=k {
                    let step = u[j][i] * d[j] * u[j][k];
                    p[(i, k)] -= step;
                }
            }
        }
        Self { u, d, align: [] }
    }

    pub(super) fn matrix(&self) -> SMatrix<T, R, R> {
        let mut p = SMatrix::zeros();
        for j in 0..R {
            for i in 0..=j {
                let mut sum = T::zero();
                for k in j..R {
                    sum += self.u[k][i] * self.d[k] * self.u[k][j];
                }
                p[(i, j)] = sum;
                p[(j, i)] = sum;
            }
        }
        p
    }

    pub(super) fn diagonal(&self) -> [T; R] {
        let mut sums = [T::zero(); R];
        for k in 0..R {
            for i in 0..=k {
                sums[i] += self.u[k][i] * self.u[k][i] * self.d[k];
            }
        }
        sums
    }

    /// Updates factors and estimate by rows of `Psi'` and their prediction errors; returns the leverage, or `None`, with nothing changed, if a row is
    /// of impossible size.
    #[inline(always)]
    pub(super) fn learn<C: Cpu, N: Count, const M: usize>(
        &mut self,
        theta: &mut [T; R],
        rows: &[[T; R]; M],
        error: &[T; M],
        count: N,
        forgetting: &Forgetting<T, R>,
    ) -> Option<T> {
        let mut within = true;
        for row in rows {
            within &= all_within(row, largest());
        }
        if !within {
            return None;
        }
        let (r, mut moved) = (count.of(R), [T::zero(); R]);
        let mut leverage = T::zero();
        for m in 0..M {
            // Prediction error after the change of the estimate, `moved`, by the rows before.
            let left = if m == 0 { error[m] } else { error[m] - dot::<C, T, R>(&moved, &rows[m], r) };
            leverage += self.row::<C, N>(&mut moved, &rows[m], left, r, forgetting.mu);
        }
        for i in 0..r {
            theta[i] += moved[i];
        }
        if forgetting.mu < T::one() {
            self.forget(forgetting, r);
        }
        Some(leverage)
    }

    /// Updates the factors by one row `psi` and its prediction error, adds the change of the estimate to `moved`, and returns the leverage.
    #[inline(always)]
    fn row<C: Cpu, N: Count>(&mut self, moved: &mut [T; R], psi: &[T; R], error: T, r: usize, mu: T) -> T {
        let mut f = [T::zero(); R];
        for j in 0..r {
            f[j] = self.dot::<C>(j, psi, r);
        }
        let (mut v, mut before, mut inverse) = ([T::zero(); R], [T::zero(); R], [T::zero(); R]);
        let mut total = mu;
        for j in 0..r {
            v[j] = self.d[j] * f[j];
            before[j] = total;
            total = C::fused(f[j], v[j], total);
        }
        for j in 0..r {
            inverse[j] = T::one() / before[j];
        }
        let last = T::one() / total;
        for j in 0..r {
            let shrunk = self.d[j] * before[j] * if j + 1 < r { inverse[j + 1] } else { last };
            self.d[j] = shrunk.max(least());
        }
        let mut gain = [T::zero(); R];
        for j in 0..r {
            let factor = f[j] * inverse[j];
            N::each(j, R, |i| {
                let old = self.u[j][i];
                self.u[j][i] = C::fused(-gain[i], factor, old);
                gain[i] = C::fused(old, v[j], gain[i]);
            });
            gain[j] = v[j];
        }
        let rate = error * last;
        for i in 0..r {
            moved[i] = C::fused(gain[i], rate, moved[i]);
        }
        T::one() - mu * last
    }

    /// Entry `j` of `U' psi`, `U` the unit upper triangular factor of the covariance.
    #[inline(always)]
    fn dot<C: Cpu>(&self, j: usize, psi: &[T; R], r: usize) -> T {
        let column = &self.u[j];
        let mut sums = [T::zero(); LANES];
        for c in 0..lanes_of(j, r).min(R / LANES) {
            for l in 0..LANES {
                let i = c * LANES + l;
                sums[l] = C::fused(column[i], psi[i], sums[l]);
            }
        }
        let mut rest = T::zero();
        if j >= lead(r) {
            for i in lead(r)..r {
                rest = C::fused(column[i], psi[i], rest);
            }
        }
        (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
    }

    fn forget(&mut self, forgetting: &Forgetting<T, R>, r: usize) {
        let (lift, limited) = forgetting.lift(&self.diagonal());
        if !limited {
            for d in self.d.iter_mut().take(r) {
                *d /= forgetting.mu;
            }
            return;
        }
        for j in 0..r {
            for i in 0..j {
                self.u[j][i] *= lift[i] / lift[j];
            }
            self.d[j] *= lift[j] * lift[j];
        }
    }
}

/// Number of whole lanes that hold entries `0..=j` of a column of `r` entries.
#[inline(always)]
const fn lanes_of(j: usize, r: usize) -> usize {
    if j < lead(r) { j / LANES + 1 } else { r / LANES }
}

/// Smallest entry of `D`, below the variance of any arm's parameter: it keeps `U` finite.
#[inline]
fn least<T: Real>() -> T {
    if is_double::<T>() { lit(1e-100) } else { lit(1e-20) }
}
