//! Intervals cut where a joint turns round.
//!
//! A sampled `sgn(dq)` says only that the sign changed somewhere between two samples. Taken as a ramp it is wrong by up to half a period
//! at every reversal, and a regressor with such an error draws its coefficient towards zero. With the velocity linear between samples
//! the reversal has a place, and friction is affine in the velocity on either side of it.

use crate::real::{Real, lit, sgn};
use nalgebra::{SMatrix, SVector};

/// Position of the first of the two Gauss points of an interval, `(1 - 1/sqrt 3)/2`.
const GAUSS: f64 = 0.211_324_865_405_187_1;
/// By how much of their difference the line through the Gauss points goes on to the ends, `(sqrt 3 - 1)/2`.
const BEYOND: f64 = 0.366_025_403_784_438_6;

/// The way from one velocity to the next, linear in between, cut at the reversals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pieces<T, const N: usize> {
    from: SVector<T, N>,
    to: SVector<T, N>,
    cuts: SVector<T, N>,
}

impl<T: Real, const N: usize> Pieces<T, N> {
    /// Cuts the way between two velocities.
    #[inline]
    pub(crate) fn of(from: &SVector<T, N>, to: &SVector<T, N>) -> Self {
        let mut cuts = SVector::repeat(T::one());
        for j in 0..N {
            if sgn(from[j]) * sgn(to[j]) < T::zero() {
                cuts[j] = from[j] / (from[j] - to[j]);
            }
        }
        Self { from: *from, to: *to, cuts }
    }

    /// Visits each piece `[start, end]` of `[0, 1]` with the rows at its two ends.
    ///
    /// The rows are those of the line through the piece's two Gauss points: what is affine in the velocity is met exactly at the ends,
    /// with the sign that holds inside the piece, and what is quadratic has its exact integral.
    #[inline]
    pub(crate) fn each<const M: usize, const R: usize>(
        &self,
        rows: impl Fn(&SVector<T, N>) -> SMatrix<T, M, R>,
        mut visit: impl FnMut(T, T, &SMatrix<T, M, R>, &SMatrix<T, M, R>),
    ) {
        let mut start = T::zero();
        for _ in 0..=N {
            let later = |cut: T| if cut > start { cut } else { T::one() };
            let end = self.cuts.iter().fold(T::one(), |end, cut| end.min(later(*cut)));
            let inner = (end - start) * lit(GAUSS);
            let at = |s: T| rows(&(self.from + (self.to - self.from) * s));
            let (a, b) = (at(start + inner), at(end - inner));
            let slope = (b - a) * lit::<T>(BEYOND);
            visit(start, end, &(a - slope), &(b + slope));
            start = end;
            if start >= T::one() {
                break;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix1x2, Vector2};

    #[test]
    fn signs_and_squares_integrate_exactly_over_two_reversals() {
        // dq1 from -1 to 3 turns at 1/4, dq2 from 1 to -1 at 1/2.
        let pieces = Pieces::of(&Vector2::new(-1.0, 1.0), &Vector2::new(3.0, -1.0));
        let (mut signs, mut squares, mut ends) = (Matrix1x2::zeros(), Matrix1x2::zeros(), [0.0; 3]);
        let mut count = 0;
        pieces.each(
            |dq| Matrix1x2::new(sgn(dq[0]), sgn(dq[1])),
            |start, end, from, to| {
                signs += (from + to) * (0.5 * (end - start));
                ends[count] = end;
                count += 1;
            },
        );
        pieces.each(
            |dq| Matrix1x2::new(dq[0] * dq[0], dq[1] * dq[1]),
            |start, end, from, to| squares += (from + to) * (0.5 * (end - start)),
        );
        assert_eq!((count, ends), (3, [0.25, 0.5, 1.0]));
        assert!((signs - Matrix1x2::new(0.5, 0.0)).amax() < 1e-15);
        assert!((squares - Matrix1x2::new(7.0 / 3.0, 1.0 / 3.0)).amax() < 1e-15);
    }

    #[test]
    fn a_start_from_rest_already_has_its_sign() {
        let pieces = Pieces::of(&Vector2::new(0.0, 0.0), &Vector2::new(0.1, 0.0));
        pieces.each(
            |dq| Matrix1x2::new(sgn(dq[0]), sgn(dq[1])),
            |_, _, from, to| {
                assert_eq!((from[0], to[0], from[1], to[1]), (1.0, 1.0, 0.0, 0.0));
            },
        );
    }
}
