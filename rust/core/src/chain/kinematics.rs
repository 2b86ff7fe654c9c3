//! Poses of the links, and motion subspaces of the joints, in the base frame.

use super::vector::{Matrix3, Twist, Vector3, cross, of, product, scaled_plus, turned, turned_plus, zero};
use super::{Chain, ChainJoint, JointKind};
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::SinCos;

/// Pose of a link, and motion subspace of its joint, in the base frame.
#[derive(Debug, Clone, Copy)]
pub struct LinkPose<V> {
    /// Rotation matrix that maps vectors of the link frame into the base frame.
    pub rotation: Matrix3<V>,
    /// Origin of the link frame in the base frame, m.
    pub position: Vector3<V>,
    /// Motion subspace of the link's joint: spatial velocity of the link per joint velocity.
    pub joint: Twist<V>,
}

impl<V: Number> LinkPose<V> {
    #[inline(always)]
    fn none() -> Self {
        Self { rotation: [[zero(); 3]; 3], position: [zero(); 3], joint: Twist::zero() }
    }
}

/// Constants of a joint: the rotation from the link frame into that of the parent link is `fixed + cosine cos q + sine sin q` (Rodrigues).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct JointConstants<T> {
    fixed: Matrix3<T>,
    cosine: Matrix3<T>,
    sine: Matrix3<T>,
    /// Unit vector along the joint axis in the parent link's frame.
    pub(super) axis: Vector3<T>,
}

impl<T: Real> JointConstants<T> {
    pub(super) fn of(joint: &ChainJoint<T>) -> Self {
        let (r, a) = (&joint.rotation, &joint.axis);
        let axis = turned(r, a);
        if joint.kind == JointKind::Prismatic {
            let none = [[T::zero(); 3]; 3];
            return Self { fixed: *r, cosine: none, sine: none, axis };
        }
        let (mut fixed, mut cosine, mut sine) = (*r, *r, *r);
        for i in 0..3 {
            for j in 0..3 {
                fixed[i][j] = axis[i] * a[j];
                cosine[i][j] = r[i][j] - fixed[i][j];
            }
            // A row of `r` times the matrix of `a x`.
            sine[i] = cross(&r[i], a);
        }
        Self { fixed, cosine, sine, axis }
    }
}

impl<T: Real> JointConstants<T> {
    /// Rotation from the link frame into that of the parent link at the joint angle with this sine and cosine.
    #[inline(always)]
    pub(super) fn rotation<V: Number<Real = T>>(&self, kind: JointKind, angle: &SinCos<V>) -> Matrix3<V> {
        let mut rotation = [[zero(); 3]; 3];
        for i in 0..3 {
            rotation[i] = of(&self.fixed[i]);
            if kind == JointKind::Revolute {
                for k in 0..3 {
                    let turned = V::of(self.cosine[i][k]).fused(angle.cosine, rotation[i][k]);
                    rotation[i][k] = V::of(self.sine[i][k]).fused(angle.sine, turned);
                }
            }
        }
        rotation
    }
}

impl<T: Real, const N: usize> Chain<T, N> {
    /// Poses of all links at the joint positions `q`, rad or m.
    #[inline(always)]
    pub fn poses<V: Number<Real = T>>(&self, q: &[V; N]) -> [LinkPose<V>; N] {
        let angles = self.angles_of(q);
        let mut sincos = [SinCos { sine: zero(), cosine: zero() }; N];
        for j in 0..N {
            sincos[j] = SinCos::of(angles[j]);
        }
        self.poses_at(&sincos, q)
    }

    /// Angles by which the joints turn, rad: positions of revolute joints, 0 for prismatic joints.
    #[inline(always)]
    pub(super) fn angles_of<V: Number<Real = T>>(&self, q: &[V; N]) -> [V; N] {
        let mut angles = *q;
        for j in 0..N {
            if self.joints[j].kind == JointKind::Prismatic {
                angles[j] = V::of(lit(0.0));
            }
        }
        angles
    }

    /// Poses of all links at the joint positions `q`, rad or m, given the sines and cosines of [`Self::angles_of`].
    #[inline(always)]
    pub(super) fn poses_at<V: Number<Real = T>>(
        &self,
        sincos: &[SinCos<V>; N],
        q: &[V; N],
    ) -> [LinkPose<V>; N] {
        let mut poses = [LinkPose::none(); N];
        let mut parent: Option<(Matrix3<V>, Vector3<V>)> = None;
        for j in 0..N {
            let (joint, constants) = (&self.joints[j], &self.constants[j]);
            let local = constants.rotation(joint.kind, &sincos[j]);
            let (mut rotation, mut position, mut axis) = (local, of(&joint.translation), of(&constants.axis));
            if let Some((turn, origin)) = &parent {
                rotation = product(turn, &local);
                position = turned_plus(turn, &position, origin);
                axis = turned(turn, &axis);
            }
            let subspace = match joint.kind {
                JointKind::Revolute => Twist { angular: axis, linear: cross(&position, &axis) },
                JointKind::Prismatic => {
                    position = scaled_plus(q[j], &axis, &position);
                    Twist { angular: [zero(); 3], linear: axis }
                }
            };
            poses[j] = LinkPose { rotation, position, joint: subspace };
            parent = Some((rotation, position));
        }
        poses
    }
}
