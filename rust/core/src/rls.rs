//! Recursive least squares, equations (20) to (22), for scalar and vector errors, with forgetting.
//!
//! ```text
//! e = y - Psi' theta
//! theta <- theta + P Psi (mu I + Psi' P Psi)^-1 e
//! P     <- (P - P Psi (mu I + Psi' P Psi)^-1 Psi' P) / mu
//! ```
//!
//! Only one triangle of `P` is computed and mirrored, so `P` stays exactly symmetric; written as `P - K (P Psi)'` without that, two-row
//! updates drift apart and end in NaN after about a thousand samples of the seed's run.

use crate::linear::solve_positive_definite;
use crate::real::Real;
use nalgebra::{ComplexField, SMatrix, SVector};

/// Estimate and covariance of `R` parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rls<T: Real, const R: usize> {
    theta: SVector<T, R>,
    p: SMatrix<T, R, R>,
    forgetting: T,
    updates: u64,
    rejected: u64,
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

    /// The same with a full `P(0)`, of which the upper triangle counts.
    pub fn with_covariance(theta0: SVector<T, R>, p0: SMatrix<T, R, R>, forgetting: T) -> Self {
        let mut p = p0;
        for i in 0..R {
            for j in 0..i {
                p[(i, j)] = p[(j, i)];
            }
        }
        Self { theta: theta0, p, forgetting, updates: 0, rejected: 0 }
    }

    /// Estimate.
    pub fn theta(&self) -> &SVector<T, R> {
        &self.theta
    }

    /// Covariance for an error of unit variance.
    pub fn covariance(&self) -> &SMatrix<T, R, R> {
        &self.p
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
        let finite = psi.iter().chain(y.iter()).all(ComplexField::is_finite);
        if !finite {
            self.rejected += 1;
            return Update::Rejected;
        }
        let g = self.p * psi.transpose();
        let mut s = psi * g;
        for i in 0..M {
            s[(i, i)] += self.forgetting;
        }
        let mut error = *y;
        for i in 0..M {
            for j in 0..R {
                let predicted = psi[(i, j)] * self.theta[j];
                error[i] -= predicted;
            }
        }
        let weighted = solve_positive_definite(s, error);
        let theta = self.theta + g * weighted;
        let p = self.reduced(&g, &s);
        if !theta.iter().chain(p.iter()).all(ComplexField::is_finite) {
            self.rejected += 1;
            return Update::Rejected;
        }
        (self.theta, self.p) = (theta, p);
        self.updates += 1;
        Update::Used(error)
    }

    /// Equation (21), upper triangle computed and mirrored.
    #[inline]
    fn reduced<const M: usize>(&self, g: &SMatrix<T, R, M>, s: &SMatrix<T, M, M>) -> SMatrix<T, R, R> {
        let scale = T::one() / self.forgetting;
        let mut p = self.p;
        for j in 0..R {
            let row = SVector::<T, M>::from_fn(|m, _| g[(j, m)]);
            let gain = solve_positive_definite(*s, row);
            for i in 0..=j {
                let mut value = p[(i, j)];
                for m in 0..M {
                    value -= g[(i, m)] * gain[m];
                }
                value *= scale;
                p[(i, j)] = value;
                p[(j, i)] = value;
            }
        }
        p
    }
}
