//! Transmission between motor and link, and hysteresis of a joint: latent states, which no encoder measures.
//!
//! A rigid joint has neither. A joint driven through a spring, or through backlash, has a rotor of its own,
//!
//! ```text
//! inertia d2(u q + deflection)/dt2 = tau - transmitted,      transmitted = stiffness deflection + damping d(deflection)/dt
//! ```
//!
//! (Spong 1987), where `u` is the rotor Jacobian: 1 for the joint's own position and the coupling ratio for the joints before, on which the
//! motor reacts with the same share of the torque that it does not transmit. Within a backlash of width `backlash` nothing is transmitted;
//! outside it the flanks push and never pull. The hysteresis state of a joint changes with the distance travelled and with nothing else.

use crate::real::{Real, lit};
use nalgebra::SVector;

/// Transmission of a joint, with its rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmission<T> {
    /// Inertia of the rotor, seen from the joint.
    pub inertia: T,
    /// Stiffness of the shaft or of the flanks.
    pub stiffness: T,
    /// Damping of the shaft or of the flanks.
    pub damping: T,
    /// Backlash, both sides together; zero for a shaft without backlash.
    pub backlash: T,
    /// Whether the rotor's inertia is a part of the link's nominal inertia rather than an addition to it.
    pub part_of_link: bool,
    /// Coupling ratio: rotor velocity per velocity of each joint before its own; 1 for a motor that sits on the link before, about 0
    /// behind a high gear ratio.
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

    /// Rotor Jacobian of joint `j` in a planar chain: rotor velocity per velocity of each joint.
    #[inline]
    pub fn rotor_jacobian<const N: usize>(&self, j: usize) -> [T; N] {
        core::array::from_fn(|k| match k.cmp(&j) {
            core::cmp::Ordering::Less => self.coupling_ratio,
            core::cmp::Ordering::Equal => T::one(),
            core::cmp::Ordering::Greater => T::zero(),
        })
    }

    /// Half of the backlash.
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

/// Where encoder and friction of a joint sit, on the link's side of its transmission or on the motor's, and how its rotor moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sides {
    /// The encoder measures the motor's position.
    pub encoder_at_motor: bool,
    /// Friction acts on the motor.
    pub friction_at_motor: bool,
    /// The rotor turns as fast as its joint and rides on the joints before; behind a high gear ratio it hardly notices them. Of elastic
    /// transmissions; the coupling ratio of backlash is a parameter.
    pub rotor_rides: bool,
}

impl Sides {
    /// Encoder and friction on the link's side of a high gear ratio.
    pub const LINK: Self = Self { encoder_at_motor: false, friction_at_motor: false, rotor_rides: false };
    /// Encoder and friction on the motor's side of a high gear ratio.
    pub const MOTOR: Self = Self { encoder_at_motor: true, friction_at_motor: true, rotor_rides: false };
}

/// Latent states of the joints, which no encoder measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatentState<T, const N: usize> {
    /// Hysteresis state of each joint at the position `anchor`.
    pub memory: SVector<T, N>,
    /// Position at which the hysteresis state is `memory`.
    pub anchor: SVector<T, N>,
    /// Deflection: motor position less joint position.
    pub deflection: SVector<T, N>,
    /// Rate of the deflection.
    pub deflection_rate: SVector<T, N>,
    /// The flank in contact where the backlash is closed, -1 or 1; zero where it is open.
    pub side: SVector<T, N>,
}

impl<T: Real, const N: usize> LatentState<T, N> {
    /// All latent states zero, at `q`.
    pub fn none(q: SVector<T, N>) -> Self {
        let zero = SVector::zeros();
        Self { memory: zero, anchor: q, deflection: zero, deflection_rate: zero, side: zero }
    }
}
