//! Arms behind one trait: everything that depends on the kind of arm lives in this folder.
//!
//! The dynamics of a serial arm with `N` joints, equation (1) of Reyes and Kelly (1997),
//!
//! ```text
//! M(q) ddq + C(q, dq) dq + g(q) + f(dq) = tau,      f_j = b_j dq_j + fc_j sgn(dq_j)
//! ```
//!
//! is linear in `theta`, so each arm also gives the regressors of its momentum, of the remaining forces, and of
//! its energy. `theta` holds the arm's inertial base parameters, then `N` viscous, then `N` Coulomb coefficients:
//! `P = INERTIAL + 2 N`. Adding an arm is one file here and one line in [`ArmKind::ALL`].

mod axis;
mod pendulum;
mod two_link;

pub use axis::Axis;
pub use pendulum::Pendulum;
pub use two_link::{LinkParameters, TwoLink};

use crate::cpu::Cpu;
use crate::number::Number;
use crate::real::{Real, sgn};
use crate::trig::SinCos;
use nalgebra::{SMatrix, SVector};

/// Terms of the equation of motion at a state: inertia matrix, by rows, and `C dq + g`.
#[derive(Debug, Clone, Copy)]
pub struct EquationTerms<V, const N: usize> {
    /// `M(q)`.
    pub inertia: [[V; N]; N],
    /// `C(q, dq) dq + g(q)`.
    pub bias: [V; N],
}

/// Name and unit of one parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter {
    /// Name as it appears in results, for example `theta1`.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
}

/// The kinds of arm an arm file can name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArmKind {
    /// One prismatic joint.
    Axis,
    /// One rotary joint under gravity.
    Pendulum,
    /// The two-link vertical arm of Reyes and Kelly (1997).
    TwoLink,
}

impl ArmKind {
    /// Every kind, in the order of the documentation.
    pub const ALL: [Self; 3] = [Self::Axis, Self::Pendulum, Self::TwoLink];

    /// The name an arm file uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Axis => <Axis<f64> as Arm<f64, 1, 4>>::KIND,
            Self::Pendulum => <Pendulum<f64> as Arm<f64, 1, 4>>::KIND,
            Self::TwoLink => <TwoLink<f64> as Arm<f64, 2, 9>>::KIND,
        }
    }

    /// Parameters in the order of `theta`.
    pub const fn parameters(self) -> &'static [Parameter] {
        match self {
            Self::Axis => <Axis<f64> as Arm<f64, 1, 4>>::PARAMETERS,
            Self::Pendulum => <Pendulum<f64> as Arm<f64, 1, 4>>::PARAMETERS,
            Self::TwoLink => <TwoLink<f64> as Arm<f64, 2, 9>>::PARAMETERS,
        }
    }

    /// Degrees of freedom.
    pub const fn joints(self) -> usize {
        match self {
            Self::Axis | Self::Pendulum => 1,
            Self::TwoLink => 2,
        }
    }

    /// Number of inertial base parameters, the first entries of `theta`.
    pub const fn inertial(self) -> usize {
        self.parameters().len() - 2 * self.joints()
    }

    /// Whether each joint turns (rad, N m) rather than slides (m, N).
    pub const fn rotary(self) -> bool {
        !matches!(self, Self::Axis)
    }

    /// The kind with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// A serial arm with `N` joints and `P` parameters, linear in them.
///
/// Required methods are the arm's own mathematics; the provided ones follow from it and hold for every arm.
pub trait Arm<T: Real, const N: usize, const P: usize>: Clone + Send + Sync {
    /// Name in arm files.
    const KIND: &'static str;
    /// Names and units of `theta`, inertial first, then viscous and Coulomb per joint.
    const PARAMETERS: &'static [Parameter];
    /// Number of inertial base parameters.
    const INERTIAL: usize = P - 2 * N;
    /// Whether the arm moves in one vertical plane, so that the angle of a tilted base says all about gravity.
    const PLANAR: bool = true;

    /// Inertia matrix `M(q)`, symmetric positive definite for physical `theta`.
    fn inertia(&self, theta: &[T; P], q: &SVector<T, N>) -> SMatrix<T, N, N>;

    /// Coriolis matrix `C(q, dq)` with `dM/dt - 2 C` skew-symmetric.
    fn coriolis(&self, theta: &[T; P], q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, N>;

    /// Gravity torque `g(q) = dU/dq` with the base turned by `tilt`, rad, in the plane of motion.
    fn gravity(&self, theta: &[T; P], q: &SVector<T, N>, tilt: T) -> SVector<T, N>;

    /// Regressor of the energy above rest at `q = 0`: `E . theta = K(q, dq) + U(q) - U(0)`.
    fn energy_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, P>;

    /// Regressor of the momentum: `Pm theta = M(q) dq`.
    fn momentum_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, P>;

    /// Regressor of `g(q) - dK/dq`: what is left of the inertial torque once the momentum's rate is taken out.
    fn potential_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, P>;

    /// The regressor of the energy, for the online estimator; arms override it where the processor `C` computes several angles at once.
    #[inline(always)]
    fn energy_regressor_on<C: Cpu>(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, P> {
        self.energy_regressor(q, dq)
    }

    /// The regressors of momentum and potential together, for the online estimator; arms override it where terms are shared.
    #[inline(always)]
    fn momentum_and_potential<C: Cpu>(
        &self,
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
    ) -> (SMatrix<T, N, P>, SMatrix<T, N, P>) {
        (self.momentum_regressor(q, dq), self.potential_regressor(q, dq))
    }

    /// Change of `theta` when a point `mass`, kg, is fixed `distance`, m, along the last link.
    fn payload(&self, theta: &[T; P], mass: T, distance: T) -> [T; P];

    /// Angles whose sines and cosines [`Arm::equation_terms`] needs, with the base turned by `tilt`.
    fn angles<V: Number<Real = T>>(&self, q: &[V; N], tilt: V) -> [V; N];

    /// The part of the inertia matrix that does not depend on `q`.
    fn constant_inertia(&self, theta: &[T; P]) -> [[T; N]; N];

    /// Inertia matrix, given its constant part, and `C dq + g` together, for the integrator: of one arm, or of several side by side. The
    /// joint positions are for arms whose prismatic joints move links; angles come as sines and cosines.
    fn equation_terms<V: Number<Real = T>>(
        &self,
        theta: &[V; P],
        constant_inertia: &[[V; N]; N],
        sincos: &[SinCos<V>; N],
        q: &[V; N],
        dq: &[V; N],
    ) -> EquationTerms<V, N>;

    /// Regressor of the whole equation of motion: `Y(q, dq, ddq) theta = tau`, equation (15).
    fn regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>, ddq: &SVector<T, N>) -> SMatrix<T, N, P>;

    /// Regressor of friction: `f(dq) = F theta`.
    #[inline]
    fn friction_regressor(&self, dq: &SVector<T, N>) -> SMatrix<T, N, P> {
        let mut f = SMatrix::zeros();
        for j in 0..N {
            f[(j, Self::INERTIAL + j)] = dq[j];
            f[(j, Self::INERTIAL + N + j)] = sgn(dq[j]);
        }
        f
    }

    /// Viscous coefficients within `theta`.
    #[inline]
    fn viscous(&self, theta: &[T; P]) -> SVector<T, N> {
        SVector::from_fn(|j, _| theta[Self::INERTIAL + j])
    }

    /// Coulomb coefficients within `theta`.
    #[inline]
    fn coulomb(&self, theta: &[T; P]) -> SVector<T, N> {
        SVector::from_fn(|j, _| theta[Self::INERTIAL + N + j])
    }

    /// Friction torque `f(dq)`, equation (4), with `sgn(0) = 0`.
    fn friction(&self, theta: &[T; P], dq: &SVector<T, N>) -> SVector<T, N> {
        self.friction_regressor(dq) * SVector::from(*theta)
    }
}
