//! Recursive least squares (Reyes and Kelly 1997, equations (20) to (22)), for scalar and vector errors, with forgetting.
//!
//! ```text
//! e = y - Psi' theta
//! theta <- theta + P Psi (mu I + Psi' P Psi)^-1 e
//! P     <- (P - P Psi (mu I + Psi' P Psi)^-1 Psi' P) / mu
//! ```
//!
//! `P` is kept in one of two forms ([`Form`]), with one result up to rounding. With forgetting, variances that are not excited grow by
//! `1/mu` per sample, which ends in numbers without meaning while the arm rests; so no variance grows beyond its value in
//! `P(0)`: rows and columns are divided by `sqrt(mu)` or by less, which keeps `P` positive definite.

mod factorized;
mod lanes;
mod plain;
mod wide;

use crate::cpu::{Cpu, Kernel, Level};
use crate::real::{Real, lit};
use factorized::Factorized;
use nalgebra::{ArrayStorage, SMatrix, SVector};
use plain::Plain;

pub use lanes::{All, Count, First};

/// Form in which the covariance `P` of recursive least squares is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Equation (21) of Reyes and Kelly (1997) as printed, rounded symmetrically. Positive definite as long as `psi' P psi` stays far below the
    /// reciprocal of the rounding unit: in double precision for any arm, in single precision not.
    Plain,
    /// Factors `U D U'`: positive definite whatever the rounding.
    Factorized,
}

impl Form {
    /// Form of the covariance: plain in double precision, unless a variance of `P(0)` is above 10^6, else factorized.
    #[inline]
    pub fn default_for<T: Real, const R: usize>(variances: &[T; R]) -> Self {
        let moderate = lanes::all_within(variances, lit(1e6));
        if is_double::<T>() && moderate { Self::Plain } else { Self::Factorized }
    }
}

/// Recursive least squares: estimate and covariance of up to `R` parameters; `N` says how many of them, counted from the first, are in use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rls<T: Real, const R: usize, N: Count = All> {
    theta: SVector<T, R>,
    count: N,
    covariance: Covariance<T, N::Align, R>,
    forgetting: Forgetting<T, R>,
    level: Level,
    leverage: T,
    updates: u64,
    rejected: u64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Covariance<T: Real, A, const R: usize> {
    Plain(Plain<T, A, R>),
    Factorized(Factorized<T, A, R>),
}

/// Forgetting factor `mu`, and for each parameter the variance above which forgetting does not lift it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Forgetting<T: Real, const R: usize> {
    mu: T,
    limit: [T; R],
}

/// What an update of recursive least squares did with a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Update<T, const M: usize> {
    /// The sample was used; holds its prediction error before the update.
    Used(SVector<T, M>),
    /// The sample is not finite, of impossible size, or would leave `P` indefinite; nothing but the count of rejected samples has changed.
    Rejected,
}

impl<T: Real, const R: usize> Rls<T, R> {
    /// Start from the estimate `theta0`, SI, and `P(0) = p0 I`, with the forgetting factor in `(0, 1]`.
    pub fn new(theta0: SVector<T, R>, p0: T, forgetting: T) -> Self {
        Self::with_covariance(theta0, SMatrix::identity() * p0, forgetting)
    }

    /// Start from the estimate `theta0`, SI, and a full positive definite `P(0)`, of which the upper triangle counts, with the forgetting factor in
    /// `(0, 1]`.
    pub fn with_covariance(theta0: SVector<T, R>, p0: SMatrix<T, R, R>, forgetting: T) -> Self {
        let limit: [T; R] = p0.diagonal().into();
        Self {
            theta: theta0,
            count: All,
            covariance: Covariance::of(&p0, Form::default_for(&limit)),
            forgetting: Forgetting { mu: forgetting, limit },
            level: Level::detect(),
            leverage: T::zero(),
            updates: 0,
            rejected: 0,
        }
    }
}

impl<T: Real, const R: usize, N: Count> Rls<T, R, N> {
    /// Restricts the estimate to the first `count` parameters; regressor rows must be zero beyond them.
    pub fn with_count<K: Count>(self, count: K) -> Rls<T, R, K> {
        let Self { theta, covariance, forgetting, level, leverage, updates, rejected, .. } = self;
        let covariance = match covariance {
            Covariance::Plain(p) => Covariance::Plain(p.aligned()),
            Covariance::Factorized(p) => Covariance::Factorized(p.aligned()),
        };
        let level = if K::in_blocks(R) && level == Level::detect() { Level::widest() } else { level };
        Rls { theta, count, covariance, forgetting, level, leverage, updates, rejected }
    }

    /// Changes the form in which the covariance `P` is kept.
    pub fn with_form(mut self, form: Form) -> Self {
        self.covariance = Covariance::of(&self.covariance(), form);
        self
    }

    /// Changes the instruction set that samples are processed with; the default is [`Level::detect`], with [`First`] of
    /// many parameters [`Level::widest`].
    pub fn with_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// Runs a kernel that works on the estimator, with vectors as wide as pay for `R` parameters.
    #[inline(always)]
    pub(crate) fn run<W: Kernel>(level: Level, kernel: W) -> W::Output {
        if N::in_blocks(R) { level.run_wide(kernel) } else { level.run(kernel) }
    }

    /// Instruction set in use.
    #[inline(always)]
    pub fn level(&self) -> Level {
        self.level
    }

    /// Estimated parameters, SI.
    #[inline]
    pub fn theta(&self) -> &SVector<T, R> {
        &self.theta
    }

    /// Covariance `P` of the estimate for an error of unit variance.
    pub fn covariance(&self) -> SMatrix<T, R, R> {
        match &self.covariance {
            Covariance::Plain(p) => p.matrix(),
            Covariance::Factorized(p) => p.matrix(),
        }
    }

    /// Diagonal of the covariance `P`: variances for an error of unit variance.
    pub fn variances(&self) -> SVector<T, R> {
        match &self.covariance {
            Covariance::Plain(p) => p.diagonal().into(),
            Covariance::Factorized(p) => p.diagonal().into(),
        }
    }

    /// Form in which the covariance `P` is kept.
    pub fn form(&self) -> Form {
        match &self.covariance {
            Covariance::Plain(_) => Form::Plain,
            Covariance::Factorized(_) => Form::Factorized,
        }
    }

    /// Leverage of the last sample used: the sum over its errors of `psi' P psi / (mu + psi' P psi)`, each in `[0, 1)`.
    ///
    /// The sum of leverages over all samples without forgetting reaches the number of parameters learned and then grows like a logarithm; the
    /// leverage of a sample that says nothing new is zero.
    #[inline]
    pub fn leverage(&self) -> T {
        self.leverage
    }

    /// Number of samples used.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// Number of samples rejected.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    /// Takes one sample with `M` prediction errors: `psi`, `(M, R)`, has one row per error, `y`, `(M,)`, the outputs.
    #[inline]
    pub fn update<const M: usize>(&mut self, psi: &SMatrix<T, M, R>, y: &SVector<T, M>) -> Update<T, M> {
        let mut rows = [[T::zero(); R]; M];
        for m in 0..M {
            for j in 0..R {
                rows[m][j] = psi[(m, j)];
            }
        }
        Self::run(self.level, UpdateKernel { rls: self, rows, y: y.data.0[0] })
    }

    /// Updates the estimate by one sample of `M` equations `y = rows theta`; for callers that are already compiled for the processor's instructions
    /// `C`.
    #[inline(always)]
    pub(crate) fn learn<C: Cpu, const M: usize>(&mut self, rows: &[[T; R]; M], y: &[T; M]) -> Update<T, M> {
        let mut error = *y;
        let mut sound = true;
        let (theta, count) = (&mut self.theta.data.0[0], self.count);
        for m in 0..M {
            error[m] -= if N::in_blocks(R) {
                wide::dot::<C, T, R>(&rows[m], theta, count.of(R))
            } else {
                lanes::dot::<C, T, R>(&rows[m], theta, count.of(R))
            };
            sound &= error[m].abs() <= largest();
        }
        let leverage = match &mut self.covariance {
            _ if !sound => None,
            Covariance::Plain(p) => p.learn::<C, N, M>(theta, rows, &error, count, &self.forgetting),
            Covariance::Factorized(p) => {
                let rows = *rows;
                p.learn::<C, N, M>(theta, &rows, &error, count, &self.forgetting)
            }
        };
        let Some(leverage) = leverage else {
            self.rejected += 1;
            return Update::Rejected;
        };
        self.leverage = leverage;
        self.updates += 1;
        Update::Used(SVector::from_array_storage(ArrayStorage([error])))
    }
}

/// One call of [`Rls::update`] as data, so that [`Kernel::run`] can be compiled for each instruction set and chosen at run time.
struct UpdateKernel<'a, T: Real, N: Count, const M: usize, const R: usize> {
    rls: &'a mut Rls<T, R, N>,
    rows: [[T; R]; M],
    y: [T; M],
}

impl<T: Real, N: Count, const M: usize, const R: usize> Kernel for UpdateKernel<'_, T, N, M, R> {
    type Output = Update<T, M>;

    #[inline(always)]
    fn run<C: Cpu>(self) -> Self::Output {
        self.rls.learn::<C, M>(&self.rows, &self.y)
    }
}

impl<T: Real, A: Copy, const R: usize> Covariance<T, A, R> {
    fn of(p: &SMatrix<T, R, R>, form: Form) -> Self {
        match form {
            Form::Plain => Self::Plain(Plain::of(p)),
            Form::Factorized => Self::Factorized(Factorized::of(p)),
        }
    }
}

impl<T: Real, const R: usize> Forgetting<T, R> {
    /// Factors by which forgetting multiplies rows and columns of a covariance with this diagonal, and whether any factor is limited.
    #[inline]
    fn lift(&self, diagonal: &[T; R]) -> ([T; R], bool) {
        let full = T::one() / self.mu.sqrt();
        let mut limited = false;
        let mut lift = [full; R];
        for i in 0..R {
            if diagonal[i] > self.limit[i] * self.mu {
                limited = true;
                lift[i] = (self.limit[i] / diagonal[i]).sqrt().max(T::one());
            }
        }
        (lift, limited)
    }
}

/// Whether the scalar type `T` is `f64`.
#[inline]
fn is_double<T: Real>() -> bool {
    T::default_epsilon() < lit(1e-12)
}

/// Largest entry of a regressor or a prediction error that is accepted: products of three such numbers with `P` stay finite.
#[inline]
fn largest<T: Real>() -> T {
    if is_double::<T>() { lit(1e30) } else { lit(1e9) }
}
