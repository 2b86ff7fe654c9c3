//! Choice of the arm's parameters that are estimated, and known values of further parameters.
//!
//! A scheme filters the whole regressor row over the arm's parameters; the columns of estimated parameters are taken out of the row, and
//! parameters of known value, as of a weighed link, move to the other side as a known torque: `y - psi_known theta_known = psi theta`.
//!
//! The inertial parameters of a serial arm are not all identifiable. With the base parameters of Gautier (1991) a set of independent
//! columns of the regressor spans all of it, so choosing columns is all that a controller has to do.

use super::friction::Friction;
use crate::real::Real;
use crate::rls::{All, Count, First};
use nalgebra::{SMatrix, SVector};

/// Choice of estimated parameters of an arm with `N` joints and `P` parameters, at most `R` of them.
pub trait Columns<T: Real, const N: usize, const P: usize, const R: usize>: Copy {
    /// Whether the number of estimated parameters is known to the compiler or at run time.
    type Count: Count;

    /// Number of estimated parameters.
    fn count(&self) -> Self::Count;

    /// Regressor rows over the estimated parameters, and outputs, from rows over the arm's first `inertial` parameters, friction, and outputs. With
    /// `M = N` row `i` is that of joint `i`; with `M = 1` the row is a sum over joints.
    fn rows<const M: usize>(
        &self,
        whole: &SMatrix<T, M, P>,
        inertial: usize,
        friction: &Friction<T, N>,
        outputs: &SVector<T, M>,
    ) -> ([[T; R]; M], [T; M]);
}

/// Index of the joint that `row` belongs to; `None` if the only row is a sum over several joints.
#[inline(always)]
const fn joint_of<const N: usize, const M: usize>(row: usize) -> Option<usize> {
    if M == 1 && N != 1 { None } else { Some(row) }
}

/// Estimation of all parameters of the arm and, with `R = P + N`, of one constant torque per joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AllColumns;

impl<T: Real, const N: usize, const P: usize, const R: usize> Columns<T, N, P, R> for AllColumns {
    type Count = All;

    #[inline(always)]
    fn count(&self) -> All {
        All
    }

    #[inline(always)]
    fn rows<const M: usize>(
        &self,
        whole: &SMatrix<T, M, P>,
        inertial: usize,
        friction: &Friction<T, N>,
        outputs: &SVector<T, M>,
    ) -> ([[T; R]; M], [T; M]) {
        const { assert!(R == P || R == P + N, "R is the arm's parameters, or those and one asymmetry per joint") }
        let mut psi = [[T::zero(); R]; M];
        for m in 0..M {
            for j in 0..inertial {
                psi[m][j] = whole[(m, j)];
            }
            friction.write(joint_of::<N, M>(m), |kind, j, value| {
                if let Some(entry) = psi[m].get_mut(inertial + kind * N + j) {
                    *entry = value;
                }
            });
        }
        (psi, outputs.data.0[0])
    }
}

/// Value, in place of the index of a column, that marks a friction torque that is not estimated.
const NONE: u8 = u8::MAX;

/// Estimated parameters chosen at run time, and known values of further parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChosenColumns<T, const N: usize, const P: usize, const R: usize> {
    /// Indices of estimated inertial parameters; the first `inertial_count` entries count.
    inertial: [u8; R],
    inertial_count: u8,
    /// Columns of the estimated viscous, Coulomb and constant torques of each joint.
    friction: [[u8; N]; 3],
    count: u8,
    /// Values of parameters that are not estimated, SI.
    known: SVector<T, P>,
    any_known: bool,
}

impl<T: Real, const N: usize, const P: usize, const R: usize> ChosenColumns<T, N, P, R> {
    /// Choice of parameters by strictly ascending indices, with the constant torque of joint `j` at `P + j`, and values of all others, SI. `None` if
    /// there are too many or an index is not possible.
    pub fn new(columns: impl IntoIterator<Item = usize>, known: &[T; P]) -> Option<Self> {
        const { assert!(R < NONE as usize && P < NONE as usize, "indices are bytes") }
        const { assert!(R.is_multiple_of(4), "whole lanes") }
        let first = P - 2 * N;
        let mut chosen = Self {
            inertial: [0; R],
            inertial_count: 0,
            friction: [[NONE; N]; 3],
            count: 0,
            known: SVector::from(*known),
            any_known: false,
        };
        let mut next = 0;
        for column in columns {
            let place = chosen.count;
            if column < next || usize::from(place) >= R {
                return None;
            }
            if let Some(friction) = column.checked_sub(first) {
                *chosen.friction.get_mut(friction.checked_div(N)?)?.get_mut(friction.checked_rem(N)?)? =
                    place;
            } else {
                *chosen.inertial.get_mut(usize::from(place))? = u8::try_from(column).ok()?;
                chosen.inertial_count += 1;
            }
            if let Some(value) = chosen.known.data.0[0].get_mut(column) {
                *value = T::zero();
            }
            (chosen.count, next) = (place + 1, column + 1);
        }
        chosen.any_known = chosen.known.iter().any(|x| *x != T::zero());
        Some(chosen)
    }

    /// Number of estimated parameters.
    pub fn len(&self) -> usize {
        usize::from(self.count)
    }

    /// Whether no parameter is estimated.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Output of the parameters of known value in row `m`: `psi_known theta_known`.
    #[inline(always)]
    fn known_output<const M: usize>(
        &self,
        whole: &SMatrix<T, M, P>,
        inertial: usize,
        friction: &Friction<T, N>,
        m: usize,
    ) -> T {
        let mut sum = T::zero();
        for (column, value) in whole.data.0.iter().zip(&self.known.data.0[0]).take(inertial) {
            sum += column[m] * *value;
        }
        friction.write(joint_of::<N, M>(m), |kind, j, value| {
            if let Some(known) = self.known.data.0[0].get(inertial + kind * N + j) {
                sum += value * *known;
            }
        });
        sum
    }
}

impl<T: Real, const N: usize, const P: usize, const R: usize> Columns<T, N, P, R>
    for ChosenColumns<T, N, P, R>
{
    type Count = First;

    #[inline(always)]
    fn count(&self) -> First {
        First::new(self.len())
    }

    #[inline(always)]
    fn rows<const M: usize>(
        &self,
        whole: &SMatrix<T, M, P>,
        inertial: usize,
        friction: &Friction<T, N>,
        outputs: &SVector<T, M>,
    ) -> ([[T; R]; M], [T; M]) {
        let (mut psi, mut y) = ([[T::zero(); R]; M], outputs.data.0[0]);
        for (c, column) in self.inertial.iter().enumerate().take(usize::from(self.inertial_count)) {
            let Some(column) = whole.data.0.get(usize::from(*column)) else { continue };
            for m in 0..M {
                psi[m][c] = column[m];
            }
        }
        for m in 0..M {
            friction.write(joint_of::<N, M>(m), |kind, j, value| {
                if let Some(entry) = psi[m].get_mut(usize::from(self.friction[kind][j])) {
                    *entry = value;
                }
            });
            if self.any_known {
                y[m] -= self.known_output::<M>(whole, inertial, friction, m);
            }
        }
        (psi, y)
    }
}
