//! Typical sizes of quantities on a given arm and log, which set the scale of an effect's parameters.

use crate::log::track::Track;
use crate::model::hypothesis::EffectInstance;
use crate::predict::residual_torque::rms;
use armgap_core::arm::Arm;
use armgap_core::effect::{EffectParameter, NEVER, Quantity};
use nalgebra::SVector;

/// Typical sizes of torque, speed, position and inertia per joint, and of the arm's length, gravity and sample period.
#[derive(Debug, Clone)]
pub struct Scales<const N: usize> {
    /// RMS torque per joint, N m or N.
    pub torque: [f64; N],
    /// RMS speed per joint, rad/s or m/s.
    pub speed: [f64; N],
    /// RMS deviation of position from its mean per joint, rad or m.
    pub position: [f64; N],
    /// Smallest and largest position per joint, rad or m.
    pub travel: [[f64; 2]; N],
    /// Inertia of each joint alone (diagonal of `M`) at `q = 0`, kg m^2 or kg.
    pub inertia: [f64; N],
    /// Median sample period, s.
    pub period: f64,
    /// Length of the last link, m; 0.3 where unknown.
    pub length: f64,
    /// Size of the acceleration of gravity, m/s^2; at least 1.
    pub gravity: f64,
}

/// Largest deviation of an effect's parameter from its centre in a fit, relative to the parameter's typical size; no arm has larger values.
const LARGEST_DEVIATION: f64 = 50.0;

/// Longest admissible time constant of an effect, in sample periods.
const LONGEST_TIME: f64 = 1000.0;

/// Ratio of the stiffness of the hardest joint limit to that of a soft one, which the joint's RMS torque deflects by the RMS deviation of its
/// position; also the ratio of their dampings.
const HARDEST: f64 = 1e4;

/// Largest characteristic speed of a speed-dependent effect in a fit, relative to the joint's RMS speed; with a larger one the effect resembles
/// another effect.
const FASTEST: f64 = 2.5;

/// Initial guess of a stop's damping, relative to the joint's RMS torque over its RMS speed.
const STOP_DAMPING: f64 = 0.1;

/// Natural frequency of a typical elastic joint, 1/s.
const SHAFT_RATE: f64 = 100.0;

/// Damping ratio of a typical elastic joint.
const SHAFT_DAMPING: f64 = 0.2;

/// Motor's share of the joint's inertia in a typical elastic joint.
const MOTOR_SHARE: f64 = 0.1;

impl<const N: usize> Scales<N> {
    /// Typical sizes from the logs `tracks` of an arm with parameters `theta`, acceleration of gravity `gravity`, m/s^2, and length `length` of the
    /// last link, m.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        arm: &A,
        theta: &[f64; P],
        tracks: &[Track<N>],
        gravity: f64,
        length: Option<f64>,
    ) -> Self {
        let inertia = arm.inertia(theta, &SVector::zeros());
        Self {
            torque: std::array::from_fn(|j| {
                rms(tracks.iter().flat_map(|t| t.held.iter().map(move |p| p[j].start)))
            }),
            speed: std::array::from_fn(|j| rms(tracks.iter().flat_map(|t| speeds(t, j)))),
            position: std::array::from_fn(|j| {
                standard_deviation(tracks.iter().flat_map(|t| t.column(j)).collect())
            }),
            travel: std::array::from_fn(|j| {
                let q = || tracks.iter().flat_map(move |t| t.q.iter().map(move |q| q[j]));
                [q().fold(f64::INFINITY, f64::min), q().fold(f64::NEG_INFINITY, f64::max)]
            }),
            inertia: std::array::from_fn(|j| inertia[(j, j)]),
            period: tracks.first().map_or(1e-3, Track::period),
            length: length.unwrap_or(0.3),
            gravity: gravity.abs().max(1.0),
        }
    }

    /// RMS speed of the slowest joint, rad/s or m/s.
    pub fn slowest(&self) -> f64 {
        self.speed.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Typical size of a quantity on joint `j`, SI.
    pub fn size(&self, quantity: Quantity, j: usize) -> f64 {
        let value = match quantity {
            Quantity::Torque => self.torque[j],
            Quantity::Inertia => self.inertia[j],
            Quantity::Drag => self.torque[j] / (self.speed[j] * self.speed[j]),
            Quantity::CubicDrag => self.torque[j] / self.speed[j].powi(3),
            Quantity::Damping | Quantity::ContactDamping => self.torque[j] / self.speed[j],
            Quantity::Stiffness | Quantity::ContactStiffness => self.torque[j] / self.position[j],
            Quantity::Impulse => self.inertia[j] * self.speed[j],
            Quantity::Hardening => self.torque[j] / self.position[j].powi(3),
            Quantity::ShaftStiffness => self.inertia[j] * SHAFT_RATE * SHAFT_RATE * MOTOR_SHARE,
            Quantity::ShaftDamping => self.inertia[j] * SHAFT_RATE * MOTOR_SHARE * SHAFT_DAMPING,
            Quantity::Speed => self.speed[j],
            Quantity::Position | Quantity::Rest => self.position[j],
            Quantity::Reach => self.travel[j][0].abs().max(self.travel[j][1].abs()),
            Quantity::Cycles => std::f64::consts::TAU / (self.travel[j][1] - self.travel[j][0]),
            Quantity::Angle | Quantity::Count | Quantity::Ratio | Quantity::Duration => 1.0,
            Quantity::Time => self.period,
            Quantity::Mass => self.torque[N - 1] / (self.gravity * self.length),
            Quantity::Length => self.length,
        };
        if value.is_finite() && value > 0.0 { value } else { 1.0 }
    }

    /// Middle of a joint's travel, rad or m.
    fn middle(&self, j: usize) -> f64 {
        let [from, to] = self.travel[j];
        0.5 * (from + to)
    }

    /// Initial guess of a parameter on joint `j`, SI, from `value` in units of the parameter's typical size; `None` for a position on a side of zero
    /// that the joint never reaches.
    pub fn initial_guess(&self, quantity: Quantity, j: usize, value: f64) -> Option<f64> {
        match quantity {
            Quantity::Ratio => Some(value),
            Quantity::Rest => Some(self.middle(j) + value * self.size(quantity, j)),
            Quantity::Reach => {
                let side = self.travel[j][usize::from(value > 0.0)];
                (side * value > 0.0).then_some(value.abs() * side)
            }
            _ => Some(value * self.size(quantity, j)),
        }
    }

    /// Initial guess of a stop towards zero at one end of joint `j`'s travel: position, stiffness (negative) and damping. The stop lies inside the
    /// travel by the part that `share`, negative for the lower end, leaves to one; `None` where it would lie beyond the middle, or away from zero.
    pub fn stop_towards_zero(&self, j: usize, share: f64) -> Option<[f64; 3]> {
        let [low, high] = self.travel[j];
        let depth = (1.0 - share.abs()) * (high - low);
        let position = if share > 0.0 { high - depth } else { low + depth };
        let push = self.size(Quantity::Torque, j);
        let sought = depth > 0.0 && 2.0 * depth < high - low && position * share < 0.0;
        sought.then(|| [position, -push / depth, STOP_DAMPING * push / self.size(Quantity::Speed, j)])
    }

    /// Value from which a parameter's size is counted: its neutral value, or zero if it has none; for a rest position the middle of the travel.
    pub fn centre(&self, parameter: &EffectParameter, j: usize) -> f64 {
        match parameter.quantity {
            Quantity::Rest => self.middle(j),
            _ if parameter.neutral < NEVER => parameter.neutral,
            _ => 0.0,
        }
    }

    /// Largest admissible deviation of a parameter of joint `j` from its centre (neutral value, zero or middle of the travel).
    pub fn largest(&self, quantity: Quantity, j: usize) -> f64 {
        let most = match quantity {
            Quantity::Time => LONGEST_TIME,
            Quantity::Speed => FASTEST,
            Quantity::ContactStiffness | Quantity::ContactDamping => HARDEST,
            _ => LARGEST_DEVIATION,
        };
        most * self.size(quantity, j)
    }

    /// Fewest cycles of a ripple per turn of joint `j` that a fit admits: one per turn, or one over the travel if that is more than a turn. Slower ripples
    /// bend so little that they imitate an offset. Negative infinity for other quantities.
    pub fn fewest_cycles(&self, quantity: Quantity, j: usize) -> f64 {
        if quantity == Quantity::Cycles { self.size(quantity, j).min(1.0) } else { f64::NEG_INFINITY }
    }

    /// Typical sizes of all parameters of an effect on its joint, SI.
    pub fn of(&self, effect: &EffectInstance) -> Vec<f64> {
        effect.law.spec().parameters.iter().map(|p| self.size(p.quantity, effect.joint)).collect()
    }
}

fn speeds<const N: usize>(track: &Track<N>, j: usize) -> Vec<f64> {
    (0..track.len()).step_by(5).map(|k| track.local(j, k).dq).collect()
}

fn standard_deviation(x: Vec<f64>) -> f64 {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    rms(x.into_iter().map(|x| x - mean))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_towards_zero_lies_inside_the_end_of_the_travel_that_is_nearest_to_zero() {
        let scales = Scales::<2> {
            torque: [3.0; 2],
            speed: [0.5; 2],
            position: [0.4; 2],
            travel: [[-2.0, -0.5], [0.2, 1.2]],
            inertia: [1.0; 2],
            period: 0.002,
            length: 0.3,
            gravity: 9.81,
        };
        let near = |a: Option<[f64; 3]>, b: [f64; 3]| {
            let a = a.unwrap();
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12), "{a:?} {b:?}");
        };
        near(scales.stop_towards_zero(0, 0.9), [-0.65, -20.0, 0.6]);
        near(scales.stop_towards_zero(1, -0.9), [0.3, -30.0, 0.6]);
        assert_eq!(scales.stop_towards_zero(0, 0.5), None);
        assert_eq!(scales.stop_towards_zero(0, -0.9), None);
        assert_eq!(scales.initial_guess(Quantity::Reach, 0, 0.9), None);
        assert_eq!(scales.initial_guess(Quantity::Reach, 0, -0.9), Some(-1.8));
    }
}
