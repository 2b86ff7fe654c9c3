//! Where an arm is, how it moves, and what of its equation follows from that.
//!
//! Sines and cosines of a place near a known one are those of the known one turned on by the difference ([`crate::trig::Rotation`]).

use crate::arm::{Arm, Balance};
use crate::number::Number;
use crate::real::{Real, lit};
use crate::trig::{NEAR, Rotation, SLIGHT, Turn};

/// An arm with numbers in the form its equation needs them.
#[derive(Debug, Clone, Copy)]
pub struct Rigid<V, A, const N: usize, const P: usize> {
    /// The arm.
    pub arm: A,
    /// Parameters, payloads included.
    pub theta: [V; P],
    /// Viscous coefficients.
    pub viscous: [V; N],
    /// Coulomb coefficients.
    pub coulomb: [V; N],
    /// Inertia that is the same everywhere, that added by effects included.
    pub steady: [[V; N]; N],
    /// Angle by which the base is turned.
    pub tilt: V,
}

impl<V: Number, A: Arm<V::Real, N, P>, const N: usize, const P: usize> Rigid<V, A, N, P> {
    /// Inertia and `C dq + g`.
    #[inline(always)]
    pub fn balance(&self, place: &Place<V, N>) -> Balance<V, N> {
        self.pose(place).balance
    }

    /// A place with all that follows from it.
    #[inline(always)]
    pub fn pose(&self, place: &Place<V, N>) -> Pose<V, N> {
        let angles = self.arm.angles(&place.q, self.tilt);
        let mut turns = [Turn { sine: angles[0], cosine: angles[0] }; N];
        for j in 0..N {
            turns[j] = Turn::of(angles[j]);
        }
        self.turned(place, turns)
    }

    /// What turns the arm's angles on where its joints move by so much, and the largest of these angles.
    #[inline(always)]
    pub fn rotations(&self, by: &[V; N], reach: Reach) -> ([Rotation<V>; N], V) {
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
    pub fn turned(&self, place: &Place<V, N>, turns: [Turn<V>; N]) -> Pose<V, N> {
        let balance = self.arm.balance(&self.theta, &self.steady, &turns, &place.dq);
        Pose { place: *place, turns, balance }
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Rigid<T, A, N, P> {
    /// A place with all that follows from it, turned on from positions with known sines and cosines if it is within reach of them.
    #[inline(always)]
    pub fn near(&self, place: &Place<T, N>, q: &[T; N], turns: &[Turn<T>; N], reach: Reach) -> Pose<T, N> {
        let mut by = place.q;
        for j in 0..N {
            by[j] -= q[j];
        }
        let (rotations, far) = self.rotations(&by, reach);
        if reach.part(far) > T::one() {
            return self.pose(place);
        }
        self.turned(place, turned(turns, &rotations))
    }
}

/// Where joints are and how they move.
#[derive(Debug, Clone, Copy)]
pub struct Place<V, const N: usize> {
    /// Positions.
    pub q: [V; N],
    /// Velocities.
    pub dq: [V; N],
}

/// A place with all that follows from it.
#[derive(Debug, Clone, Copy)]
pub struct Pose<V, const N: usize> {
    /// Positions and velocities.
    pub place: Place<V, N>,
    /// Sines and cosines of the angles that the arm's equation depends on.
    pub turns: [Turn<V>; N],
    /// Inertia and `C dq + g`.
    pub balance: Balance<V, N>,
}

impl<V: Number, const N: usize> Pose<V, N> {
    /// All zero.
    #[inline(always)]
    pub(crate) fn none() -> Self {
        let zero = V::of(lit(0.0));
        let (zeros, inertia) = ([zero; N], [[zero; N]; N]);
        Self {
            place: Place { q: zeros, dq: zeros },
            turns: [Turn { sine: zero, cosine: zero }; N],
            balance: Balance { inertia, bias: zeros },
        }
    }
}

/// The sines and cosines of angles turned on, each by its rotation.
#[inline(always)]
pub fn turned<V: Number, const N: usize>(turns: &[Turn<V>; N], by: &[Rotation<V>; N]) -> [Turn<V>; N] {
    let mut turned = *turns;
    for j in 0..N {
        turned[j] = turns[j].by(&by[j]);
    }
    turned
}

/// How far it can be from one pose to another; a shorter way takes shorter series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// As far as an arm gets in half a step.
    Near,
    /// As far as the stages of a step are from each other.
    Beside,
}

impl Reach {
    /// Largest difference of angles, rad.
    #[inline(always)]
    fn largest(self) -> f64 {
        match self {
            Self::Near => NEAR,
            Self::Beside => SLIGHT,
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
            Self::Beside => Rotation::slight(angle),
        }
    }
}
