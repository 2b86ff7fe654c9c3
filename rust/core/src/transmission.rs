//! What lies between the motor and the link, and what a joint remembers of its path: states that no encoder shows.
//!
//! A rigid joint has neither. A joint driven through a spring, or through play, has a motor side of its own,
//!
//! ```text
//! inertia d2(u q + twist)/dt2 = tau - transmitted,      transmitted = stiffness twist + damping dtwist
//! ```
//!
//! (Spong 1987), where `u q` is the joint's own position and, as far as the rotor rides on them, that of the joints before, on which the
//! motor reacts with as much of the torque that it does not transmit. Within a play of width `gap` nothing is transmitted, and
//! outside it the flanks push and never pull. A joint with hysteresis remembers a quantity that changes with the distance travelled and
//! with nothing else.

use crate::real::{Real, lit};
use nalgebra::SVector;

/// The motor side of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive<T> {
    /// Inertia of the motor side, seen from the joint.
    pub inertia: T,
    /// Stiffness of the shaft or of the flanks.
    pub stiffness: T,
    /// Damping of the shaft or of the flanks.
    pub damping: T,
    /// Play, both sides together; zero for a shaft without play.
    pub gap: T,
    /// Whether the inertia is a part of the link's nominal inertia rather than an addition to it.
    pub inside: bool,
    /// Part of the turning of the joints before it that the rotor takes part in beside its own: one for a motor that sits on the link before,
    /// next to nothing behind a high gear.
    pub riding: T,
}

impl<T: Real> Drive<T> {
    /// Torque passed on to the link.
    #[inline]
    pub fn transmitted(&self, twist: T, dtwist: T) -> T {
        if self.gap <= T::zero() {
            return self.stiffness * twist + self.damping * dtwist;
        }
        let depth = twist.abs() - self.gap * lit(0.5);
        if depth <= T::zero() {
            return T::zero();
        }
        let side = if twist < T::zero() { -T::one() } else { T::one() };
        side * (self.stiffness * depth + self.damping * side * dtwist).max(T::zero())
    }

    /// How the rotor of joint `j` turns as the joints of a planar chain do, per unit of each.
    #[inline]
    pub fn lever<const N: usize>(&self, j: usize) -> [T; N] {
        core::array::from_fn(|k| match k.cmp(&j) {
            core::cmp::Ordering::Less => self.riding,
            core::cmp::Ordering::Equal => T::one(),
            core::cmp::Ordering::Greater => T::zero(),
        })
    }

    /// How far the rotor may turn to either side of the middle of its play.
    #[inline]
    pub fn half_gap(&self) -> T {
        self.gap * lit(0.5)
    }

    /// Natural frequency against a link of this inertia, 1/s.
    pub fn rate(&self, link: T) -> T {
        let spread = T::one() / self.inertia + T::one() / link;
        (self.stiffness * spread).sqrt().max(self.damping * spread)
    }
}

/// States of the joints that no encoder shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hidden<T, const N: usize> {
    /// What each joint remembers of its path, as it was at `anchor`.
    pub memory: SVector<T, N>,
    /// Position at which `memory` holds.
    pub anchor: SVector<T, N>,
    /// Motor position less joint position.
    pub twist: SVector<T, N>,
    /// Its rate.
    pub dtwist: SVector<T, N>,
    /// The flank that carries where a play is closed, -1 or 1; zero where none does.
    pub side: SVector<T, N>,
}

impl<T: Real, const N: usize> Hidden<T, N> {
    /// Nothing remembered and nothing twisted at `q`.
    pub fn none(q: SVector<T, N>) -> Self {
        let zero = SVector::zeros();
        Self { memory: zero, anchor: q, twist: zero, dtwist: zero, side: zero }
    }
}
