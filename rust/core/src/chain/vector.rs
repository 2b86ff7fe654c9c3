//! Vectors of 3, matrices of 3 by 3, and spatial vectors, whose entries are a [`Number`]: one number, or several side by side.
//!
//! Spatial vectors are those of Featherstone 2008, chapter 2, at the origin of the base frame and in the axes of the base frame.

use crate::number::Number;
use crate::real::lit;

/// Vector of three numbers.
pub type Vector3<V> = [V; 3];

/// Matrix of three by three numbers, by rows.
pub type Matrix3<V> = [[V; 3]; 3];

/// Zero in every lane.
#[inline(always)]
pub(super) fn zero<V: Number>() -> V {
    V::of(lit(0.0))
}

/// The vector `x` in every lane.
#[inline(always)]
pub(super) fn of<V: Number>(x: &Vector3<V::Real>) -> Vector3<V> {
    [V::of(x[0]), V::of(x[1]), V::of(x[2])]
}

#[inline(always)]
pub(super) fn add<V: Number>(a: &Vector3<V>, b: &Vector3<V>) -> Vector3<V> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
pub(super) fn subtract<V: Number>(a: &Vector3<V>, b: &Vector3<V>) -> Vector3<V> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
pub(super) fn negative<V: Number>(a: &Vector3<V>) -> Vector3<V> {
    [-a[0], -a[1], -a[2]]
}

/// Vector `s a`.
#[inline(always)]
pub(super) fn scaled<V: Number>(s: V, a: &Vector3<V>) -> Vector3<V> {
    [s * a[0], s * a[1], s * a[2]]
}

/// Vector `s a + b`.
#[inline(always)]
pub(super) fn scaled_plus<V: Number>(s: V, a: &Vector3<V>, b: &Vector3<V>) -> Vector3<V> {
    [s.fused(a[0], b[0]), s.fused(a[1], b[1]), s.fused(a[2], b[2])]
}

#[inline(always)]
pub(super) fn dot<V: Number>(a: &Vector3<V>, b: &Vector3<V>) -> V {
    a[0].fused(b[0], a[1].fused(b[1], a[2] * b[2]))
}

/// Vector product `a x b`.
#[inline(always)]
pub(super) fn cross<V: Number>(a: &Vector3<V>, b: &Vector3<V>) -> Vector3<V> {
    [a[1].fused(b[2], -(a[2] * b[1])), a[2].fused(b[0], -(a[0] * b[2])), a[0].fused(b[1], -(a[1] * b[0]))]
}

/// Vector `a x b + c`.
#[inline(always)]
pub(super) fn cross_plus<V: Number>(a: &Vector3<V>, b: &Vector3<V>, c: &Vector3<V>) -> Vector3<V> {
    [
        a[1].fused(b[2], (-a[2]).fused(b[1], c[0])),
        a[2].fused(b[0], (-a[0]).fused(b[2], c[1])),
        a[0].fused(b[1], (-a[1]).fused(b[0], c[2])),
    ]
}

/// Product `m x` of the matrix `m` and the vector `x`.
#[inline(always)]
pub(super) fn turned<V: Number>(m: &Matrix3<V>, x: &Vector3<V>) -> Vector3<V> {
    [dot(&m[0], x), dot(&m[1], x), dot(&m[2], x)]
}

/// Vector `m x + b`.
#[inline(always)]
pub(super) fn turned_plus<V: Number>(m: &Matrix3<V>, x: &Vector3<V>, b: &Vector3<V>) -> Vector3<V> {
    let row = |i: usize| m[i][0].fused(x[0], m[i][1].fused(x[1], m[i][2].fused(x[2], b[i])));
    [row(0), row(1), row(2)]
}

/// Product `m' x` of the transposed matrix `m` and the vector `x`.
#[inline(always)]
pub(super) fn turned_back<V: Number>(m: &Matrix3<V>, x: &Vector3<V>) -> Vector3<V> {
    scaled_plus(x[0], &m[0], &scaled_plus(x[1], &m[1], &scaled(x[2], &m[2])))
}

/// Product `a b` of two 3 by 3 matrices.
#[inline(always)]
pub(super) fn product<V: Number>(a: &Matrix3<V>, b: &Matrix3<V>) -> Matrix3<V> {
    [turned_back(b, &a[0]), turned_back(b, &a[1]), turned_back(b, &a[2])]
}

/// Spatial motion vector: a velocity, an acceleration, or a joint's motion subspace.
#[derive(Debug, Clone, Copy)]
pub struct Twist<V> {
    /// Angular part of the motion vector, rad/s for a velocity.
    pub angular: Vector3<V>,
    /// Linear part of the motion vector at the origin of the base frame, m/s for a velocity.
    pub linear: Vector3<V>,
}

impl<V: Number> Twist<V> {
    /// Zero spatial motion vector.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { angular: [zero(); 3], linear: [zero(); 3] }
    }

    /// Spatial motion vector `s self + other`.
    #[inline(always)]
    pub(super) fn scaled_plus(&self, s: V, other: &Self) -> Self {
        Self {
            angular: scaled_plus(s, &self.angular, &other.angular),
            linear: scaled_plus(s, &self.linear, &other.linear),
        }
    }

    /// Spatial cross product `self x other`: rate of the motion vector `other` fixed in a body that moves at the spatial velocity `self`.
    #[inline(always)]
    pub(super) fn cross(&self, other: &Self) -> Self {
        Self {
            angular: cross(&self.angular, &other.angular),
            linear: cross_plus(&self.angular, &other.linear, &cross(&self.linear, &other.angular)),
        }
    }

    /// Spatial cross product `self x* force`: rate of the force vector `force` fixed in a body that moves at the spatial velocity `self`.
    #[inline(always)]
    pub(super) fn cross_force(&self, force: &Wrench<V>) -> Wrench<V> {
        Wrench {
            moment: cross_plus(&self.angular, &force.moment, &cross(&self.linear, &force.force)),
            force: cross(&self.angular, &force.force),
        }
    }

    /// Power of the spatial force `force` at the spatial velocity `self`, W.
    #[inline(always)]
    pub(super) fn dot(&self, force: &Wrench<V>) -> V {
        dot(&self.angular, &force.moment) + dot(&self.linear, &force.force)
    }
}

/// Spatial force vector: a moment and a force, or an angular and a linear momentum.
#[derive(Debug, Clone, Copy)]
pub struct Wrench<V> {
    /// Moment about the origin of the base frame, N m; of a momentum the angular momentum, kg m^2/s.
    pub moment: Vector3<V>,
    /// Force, N; of a momentum the linear momentum, kg m/s.
    pub force: Vector3<V>,
}

impl<V: Number> Wrench<V> {
    /// Zero spatial force vector.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { moment: [zero(); 3], force: [zero(); 3] }
    }

    /// Spatial force vector `self + other`.
    #[inline(always)]
    pub(super) fn plus(&self, other: &Self) -> Self {
        Self { moment: add(&self.moment, &other.moment), force: add(&self.force, &other.force) }
    }
    /// Spatial force vector `s self`.
    #[inline(always)]
    pub(super) fn scaled(&self, s: V) -> Self {
        Self { moment: scaled(s, &self.moment), force: scaled(s, &self.force) }
    }
}
