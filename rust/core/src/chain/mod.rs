//! Serial arms of any number of revolute and prismatic joints: open chains of rigid links.
//!
//! Poses, velocities, forces and inertias are spatial vectors and matrices at the origin of the base frame, in the axes of the base frame
//! (Featherstone 2008, section 2), so that those of several links add up without transformations. The inertia matrix follows from the composite rigid
//! body algorithm (section 6.2), bias and inverse dynamics from the recursive Newton-Euler algorithm (section 5.3). Scalars are a
//! [`crate::number::Number`]: of one chain, or of several side by side.
//!
//! [`crate::plant::Plant`] adds friction with stick-slip and effects to a [`Chain`], which is an [`crate::arm::Arm`].

mod arm;
mod derivatives;
mod dynamics;
mod inertia;
mod kinematics;
mod parameters;
mod regressor;
mod vector;

pub use derivatives::TorqueDerivatives;
pub use dynamics::InertiaMatrix;
pub use inertia::{LINK_PARAMETERS, LinkInertia, point_mass};
pub use kinematics::LinkPose;
pub use parameters::{ChainParameter, LINK_NAMES, PARAMETERS_PER_JOINT, parameter};
pub use vector::{Matrix3, Twist, Vector3, Wrench};

use crate::real::Real;
use kinematics::JointConstants;

/// Largest number of joints of a chain whose size is chosen at run time, as in `armgap-fit` and the Python and C interfaces.
pub const MAX_JOINTS: usize = 7;

/// Kind of a joint: revolute or prismatic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// The joint turns about its axis; rad, N m.
    Revolute,
    /// The joint slides along its axis; m, N.
    Prismatic,
}

/// Joint of a chain: its axis, and its frame in the frame of the parent link. At `q = 0` the link frame is the joint frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainJoint<T> {
    /// Kind of the joint: revolute or prismatic.
    pub kind: JointKind,
    /// Rotation matrix, by rows, from the joint frame into the frame of the parent link; for the first joint, into the base frame.
    pub rotation: Matrix3<T>,
    /// Origin of the joint frame in the frame of the parent link, m.
    pub translation: Vector3<T>,
    /// Unit vector along the joint axis, in the joint frame.
    pub axis: Vector3<T>,
}

/// Serial arm with `N` revolute or prismatic joints, under gravity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chain<T, const N: usize> {
    joints: [ChainJoint<T>; N],
    gravity: Vector3<T>,
    constants: [JointConstants<T>; N],
    /// For each link at `q = 0`: scalar product of gravity and the position of the link frame's origin, m^2/s^2, and gravity in the axes of the link
    /// frame, m/s^2.
    reference: [(T, Vector3<T>); N],
}

impl<T: Real, const N: usize> Chain<T, N> {
    /// Chain of `joints`, from the base outwards, under `gravity`, m/s^2, in the base frame. Rotations must be orthogonal and axes of unit
    /// length.
    pub fn new(joints: [ChainJoint<T>; N], gravity: Vector3<T>) -> Self {
        let constants = joints.map(|joint| JointConstants::of(&joint));
        let mut chain = Self { joints, gravity, constants, reference: [(T::zero(), [T::zero(); 3]); N] };
        chain.reference = chain.gravity_along(&[T::zero(); N]);
        chain
    }

    /// Joints of the chain, from the base outwards.
    pub fn joints(&self) -> &[ChainJoint<T>; N] {
        &self.joints
    }

    /// Acceleration of gravity in the base frame, m/s^2.
    pub fn gravity_vector(&self) -> &Vector3<T> {
        &self.gravity
    }

    /// The chain under a changed `gravity`, m/s^2, in the base frame, as when its base is tilted.
    pub fn with_gravity(&self, gravity: Vector3<T>) -> Self {
        Self::new(self.joints, gravity)
    }

    /// For each link at `q`: scalar product of gravity and the position of the link frame's origin, m^2/s^2, and gravity in the axes of the link
    /// frame, m/s^2.
    fn gravity_along(&self, q: &[T; N]) -> [(T, Vector3<T>); N] {
        let along = |pose: LinkPose<T>| {
            (vector::dot(&self.gravity, &pose.position), vector::turned_back(&pose.rotation, &self.gravity))
        };
        self.poses(q).map(along)
    }
}
