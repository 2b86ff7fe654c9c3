//! A torque that depends on one variable of the motion, as a table.

use nalgebra::SVector;
use schemars::JsonSchema;
use serde::Serialize;

/// What a law may depend on; joints from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionVariable {
    /// Position of a joint.
    Position(usize),
    /// Its velocity.
    Velocity(usize),
    /// Its acceleration.
    Acceleration(usize),
    /// Its commanded torque.
    Torque(usize),
    /// Time since the log began.
    Time,
}

impl MotionVariable {
    /// All variables of `n` joints, those of joint `own` first.
    pub fn all(n: usize, own: usize) -> Vec<Self> {
        let of_joint = |i| [Self::Position(i), Self::Velocity(i), Self::Acceleration(i), Self::Torque(i)];
        (0..n).flat_map(|i| of_joint((own + i) % n)).chain(std::iter::once(Self::Time)).collect()
    }

    /// Its name: `q1`, `dq1`, `ddq1`, `tau1` and so on, or `t`.
    pub fn name(self) -> String {
        match self {
            Self::Position(i) => format!("q{}", i + 1),
            Self::Velocity(i) => format!("dq{}", i + 1),
            Self::Acceleration(i) => format!("ddq{}", i + 1),
            Self::Torque(i) => format!("tau{}", i + 1),
            Self::Time => "t".to_owned(),
        }
    }

    /// Its unit.
    pub fn unit(self, rotary: bool) -> &'static str {
        let [rotary_unit, linear_unit] = match self {
            Self::Position(_) => ["rad", "m"],
            Self::Velocity(_) => ["rad/s", "m/s"],
            Self::Acceleration(_) => ["rad/s^2", "m/s^2"],
            Self::Torque(_) => ["N m", "N"],
            Self::Time => ["s", "s"],
        };
        if rotary { rotary_unit } else { linear_unit }
    }

    /// Its value where the motion (position, velocity, acceleration), the commanded torque and the time since the log began are these.
    pub fn of<const N: usize>(
        self,
        [q, dq, ddq]: &[SVector<f64, N>; 3],
        tau: &SVector<f64, N>,
        t: f64,
    ) -> f64 {
        match self {
            Self::Position(i) => q[i],
            Self::Velocity(i) => dq[i],
            Self::Acceleration(i) => ddq[i],
            Self::Torque(i) => tau[i],
            Self::Time => t,
        }
    }
}

/// A dependence of the residual torque that no effect of the library explains.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Dependence {
    /// 1-based joint that the torque acts on.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// What it depends on: `q1`, `dq1`, `ddq1`, `tau1` and so on, or `t`, the time since the log began.
    pub variable: String,
    /// The same, to evaluate.
    #[serde(skip)]
    pub depends_on: MotionVariable,
    /// Unit of the variable.
    pub unit: &'static str,
    /// Share of the joint's residual torque, beyond noise, that the law predicts in logs that it was not fitted to (variance).
    #[schemars(range(min = 0, max = 1))]
    pub share: f64,
    /// The law.
    pub law: DependenceLaw,
}

/// A torque as a table over a variable, beside the mean of the residual torque and the laws before it.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct DependenceLaw {
    /// Mean of the variable in each class, rising.
    pub x: Vec<f64>,
    /// Torque there, N m or N.
    pub torque: Vec<f64>,
    /// Its standard deviation, from the scatter over blocks.
    pub sigma: Vec<f64>,
    /// Torque that `torque` stands beside.
    #[serde(skip)]
    pub constant: f64,
}

impl DependenceLaw {
    /// Whole torque at a value of the variable: straight lines between the classes, and that of the outermost ones beyond them.
    pub fn at(&self, x: f64) -> f64 {
        let (Some(first), Some(last)) = (self.torque.first(), self.torque.last()) else { return 0.0 };
        self.constant
            + match self.x.partition_point(|edge| *edge <= x) {
                0 => *first,
                i if i == self.x.len() => *last,
                i => {
                    let part = (x - self.x[i - 1]) / (self.x[i] - self.x[i - 1]);
                    self.torque[i - 1] + part * (self.torque[i] - self.torque[i - 1])
                }
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_followed_between_its_classes_and_held_beyond_them() {
        let law = DependenceLaw {
            x: vec![-1.0, 0.0, 2.0],
            torque: vec![0.5, -0.5, 1.5],
            sigma: vec![0.1; 3],
            constant: 10.0,
        };
        for (x, torque) in [(-5.0, 10.5), (-1.0, 10.5), (-0.5, 10.0), (1.0, 10.5), (2.0, 11.5), (9.0, 11.5)] {
            assert!((law.at(x) - torque).abs() < 1e-12, "{x}");
        }
    }
}
