//! Kinematic state of an arm, and the terms of its equation of motion that follow from it.
//!
//! Sines and cosines near a known state are those of the known state, rotated by the addition theorems ([`crate::trig::Rotation`]).

use crate::arm::{Arm, EquationTerms};
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::{NEAR, Rotation, SLIGHT, SinCos};

/// Rigid arm with parameter values in the form that its equation of motion needs.
#[derive(Debug, Clone, Copy)]
pub struct RigidArm<V, A, const N: usize, const P: usize> {
    /// Kind of arm, with its gravity and geometry.
    pub arm: A,
    /// Parameters of the arm, payloads included, SI.
    pub theta: [V; P],
    /// Viscous coefficients of the joints, N m s/rad (N s/m).
    pub viscous: [V; N],
    /// Coulomb coefficients of the joints, N m (N).
    pub coulomb: [V; N],
    /// Part of the inertia matrix that does not depend on `q`, inertia added by effects included, by rows, kg m^2 (kg).
    pub constant_inertia: [[V; N]; N],
    /// Angle by which the base is turned in the plane of motion, rad.
    pub tilt: V,
}

impl<V: Number, A: Arm<V::Real, N, P>, const N: usize, const P: usize> RigidArm<V, A, N, P> {
    /// Inertia matrix and bias `C dq + g` at the joint state `joints`.
    #[inline(always)]
    pub fn equation_terms(&self, joints: &JointState<V, N>) -> EquationTerms<V, N> {
        self.kinematics(joints).equation_terms
    }

    /// Kinematic state at the joint state `joints`.
    #[inline(always)]
    pub fn kinematics(&self, joints: &JointState<V, N>) -> KinematicState<V, N> {
        let angles = self.arm.angles(&joints.q, self.tilt);
        let mut sincos = [SinCos { sine: angles[0], cosine: angles[0] }; N];
        for j in 0..N {
            sincos[j] = SinCos::of(angles[j]);
        }
        self.rotated(joints, sincos)
    }

    /// Rotations by which the arm's angles change when the joints move by `by`, rad or m, and the largest absolute rotation angle, rad.
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

    /// Kinematic state at the joint state `joints`, given the sines and cosines of the arm's angles.
    #[inline(always)]
    pub fn rotated(&self, joints: &JointState<V, N>, sincos: [SinCos<V>; N]) -> KinematicState<V, N> {
        let equation_terms =
            self.arm.equation_terms(&self.theta, &self.constant_inertia, &sincos, &joints.q, &joints.dq);
        KinematicState { joints: *joints, sincos, equation_terms }
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> RigidArm<T, A, N, P> {
    /// Kinematic state at the joint state `joints`, from sines and cosines known at the positions `q` if the angles between `q` and the joint state
    /// are within the range `reach`.
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

    /// Load of each joint, N m (N), at the accelerations `ddq`, given inertia matrix and bias of the arm without further rotors: the torque that its
    /// transmission passes on to the link, or the bias where the arm's parameters do not tell that ([`Arm::ROTORS_APART`]).
    #[inline]
    pub fn loads(&self, equation_terms: &EquationTerms<T, N>, ddq: &[T; N]) -> [T; N] {
        let mut loads = equation_terms.bias;
        if A::ROTORS_APART {
            for (j, load) in loads.iter_mut().enumerate() {
                for k in 0..N {
                    *load += (equation_terms.inertia[j][k] - self.constant_inertia[j][k]) * ddq[k];
                }
            }
        }
        loads
    }
}

/// Positions and velocities of all joints.
#[derive(Debug, Clone, Copy)]
pub struct JointState<V, const N: usize> {
    /// Joint positions, rad or m.
    pub q: [V; N],
    /// Joint velocities, rad/s or m/s.
    pub dq: [V; N],
}

/// Joint state with sines and cosines of the arm's angles, inertia matrix and bias.
#[derive(Debug, Clone, Copy)]
pub struct KinematicState<V, const N: usize> {
    /// Positions and velocities of all joints.
    pub joints: JointState<V, N>,
    /// Sines and cosines of the angles that the arm's equation of motion depends on.
    pub sincos: [SinCos<V>; N],
    /// Inertia matrix and bias `C dq + g`.
    pub equation_terms: EquationTerms<V, N>,
}

impl<V: Number, const N: usize> KinematicState<V, N> {
    /// Kinematic state of zeros, to be overwritten.
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

/// Sines and cosines of angles after the rotations `by`.
#[inline(always)]
pub fn rotated<V: Number, const N: usize>(sincos: &[SinCos<V>; N], by: &[Rotation<V>; N]) -> [SinCos<V>; N] {
    let mut rotated = *sincos;
    for j in 0..N {
        rotated[j] = sincos[j].by(&by[j]);
    }
    rotated
}

/// Range of angles that a series of [`Rotation`] covers; a smaller range needs fewer terms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AngleRange {
    /// Up to the rotation in half an integration step, 0.1 rad.
    Near,
    /// Up to the angle between two Runge-Kutta stages at the same time, 0.0125 rad.
    Slight,
}

impl AngleRange {
    /// Largest angle of the range, rad.
    #[inline(always)]
    fn largest(self) -> f64 {
        match self {
            Self::Near => NEAR,
            Self::Slight => SLIGHT,
        }
    }

    /// An angle, rad, divided by the largest angle of the range; above 1 the series of [`Rotation`] is not accurate.
    #[inline(always)]
    pub fn part<V: Number>(self, angle: V) -> V {
        angle * V::of(lit(1.0 / self.largest()))
    }

    /// Rotation by an angle within the range, rad.
    #[inline(always)]
    fn rotation<V: Number>(self, angle: V) -> Rotation<V> {
        match self {
            Self::Near => Rotation::near(angle),
            Self::Slight => Rotation::slight(angle),
        }
    }
}
