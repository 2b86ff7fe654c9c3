//! Kinematic state of an arm, and the terms of its equation of motion that follow from it.
//!
//! Sines and cosines near a known state follow from those of the known state by the addition theorems ([`crate::trig::Rotation`]).

use crate::arm::{Arm, EquationTerms};
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::{NEAR, Rotation, SLIGHT, SinCos};

/// A rigid arm with parameter values in the form its equation of motion needs.
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
    /// Part of the inertia matrix that does not depend on `q`, including what effects add.
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

    /// Kinematic state of these joints.
    #[inline(always)]
    pub fn kinematics(&self, joints: &JointState<V, N>) -> KinematicState<V, N> {
        let angles = self.arm.angles(&joints.q, self.tilt);
        let mut sincos = [SinCos { sine: angles[0], cosine: angles[0] }; N];
        for j in 0..N {
            sincos[j] = SinCos::of(angles[j]);
        }
        self.rotated(joints, sincos)
    }

    /// Rotations of the arm's angles for these joint displacements, and the largest of these angles.
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

    /// Kinematic state of these joints, given the sines and cosines of the arm's angles.
    #[inline(always)]
    pub fn rotated(&self, joints: &JointState<V, N>, sincos: [SinCos<V>; N]) -> KinematicState<V, N> {
        let equation_terms =
            self.arm.equation_terms(&self.theta, &self.constant_inertia, &sincos, &joints.q, &joints.dq);
        KinematicState { joints: *joints, sincos, equation_terms }
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> RigidArm<T, A, N, P> {
    /// Kinematic state of these joints, from positions with known sines and cosines if they are within the angle range.
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

/// Positions and velocities of all joints.
#[derive(Debug, Clone, Copy)]
pub struct JointState<V, const N: usize> {
    /// Positions.
    pub q: [V; N],
    /// Velocities.
    pub dq: [V; N],
}

/// Joint state, sines and cosines, and the terms of the equation of motion at it.
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

/// Sines and cosines of rotated angles.
#[inline(always)]
pub fn rotated<V: Number, const N: usize>(sincos: &[SinCos<V>; N], by: &[Rotation<V>; N]) -> [SinCos<V>; N] {
    let mut rotated = *sincos;
    for j in 0..N {
        rotated[j] = sincos[j].by(&by[j]);
    }
    rotated
}

/// Range of angle differences that a rotation series covers; a smaller range needs fewer terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AngleRange {
    /// Up to the rotation in half a step.
    Near,
    /// Up to the difference between Runge-Kutta stages at the same time.
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

    /// An angle relative to the largest: beyond 1 the series does not hold.
    #[inline(always)]
    pub fn part<V: Number>(self, angle: V) -> V {
        angle * V::of(lit(1.0 / self.largest()))
    }

    /// Rotation by an angle within the range.
    #[inline(always)]
    fn rotation<V: Number>(self, angle: V) -> Rotation<V> {
        match self {
            Self::Near => Rotation::near(angle),
            Self::Slight => Rotation::slight(angle),
        }
    }
}
