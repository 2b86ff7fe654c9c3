//! Equation of motion of a chain: inertia matrix, bias, inverse and forward dynamics, energies.

use super::Chain;
use super::inertia::{LinkInertia, SpatialInertia};
use super::kinematics::LinkPose;
use super::vector::{Twist, Wrench, dot, negative, of, scaled_plus, turned, zero};
use crate::arm::EquationTerms;
use crate::linear::solve_positive_definite;
use crate::number::Number;
use crate::real::{Real, lit};

/// Matrix over joints, such as an inertia matrix, by rows.
pub type InertiaMatrix<V, const N: usize> = [[V; N]; N];

impl<T: Real, const N: usize> Chain<T, N> {
    /// Inertia matrix `M(q)`, `(N, N)`, kg m^2 (kg), of a chain with the inertial parameters `links`.
    #[inline(always)]
    pub fn inertia_matrix<V: Number<Real = T>>(
        &self,
        links: &[LinkInertia<V>; N],
        q: &[V; N],
    ) -> InertiaMatrix<V, N> {
        let poses = self.poses(q);
        let mut inertia = [SpatialInertia::zero(); N];
        for j in 0..N {
            inertia[j] = SpatialInertia::of(&links[j], &poses[j]);
        }
        composite_inertia(&poses, &mut inertia, &[[zero(); N]; N])
    }

    /// Joint torques of a motion by inverse dynamics, `M ddq + C dq + g`, `(N,)`, N m (N), of a chain with the inertial parameters `links`.
    #[inline(always)]
    pub fn inverse_dynamics<V: Number<Real = T>>(
        &self,
        links: &[LinkInertia<V>; N],
        q: &[V; N],
        dq: &[V; N],
        ddq: &[V; N],
    ) -> [V; N] {
        let poses = self.poses(q);
        let motions = self.motions(&poses, dq, Some(ddq));
        let mut forces = [Wrench::zero(); N];
        for j in 0..N {
            forces[j] = motions[j].force(&SpatialInertia::of(&links[j], &poses[j]));
        }
        joint_torques(&poses, &mut forces)
    }

    /// Bias `C dq + g`, `(N,)`, N m (N), of a chain with the inertial parameters `links`: joint torques of a motion without acceleration.
    #[inline(always)]
    pub fn bias<V: Number<Real = T>>(&self, links: &[LinkInertia<V>; N], q: &[V; N], dq: &[V; N]) -> [V; N] {
        self.equation_terms_at(&self.poses(q), links, &[[zero(); N]; N], dq).bias
    }

    /// Joint accelerations, `(N,)`, rad/s^2 (m/s^2), under the joint torques `tau`, N m (N), without friction; `constant_inertia`, such as rotor
    /// inertias, is added to `M(q)`, which is factored as `L D L'`.
    #[inline(always)]
    pub fn forward_dynamics<V: Number<Real = T>>(
        &self,
        links: &[LinkInertia<V>; N],
        constant_inertia: &InertiaMatrix<V, N>,
        [q, dq, tau]: [&[V; N]; 3],
    ) -> [V; N] {
        let EquationTerms { inertia, bias } =
            self.equation_terms_at(&self.poses(q), links, constant_inertia, dq);
        let mut right = *tau;
        for j in 0..N {
            right[j] = right[j] - bias[j];
        }
        solve_positive_definite(inertia, right)
    }

    /// Kinetic energy of the links, J, without that of rotors.
    #[inline(always)]
    pub fn links_kinetic_energy<V: Number<Real = T>>(
        &self,
        links: &[LinkInertia<V>; N],
        q: &[V; N],
        dq: &[V; N],
    ) -> V {
        let poses = self.poses(q);
        let motions = self.motions(&poses, dq, None);
        let mut twice: V = zero();
        for j in 0..N {
            let velocity = &motions[j].velocity;
            twice = twice + velocity.dot(&SpatialInertia::of(&links[j], &poses[j]).times(velocity));
        }
        twice * V::of(lit(0.5))
    }

    /// Potential energy of the links above that at `q = 0`, J.
    #[inline(always)]
    pub fn links_potential_energy<V: Number<Real = T>>(&self, links: &[LinkInertia<V>; N], q: &[V; N]) -> V {
        let (poses, gravity) = (self.poses(q), of::<V>(&self.gravity));
        let mut energy: V = zero();
        for j in 0..N {
            let [mass, hx, hy, hz, ..] = links[j];
            let (first, (height, turned_gravity)) = ([hx, hy, hz], &self.reference[j]);
            let now = scaled_plus(mass, &poses[j].position, &turned(&poses[j].rotation, &first));
            let before = mass.fused(V::of(*height), dot(&of(turned_gravity), &first));
            energy = energy + before - dot(&gravity, &now);
        }
        energy
    }

    /// Inertia matrix plus `constant_inertia`, and bias `C dq + g`, at known link poses.
    #[inline(always)]
    pub(super) fn equation_terms_at<V: Number<Real = T>>(
        &self,
        poses: &[LinkPose<V>; N],
        links: &[LinkInertia<V>; N],
        constant_inertia: &InertiaMatrix<V, N>,
        dq: &[V; N],
    ) -> EquationTerms<V, N> {
        let motions = self.motions(poses, dq, None);
        let (mut inertia, mut forces) = ([SpatialInertia::zero(); N], [Wrench::zero(); N]);
        for j in 0..N {
            inertia[j] = SpatialInertia::of(&links[j], &poses[j]);
            forces[j] = motions[j].force(&inertia[j]);
        }
        let bias = joint_torques(poses, &mut forces);
        EquationTerms { inertia: composite_inertia(poses, &mut inertia, constant_inertia), bias }
    }

    /// Motion of the base: at rest, with the acceleration `-g`, so that the links' weights appear as inertia forces.
    #[inline(always)]
    pub(super) fn base_motion<V: Number<Real = T>>(&self) -> LinkMotion<V> {
        let acceleration = Twist { angular: [zero(); 3], linear: negative(&of(&self.gravity)) };
        LinkMotion { velocity: Twist::zero(), acceleration }
    }

    /// Spatial velocities and accelerations of all links; without `ddq` the joint accelerations are zero.
    #[inline(always)]
    pub(super) fn motions<V: Number<Real = T>>(
        &self,
        poses: &[LinkPose<V>; N],
        dq: &[V; N],
        ddq: Option<&[V; N]>,
    ) -> [LinkMotion<V>; N] {
        let mut last = self.base_motion();
        let mut motions = [last; N];
        for j in 0..N {
            let joint = &poses[j].joint;
            let mut rate = last.velocity.cross(joint);
            rate = rate.scaled_plus(dq[j], &last.acceleration);
            if let Some(ddq) = ddq {
                rate = joint.scaled_plus(ddq[j], &rate);
            }
            last = LinkMotion { velocity: joint.scaled_plus(dq[j], &last.velocity), acceleration: rate };
            motions[j] = last;
        }
        motions
    }
}

/// Spatial velocity of a link, and its spatial acceleration minus gravity, in the base frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct LinkMotion<V> {
    pub(super) velocity: Twist<V>,
    pub(super) acceleration: Twist<V>,
}

impl<V: Number> LinkMotion<V> {
    /// Spatial force that a link with this spatial inertia needs for its motion and its weight.
    #[inline(always)]
    pub(super) fn force(&self, inertia: &SpatialInertia<V>) -> Wrench<V> {
        let rate = self.velocity.cross_force(&inertia.times(&self.velocity));
        inertia.times(&self.acceleration).plus(&rate)
    }
}

/// Joint torques, N m (N), for the spatial forces on each link; on return `forces[j]` is the sum over link `j` and all outer links.
#[inline(always)]
pub(super) fn joint_torques<V: Number, const N: usize>(
    poses: &[LinkPose<V>; N],
    forces: &mut [Wrench<V>; N],
) -> [V; N] {
    let (mut torques, mut outer) = ([zero(); N], Wrench::zero());
    for j in (0..N).rev() {
        outer = outer.plus(&forces[j]);
        forces[j] = outer;
        torques[j] = poses[j].joint.dot(&outer);
    }
    torques
}

/// Inertia matrix by the composite rigid body algorithm plus `constant_inertia`, from the spatial inertia of each link; on return `inertia[j]` is the
/// sum over link `j` and all outer links.
#[inline(always)]
pub(super) fn composite_inertia<V: Number, const N: usize>(
    poses: &[LinkPose<V>; N],
    inertia: &mut [SpatialInertia<V>; N],
    constant_inertia: &InertiaMatrix<V, N>,
) -> InertiaMatrix<V, N> {
    let (mut matrix, mut outer) = (*constant_inertia, SpatialInertia::zero());
    for j in (0..N).rev() {
        outer = outer.plus(&inertia[j]);
        inertia[j] = outer;
        let force = outer.times(&poses[j].joint);
        for i in 0..=j {
            let entry = poses[i].joint.dot(&force);
            matrix[i][j] = matrix[i][j] + entry;
            if i != j {
                matrix[j][i] = matrix[j][i] + entry;
            }
        }
    }
    matrix
}
