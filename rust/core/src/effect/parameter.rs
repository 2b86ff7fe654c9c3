//! Parameters of effects: what they measure, their units, bounds and neutral values.

/// Value of a threshold that is never reached, in its SI unit: the neutral value of effects that begin beyond a threshold.
pub const NEVER: f64 = 1e9;

/// Quantity that a parameter of an effect measures; it decides the parameter's unit and the scale of its initial guesses (trial values).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Joint torque (force on a linear joint).
    Torque,
    /// Joint inertia (mass on a linear joint).
    Inertia,
    /// Torque per squared speed, N m s^2/rad^2 (N s^2/m^2).
    Drag,
    /// Torque per cubed speed, N m s^3/rad^3 (N s^3/m^3).
    CubicDrag,
    /// Torque per joint position, N m/rad (N/m).
    Stiffness,
    /// Torque per deflection of a shaft, N m/rad (N/m).
    ShaftStiffness,
    /// Torque per deflection rate of a shaft, N m s/rad (N s/m).
    ShaftDamping,
    /// Torque per depth beyond a joint limit, N m/rad (N/m).
    ContactStiffness,
    /// Torque per speed beyond a joint limit, N m s/rad (N s/m).
    ContactDamping,
    /// Torque per cubed joint position, N m/rad^3 (N/m^3).
    Hardening,
    /// Torque times time, N m s (N s).
    Impulse,
    /// Torque per speed, N m s/rad (N s/m).
    Damping,
    /// Joint speed, rad/s (m/s).
    Speed,
    /// Joint position, rad (m).
    Position,
    /// Joint position at which a spring is at rest, rad (m); trial values count from the middle of the joint's travel.
    Rest,
    /// Joint position, rad (m); trial values are shares of the farthest position reached on either side of zero.
    Reach,
    /// Cycles per revolution (per metre on a linear joint, times 2 pi); trial values are cycles over the joint's travel.
    Cycles,
    /// Phase or direction, rad.
    Angle,
    /// Number of cycles per revolution, or any other count.
    Count,
    /// Ratio without unit.
    Ratio,
    /// Time, s.
    Time,
    /// Mass, kg.
    Mass,
    /// Length, m.
    Length,
    /// Time, s, with trial values of the order of seconds.
    Duration,
}

impl Quantity {
    /// SI unit of the quantity on a rotary or a linear joint.
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
    /// Name of the parameter in results and on the command line.
    pub name: &'static str,
    /// Quantity that the parameter measures.
    pub quantity: Quantity,
    /// Smallest admissible value of the parameter, SI.
    pub lower: f64,
    /// Largest admissible value of the parameter, SI.
    pub upper: f64,
    /// Value of an effect's first parameter at which the effect vanishes; without meaning for further parameters.
    pub neutral: f64,
}

impl EffectParameter {
    /// Parameter that is a threshold: the effect vanishes where it is [`NEVER`].
    pub const fn threshold(name: &'static str, quantity: Quantity, lower: f64) -> Self {
        Self { name, quantity, lower, upper: f64::INFINITY, neutral: NEVER }
    }

    /// Parameter that shapes an effect: between bounds, with no value at which the effect vanishes.
    pub const fn shape(name: &'static str, quantity: Quantity, lower: f64, upper: f64) -> Self {
        Self { name, quantity, lower, upper, neutral: 0.0 }
    }

    /// Parameter that may take any value; the effect vanishes where it is zero.
    pub const fn signed(name: &'static str, quantity: Quantity) -> Self {
        Self { name, quantity, lower: f64::NEG_INFINITY, upper: f64::INFINITY, neutral: 0.0 }
    }

    /// Parameter between bounds; the effect vanishes where it is zero.
    pub const fn bounded(name: &'static str, quantity: Quantity, lower: f64, upper: f64) -> Self {
        Self { name, quantity, lower, upper, neutral: 0.0 }
    }
}
