//! Equation of motion of a chain: inertia matrix, bias, inverse and forward dynamics, energies.

use super::Chain;
use super::inertia::{LinkInertia, SpatialInertia};
use super::kinematics::LinkPose;
use super::vector::{Twist, Wrench, cross, cross_plus, dot, negative, of, scaled, scaled_plus, turned, zero};
use crate::arm::EquationTerms;
use crate::linear::solve_in_place;
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
        let (mut matrix, mut outer) = ([[zero(); N]; N], SpatialInertia::zero());
        for j in (0..N).rev() {
            outer = outer.plus(&SpatialInertia::of(&links[j], &poses[j]));
            add_column(&mut matrix, &poses, &outer, j);
        }
        mirror(&mut matrix);
        matrix
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
        joint_torques(links, &poses, &self.motions(&poses, dq, Some(ddq)))
    }

    /// Bias `C dq + g`, `(N,)`, N m (N), of a chain with the inertial parameters `links`: joint torques of a motion without acceleration.
    #[inline(always)]
    pub fn bias<V: Number<Real = T>>(&self, links: &[LinkInertia<V>; N], q: &[V; N], dq: &[V; N]) -> [V; N] {
        let poses = self.poses(q);
        joint_torques(links, &poses, &self.motions(&poses, dq, None))
    }

    /// Joint accelerations, `(N,)`, rad/s^2 (m/s^2), under the joint torques `tau`, N m (N), without friction; `constant_inertia`, such as rotor
    /// inertias, is added to `M(q)`, which is factored as `U D U'`.
    #[inline(always)]
    pub fn forward_dynamics<V: Number<Real = T>>(
        &self,
        links: &[LinkInertia<V>; N],
        constant_inertia: &InertiaMatrix<V, N>,
        [q, dq, tau]: [&[V; N]; 3],
    ) -> [V; N] {
        let (mut inertia, mut right) = (*constant_inertia, *tau);
        self.add_equation_terms(&self.poses(q), links, dq, &mut inertia, |j, bias| {
            right[j] = right[j] - bias;
        });
        solve_in_place(&mut inertia, &mut right);
        right
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
        let (mut inertia, mut bias) = (*constant_inertia, [zero(); N]);
        self.add_equation_terms(poses, links, dq, &mut inertia, |j, own| bias[j] = own);
        mirror(&mut inertia);
        EquationTerms { inertia, bias }
    }

    /// Adds the inertia matrix to the upper triangle of `inertia`, by the composite rigid body algorithm, and calls `put(j, bias)` for every joint
    /// `j`, from the last to the first. Bodies are added up from the last link inwards, so that nothing but the links' motions is kept for later.
    #[inline(always)]
    fn add_equation_terms<V: Number<Real = T>>(
        &self,
        poses: &[LinkPose<V>; N],
        links: &[LinkInertia<V>; N],
        dq: &[V; N],
        inertia: &mut InertiaMatrix<V, N>,
        mut put: impl FnMut(usize, V),
    ) {
        let motions = self.motions(poses, dq, None);
        let (mut outer, mut force) = (SpatialInertia::zero(), Wrench::zero());
        for j in (0..N).rev() {
            let own = SpatialInertia::of(&links[j], &poses[j]);
            force = force.plus(&motions[j].force(&own));
            put(j, poses[j].joint.dot(&force));
            outer = outer.plus(&own);
            add_column(inertia, poses, &outer, j);
        }
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
    /// Spatial force that a link with this spatial inertia needs for its motion and its weight. With `a` the acceleration of the link's point at the
    /// base origin less gravity, `alpha` the angular acceleration and `w` the angular velocity it is the force `m a + alpha x h + w x (w x h)` and
    /// the moment `h x a + I alpha + w x I w`, `m` mass, `h` first and `I` second moments: `I a + v x* I v` (Featherstone 2008, section 5.3) with
    /// the terms of the linear velocity collected.
    #[inline(always)]
    pub(super) fn force(&self, inertia: &SpatialInertia<V>) -> Wrench<V> {
        let (Twist { angular: w, linear: v }, Twist { angular: alpha, linear }) =
            (&self.velocity, &self.acceleration);
        let (a, h) = (cross_plus(w, v, linear), &inertia.first);
        let own = cross_plus(w, &inertia.second_times(w), &inertia.second_times(alpha));
        let outwards = cross_plus(w, &cross(w, h), &scaled(inertia.mass, &a));
        Wrench { moment: cross_plus(h, &a, &own), force: cross_plus(alpha, h, &outwards) }
    }
}

/// Joint torques, N m (N), of links with the inertial parameters `links` that move by `motions`.
#[inline(always)]
fn joint_torques<V: Number, const N: usize>(
    links: &[LinkInertia<V>; N],
    poses: &[LinkPose<V>; N],
    motions: &[LinkMotion<V>; N],
) -> [V; N] {
    let (mut torques, mut outer) = ([zero(); N], Wrench::zero());
    for j in (0..N).rev() {
        outer = outer.plus(&motions[j].force(&SpatialInertia::of(&links[j], &poses[j])));
        torques[j] = poses[j].joint.dot(&outer);
    }
    torques
}

/// Adds column `j` of the inertia matrix, `i <= j`, to `matrix`; `outer` is the spatial inertia of link `j` and all outer links.
#[inline(always)]
fn add_column<V: Number, const N: usize>(
    matrix: &mut InertiaMatrix<V, N>,
    poses: &[LinkPose<V>; N],
    outer: &SpatialInertia<V>,
    j: usize,
) {
    let force = outer.times(&poses[j].joint);
    for i in (0..N).take(j + 1) {
        matrix[i][j] = matrix[i][j] + poses[i].joint.dot(&force);
    }
}

/// Copies the upper triangle of `matrix` to the lower one.
#[inline(always)]
fn mirror<V: Number, const N: usize>(matrix: &mut InertiaMatrix<V, N>) {
    for j in 0..N {
        for i in (0..N).take(j) {
            matrix[j][i] = matrix[i][j];
        }
    }
}
