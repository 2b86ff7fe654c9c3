//! Spatial inertia of a link, from its ten inertial parameters.

use super::kinematics::LinkPose;
use super::vector::{
    Twist, Vector3, Wrench, add, cross_plus, dot, negative, product, scaled, scaled_plus, turned, zero,
};
use crate::number::Number;
use crate::real::lit;

/// Number of inertial parameters of a link.
pub const LINK_PARAMETERS: usize = 10;

/// Inertial parameters of a link in the order of Pinocchio: mass, first moments `m c_x, m c_y, m c_z`, and second moments
/// `I_xx, I_xy, I_yy, I_xz, I_yz, I_zz` about the origin of the link frame, all in the axes of the link frame; kg, kg m, kg m^2.
pub type LinkInertia<V> = [V; LINK_PARAMETERS];

/// Spatial inertia of one or several bodies about the origin of the base frame, in the axes of the base frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpatialInertia<V> {
    pub(super) mass: V,
    /// First moments of mass about the origin of the base frame, kg m.
    pub(super) first: Vector3<V>,
    /// Moments of inertia `xx, xy, yy, xz, yz, zz` about the origin of the base frame, kg m^2.
    pub(super) second: [V; 6],
}

impl<V: Number> SpatialInertia<V> {
    /// Zero spatial inertia, of no body.
    #[inline(always)]
    pub(super) fn zero() -> Self {
        Self { mass: zero(), first: [zero(); 3], second: [zero(); 6] }
    }

    /// Spatial inertia, in the base frame, of a link at `pose` with the inertial parameters `link`.
    #[inline(always)]
    pub(super) fn of(link: &LinkInertia<V>, pose: &LinkPose<V>) -> Self {
        let [mass, hx, hy, hz, xx, xy, yy, xz, yz, zz] = *link;
        let (r, p) = (&pose.rotation, &pose.position);
        let first = turned(r, &[hx, hy, hz]);
        let half = product(r, &[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
        // Parallel axis theorem: `2 (p.u) 1 - p u' - u p'`, `p` the position and `u` the first moments plus half of their change by `p`.
        let u = scaled_plus(mass * V::of(lit(0.5)), p, &first);
        let along = [p[0] * u[0], p[1] * u[1], p[2] * u[2]];
        let twice = V::of(lit(2.0));
        let off = |i: usize, j: usize| dot(&half[i], &r[j]) - p[i].fused(u[j], u[i] * p[j]);
        Self {
            mass,
            first: scaled_plus(mass, p, &first),
            second: [
                twice.fused(along[1] + along[2], dot(&half[0], &r[0])),
                off(0, 1),
                twice.fused(along[0] + along[2], dot(&half[1], &r[1])),
                off(0, 2),
                off(1, 2),
                twice.fused(along[0] + along[1], dot(&half[2], &r[2])),
            ],
        }
    }

    /// Spatial inertia of two rigidly connected bodies.
    #[inline(always)]
    pub(super) fn plus(&self, other: &Self) -> Self {
        let mut second = self.second;
        for i in 0..6 {
            second[i] = second[i] + other.second[i];
        }
        Self { mass: self.mass + other.mass, first: add(&self.first, &other.first), second }
    }

    /// Product of the matrix of moments of inertia and the vector `x`.
    #[inline(always)]
    pub(super) fn second_times(&self, x: &Vector3<V>) -> Vector3<V> {
        let [xx, xy, yy, xz, yz, zz] = self.second;
        [dot(&[xx, xy, xz], x), dot(&[xy, yy, yz], x), dot(&[xz, yz, zz], x)]
    }

    /// Spatial inertia times a spatial velocity (momentum) or acceleration (force).
    #[inline(always)]
    pub(super) fn times(&self, motion: &Twist<V>) -> Wrench<V> {
        Wrench {
            moment: cross_plus(&self.first, &motion.linear, &self.second_times(&motion.angular)),
            force: cross_plus(&motion.angular, &self.first, &scaled(self.mass, &motion.linear)),
        }
    }
}

/// Ten inertial parameters of a point mass `mass`, kg, at the position `at`, m, in the link frame.
pub fn point_mass<V: Number>(mass: V, at: Vector3<V>) -> LinkInertia<V> {
    let [x, y, z] = at;
    let [hx, hy, hz] = scaled(mass, &at);
    let [xy, xz, yz] = negative(&[hx * y, hx * z, hy * z]);
    [mass, hx, hy, hz, hy.fused(y, hz * z), xy, hx.fused(x, hz * z), xz, yz, hx.fused(x, hy * y)]
}
