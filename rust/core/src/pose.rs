//! Where an arm is, how it moves, and what of its equation follows from that.
//!
//! Sines and cosines of a place near a known one are those of the known one turned on by the difference ([`crate::trig::Turn`]).

use crate::arm::{Arm, Balance};
use crate::number::Number;
use crate::real::lit;
use crate::trig::{NEAR, SLIGHT, Turn};

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

    /// The pose at a place which is `by` further on than a known pose, and how far that is: beyond 1, too far.
    #[inline(always)]
    pub fn near(
        &self,
        known: &Pose<V, N>,
        place: &Place<V, N>,
        by: &[V; N],
        reach: Reach,
    ) -> (Pose<V, N>, V) {
        let zero = V::of(lit(0.0));
        let angles = self.arm.angles(by, zero);
        let (mut turns, mut far) = (known.turns, zero);
        for j in 0..N {
            turns[j] = match reach {
                Reach::Near => turns[j].by(angles[j]),
                Reach::Beside => turns[j].slightly_by(angles[j]),
            };
            far = angles[j].size().larger(far);
        }
        (self.turned(place, turns), far * V::of(lit(1.0 / reach.largest())))
    }

    #[inline(always)]
    fn turned(&self, place: &Place<V, N>, turns: [Turn<V>; N]) -> Pose<V, N> {
        let balance = self.arm.balance(&self.theta, &self.steady, &turns, &place.dq);
        Pose { place: *place, turns, balance }
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

/// How far it can be from one pose to another; a shorter way takes shorter series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// As far as an arm gets in a step.
    Near,
    /// As far as the stages of a step are from each other.
    Beside,
}

impl Reach {
    /// Largest difference of angles, rad.
    #[inline(always)]
    pub fn largest(self) -> f64 {
        match self {
            Self::Near => NEAR,
            Self::Beside => SLIGHT,
        }
    }
}
