//! Fast behaviour of a plant: torques that jump at a position, and rates that need short integration steps.

use super::Plant;
use crate::arm::Arm;
use crate::effect::Edge;
use crate::kinematics::JointState;
use crate::linear::free_inertia;
use crate::real::{Real, lit};
use nalgebra::SVector;

/// Factor by which steps during an impact are shorter than stability of the integration needs, to resolve the impact.
const FOLLOWED: f64 = 4.0;

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Plant<T, A, N, P> {
    /// Whether the torque of any joint jumps at a position.
    #[inline]
    pub fn jumps(&self) -> bool {
        self.jumps
    }

    /// Positions of joint `j` at which its torque jumps, with the contacts beyond them.
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

    /// Fastest rate of the plant at the positions `q`, 1/s: at which smoothed friction stops a joint, a motor oscillates against its link, or a joint
    /// meets a joint limit, as an impact that is to be resolved. Zero for a rigid arm with exact friction.
    pub fn fastest(&self, q: &SVector<T, N>) -> T {
        let behind = self.jumps && (0..N).any(|j| self.edges(j).any(|edge| edge.is_behind(q[j])));
        if !(0..N).any(|j| self.is_rounded(j)) && !self.drivetrain.any() && !behind {
            return T::zero();
        }
        let inertia = self.rigid.equation_terms(&JointState { q: (*q).into(), dq: [T::zero(); N] }).inertia;
        self.fastest_with(q, &core::array::from_fn(|j| free_inertia(&inertia, j)))
    }

    /// Fastest rate of the plant at the positions `q`, 1/s, as [`Plant::fastest`] has it; `free` is each joint's inertia with all other joints free to
    /// move, kg m^2 (kg).
    #[inline]
    pub(crate) fn fastest_with(&self, q: &SVector<T, N>, free: &[T; N]) -> T {
        let mut fastest = T::zero();
        for j in 0..N {
            let free = free[j].max(lit(1e-9));
            if self.is_rounded(j) {
                let x = self.point(j, T::zero(), q[j], T::zero(), T::zero(), T::zero());
                let braked = match self.drivetrain.get(j) {
                    Some(transmission) if self.drivetrain.sides(j).friction_at_motor => transmission.inertia,
                    _ => free,
                };
                fastest = fastest.max(self.level(j, &x, T::one()) / (self.rounding[j] * braked));
            }
            if let Some(transmission) = self.drivetrain.get(j).filter(|d| d.backlash <= T::zero()) {
                fastest = fastest.max(transmission.rate(free));
            }
            if self.jumps {
                let met = self.edges(j).filter(|edge| edge.is_behind(q[j]));
                fastest = met.fold(fastest, |rate, edge| rate.max(edge.rate(free) * lit(FOLLOWED)));
            }
        }
        fastest
    }
}
