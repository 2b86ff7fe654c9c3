//! Where an arm is, how it moves, and what of its equation follows from that.
//!
//! Sines and cosines of a place near a known one are those of the known one turned on by the difference ([`crate::trig::Rotation`]).

use crate::arm::{Arm, EquationTerms};
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::{NEAR, Rotation, SLIGHT, SinCos};

/// An arm with numbers in the form its equation needs them.
#[derive(Debug, Clone, Copy)]
pub struct RigidArm<V, A, const N: usize, const P: usize> {
    /// The arm.
    pub arm: A,
    /// Parameters, payloads included.
    pub theta: [V; P],
    /// Viscous coefficients.
    pub viscous: [V; N],
    /// Coulomb coefficients.
    pub coulomb: [V; N],
    /// Inertia that is the same everywhere, that added by effects included.
    pub constant_inertia: [[V; N]; N],
    /// Angle by which the base is turned.
    pub tilt: V,
}

impl<V: Number, A: Arm<V::Real, N, P>, const N: usize, const P: usize> RigidArm<V, A, N, P> {
    /// Inertia and `C dq + g`.
    #[inline(always)]
    pub fn equation_terms(&self, joints: &JointState<V, N>) -> EquationTerms<V, N> {
        self.kinematics(joints).equation_terms
    }

    /// A place with all that follows from it.
    #[inline(always)]
    pub fn kinematics(&self, joints: &JointState<V, N>) -> KinematicState<V, N> {
        let angles = self.arm.angles(&joints.q, self.tilt);
        let mut sincos = [SinCos { sine: angles[0], cosine: angles[0] }; N];
        for j in 0..N {
            sincos[j] = SinCos::of(angles[j]);
        }
        self.rotated(joints, sincos)
    }

    /// What turns the arm's angles on where its joints move by so much, and the largest of these angles.
    #[inline(always)]
    pub fn rotations(&self, by: &[V; N], reach: AngleRange) -> ([Rotation<V>; N], V) {
        // Adding -0 is the one sum that a compiler may leave out.
        let angles = self.arm.angles(by, V::of(lit(-0.0)));
        let (mut rotations, mut far) = ([reach.rotation(angles[0]); N], angles[0].size());
        for j in 1..N {
            rotations[j] = reach.rotation(angles[j]);
            far = angles[j].size().larger(far);
        }
        (rotations, far)
    }

    /// A place whose angles have these sines and cosines, with all that follows from it.
    #[inline(always)]
    pub fn rotated(&self, joints: &JointState<V, N>, sincos: [SinCos<V>; N]) -> KinematicState<V, N> {
        let equation_terms =
            self.arm.equation_terms(&self.theta, &self.constant_inertia, &sincos, &joints.dq);
        KinematicState { joints: *joints, sincos, equation_terms }
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> RigidArm<T, A, N, P> {
    /// A place with all that follows from it, turned on from positions with known sines and cosines if it is within reach of them.
    #[inline(always)]
    pub fn near(
        &self,
        joints: &JointState<T, N>,
        q: &[T; N],
        sincos: &[SinCos<T>; N],
        reach: AngleRange,
    ) -> KinematicState<T, N> {
        let mut by = joints.q;
        for j in 0..N {
            by[j] -= q[j];
        }
        let (rotations, far) = self.rotations(&by, reach);
        if reach.part(far) > T::one() {
            return self.kinematics(joints);
        }
        self.rotated(joints, rotated(sincos, &rotations))
    }
}

/// Where joints are and how they move.
#[derive(Debug, Clone, Copy)]
pub struct JointState<V, const N: usize> {
    /// Positions.
    pub q: [V; N],
    /// Velocities.
    pub dq: [V; N],
}

/// A place with all that follows from it.
#[derive(Debug, Clone, Copy)]
pub struct KinematicState<V, const N: usize> {
    /// Positions and velocities.
    pub joints: JointState<V, N>,
    /// Sines and cosines of the angles that the arm's equation depends on.
    pub sincos: [SinCos<V>; N],
    /// Inertia and `C dq + g`.
    pub equation_terms: EquationTerms<V, N>,
}

impl<V: Number, const N: usize> KinematicState<V, N> {
    /// All zero.
    #[inline(always)]
    pub(crate) fn none() -> Self {
        let zero = V::of(lit(0.0));
        let (zeros, inertia) = ([zero; N], [[zero; N]; N]);
        Self {
            joints: JointState { q: zeros, dq: zeros },
            sincos: [SinCos { sine: zero, cosine: zero }; N],
            equation_terms: EquationTerms { inertia, bias: zeros },
        }
    }
}

/// The sines and cosines of angles turned on, each by its rotation.
#[inline(always)]
pub fn rotated<V: Number, const N: usize>(sincos: &[SinCos<V>; N], by: &[Rotation<V>; N]) -> [SinCos<V>; N] {
    let mut rotated = *sincos;
    for j in 0..N {
        rotated[j] = sincos[j].by(&by[j]);
    }
    rotated
}

/// How far it can be from one pose to another; a shorter way takes shorter series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AngleRange {
    /// As far as an arm gets in half a step.
    Near,
    /// As far as the stages of a step are from each other.
    Slight,
}

impl AngleRange {
    /// Largest difference of angles, rad.
    #[inline(always)]
    fn largest(self) -> f64 {
        match self {
            Self::Near => NEAR,
            Self::Slight => SLIGHT,
        }
    }

    /// An angle as a part of the largest: beyond 1, too far.
    #[inline(always)]
    pub fn part<V: Number>(self, angle: V) -> V {
        angle * V::of(lit(1.0 / self.largest()))
    }

    /// What turns on by an angle within reach.
    #[inline(always)]
    fn rotation<V: Number>(self, angle: V) -> Rotation<V> {
        match self {
            Self::Near => Rotation::near(angle),
            Self::Slight => Rotation::slight(angle),
        }
    }
}
