//! Derivatives of inverse dynamics: of the joint torques by positions, velocities and accelerations.
//!
//! A small displacement of joint `i` moves all outer links as one body. With the motion subspace `S` of the joint, `S' = v x S` and `S'' = a x S + v
//! x S'`, `v` and `a` velocity and acceleration of the joint's parent link, the force on outer link `k` changes by `S x* f_k + I_k S'' + 2 B_k S'`
//! per joint position and by `2 (I_k S' + B_k S)` per joint velocity, where `f_k` is the force on link `k`, `I_k` its spatial inertia, `v_k` its
//! velocity, and `2 B_k x = v_k x* I_k x + x x* I_k v_k - I_k (v_k x x)` (Singh, Russell and Wensing 2022). In the axes of the base frame `B_k` has
//! twelve numbers: `B_k x` is the force `x_w x p`, `p` the linear momentum, and the moment `G x_w`, `G = -[w x] Sigma - [h x] [v x]`, `x_w` the
//! angular part of `x`, `w` and `v` angular and linear velocity of the link, `Sigma` and `h` its second and first moments of mass. The operators
//! `B_k` of several links add up.

use super::Chain;
use super::dynamics::InertiaMatrix;
use super::inertia::{LinkInertia, SpatialInertia};
use super::kinematics::LinkPose;
use super::vector::{
    Matrix3, Twist, Vector3, Wrench, add, cross, cross_plus, dot, scaled, turned, turned_back, zero,
};
use crate::number::Number;
use crate::real::{Real, lit};

/// Joint torques of a motion and their derivatives by `q`, `dq` and `ddq`; row `i` of a matrix is of torque `i`.
#[derive(Debug, Clone, Copy)]
pub struct TorqueDerivatives<V, const N: usize> {
    /// Joint torques `M ddq + C dq + g`, N m (N).
    pub torque: [V; N],
    /// Derivatives of the torques by joint positions, `(N, N)`, by rows.
    pub by_position: InertiaMatrix<V, N>,
    /// Derivatives of the torques by joint velocities, `(N, N)`, by rows.
    pub by_velocity: InertiaMatrix<V, N>,
    /// Derivatives of the torques by joint accelerations: the inertia matrix, by rows.
    pub by_acceleration: InertiaMatrix<V, N>,
}

/// Operator `B` of one or several links (Singh, Russell and Wensing 2022): `2 B x = v x* I x + x x* I v - I (v x x)`, `v` the velocity of a link and
/// `I` its spatial inertia, as the matrix of the moment and the linear momentum.
#[derive(Clone, Copy)]
struct VelocityOperator<V> {
    moment: Matrix3<V>,
    momentum: Vector3<V>,
}

impl<V: Number> VelocityOperator<V> {
    #[inline(always)]
    fn zero() -> Self {
        Self { moment: [[zero(); 3]; 3], momentum: [zero(); 3] }
    }

    /// Operator `B` of a link with this spatial inertia and velocity.
    #[inline(always)]
    fn of(inertia: &SpatialInertia<V>, velocity: &Twist<V>) -> Self {
        let (Twist { angular: w, linear: v }, h) = (velocity, &inertia.first);
        let [xx, xy, yy, xz, yz, zz] = inertia.second;
        let half = (xx + yy + zz) * V::of(lit(0.5));
        let second_mass = [[half - xx, -xy, -xz], [-xy, half - yy, -yz], [-xz, -yz, half - zz]];
        // `[h x] [v x] = v h' - (h.v) 1`.
        let along = dot(h, v);
        let mut moment = [[zero(); 3]; 3];
        for c in 0..3 {
            let column = cross(w, &second_mass[c]);
            for r in 0..3 {
                moment[r][c] = -(column[r] + v[r] * h[c]);
            }
            moment[c][c] = moment[c][c] + along;
        }
        Self { moment, momentum: cross_plus(w, h, &scaled(inertia.mass, v)) }
    }

    #[inline(always)]
    fn plus(&self, other: &Self) -> Self {
        let mut moment = self.moment;
        for r in 0..3 {
            moment[r] = add(&moment[r], &other.moment[r]);
        }
        Self { moment, momentum: add(&self.momentum, &other.momentum) }
    }

    /// Force `B x` for the motion vector `x`.
    #[inline(always)]
    fn times(&self, x: &Twist<V>) -> Wrench<V> {
        Wrench { moment: turned(&self.moment, &x.angular), force: cross(&x.angular, &self.momentum) }
    }

    /// Vector `r` for which the power of the force `B x` at `joint` is `r . x_w`, `x_w` the angular part of the motion vector `x`.
    #[inline(always)]
    fn transposed(&self, joint: &Twist<V>) -> Vector3<V> {
        cross_plus(&self.momentum, &joint.linear, &turned_back(&self.moment, &joint.angular))
    }
}

impl<T: Real, const N: usize> Chain<T, N> {
    /// Joint torques of a motion `[q, dq, ddq]`, SI, by inverse dynamics, and their derivatives; `links` are the links' inertial parameters.
    #[inline(always)]
    pub fn torque_derivatives<V: Number<Real = T>>(
        &self,
        links: &[LinkInertia<V>; N],
        [q, dq, ddq]: [&[V; N]; 3],
    ) -> TorqueDerivatives<V, N> {
        let poses: [LinkPose<V>; N] = self.poses(q);
        let motions = self.motions(&poses, dq, Some(ddq));
        let (mut first, mut second) = ([Twist::zero(); N], [Twist::zero(); N]);
        let mut before = self.base_motion();
        for j in 0..N {
            first[j] = before.velocity.cross(&poses[j].joint);
            second[j] = before
                .acceleration
                .cross(&poses[j].joint)
                .scaled_plus(V::of(T::one()), &before.velocity.cross(&first[j]));
            before = motions[j];
        }
        let two = V::of(lit(2.0));
        let none = [[zero(); N]; N];
        let mut all = TorqueDerivatives {
            torque: [zero(); N],
            by_position: none,
            by_velocity: none,
            by_acceleration: none,
        };
        let (mut inertia, mut operator, mut force) =
            (SpatialInertia::zero(), VelocityOperator::zero(), Wrench::zero());
        for j in (0..N).rev() {
            let own = SpatialInertia::of(&links[j], &poses[j]);
            inertia = inertia.plus(&own);
            operator = operator.plus(&VelocityOperator::of(&own, &motions[j].velocity));
            force = force.plus(&motions[j].force(&own));
            let joint = &poses[j].joint;
            all.torque[j] = joint.dot(&force);
            let momentum = inertia.times(joint);
            // Derivatives by this joint, of its own torque and of the torques of inner joints.
            let by_velocity = inertia.times(&first[j]).plus(&operator.times(joint));
            let by_position = joint
                .cross_force(&force)
                .plus(&inertia.times(&second[j]))
                .plus(&operator.times(&first[j]).scaled(two));
            // Derivatives of this joint's torque by inner joints.
            let transposed = scaled(two, &operator.transposed(joint));
            for i in (0..N).take(j + 1) {
                let inner = &poses[i].joint;
                all.by_position[i][j] = inner.dot(&by_position);
                all.by_velocity[i][j] = two * inner.dot(&by_velocity);
                all.by_acceleration[i][j] = inner.dot(&momentum);
                if i != j {
                    all.by_position[j][i] = second[i].dot(&momentum) + dot(&transposed, &first[i].angular);
                    all.by_velocity[j][i] =
                        two.fused(first[i].dot(&momentum), dot(&transposed, &inner.angular));
                    all.by_acceleration[j][i] = all.by_acceleration[i][j];
                }
            }
        }
        all
    }
}
