//! One prismatic joint: `theta1 ddq + theta2 + theta3 dq + theta4 sgn(dq) = tau`.
//!
//! `theta1` is the moving mass, kg, `theta2` the component of its weight along the axis, N (0 when horizontal), `theta3` the viscous, N s/m, and
//! `theta4` the Coulomb coefficient, N.

use super::{Arm, EquationTerms, Parameter};
use crate::number::Number;
use crate::real::Real;
use crate::trig::SinCos;
use nalgebra::{SMatrix, SVector};

/// Arm of one prismatic joint; `gravity`, m/s^2, is needed only when the base is tilted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis<T> {
    /// Acceleration of gravity, m/s^2.
    pub gravity: T,
}

impl<T: Real> Arm<T, 1, 4> for Axis<T> {
    const KIND: &'static str = "axis";
    const PARAMETERS: &'static [Parameter] = &[
        Parameter { name: "theta1", unit: "kg" },
        Parameter { name: "theta2", unit: "N" },
        Parameter { name: "viscous1", unit: "N s/m" },
        Parameter { name: "coulomb1", unit: "N" },
    ];

    fn inertia(&self, theta: &[T; 4], _q: &SVector<T, 1>) -> SMatrix<T, 1, 1> {
        SMatrix::<T, 1, 1>::new(theta[0])
    }

    fn coriolis(&self, _: &[T; 4], _: &SVector<T, 1>, _: &SVector<T, 1>) -> SMatrix<T, 1, 1> {
        SMatrix::zeros()
    }

    fn gravity(&self, theta: &[T; 4], _q: &SVector<T, 1>, tilt: T) -> SVector<T, 1> {
        SVector::<T, 1>::new(theta[1] * tilt.cos() + theta[0] * self.gravity * tilt.sin())
    }

    #[inline(always)]
    fn angles<V: Number<Real = T>>(&self, _: &[V; 1], tilt: V) -> [V; 1] {
        [tilt]
    }

    #[inline]
    fn constant_inertia(&self, theta: &[T; 4]) -> [[T; 1]; 1] {
        [[theta[0]]]
    }

    #[inline(always)]
    fn equation_terms<V: Number<Real = T>>(
        &self,
        theta: &[V; 4],
        constant_inertia: &[[V; 1]; 1],
        sincos: &[SinCos<V>; 1],
        _q: &[V; 1],
        _: &[V; 1],
    ) -> EquationTerms<V, 1> {
        let along = theta[0] * V::of(self.gravity) * sincos[0].sine;
        EquationTerms { inertia: *constant_inertia, bias: [theta[1].fused(sincos[0].cosine, along)] }
    }

    #[inline(always)]
    fn energy_regressor(&self, q: &SVector<T, 1>, dq: &SVector<T, 1>) -> SVector<T, 4> {
        let half: T = crate::real::lit(0.5);
        SVector::from([half * dq[0] * dq[0], q[0], T::zero(), T::zero()])
    }

    #[inline(always)]
    fn momentum_regressor(&self, _q: &SVector<T, 1>, dq: &SVector<T, 1>) -> SMatrix<T, 1, 4> {
        SMatrix::from([[dq[0]], [T::zero()], [T::zero()], [T::zero()]])
    }

    #[inline(always)]
    fn potential_regressor(&self, _q: &SVector<T, 1>, _dq: &SVector<T, 1>) -> SMatrix<T, 1, 4> {
        SMatrix::from([[T::zero()], [T::one()], [T::zero()], [T::zero()]])
    }

    fn regressor(&self, _q: &SVector<T, 1>, dq: &SVector<T, 1>, ddq: &SVector<T, 1>) -> SMatrix<T, 1, 4> {
        let mut y = self.friction_regressor(dq);
        y[(0, 0)] = ddq[0];
        y[(0, 1)] = T::one();
        y
    }

    fn payload(&self, theta: &[T; 4], mass: T, _distance: T) -> [T; 4] {
        let weight = if theta[0] > T::zero() { mass * theta[1] / theta[0] } else { T::zero() };
        [mass, weight, T::zero(), T::zero()]
    }
}
