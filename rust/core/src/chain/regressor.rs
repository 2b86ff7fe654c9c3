//! Regressors of a chain: rows by which torques, momenta and energies are linear in the ten inertial parameters of each link.
//!
//! For the origin of a link's frame, with `a` the classical acceleration less gravity, `w` the angular velocity and `alpha` the angular acceleration,
//! in the axes of the link frame, the link needs the force `m a + (alpha x + w x w x) h` and about the origin the moment `h x a + I alpha + w x I w`,
//! `m` mass, `h` first and `I` second moments (Siciliano 2009, section 7.2). A torque row is the power of this force and moment along the motion
//! subspace of a joint.

use super::inertia::LinkInertia;
use super::kinematics::LinkPose;
use super::vector::{
    Matrix3, Twist, Vector3, add, cross, cross_plus, dot, of, scaled_plus, subtract, turned_back, zero,
};
use super::{Chain, JointKind};
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::SinCos;

impl<T: Real, const N: usize> Chain<T, N> {
    /// Torque regressor at a motion `[q, dq, ddq]`: calls `put(i, k, row)` for every joint `i` and link `k >= i`, such that the sum over `k` of `row
    /// . links[k]` is the torque of joint `i` by [`Chain::inverse_dynamics`]. Inner links, `k < i`, do not load joint `i`.
    #[inline(always)]
    pub fn torque_regressor<V: Number<Real = T>>(
        &self,
        [q, dq, ddq]: [&[V; N]; 3],
        mut put: impl FnMut(usize, usize, LinkInertia<V>),
    ) {
        let poses = self.poses(q);
        let motions = self.motions(&poses, dq, Some(ddq));
        for k in 0..N {
            let pose = &poses[k];
            let (velocity, acceleration) =
                (in_link(&motions[k].velocity, pose), in_link(&motions[k].acceleration, pose));
            let (w, alpha) = (&velocity.angular, &acceleration.angular);
            let a = cross_plus(w, &velocity.linear, &acceleration.linear);
            let force = first_moments_force(w, alpha);
            let moment = second_moments_moment(w, alpha);
            for i in (0..N).take(k + 1) {
                let Twist { angular, linear } = in_link(&poses[i].joint, pose);
                let h = cross_plus(&a, &angular, &turned_back(&force, &linear));
                let mut row = [dot(&linear, &a), h[0], h[1], h[2], a[0], a[0], a[0], a[0], a[0], a[0]];
                for c in 0..6 {
                    row[4 + c] = dot(&angular, &moment[c]);
                }
                put(i, k, row);
            }
        }
    }

    /// Regressors of the momentum `M dq` and of `g - dK/dq`, `K` the kinetic energy: calls `put(i, k, momentum, potential)` for every joint `i` and
    /// link `k >= i`. The time derivative of the momentum plus `g - dK/dq` is the torque.
    #[inline(always)]
    pub fn momentum_regressors<V: Number<Real = T>>(
        &self,
        q: &[V; N],
        dq: &[V; N],
        mut put: impl FnMut(usize, usize, LinkInertia<V>, LinkInertia<V>),
    ) {
        let poses = self.poses(q);
        let motions = self.motions(&poses, dq, None);
        let gravity = of::<V>(&self.gravity);
        let mut rates = [Twist::zero(); N];
        for k in 0..N {
            rates[k] = motions[k].velocity.cross(&poses[k].joint);
            let (velocity, g) =
                (in_link(&motions[k].velocity, &poses[k]), turned_back(&poses[k].rotation, &gravity));
            for i in (0..N).take(k + 1) {
                let joint = in_link(&poses[i].joint, &poses[k]);
                let momentum = momentum_row(&joint, &velocity);
                // `dK/dq_i` is the momentum along the rate of joint `i`'s motion subspace.
                let mut potential = momentum_row(&in_link(&rates[i], &poses[k]), &velocity).map(|x| -x);
                let weight = cross(&g, &joint.angular);
                potential[0] = potential[0] - dot(&g, &joint.linear);
                for c in 0..3 {
                    potential[1 + c] = potential[1 + c] - weight[c];
                }
                put(i, k, momentum, potential);
            }
        }
    }

    /// The same regressors, column by column, with joints side by side in lanes; `units[k]` is one in the lane of joint `k`, else zero. Calls
    /// `put(k, momentum, potential)` for every link `k` with ten columns of each.
    ///
    /// The joints' motion subspaces and their rates go from link to link in the axes of each.
    #[inline(always)]
    pub(super) fn momentum_columns<V: Number<Real = T>>(
        &self,
        sincos: &[SinCos<T>; N],
        [q, dq]: [&[T; N]; 2],
        units: &[V; N],
        mut put: impl FnMut(usize, LinkInertia<V>, LinkInertia<V>),
    ) {
        let (mut joints, mut rates, mut velocity) = (Twist::zero(), Twist::zero(), Twist::zero());
        let mut gravity = of::<V>(&self.gravity);
        for k in 0..N {
            let (joint, constants) = (&self.joints[k], &self.constants[k]);
            let angle = SinCos { sine: V::of(sincos[k].sine), cosine: V::of(sincos[k].cosine) };
            let rotation = constants.rotation(joint.kind, &angle);
            let (mut step, axis) = (of(&joint.translation), of(&joint.axis));
            if joint.kind == JointKind::Prismatic {
                step = scaled_plus(V::of(q[k]), &of(&constants.axis), &step);
            }
            let outwards = (&rotation, &step);
            let own = match joint.kind {
                JointKind::Revolute => Twist { angular: axis, linear: [zero(); 3] },
                JointKind::Prismatic => Twist { angular: [zero(); 3], linear: axis },
            };
            velocity = own.scaled_plus(V::of(dq[k]), &in_next(&velocity, outwards));
            joints = own.scaled_plus(units[k], &in_next(&joints, outwards));
            rates = velocity.cross(&own).scaled_plus(units[k], &in_next(&rates, outwards));
            gravity = turned_back(&rotation, &gravity);
            let momentum = momentum_row(&joints, &velocity);
            let mut potential = momentum_row(&rates, &velocity).map(|x| -x);
            let weight = cross(&gravity, &joints.angular);
            potential[0] = potential[0] - dot(&gravity, &joints.linear);
            for c in 0..3 {
                potential[1 + c] = potential[1 + c] - weight[c];
            }
            put(k, momentum, potential);
        }
    }

    /// Regressor of the links' kinetic and potential energy, J, zero at rest at `q = 0`: row `k` times `links[k]`, summed over all links.
    #[inline(always)]
    pub fn links_energy_regressor<V: Number<Real = T>>(
        &self,
        q: &[V; N],
        dq: &[V; N],
    ) -> [LinkInertia<V>; N] {
        let (angles, mut rows) = (self.angles_of(q), [[zero(); 10]; N]);
        self.link_energies(|j| (SinCos::of(angles[j]), q[j], dq[j]), |k, row| rows[k] = row);
        rows
    }

    /// Rows of [`Self::links_energy_regressor`], given sine and cosine of the angle ([`Self::angles_of`]), position and velocity of every
    /// joint as `state(j)`: calls `put(k, row)` for every link `k`.
    ///
    /// Energies need no vectors of several links in one frame, so velocity and gravity go from link to link in the axes of each (Luh, Walker and Paul
    /// 1980).
    #[inline(always)]
    pub(super) fn link_energies<V: Number<Real = T>>(
        &self,
        state: impl Fn(usize) -> (SinCos<V>, V, V),
        mut put: impl FnMut(usize, LinkInertia<V>),
    ) {
        let half = V::of(lit(0.5));
        let (mut w, mut v, mut gravity) = ([zero(); 3], [zero(); 3], of::<V>(&self.gravity));
        // Scalar product of gravity and the position of the link frame's origin, m^2/s^2.
        let mut along = zero();
        for k in 0..N {
            let (joint, constants) = (&self.joints[k], &self.constants[k]);
            let (angle, position, rate) = state(k);
            let rotation = constants.rotation(joint.kind, &angle);
            let (mut step, axis) = (of(&joint.translation), of(&joint.axis));
            if joint.kind == JointKind::Prismatic {
                step = scaled_plus(position, &of(&constants.axis), &step);
            }
            along = along + dot(&gravity, &step);
            v = turned_back(&rotation, &cross_plus(&w, &step, &v));
            w = turned_back(&rotation, &w);
            gravity = turned_back(&rotation, &gravity);
            match joint.kind {
                JointKind::Revolute => w = scaled_plus(rate, &axis, &w),
                JointKind::Prismatic => v = scaled_plus(rate, &axis, &v),
            }
            let (height, turned_gravity) = &self.reference[k];
            let [hx, hy, hz] = cross_plus(&v, &w, &subtract(&of(turned_gravity), &gravity));
            put(
                k,
                [
                    half.fused(dot(&v, &v), V::of(*height) - along),
                    hx,
                    hy,
                    hz,
                    half * w[0] * w[0],
                    w[0] * w[1],
                    half * w[1] * w[1],
                    w[0] * w[2],
                    w[1] * w[2],
                    half * w[2] * w[2],
                ],
            );
        }
    }
}

/// Spatial motion vector at the origin of a link's frame in the axes of the link, from `motion` at the origin of the base frame.
#[inline(always)]
fn in_link<V: Number>(motion: &Twist<V>, pose: &LinkPose<V>) -> Twist<V> {
    let at_origin = cross_plus(&motion.angular, &pose.position, &motion.linear);
    Twist {
        angular: turned_back(&pose.rotation, &motion.angular),
        linear: turned_back(&pose.rotation, &at_origin),
    }
}

/// Spatial motion vector at the origin of a link's frame in the axes of the link, from `motion` in the frame of its parent link, in which the link's
/// frame has the orientation `rotation` and the origin `step`.
#[inline(always)]
fn in_next<V: Number>(motion: &Twist<V>, (rotation, step): (&Matrix3<V>, &Vector3<V>)) -> Twist<V> {
    Twist {
        angular: turned_back(rotation, &motion.angular),
        linear: turned_back(rotation, &cross_plus(&motion.angular, step, &motion.linear)),
    }
}

/// Momentum of a link along the motion subspace `joint` as a row over the link's ten inertial parameters; the link moves at `velocity`.
#[inline(always)]
fn momentum_row<V: Number>(joint: &Twist<V>, velocity: &Twist<V>) -> LinkInertia<V> {
    let (w, own) = (&velocity.angular, &joint.angular);
    let h = add(&cross(&joint.linear, w), &cross(&velocity.linear, own));
    let sum = |i: usize, j: usize| own[i].fused(w[j], own[j] * w[i]);
    [
        dot(&joint.linear, &velocity.linear),
        h[0],
        h[1],
        h[2],
        own[0] * w[0],
        sum(0, 1),
        own[1] * w[1],
        sum(0, 2),
        sum(1, 2),
        own[2] * w[2],
    ]
}

/// Matrix `[alpha x] + [w x] [w x]`: times the first moments of a link, the force due to them at angular velocity `w` and angular acceleration
/// `alpha`.
#[inline(always)]
fn first_moments_force<V: Number>(w: &Vector3<V>, alpha: &Vector3<V>) -> [Vector3<V>; 3] {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = squares(w);
    [
        [-(yy + zz), xy - alpha[2], xz + alpha[1]],
        [xy + alpha[2], -(xx + zz), yz - alpha[0]],
        [xz - alpha[1], yz + alpha[0], -(xx + yy)],
    ]
}

/// Moments `I alpha + w x I w` for a unit value of each of `I_xx, I_xy, I_yy, I_xz, I_yz, I_zz`.
#[inline(always)]
fn second_moments_moment<V: Number>(w: &Vector3<V>, alpha: &Vector3<V>) -> [Vector3<V>; 6] {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = squares(w);
    let [x, y, z] = *alpha;
    [
        [x, xz, -xy],
        [y - xz, x + yz, xx - yy],
        [-yz, y, xy],
        [z + xy, zz - xx, x - yz],
        [yy - zz, z - xy, y + xz],
        [yz, -xz, z],
    ]
}

/// Outer product `w w'` of the vector `w`, by rows.
#[inline(always)]
fn squares<V: Number>(w: &Vector3<V>) -> [Vector3<V>; 3] {
    let [x, y, z] = *w;
    [[x * x, x * y, x * z], [x * y, y * y, y * z], [x * z, y * z, z * z]]
}
