//! Transmission between motor and link, and hysteresis of a joint: latent states, which no encoder measures.
//!
//! A rigid joint has neither latent state. A joint driven through a spring, or through backlash, has a rotor of its own,
//!
//! ```text
//! inertia d2(u q + deflection)/dt2 = tau - transmitted,      transmitted = stiffness deflection + damping d(deflection)/dt
//! ```
//!
//! (Spong 1987), where `u` is the rotor Jacobian: 1 for the joint's own position and the coupling ratio for inner joints, on which the motor reacts
//! with this ratio times the part of its torque that is not transmitted. Within a backlash of width `backlash` no torque is transmitted; outside it
//! the flanks push and never pull. The hysteresis state of a joint changes with the distance travelled alone.

use crate::real::{Real, lit};
use nalgebra::SVector;

/// Transmission of a joint, with its rotor: an elastic shaft, or backlash.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmission<T> {
    /// Inertia of the rotor reflected to the joint, kg m^2 (kg).
    pub inertia: T,
    /// Stiffness of the shaft or of the flanks of the backlash, N m/rad (N/m).
    pub stiffness: T,
    /// Damping of the shaft or of the flanks of the backlash, N m s/rad (N s/m).
    pub damping: T,
    /// Width of the backlash, both sides together, rad or m; zero for a shaft without backlash.
    pub backlash: T,
    /// Whether the rotor's inertia is a part of the link's nominal inertia rather than an addition to it.
    pub part_of_link: bool,
    /// Coupling ratio: rotor velocity per velocity of each joint before its own; 1 for a motor that sits on the previous link, about 0 behind a high
    /// gear ratio.
    pub coupling_ratio: T,
}

impl<T: Real> Transmission<T> {
    /// Torque passed on to the link, N m (N), at a deflection, rad or m, and its rate.
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

    /// Half of the width of the backlash, rad or m.
    #[inline]
    pub fn half_backlash(&self) -> T {
        self.backlash * lit(0.5)
    }

    /// Natural frequency of rotor and link against each other, or damping rate if that is larger, 1/s; `link` is the link's inertia, kg m^2 (kg).
    pub fn rate(&self, link: T) -> T {
        let spread = T::one() / self.inertia + T::one() / link;
        (self.stiffness * spread).sqrt().max(self.damping * spread)
    }
}

/// Whether encoder and friction of a joint sit on the link's or the motor's side of its transmission, and how its rotor moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sides {
    /// Whether the encoder measures the motor's position rather than the link's.
    pub encoder_at_motor: bool,
    /// Whether friction acts on the motor rather than on the link.
    pub friction_at_motor: bool,
    /// Whether the rotor turns as fast as its joint and moves with inner joints, as without a gear; behind a high gear ratio inner joints hardly
    /// matter. For elastic transmissions; the coupling ratio of backlash is a parameter.
    pub rotor_rides: bool,
}

impl Sides {
    /// Encoder and friction on the link's side of a high gear ratio.
    pub const LINK: Self = Self { encoder_at_motor: false, friction_at_motor: false, rotor_rides: false };
    /// Encoder and friction on the motor's side of a high gear ratio.
    pub const MOTOR: Self = Self { encoder_at_motor: true, friction_at_motor: true, rotor_rides: false };
}

/// Latent states of the joints, which no encoder measures: hysteresis, deflection and backlash.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatentState<T, const N: usize> {
    /// Hysteresis state of each joint at the position `anchor`, N m (N).
    pub memory: SVector<T, N>,
    /// Joint positions at which the hysteresis states are `memory`, rad or m.
    pub anchor: SVector<T, N>,
    /// Deflection of each transmission, motor position less joint position, rad or m.
    pub deflection: SVector<T, N>,
    /// Rate of each deflection, rad/s or m/s.
    pub deflection_rate: SVector<T, N>,
    /// Flank in contact where the backlash of a joint is closed, -1 or 1; zero where it is open.
    pub side: SVector<T, N>,
}

impl<T: Real, const N: usize> LatentState<T, N> {
    /// Latent states of zero at the joint positions `q`, rad or m.
    pub fn none(q: SVector<T, N>) -> Self {
        let zero = SVector::zeros();
        Self { memory: zero, anchor: q, deflection: zero, deflection_rate: zero, side: zero }
    }
}
