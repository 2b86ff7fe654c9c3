//! Small symmetric positive definite systems, solved in place without a library's panics.

use crate::real::Real;
use nalgebra::{SMatrix, SVector};

/// Solves `a x = b` for symmetric positive definite `a` by `L D L'`; an indefinite `a` gives non-finite numbers, not a panic.
#[inline]
pub fn solve_positive_definite<T: Real, const N: usize>(
    mut a: SMatrix<T, N, N>,
    mut b: SVector<T, N>,
) -> SVector<T, N> {
    for k in 0..N {
        let pivot = T::one() / a[(k, k)];
        for i in (k + 1)..N {
            let factor = a[(i, k)] * pivot;
            for j in (k + 1)..N {
                let step = factor * a[(k, j)];
                a[(i, j)] -= step;
            }
            let step = factor * b[k];
            b[i] -= step;
        }
    }
    for k in (0..N).rev() {
        for j in (k + 1)..N {
            let step = a[(k, j)] * b[j];
            b[k] -= step;
        }
        b[k] /= a[(k, k)];
    }
    b
}
