//! The two-link vertical arm of Reyes and Kelly (1997), section 5, with its nine parameters.
//!
//! `q1` is measured from the vertical pointing down, `q2` relative to link 1:
//!
//! ```text
//! M = [theta1 + 2 theta2 c2,  theta3 + theta2 c2]    C = [-theta2 s2 dq2,  -theta2 s2 (dq1 + dq2)]
//!     [theta3 + theta2 c2,    theta3            ]        [ theta2 s2 dq1,   0                     ]
//! g = [theta4 s1 + theta5 s12,  theta5 s12]          f = [theta6 dq1 + theta8 sgn dq1, theta7 dq2 + theta9 sgn dq2]
//! ```
//!
//! `C` is the matrix of Christoffel's symbols, for which `dM/dt - 2 C` is skew-symmetric. Reyes and Kelly print a matrix with equal product `C dq`,
//! for which only `dq' (dM/dt - 2 C) dq = 0` holds.

use super::{Arm, EquationTerms, Parameter};
use crate::cpu::{Cpu, Portable};
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::{SinCos, sin_cos, sines_cosines};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Two-link vertical arm of Reyes and Kelly (1997).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoLink<T> {
    /// Acceleration of gravity, m/s^2.
    pub gravity: T,
    /// Length of link 1, m. [`TwoLink::new`] derives it from `theta` when the arm file does not give it.
    pub length1: T,
}

/// Physical parameters of the links of a two-link arm (Reyes and Kelly 1997, Table I).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkParameters<T> {
    /// Masses of links 1 and 2, kg.
    pub mass: [T; 2],
    /// Lengths of links 1 and 2, m.
    pub length: [T; 2],
    /// Distances of the centres of mass of links 1 and 2 from joints 1 and 2, m.
    pub com: [T; 2],
    /// Inertias of links 1 and 2 about their centres of mass, kg m^2.
    pub inertia: [T; 2],
}

impl<T: Real> TwoLink<T> {
    /// Arm under `gravity`, m/s^2; a missing `length1`, m, follows from `theta2 = l1 m2 lc2` and `theta5 = g m2 lc2`.
    pub fn new(gravity: T, length1: Option<T>, theta: &[T; 9]) -> Self {
        let derived = if theta[4] > T::zero() { gravity * theta[1] / theta[4] } else { T::zero() };
        Self { gravity, length1: length1.unwrap_or(derived) }
    }

    /// Base inertial parameters `theta1 ... theta5` from physical ones (Reyes and Kelly 1997, section 5), with `gravity` in m/s^2.
    pub fn inertial_from_links(links: &LinkParameters<T>, gravity: T) -> [T; 5] {
        let LinkParameters { mass: [m1, m2], length: [l1, _], com: [c1, c2], inertia: [i1, i2] } = *links;
        [
            m1 * c1 * c1 + m2 * l1 * l1 + m2 * c2 * c2 + i1 + i2,
            l1 * m2 * c2,
            m2 * c2 * c2 + i2,
            gravity * (c1 * m1 + m2 * l1),
            gravity * m2 * c2,
        ]
    }
}

impl<T: Real> Arm<T, 2, 9> for TwoLink<T> {
    const KIND: &'static str = "two-link";
    const PARAMETERS: &'static [Parameter] = &[
        Parameter { name: "theta1", unit: "kg m^2" },
        Parameter { name: "theta2", unit: "kg m^2" },
        Parameter { name: "theta3", unit: "kg m^2" },
        Parameter { name: "theta4", unit: "N m" },
        Parameter { name: "theta5", unit: "N m" },
        Parameter { name: "viscous1", unit: "N m s/rad" },
        Parameter { name: "viscous2", unit: "N m s/rad" },
        Parameter { name: "coulomb1", unit: "N m" },
        Parameter { name: "coulomb2", unit: "N m" },
    ];

    #[inline]
    fn inertia(&self, theta: &[T; 9], q: &Vector2<T>) -> Matrix2<T> {
        let k = theta[1] * q[1].cos();
        Matrix2::new(theta[0] + k + k, theta[2] + k, theta[2] + k, theta[2])
    }

    fn coriolis(&self, theta: &[T; 9], q: &Vector2<T>, dq: &Vector2<T>) -> Matrix2<T> {
        let k = theta[1] * q[1].sin();
        Matrix2::new(-k * dq[1], -k * (dq[0] + dq[1]), k * dq[0], T::zero())
    }

    fn gravity(&self, theta: &[T; 9], q: &Vector2<T>, tilt: T) -> Vector2<T> {
        let outer = theta[4] * (q[0] + q[1] + tilt).sin();
        Vector2::new(theta[3] * (q[0] + tilt).sin() + outer, outer)
    }

    #[inline(always)]
    fn angles<V: Number<Real = T>>(&self, q: &[V; 2], tilt: V) -> [V; 2] {
        [q[0] + tilt, q[1]]
    }

    #[inline]
    fn constant_inertia(&self, theta: &[T; 9]) -> [[T; 2]; 2] {
        [[theta[0], theta[2]], [theta[2], theta[2]]]
    }

    #[inline(always)]
    fn equation_terms<V: Number<Real = T>>(
        &self,
        theta: &[V; 9],
        constant_inertia: &[[V; 2]; 2],
        sincos: &[SinCos<V>; 2],
        _q: &[V; 2],
        dq: &[V; 2],
    ) -> EquationTerms<V, 2> {
        let [SinCos { sine: s1, cosine: c1 }, SinCos { sine: s2, cosine: c2 }] = *sincos;
        let outer = theta[4] * s1.fused(c2, c1 * s2);
        let (kc, ks, twice) = (theta[1] * c2, theta[1] * s2, V::of(lit(2.0)));
        let [[own, coupled], [_, outer_own]] = *constant_inertia;
        let coupled = coupled + kc;
        let inertia = [[twice.fused(kc, own), coupled], [coupled, outer_own]];
        let bias1 = (-(ks * dq[1])).fused(twice.fused(dq[0], dq[1]), theta[3].fused(s1, outer));
        EquationTerms { inertia, bias: [bias1, (ks * dq[0]).fused(dq[0], outer)] }
    }

    fn energy_regressor(&self, q: &Vector2<T>, dq: &Vector2<T>) -> SVector<T, 9> {
        self.energy_regressor_on::<Portable>(q, dq)
    }

    #[inline(always)]
    fn energy_regressor_on<C: Cpu>(&self, q: &Vector2<T>, dq: &Vector2<T>) -> SVector<T, 9> {
        let (half, sum) = (lit::<T>(0.5), dq[0] + dq[1]);
        let [SinCos { sine: s1, cosine: c1 }, SinCos { sine: s2, cosine: c2 }] =
            sines_cosines::<C, T, 2>((*q).into());
        let mut e = SVector::zeros();
        e[0] = half * dq[0] * dq[0];
        e[1] = c2 * dq[0] * sum;
        e[2] = dq[1] * (dq[0] + half * dq[1]);
        e[3] = T::one() - c1;
        e[4] = T::one() - (c1 * c2 - s1 * s2);
        e
    }

    fn momentum_regressor(&self, q: &Vector2<T>, dq: &Vector2<T>) -> SMatrix<T, 2, 9> {
        let c2 = q[1].cos();
        let mut p = SMatrix::zeros();
        p[(0, 0)] = dq[0];
        p[(0, 1)] = c2 * (dq[0] + dq[0] + dq[1]);
        p[(0, 2)] = dq[1];
        p[(1, 1)] = c2 * dq[0];
        p[(1, 2)] = dq[0] + dq[1];
        p
    }

    fn potential_regressor(&self, q: &Vector2<T>, dq: &Vector2<T>) -> SMatrix<T, 2, 9> {
        let outer = (q[0] + q[1]).sin();
        let mut b = SMatrix::zeros();
        b[(0, 3)] = q[0].sin();
        b[(0, 4)] = outer;
        b[(1, 1)] = q[1].sin() * dq[0] * (dq[0] + dq[1]);
        b[(1, 4)] = outer;
        b
    }

    #[inline(always)]
    fn momentum_and_potential<C: Cpu>(
        &self,
        q: &Vector2<T>,
        dq: &Vector2<T>,
    ) -> (SMatrix<T, 2, 9>, SMatrix<T, 2, 9>) {
        let [SinCos { sine: s1, cosine: c1 }, SinCos { sine: s2, cosine: c2 }] =
            sines_cosines::<C, T, 2>((*q).into());
        let (sum, outer) = (dq[0] + dq[1], s1 * c2 + c1 * s2);
        let (mut p, mut b) = (SMatrix::zeros(), SMatrix::zeros());
        p[(0, 0)] = dq[0];
        p[(0, 1)] = c2 * (dq[0] + sum);
        p[(0, 2)] = dq[1];
        p[(1, 1)] = c2 * dq[0];
        p[(1, 2)] = sum;
        b[(0, 3)] = s1;
        b[(0, 4)] = outer;
        b[(1, 1)] = s2 * dq[0] * sum;
        b[(1, 4)] = outer;
        (p, b)
    }

    fn regressor(&self, q: &Vector2<T>, dq: &Vector2<T>, ddq: &Vector2<T>) -> SMatrix<T, 2, 9> {
        let (s2, c2) = sin_cos(q[1]);
        let outer = (q[0] + q[1]).sin();
        let mut y = self.friction_regressor(dq);
        y[(0, 0)] = ddq[0];
        y[(0, 1)] = c2 * (ddq[0] + ddq[0] + ddq[1]) - s2 * dq[1] * (dq[0] + dq[0] + dq[1]);
        y[(0, 2)] = ddq[1];
        y[(0, 3)] = q[0].sin();
        y[(0, 4)] = outer;
        y[(1, 1)] = c2 * ddq[0] + s2 * dq[0] * dq[0];
        y[(1, 2)] = ddq[0] + ddq[1];
        y[(1, 4)] = outer;
        y
    }

    fn payload(&self, _theta: &[T; 9], mass: T, distance: T) -> [T; 9] {
        let mut delta = [T::zero(); 9];
        let (l1, g) = (self.length1, self.gravity);
        delta[0] = mass * (l1 * l1 + distance * distance);
        delta[1] = mass * l1 * distance;
        delta[2] = mass * distance * distance;
        delta[3] = g * mass * l1;
        delta[4] = g * mass * distance;
        delta
    }
}
