//! Solution of small symmetric positive definite linear systems, in place and without panics.

use crate::number::Number;
use crate::real::lit;

/// Solves `a x = b` for symmetric positive definite `a` by `L D L'`; an indefinite `a` gives non-finite numbers, not a panic.
#[inline(always)]
pub fn solve_positive_definite<V: Number, const N: usize>(mut a: [[V; N]; N], mut b: [V; N]) -> [V; N] {
    if N == 2 {
        return cramer(&a, &b);
    }
    let one = V::of(lit(1.0));
    let mut pivots = b;
    for k in 0..N {
        pivots[k] = one / a[k][k];
        for i in (k + 1)..N {
            let factor = -(a[i][k] * pivots[k]);
            for j in (k + 1)..N {
                a[i][j] = factor.fused(a[k][j], a[i][j]);
            }
            b[i] = factor.fused(b[k], b[i]);
        }
    }
    for k in (0..N).rev() {
        for j in (k + 1)..N {
            b[k] = (-a[k][j]).fused(b[j], b[k]);
        }
        b[k] = b[k] * pivots[k];
    }
    b
}

/// Inertia of joint `j` with all other joints free to move, kg m^2 (kg): the Schur complement `1 / (M^-1)_jj` of the inertia matrix.
#[inline]
pub fn free_inertia<V: Number, const N: usize>(inertia: &[[V; N]; N], j: usize) -> V {
    if N <= 2 {
        let mut own = inertia[j][j];
        for i in 0..N {
            if i != j {
                own = own - inertia[j][i] * inertia[j][i] / inertia[i][i];
            }
        }
        return own;
    }
    let mut unit = [V::of(lit(0.0)); N];
    unit[j] = V::of(lit(1.0));
    V::of(lit(1.0)) / solve_positive_definite(*inertia, unit)[j]
}

/// Solves two equations `a x = b` by Cramer's rule, with a single division.
#[inline(always)]
fn cramer<V: Number, const N: usize>(a: &[[V; N]; N], b: &[V; N]) -> [V; N] {
    let (i, j) = (0, N - 1);
    let one = V::of(lit(1.0));
    let scale = one / a[i][i].fused(a[j][j], -(a[i][j] * a[j][i]));
    let mut x = *b;
    x[i] = a[j][j].fused(b[i], -(a[i][j] * b[j])) * scale;
    x[j] = a[i][i].fused(b[j], -(a[j][i] * b[i])) * scale;
    x
}
