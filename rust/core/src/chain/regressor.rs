//! Regressors of a chain: rows by which torques, momenta and energies are linear in the ten inertial parameters of each link.
//!
//! For the origin of a link's frame, with `a` the classical acceleration less gravity, `w` the angular velocity and `alpha` the angular acceleration,
//! in the axes of the link frame, the link needs the force `m a + (alpha x + w x w x) h` and about the origin the moment `h x a + I alpha + w x I w`,
//! `m` mass, `h` first and `I` second moments (Siciliano 2009, section 7.2). A torque row is the power of this force and moment along the motion
//! subspace of a joint.

use super::Chain;
use super::inertia::LinkInertia;
use super::kinematics::LinkPose;
use super::vector::{Twist, Vector3, add, cross, cross_plus, dot, of, subtract, turned_back, zero};
use crate::number::Number;
use crate::real::{Real, lit};

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

    /// Regressor of the links' kinetic and potential energy, J, zero at rest at `q = 0`: row `k` times `links[k]`, summed over all links.
    #[inline(always)]
    pub fn links_energy_regressor<V: Number<Real = T>>(
        &self,
        q: &[V; N],
        dq: &[V; N],
    ) -> [LinkInertia<V>; N] {
        let poses = self.poses(q);
        let motions = self.motions(&poses, dq, None);
        let (gravity, half) = (of::<V>(&self.gravity), V::of(lit(0.5)));
        let mut rows = [[zero(); 10]; N];
        for k in 0..N {
            let Twist { angular: w, linear: v } = in_link(&motions[k].velocity, &poses[k]);
            let (height, turned_gravity) = &self.reference[k];
            let rise = V::of(*height) - dot(&gravity, &poses[k].position);
            let fall = subtract(&of(turned_gravity), &turned_back(&poses[k].rotation, &gravity));
            let [hx, hy, hz] = cross_plus(&v, &w, &fall);
            rows[k] = [
                half.fused(dot(&v, &v), rise),
                hx,
                hy,
                hz,
                half * w[0] * w[0],
                w[0] * w[1],
                half * w[1] * w[1],
                w[0] * w[2],
                w[1] * w[2],
                half * w[2] * w[2],
            ];
        }
        rows
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
