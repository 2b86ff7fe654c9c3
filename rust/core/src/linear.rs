//! Solution of small symmetric positive definite linear systems, in place and without panics.

use crate::number::Number;
use crate::real::lit;

/// Solves `a x = b` for symmetric positive definite `a`, as [`solve_in_place`].
#[inline(always)]
pub fn solve_positive_definite<V: Number, const N: usize>(mut a: [[V; N]; N], mut b: [V; N]) -> [V; N] {
    solve_in_place(&mut a, &mut b);
    b
}

/// Solves `a x = b` for symmetric positive definite `a`, of which the upper triangle is read, by `U D U'`; writes `x` to `b` and overwrites `a`. An
/// indefinite `a` gives non-finite numbers, not a panic. The last rows come first: of a chain's inertia matrix they are known first.
#[inline(always)]
pub fn solve_in_place<V: Number, const N: usize>(a: &mut [[V; N]; N], b: &mut [V; N]) {
    if N == 2 {
        *b = cramer(a, b);
        return;
    }
    let one = V::of(lit(1.0));
    let mut inverses = *b;
    for k in (0..N).rev() {
        inverses[k] = one / a[k][k];
        for i in (0..N).take(k) {
            let factor = -(a[i][k] * inverses[k]);
            for j in (i..N).take(k - i) {
                a[i][j] = factor.fused(a[j][k], a[i][j]);
            }
            b[i] = factor.fused(b[k], b[i]);
        }
    }
    for k in 0..N {
        for j in (0..N).take(k) {
            b[k] = (-a[j][k]).fused(b[j], b[k]);
        }
        b[k] = b[k] * inverses[k];
    }
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
    let scale = one / a[i][i].fused(a[j][j], -(a[i][j] * a[i][j]));
    let mut x = *b;
    x[i] = a[j][j].fused(b[i], -(a[i][j] * b[j])) * scale;
    x[j] = a[i][i].fused(b[j], -(a[i][j] * b[i])) * scale;
    x
}
