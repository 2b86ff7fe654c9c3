//! One rotary joint: `theta1 ddq + theta2 sin q + theta3 dq + theta4 sgn(dq) = tau`, `q`, rad, from hanging down.
//!
//! `theta1` is the inertia about the joint, kg m^2, `theta2 = m g l` the largest gravity torque, N m, `theta3` the viscous, N m s/rad, and
//! `theta4` the Coulomb coefficient, N m.

use super::{Arm, EquationTerms, Parameter};
use crate::number::Number;
use crate::real::Real;
use crate::trig::{SinCos, sin_cos};
use nalgebra::{SMatrix, SVector};

/// Arm of one rotary joint: a physical pendulum with a motor in its pivot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pendulum<T> {
    /// Acceleration of gravity, m/s^2.
    pub gravity: T,
}

impl<T: Real> Arm<T, 1, 4> for Pendulum<T> {
    const KIND: &'static str = "pendulum";
    const PARAMETERS: &'static [Parameter] = &[
        Parameter { name: "theta1", unit: "kg m^2" },
        Parameter { name: "theta2", unit: "N m" },
        Parameter { name: "viscous1", unit: "N m s/rad" },
        Parameter { name: "coulomb1", unit: "N m" },
    ];

    fn inertia(&self, theta: &[T; 4], _q: &SVector<T, 1>) -> SMatrix<T, 1, 1> {
        SMatrix::<T, 1, 1>::new(theta[0])
    }

    fn coriolis(&self, _: &[T; 4], _: &SVector<T, 1>, _: &SVector<T, 1>) -> SMatrix<T, 1, 1> {
        SMatrix::zeros()
    }

    fn gravity(&self, theta: &[T; 4], q: &SVector<T, 1>, tilt: T) -> SVector<T, 1> {
        SVector::<T, 1>::new(theta[1] * sin_cos(q[0] + tilt).0)
    }

    #[inline(always)]
    fn angles<V: Number<Real = T>>(&self, q: &[V; 1], tilt: V) -> [V; 1] {
        [q[0] + tilt]
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
        EquationTerms { inertia: *constant_inertia, bias: [theta[1] * sincos[0].sine] }
    }

    #[inline(always)]
    fn energy_regressor(&self, q: &SVector<T, 1>, dq: &SVector<T, 1>) -> SVector<T, 4> {
        let half: T = crate::real::lit(0.5);
        SVector::from([half * dq[0] * dq[0], T::one() - q[0].cos(), T::zero(), T::zero()])
    }

    #[inline(always)]
    fn momentum_regressor(&self, _q: &SVector<T, 1>, dq: &SVector<T, 1>) -> SMatrix<T, 1, 4> {
        SMatrix::from([[dq[0]], [T::zero()], [T::zero()], [T::zero()]])
    }

    #[inline(always)]
    fn potential_regressor(&self, q: &SVector<T, 1>, _dq: &SVector<T, 1>) -> SMatrix<T, 1, 4> {
        SMatrix::from([[T::zero()], [q[0].sin()], [T::zero()], [T::zero()]])
    }

    fn regressor(&self, q: &SVector<T, 1>, dq: &SVector<T, 1>, ddq: &SVector<T, 1>) -> SMatrix<T, 1, 4> {
        let mut y = self.friction_regressor(dq);
        y[(0, 0)] = ddq[0];
        y[(0, 1)] = q[0].sin();
        y
    }

    fn payload(&self, _theta: &[T; 4], mass: T, distance: T) -> [T; 4] {
        let inertia = mass * distance * distance;
        [inertia, mass * self.gravity * distance, T::zero(), T::zero()]
    }
}
