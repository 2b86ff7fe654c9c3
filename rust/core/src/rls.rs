//! Recursive least squares, equations (20) to (22), for scalar and vector errors, with forgetting.
//!
//! ```text
//! e = y - Psi' theta
//! theta <- theta + P Psi (mu I + Psi' P Psi)^-1 e
//! P     <- (P - P Psi (mu I + Psi' P Psi)^-1 Psi' P) / mu
//! ```
//!
//! `P` is kept as `U D U'`, `U` unit upper triangular and `D` diagonal, and updated row by row of `Psi'` (Bierman 1977, *Factorization
//! methods for discrete sequential estimation*, chapter V). Each entry of `D` is multiplied by a positive number, so `P` is symmetric and
//! positive definite whatever the rounding. The difference in (21) loses that where `Psi' P Psi` exceeds the reciprocal of the rounding
//! unit, which in single precision it soon does; written as `P - K (P Psi)'`, two-row updates of the seed's run end in NaN in double
//! precision too.

use crate::real::Real;
use nalgebra::{ComplexField, SMatrix, SVector};

/// Estimate and covariance of `R` parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rls<T: Real, const R: usize> {
    belief: Belief<T, R>,
    forgetting: T,
    updates: u64,
    rejected: u64,
}

/// What an update replaces as a whole or not at all.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Belief<T: Real, const R: usize> {
    theta: SVector<T, R>,
    u: SMatrix<T, R, R>,
    d: SVector<T, R>,
}

/// What an update did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Update<T, const M: usize> {
    /// The sample was used; its prediction error before the update.
    Used(SVector<T, M>),
    /// The sample, or what it would lead to, is not finite; nothing has changed but the count.
    Rejected,
}

impl<T: Real, const R: usize> Rls<T, R> {
    /// `theta(0)`, `P(0) = p0 I`, and the forgetting factor `mu` in `(0, 1]`.
    pub fn new(theta0: SVector<T, R>, p0: T, forgetting: T) -> Self {
        Self::with_covariance(theta0, SMatrix::identity() * p0, forgetting)
    }

    /// The same with a full positive definite `P(0)`, of which the upper triangle counts.
    pub fn with_covariance(theta0: SVector<T, R>, p0: SMatrix<T, R, R>, forgetting: T) -> Self {
        let (mut p, mut u, mut d) = (p0, SMatrix::identity(), SVector::zeros());
        for j in (0..R).rev() {
            d[j] = p[(j, j)];
            for i in 0..j {
                u[(i, j)] = p[(i, j)] / d[j];
            }
            for k in 0..j {
                for i in 0..=k {
                    let step = u[(i, j)] * d[j] * u[(k, j)];
                    p[(i, k)] -= step;
                }
            }
        }
        Self { belief: Belief { theta: theta0, u, d }, forgetting, updates: 0, rejected: 0 }
    }

    /// Estimate.
    pub fn theta(&self) -> &SVector<T, R> {
        &self.belief.theta
    }

    /// Covariance `P` for an error of unit variance.
    pub fn covariance(&self) -> SMatrix<T, R, R> {
        let Belief { u, d, .. } = &self.belief;
        let mut p = SMatrix::zeros();
        for j in 0..R {
            for i in 0..=j {
                let mut sum = T::zero();
                for k in j..R {
                    sum += u[(i, k)] * d[k] * u[(j, k)];
                }
                p[(i, j)] = sum;
                p[(j, i)] = sum;
            }
        }
        p
    }

    /// Samples used.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Samples rejected because they, or their consequence, were not finite.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    /// One sample with `M` errors: `psi` has one row per error.
    #[inline]
    pub fn update<const M: usize>(&mut self, psi: &SMatrix<T, M, R>, y: &SVector<T, M>) -> Update<T, M> {
        let error = y - psi * self.belief.theta;
        let mut next = self.belief;
        for m in 0..M {
            next.learn(&SVector::from_fn(|j, _| psi[(m, j)]), y[m], self.forgetting);
        }
        next.d /= self.forgetting;
        if !(next.is_sound() && error.iter().all(ComplexField::is_finite)) {
            self.rejected += 1;
            return Update::Rejected;
        }
        self.belief = next;
        self.updates += 1;
        Update::Used(error)
    }
}

impl<T: Real, const R: usize> Belief<T, R> {
    /// One row of `Psi'`, its output, and the variance of its error.
    #[inline]
    fn learn(&mut self, psi: &SVector<T, R>, y: T, variance: T) {
        let mut error = y;
        let mut gain = SVector::<T, R>::zeros();
        let mut total = variance;
        for j in 0..R {
            error -= psi[j] * self.theta[j];
            let mut f = psi[j];
            for i in 0..j {
                f += self.u[(i, j)] * psi[i];
            }
            let v = self.d[j] * f;
            let inverse = T::one() / total;
            let before = total;
            total += f * v;
            self.d[j] *= before / total;
            let factor = -f * inverse;
            gain[j] = v;
            for i in 0..j {
                let old = self.u[(i, j)];
                self.u[(i, j)] = old + gain[i] * factor;
                gain[i] += old * v;
            }
        }
        let weighted = error / total;
        for j in 0..R {
            self.theta[j] += gain[j] * weighted;
        }
    }

    /// Whether the numbers are finite and `P` positive definite.
    #[inline]
    fn is_sound(&self) -> bool {
        let numbers = self.theta.iter().chain(self.u.iter()).chain(self.d.iter());
        numbers.fold(true, |all, x| all & x.is_finite())
            & self.d.iter().fold(true, |all, d| all & (*d > T::zero()))
    }
}
