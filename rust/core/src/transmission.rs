//! What lies between the motor and the link, and what a joint remembers of its path: states that no encoder shows.
//!
//! A rigid joint has neither. A joint driven through a spring, or through play, has a motor side of its own,
//!
//! ```text
//! inertia d2(u q + twist)/dt2 = tau - transmitted,      transmitted = stiffness twist + damping dtwist
//! ```
//!
//! (Spong 1987), where `u q` is the joint's own position and, as far as the rotor rides on them, that of the joints before, on which the
//! motor reacts with as much of the torque that it does not transmit. Within a play of width `backlash` nothing is transmitted, and
//! outside it the flanks push and never pull. A joint with hysteresis remembers a quantity that changes with the distance travelled and
//! with nothing else.

use crate::real::{Real, lit};
use nalgebra::SVector;

/// The motor side of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmission<T> {
    /// Inertia of the motor side, seen from the joint.
    pub inertia: T,
    /// Stiffness of the shaft or of the flanks.
    pub stiffness: T,
    /// Damping of the shaft or of the flanks.
    pub damping: T,
    /// Play, both sides together; zero for a shaft without play.
    pub backlash: T,
    /// Whether the inertia is a part of the link's nominal inertia rather than an addition to it.
    pub part_of_link: bool,
    /// Part of the turning of the joints before it that the rotor takes part in beside its own: one for a motor that sits on the link before,
    /// next to nothing behind a high gear.
    pub coupling_ratio: T,
}

impl<T: Real> Transmission<T> {
    /// Torque passed on to the link.
    #[inline]
    pub fn transmitted(&self, deflection: T, deflection_rate: T) -> T {
        if self.backlash <= T::zero() {
            return self.stiffness * deflection + self.damping * deflection_rate;
        }
        let depth = deflection.abs() - self.backlash * lit(0.5);
        if depth <= T::zero() {
            return T::zero();
        }
        let side = if deflection < T::zero() { -T::one() } else { T::one() };
        side * (self.stiffness * depth + self.damping * side * deflection_rate).max(T::zero())
    }

    /// How the rotor of joint `j` turns as the joints of a planar chain do, per unit of each.
    #[inline]
    pub fn rotor_jacobian<const N: usize>(&self, j: usize) -> [T; N] {
        core::array::from_fn(|k| match k.cmp(&j) {
            core::cmp::Ordering::Less => self.coupling_ratio,
            core::cmp::Ordering::Equal => T::one(),
            core::cmp::Ordering::Greater => T::zero(),
        })
    }

    /// How far the rotor may turn to either side of the middle of its play.
    #[inline]
    pub fn half_backlash(&self) -> T {
        self.backlash * lit(0.5)
    }

    /// Natural frequency against a link of this inertia, 1/s.
    pub fn rate(&self, link: T) -> T {
        let spread = T::one() / self.inertia + T::one() / link;
        (self.stiffness * spread).sqrt().max(self.damping * spread)
    }
}

/// States of the joints that no encoder shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatentState<T, const N: usize> {
    /// What each joint remembers of its path, as it was at `anchor`.
    pub memory: SVector<T, N>,
    /// Position at which `memory` holds.
    pub anchor: SVector<T, N>,
    /// Motor position less joint position.
    pub deflection: SVector<T, N>,
    /// Its rate.
    pub deflection_rate: SVector<T, N>,
    /// The flank that carries where a play is closed, -1 or 1; zero where none does.
    pub side: SVector<T, N>,
}

impl<T: Real, const N: usize> LatentState<T, N> {
    /// Nothing remembered and nothing twisted at `q`.
    pub fn none(q: SVector<T, N>) -> Self {
        let zero = SVector::zeros();
        Self { memory: zero, anchor: q, deflection: zero, deflection_rate: zero, side: zero }
    }
}
