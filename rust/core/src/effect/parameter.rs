//! Parameters of effects: what they measure, their units, bounds and neutral values.

/// A threshold so far away that it is never reached: the neutral value of effects that begin beyond one.
pub const NEVER: f64 = 1e9;

/// What a parameter measures; it decides the unit and the scale of a first trial value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Joint torque (force on a linear joint).
    Torque,
    /// Joint inertia (mass on a linear joint).
    Inertia,
    /// Torque per squared speed.
    Drag,
    /// Torque per cubed speed.
    CubicDrag,
    /// Torque per position.
    Stiffness,
    /// Torque per deflection of a shaft.
    ShaftStiffness,
    /// Torque per deflection rate of a shaft.
    ShaftDamping,
    /// Torque per depth behind a joint limit.
    ContactStiffness,
    /// Torque per speed behind a joint limit.
    ContactDamping,
    /// Torque per cubed position.
    Hardening,
    /// Torque times time.
    Impulse,
    /// Torque per speed.
    Damping,
    /// Joint speed.
    Speed,
    /// Joint position.
    Position,
    /// Joint position where something rests, measured from the middle of the joint's travel.
    Rest,
    /// Joint position, measured in the farthest position reached on either side of zero.
    Reach,
    /// Cycles per revolution (per metre on a linear joint, times 2 pi), measured in cycles over the joint's travel.
    Cycles,
    /// Phase or direction, always an angle.
    Angle,
    /// Cycles per revolution, or any other count.
    Count,
    /// A ratio to one.
    Ratio,
    /// Time.
    Time,
    /// Mass.
    Mass,
    /// Length.
    Length,
    /// Time, on the scale of seconds.
    Duration,
}

impl Quantity {
    /// SI unit on a rotary or a linear joint.
    pub const fn unit(self, rotary: bool) -> &'static str {
        match (self, rotary) {
            (Self::Torque, true) => "N m",
            (Self::Torque, false) => "N",
            (Self::Inertia, true) => "kg m^2",
            (Self::Inertia, false) | (Self::Mass, _) => "kg",
            (Self::Drag, true) => "N m s^2/rad^2",
            (Self::Drag, false) => "N s^2/m^2",
            (Self::Stiffness | Self::ShaftStiffness | Self::ContactStiffness, true) => "N m/rad",
            (Self::Stiffness | Self::ShaftStiffness | Self::ContactStiffness, false) => "N/m",
            (Self::Damping | Self::ShaftDamping | Self::ContactDamping, true) => "N m s/rad",
            (Self::Damping | Self::ShaftDamping | Self::ContactDamping, false) => "N s/m",
            (Self::CubicDrag, true) => "N m s^3/rad^3",
            (Self::CubicDrag, false) => "N s^3/m^3",
            (Self::Impulse, true) => "N m s",
            (Self::Impulse, false) => "N s",
            (Self::Hardening, true) => "N m/rad^3",
            (Self::Hardening, false) => "N/m^3",
            (Self::Speed, true) => "rad/s",
            (Self::Speed, false) => "m/s",
            (Self::Position | Self::Rest | Self::Reach, true) | (Self::Angle, _) => "rad",
            (Self::Position | Self::Rest | Self::Reach, false) | (Self::Length, _) => "m",
            (Self::Count | Self::Cycles | Self::Ratio, _) => "1",
            (Self::Time | Self::Duration, _) => "s",
        }
    }
}

/// One parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectParameter {
    /// Name in results and on the command line.
    pub name: &'static str,
    /// What it measures.
    pub quantity: Quantity,
    /// Smallest admissible value, SI.
    pub lower: f64,
    /// Largest admissible value, SI.
    pub upper: f64,
    /// Value at which the effect vanishes (for the first parameter; others have none of their own).
    pub neutral: f64,
}

impl EffectParameter {
    /// A parameter that is neutral at [`NEVER`].
    pub const fn threshold(name: &'static str, quantity: Quantity, lower: f64) -> Self {
        Self { name, quantity, lower, upper: f64::INFINITY, neutral: NEVER }
    }

    /// A shape: it may take any value and switches nothing off.
    pub const fn shape(name: &'static str, quantity: Quantity, lower: f64, upper: f64) -> Self {
        Self { name, quantity, lower, upper, neutral: 0.0 }
    }

    /// A parameter that may take any value and vanishes at zero.
    pub const fn signed(name: &'static str, quantity: Quantity) -> Self {
        Self { name, quantity, lower: f64::NEG_INFINITY, upper: f64::INFINITY, neutral: 0.0 }
    }

    /// A parameter between bounds that vanishes at zero.
    pub const fn bounded(name: &'static str, quantity: Quantity, lower: f64, upper: f64) -> Self {
        Self { name, quantity, lower, upper, neutral: 0.0 }
    }
}
