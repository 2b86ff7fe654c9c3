//! Gaussian pulse over time: a push on a joint as it appears in the low-passed residual torque.

use super::residual::LOW_PASS;

/// Least distance in time between the centres of two Gaussian pulses on one joint, s.
const MIN_PULSE_SEPARATION: f64 = 0.3;

/// Gaussian pulse of residual torque on one joint.
#[derive(Debug, Clone, Copy)]
pub struct Bell {
    /// Joint that the pulse acts on, counted from 0.
    pub joint: usize,
    /// Time of the pulse's centre, s.
    pub time: f64,
    /// Standard deviation of the Gaussian over time, after the low-pass of the residual torque, s.
    pub width: f64,
    /// Height of the pulse, N m or N.
    pub height: f64,
    /// Standard deviation of the pulse's height, N m or N.
    pub sigma: f64,
    /// Height in standard deviations, relative to the typical size of chance pulses of equal width on the joint.
    pub z: f64,
}

impl Bell {
    /// Impulse of the pulse, N m s (N s).
    pub fn impulse(&self) -> f64 {
        self.height * self.width * std::f64::consts::TAU.sqrt()
    }

    /// Length of a rectangular pulse, s, whose variance over time equals that of the Gaussian before the low-pass.
    pub fn duration(&self) -> f64 {
        12.0_f64.sqrt() * (self.width.powi(2) - LOW_PASS.powi(2)).max(0.0).sqrt()
    }

    /// Value of the pulse at time `t`, per unit of height.
    pub fn at(&self, t: f64) -> f64 {
        let x = (t - self.time) / self.width;
        if x.abs() > 5.0 { 0.0 } else { (-0.5 * x * x).exp() }
    }

    /// Values of the pulse, per unit of height, at the points `t` of a regular grid of spacing `step`, s, by a recurrence.
    pub fn over(&self, t: &[f64], step: f64) -> Vec<f64> {
        let step = step / self.width;
        let from = t.first().map_or(0.0, |t| (t - self.time) / self.width);
        let (mut value, bend) = ((-0.5 * from * from).exp(), (-step * step).exp());
        let mut ratio = (-step * (from + 0.5 * step)).exp();
        let next = |_| {
            let here = value;
            value *= ratio;
            ratio *= bend;
            here
        };
        t.iter().map(next).collect()
    }

    /// Whether two pulses lie on one joint and too close in time to be two pushes.
    pub fn touches(&self, other: &Self) -> bool {
        self.joint == other.joint && (self.time - other.time).abs() < MIN_PULSE_SEPARATION
    }
}

/// All pulses except the one with index `i`.
pub fn all_but(bells: &[Bell], i: usize) -> Vec<Bell> {
    bells.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, b)| *b).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bell_over_a_grid_is_the_bell_at_its_points() {
        for (time, width) in [(3.004, 0.045), (2.7, 0.18)] {
            let bell = Bell { joint: 0, time, width, height: 0.0, sigma: 0.0, z: 0.0 };
            let t: Vec<f64> = (0..144).map(|i| time - 4.0 * width + 0.01 * f64::from(i)).collect();
            let near: Vec<f64> = t.into_iter().filter(|t| (t - time).abs() < 4.0 * width).collect();
            for (t, value) in near.iter().zip(bell.over(&near, 0.01)) {
                assert!((value / bell.at(*t) - 1.0).abs() < 1e-11, "{t}: {value}");
            }
        }
    }
}
