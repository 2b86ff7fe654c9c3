//! Fast behaviour of a plant: torques that jump at a position, and rates that need short integration steps.

use super::Plant;
use crate::arm::Arm;
use crate::effect::Edge;
use crate::kinematics::JointState;
use crate::linear::free_inertia;
use crate::real::{Real, lit};
use crate::transmission::LatentState;
use nalgebra::SVector;

/// Factor by which steps during an impact are shorter than stability of the integration requires, so that the impact is resolved.
const FOLLOWED: f64 = 4.0;

/// Velocity, in widths of a joint's friction regularisation, beyond which the joint slides: 1 - tanh(6) = 1.2e-5.
pub(crate) const SLIDING: f64 = 6.0;

/// Rates of a plant that need short integration steps, 1/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepRates<T> {
    /// Rate at which regularised friction stops a joint near standstill.
    pub friction: T,
    /// Rate at which a motor oscillates against its link, or a joint against a joint limit; the latter with a factor, so that the impact is resolved.
    pub elsewhere: T,
}

impl<T: Real> StepRates<T> {
    /// Rates of which each is the larger of that of `self` and that of `other`.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self { friction: self.friction.max(other.friction), elsewhere: self.elsewhere.max(other.elsewhere) }
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Plant<T, A, N, P> {
    /// Whether the torque of any joint jumps at a position.
    #[inline]
    pub fn jumps(&self) -> bool {
        self.jumps
    }

    /// Positions of joint `j`, rad (m), at which its torque jumps, each with the stiffness and damping of the joint limit there, if the jump is due
    /// to one.
    pub fn edges(&self, j: usize) -> impl Iterator<Item = Edge<T>> {
        let on_joint = self.effects().filter(move |e| e.joint == j);
        on_joint.filter_map(|e| e.law.edge(&e.p))
    }

    /// First position strictly between `from` and `to`, rad or m, at which the torque of joint `j` jumps.
    pub(crate) fn edge_between(&self, j: usize, from: T, to: T) -> Option<T> {
        if !self.jumps {
            return None;
        }
        let edges = self.edges(j).map(|edge| edge.position);
        let between = edges.filter(|edge| (from - *edge) * (to - *edge) < T::zero());
        between.fold(None, |first: Option<T>, edge| match first {
            Some(first) if (first - from).abs() <= (edge - from).abs() => Some(first),
            _ => Some(edge),
        })
    }

    /// Fastest rate, 1/s, at which viscous friction stops a joint at the positions `q`.
    pub fn viscous_rate(&self, q: &SVector<T, N>) -> T {
        let inertia = self.rigid.equation_terms(&JointState { q: (*q).into(), dq: [T::zero(); N] }).inertia;
        (0..N).fold(T::zero(), |fastest: T, j| {
            fastest.max(self.rigid.viscous[j] / free_inertia(&inertia, j).max(lit(1e-9)))
        })
    }

    /// Fastest rate of the plant at the positions `q`, 1/s: the larger of its [`Plant::step_rates`].
    pub fn fastest(&self, q: &SVector<T, N>) -> T {
        let StepRates { friction, elsewhere } = self.step_rates(q);
        friction.max(elsewhere)
    }

    /// Rates of the plant at the positions `q` that need short steps. Zero for a rigid arm with exact friction.
    pub fn step_rates(&self, q: &SVector<T, N>) -> StepRates<T> {
        let behind = self.jumps && (0..N).any(|j| self.edges(j).any(|edge| edge.is_behind(q[j])));
        if !(0..N).any(|j| self.is_rounded(j)) && !self.drivetrain.any() && !behind {
            return StepRates { friction: T::zero(), elsewhere: T::zero() };
        }
        let inertia = self.rigid.equation_terms(&JointState { q: (*q).into(), dq: [T::zero(); N] }).inertia;
        self.step_rates_with(q, &core::array::from_fn(|j| free_inertia(&inertia, j)))
    }

    /// Rates of the plant at the positions `q`, as [`Plant::step_rates`] has them; `free` is each joint's inertia with all other joints free to move,
    /// kg m^2 (kg).
    #[inline]
    pub(crate) fn step_rates_with(&self, q: &SVector<T, N>, free: &[T; N]) -> StepRates<T> {
        let (mut friction, mut elsewhere) = (T::zero(), T::zero());
        for j in 0..N {
            friction = friction.max(self.friction_rate(j, q[j], free[j]));
            let free = free[j].max(lit(1e-9));
            if let Some(transmission) = self.drivetrain.get(j).filter(|d| d.backlash <= T::zero()) {
                elsewhere = elsewhere.max(transmission.rate(free));
            }
            if self.jumps {
                let met = self.edges(j).filter(|edge| edge.is_behind(q[j]));
                elsewhere = met.fold(elsewhere, |rate, edge| rate.max(edge.rate(free) * lit(FOLLOWED)));
            }
        }
        StepRates { friction, elsewhere }
    }

    /// Rate at which regularised friction stops joint `j`, 1/s, near standstill at the position `q`, rad (m); `free` is the joint's inertia with all
    /// other joints free to move, kg m^2 (kg). Zero for exact friction.
    fn friction_rate(&self, j: usize, q: T, free: T) -> T {
        if !self.is_rounded(j) {
            return T::zero();
        }
        let x = self.point(j, T::zero(), q, T::zero(), T::zero(), T::zero());
        let braked = match self.drivetrain.get(j) {
            Some(transmission) if self.drivetrain.sides(j).friction_at_motor => transmission.inertia,
            _ => free.max(lit(1e-9)),
        };
        self.level(j, &x, T::one()) / (self.rounding[j] * braked)
    }

    /// Width of friction regularisation of each joint, rad/s (m/s), for which friction stops the joint near standstill at the rate `rate`, 1/s, at
    /// the positions `q`. Zero for exact friction.
    pub fn widths_at_rate(&self, q: &SVector<T, N>, rate: T) -> [T; N] {
        let inertia = self.rigid.equation_terms(&JointState { q: (*q).into(), dq: [T::zero(); N] }).inertia;
        core::array::from_fn(|j| {
            self.rounding[j] * self.friction_rate(j, q[j], free_inertia(&inertia, j)) / rate
        })
    }

    /// Whether the regularised friction of joint `j` differs from Coulomb friction at the velocity `dq`, rad/s (m/s), by no more than a part in 10^5;
    /// true for exact friction.
    #[inline]
    pub(crate) fn slides(&self, j: usize, dq: T) -> bool {
        dq.abs() > self.rounding[j] * lit(SLIDING) || !self.is_rounded(j)
    }

    /// Whether all joints with regularised friction slide ([`Plant::slides`]) at the joint velocities `dq`, rad/s or m/s.
    #[inline]
    pub(crate) fn all_slide(&self, dq: &SVector<T, N>, latent: &LatentState<T, N>) -> bool {
        (0..N).all(|j| self.slides(j, self.friction_velocity(j, dq, latent)))
    }
}
