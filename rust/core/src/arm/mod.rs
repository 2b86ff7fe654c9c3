//! Kinds of arm with dynamics in closed form behind one trait, [`Arm`].
//!
//! The dynamics of a serial arm with `N` joints, equation (1) of Reyes and Kelly (1997),
//!
//! ```text
//! M(q) ddq + C(q, dq) dq + g(q) + f(dq) = tau,      f_j = b_j dq_j + fc_j sgn(dq_j)
//! ```
//!
//! is linear in `theta`, so each arm also gives the regressors of its momentum, of the remaining forces, and of
//! its energy. `theta` holds the arm's inertial base parameters, then `N` viscous, then `N` Coulomb coefficients:
//! `P = INERTIAL + 2 N`. Adding a kind of arm is one file in this folder and one line in [`ArmKind::ALL`].

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

/// Terms of the equation of motion `M ddq + C dq + g + f = tau` at one state.
#[derive(Debug, Clone, Copy)]
pub struct EquationTerms<V, const N: usize> {
    /// Inertia matrix `M(q)`, by rows, kg m^2 (kg).
    pub inertia: [[V; N]; N],
    /// Bias `C(q, dq) dq + g(q)`, N m (N).
    pub bias: [V; N],
}

/// Name and unit of one parameter of an arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter {
    /// Name of the parameter as it appears in results, for example `theta1`.
    pub name: &'static str,
    /// SI unit of the parameter, for example `kg m^2`.
    pub unit: &'static str,
}

/// Kinds of arm with dynamics in closed form, as an arm file names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArmKind {
    /// Linear axis: one prismatic joint.
    Axis,
    /// Pendulum: one rotary joint under gravity.
    Pendulum,
    /// The two-link vertical arm of Reyes and Kelly (1997).
    TwoLink,
}

impl ArmKind {
    /// All kinds of arm, in the order of the documentation.
    pub const ALL: [Self; 3] = [Self::Axis, Self::Pendulum, Self::TwoLink];

    /// Name of the kind of arm in arm files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Axis => <Axis<f64> as Arm<f64, 1, 4>>::KIND,
            Self::Pendulum => <Pendulum<f64> as Arm<f64, 1, 4>>::KIND,
            Self::TwoLink => <TwoLink<f64> as Arm<f64, 2, 9>>::KIND,
        }
    }

    /// Names and units of the arm's parameters in the order of `theta`.
    pub const fn parameters(self) -> &'static [Parameter] {
        match self {
            Self::Axis => <Axis<f64> as Arm<f64, 1, 4>>::PARAMETERS,
            Self::Pendulum => <Pendulum<f64> as Arm<f64, 1, 4>>::PARAMETERS,
            Self::TwoLink => <TwoLink<f64> as Arm<f64, 2, 9>>::PARAMETERS,
        }
    }

    /// Number of joints of the kind of arm.
    pub const fn joints(self) -> usize {
        match self {
            Self::Axis | Self::Pendulum => 1,
            Self::TwoLink => 2,
        }
    }

    /// Number of inertial base parameters, which come first in `theta`.
    pub const fn inertial(self) -> usize {
        self.parameters().len() - 2 * self.joints()
    }

    /// Whether the arm's joints turn (rad, N m) rather than slide (m, N).
    pub const fn rotary(self) -> bool {
        !matches!(self, Self::Axis)
    }

    /// The kind of arm that arm files call `name`.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

/// Taker of columns of the regressors of momentum and of `g - dK/dq`; see [`Arm::momentum_columns`].
pub trait MomentumColumns<T, const N: usize> {
    /// Takes neighbouring columns of both regressors, of which the first is column `first`; with `#[inline(always)]`, as it is part of a kernel.
    fn put(&mut self, first: usize, momentum: &[[T; N]], potential: &[[T; N]]);
}

/// A serial arm with `N` joints and `P` parameters, in which its dynamics are linear.
///
/// Required methods are the equations of one kind of arm; provided methods follow from them.
pub trait Arm<T: Real, const N: usize, const P: usize>: Clone + Send + Sync {
    /// Name of the kind of arm in arm files.
    const KIND: &'static str;
    /// Names and units of `theta`, inertial first, then viscous and Coulomb per joint.
    const PARAMETERS: &'static [Parameter];
    /// Number of inertial base parameters.
    const INERTIAL: usize = P - 2 * N;
    /// Whether the arm moves in one vertical plane, so that one angle, rad, describes a tilted base.
    const PLANAR: bool = true;
    /// Whether [`Arm::constant_inertia`] is that of the motors' rotors alone, so that the torque that each transmission passes on is known.
    const ROTORS_APART: bool = false;

    /// Inertia matrix `M(q)`, symmetric positive definite for physical `theta`.
    fn inertia(&self, theta: &[T; P], q: &SVector<T, N>) -> SMatrix<T, N, N>;

    /// Coriolis matrix `C(q, dq)` with `dM/dt - 2 C` skew-symmetric.
    fn coriolis(&self, theta: &[T; P], q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, N>;

    /// Gravity torque `g(q) = dU/dq`, N m (N), with the base turned by `tilt`, rad, in the plane of motion.
    fn gravity(&self, theta: &[T; P], q: &SVector<T, N>, tilt: T) -> SVector<T, N>;

    /// Regressor `E` of the energy above rest at `q = 0`, J: `E . theta = K(q, dq) + U(q) - U(0)`.
    fn energy_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, P>;

    /// Regressor `Pm`, `(N, P)`, of the momentum: `Pm theta = M(q) dq`.
    fn momentum_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, P>;

    /// Regressor `B`, `(N, P)`, of the torque minus the time derivative of the momentum, without friction: `B theta = g(q) - dK/dq`, `K` the kinetic
    /// energy.
    fn potential_regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SMatrix<T, N, P>;

    /// Same as [`Arm::energy_regressor`], for the online estimator; an arm overrides this method to compute several sines and cosines at once on the
    /// processor `C`.
    #[inline(always)]
    fn energy_regressor_on<C: Cpu>(&self, q: &SVector<T, N>, dq: &SVector<T, N>) -> SVector<T, P> {
        self.energy_regressor(q, dq)
    }

    /// Same as [`Arm::energy_regressor_on`] at two states `[q, dq]`; an arm overrides this method to compute both side by side.
    #[inline(always)]
    fn energy_regressors_on<C: Cpu>(&self, states: [[&SVector<T, N>; 2]; 2]) -> [SVector<T, P>; 2] {
        let [[q, dq], [other_q, other_dq]] = states;
        [self.energy_regressor_on::<C>(q, dq), self.energy_regressor_on::<C>(other_q, other_dq)]
    }

    /// [`Arm::momentum_regressor`] and [`Arm::potential_regressor`], for the online estimator; an arm overrides this method to compute shared terms
    /// once.
    #[inline(always)]
    fn momentum_and_potential<C: Cpu>(
        &self,
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
    ) -> (SMatrix<T, N, P>, SMatrix<T, N, P>) {
        (self.momentum_regressor(q, dq), self.potential_regressor(q, dq))
    }

    /// The inertial columns of [`Arm::momentum_and_potential`], for the online estimator, given to `sink` as soon as they are computed, each once; an
    /// arm with many parameters overrides this method, so that the matrices need not pass through memory.
    #[inline(always)]
    fn momentum_columns<C: Cpu>(
        &self,
        q: &SVector<T, N>,
        dq: &SVector<T, N>,
        sink: &mut impl MomentumColumns<T, N>,
    ) {
        let (momentum, potential) = self.momentum_and_potential::<C>(q, dq);
        if let (Some(momentum), Some(potential)) =
            (momentum.data.0.get(..Self::INERTIAL), potential.data.0.get(..Self::INERTIAL))
        {
            sink.put(0, momentum, potential);
        }
    }

    /// Change of `theta` when a point `mass`, kg, is fixed `distance`, m, along the last link.
    fn payload(&self, theta: &[T; P], mass: T, distance: T) -> [T; P];

    /// Angles, rad, whose sines and cosines [`Arm::equation_terms`] needs, with the base turned by `tilt`, rad.
    fn angles<V: Number<Real = T>>(&self, q: &[V; N], tilt: V) -> [V; N];

    /// Part of the inertia matrix, by rows, that does not depend on `q`.
    fn constant_inertia(&self, theta: &[T; P]) -> [[T; N]; N];

    /// Inertia matrix and bias `C dq + g` of one arm, or of several side by side, from [`Arm::constant_inertia`], the sines and cosines of
    /// [`Arm::angles`], and the joint state; `q` is used only by arms whose prismatic joints move links.
    fn equation_terms<V: Number<Real = T>>(
        &self,
        theta: &[V; P],
        constant_inertia: &[[V; N]; N],
        sincos: &[SinCos<V>; N],
        q: &[V; N],
        dq: &[V; N],
    ) -> EquationTerms<V, N>;

    /// Regressor `Y`, `(N, P)`, of the equation of motion: `Y(q, dq, ddq) theta = tau`, Reyes and Kelly (1997), equation (15).
    fn regressor(&self, q: &SVector<T, N>, dq: &SVector<T, N>, ddq: &SVector<T, N>) -> SMatrix<T, N, P>;

    /// Regressor `F`, `(N, P)`, of friction: `f(dq) = F theta`.
    #[inline]
    fn friction_regressor(&self, dq: &SVector<T, N>) -> SMatrix<T, N, P> {
        let mut f = SMatrix::zeros();
        for j in 0..N {
            f[(j, Self::INERTIAL + j)] = dq[j];
            f[(j, Self::INERTIAL + N + j)] = sgn(dq[j]);
        }
        f
    }

    /// Viscous coefficients of the joints, from `theta`, N m s/rad (N s/m).
    #[inline]
    fn viscous(&self, theta: &[T; P]) -> SVector<T, N> {
        SVector::from_fn(|j, _| theta[Self::INERTIAL + j])
    }

    /// Coulomb coefficients of the joints, from `theta`, N m (N).
    #[inline]
    fn coulomb(&self, theta: &[T; P]) -> SVector<T, N> {
        SVector::from_fn(|j, _| theta[Self::INERTIAL + N + j])
    }

    /// Friction torque `f(dq)`, N m (N), Reyes and Kelly (1997), equation (4), with `sgn(0) = 0`.
    fn friction(&self, theta: &[T; P], dq: &SVector<T, N>) -> SVector<T, N> {
        self.friction_regressor(dq) * SVector::from(*theta)
    }
}
