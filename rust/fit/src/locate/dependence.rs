//! Torque that depends on one variable of the motion, as a table.

use crate::locate::table_form::{MotionPoint, Place, TableForm};
use crate::locate::variable_classes::hats;
use schemars::JsonSchema;
use serde::Serialize;

/// Variable of the motion that a residual torque may depend on; joints are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MotionVariable {
    /// Position of a joint, rad or m.
    Position(usize),
    /// Velocity of a joint, rad/s or m/s.
    Velocity(usize),
    /// Acceleration of a joint, rad/s^2 or m/s^2.
    Acceleration(usize),
    /// Commanded torque of a joint, N m or N.
    Torque(usize),
    /// Time since the log began, s.
    Time,
    /// Magnitude of a joint's commanded torque, N m or N.
    Load(usize),
    /// Stop operator of a joint's commanded torque with this radius, N m or N: it follows changes of the torque within plus and minus the radius. It
    /// is the elementary hysteresis of Prandtl and Ishlinskii: the difference between a torque and what a play passes on.
    Stop(usize, f64),
    /// Torque on a joint of the cause in whose place the table stands, N m or N.
    Cause(usize),
}

impl MotionVariable {
    /// All variables of the motion of `n` joints that results may list, those of joint `own` (from 0) first.
    pub fn all(n: usize, own: usize) -> Vec<Self> {
        let of_joint = |i| [Self::Position(i), Self::Velocity(i), Self::Acceleration(i), Self::Torque(i)];
        (0..n).flat_map(|i| of_joint((own + i) % n)).chain(std::iter::once(Self::Time)).collect()
    }

    /// Name of the variable in results: `q1`, `dq1`, `ddq1`, `tau1` and so on, or `t`.
    pub fn name(self) -> String {
        match self {
            Self::Position(i) => format!("q{}", i + 1),
            Self::Velocity(i) => format!("dq{}", i + 1),
            Self::Acceleration(i) => format!("ddq{}", i + 1),
            Self::Torque(i) => format!("tau{}", i + 1),
            Self::Time => "t".to_owned(),
            Self::Load(i) => format!("|tau{}|", i + 1),
            Self::Stop(i, radius) => format!("stop of tau{} within {radius:.3}", i + 1),
            Self::Cause(i) => format!("torque of the cause on joint {}", i + 1),
        }
    }

    /// Joint whose position, velocity, acceleration or torque the variable is, from 0; `None` for the time.
    pub fn joint(self) -> Option<usize> {
        match self {
            Self::Position(i)
            | Self::Velocity(i)
            | Self::Acceleration(i)
            | Self::Torque(i)
            | Self::Load(i)
            | Self::Stop(i, _)
            | Self::Cause(i) => Some(i),
            Self::Time => None,
        }
    }

    /// SI unit of the variable, for rotary or linear joints.
    pub fn unit(self, rotary: bool) -> &'static str {
        let [rotary_unit, linear_unit] = match self {
            Self::Position(_) => ["rad", "m"],
            Self::Velocity(_) => ["rad/s", "m/s"],
            Self::Acceleration(_) => ["rad/s^2", "m/s^2"],
            Self::Torque(_) | Self::Load(_) | Self::Stop(..) | Self::Cause(_) => ["N m", "N"],
            Self::Time => ["s", "s"],
        };
        if rotary { rotary_unit } else { linear_unit }
    }

    /// Value of the variable at every point of a log.
    pub fn along<const N: usize>(self, points: &[MotionPoint<N>]) -> Vec<f64> {
        let each = |f: &dyn Fn(&MotionPoint<N>) -> f64| points.iter().map(f).collect();
        match self {
            Self::Position(i) => each(&|x| x.motion[0][i]),
            Self::Velocity(i) => each(&|x| x.motion[1][i]),
            Self::Acceleration(i) => each(&|x| x.motion[2][i]),
            Self::Torque(i) => each(&|x| x.tau[i]),
            Self::Time => each(&|x| x.t),
            Self::Load(i) => each(&|x| x.tau[i].abs()),
            Self::Cause(i) => each(&|x| x.cause[i]),
            Self::Stop(i, radius) => {
                let mut before = points.first().map_or(0.0, |x| x.tau[i]);
                let follow = |stop: &mut f64, x: &MotionPoint<N>| {
                    *stop = (*stop + x.tau[i] - before).clamp(-radius, radius);
                    before = x.tau[i];
                    Some(*stop)
                };
                points.iter().scan(0.0, follow).collect()
            }
        }
    }
}

/// Dependence of a joint's residual torque on one variable of the motion, or on two together, that no effect of the library explains.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Dependence {
    /// Joint that the torque acts on, counted from 1.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// Name of the variable that the torque depends on: `q1`, `dq1`, `ddq1`, `tau1` and so on, or `t`, the time since the log began. Of two variables
    /// the one that alone predicts more.
    pub variable: String,
    /// Variables that the torque depends on and factor of the table, in a form that can be evaluated.
    #[serde(skip)]
    pub form: TableForm,
    /// SI unit of the variable that the torque depends on.
    pub unit: &'static str,
    /// Share, 0 to 1, of the variance of the joint's residual torque beyond noise that the fitted table (of both variables, where there are two)
    /// predicts in logs it was not fitted to.
    #[schemars(range(min = 0, max = 1))]
    pub share: f64,
    /// Torque as a table over the variable.
    pub law: DependenceLaw,
    /// Torque as a table over the variable and a second one; none where the torque depends on one variable.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid: Option<DependenceGrid>,
}

/// Torque on a joint as a table over one variable of the motion, to be added to the mean torque and to the joint's earlier tables.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct DependenceLaw {
    /// Mean of the variable in each class, ascending, in the variable's SI unit.
    pub x: Vec<f64>,
    /// Torque in each class of the variable less the mean torque `constant`, N m or N; where the table has a factor, per unit of the factor.
    pub torque: Vec<f64>,
    /// Standard deviation of the torque in each class, from the scatter over blocks of one second, N m or N.
    pub sigma: Vec<f64>,
    /// Mean torque to which the table's torques are added before the table's factor multiplies them, and torque that is added to the product, N m or
    /// N.
    #[serde(skip)]
    pub constant: [f64; 2],
}

/// Torque on a joint as a table over two variables of the motion, in place of the table over the first alone.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct DependenceGrid {
    /// Name of the second variable, as that of the first.
    pub variable: String,
    /// SI unit of the second variable.
    pub unit: &'static str,
    /// Mean of the first variable in each of its classes, ascending, in its SI unit.
    pub x: Vec<f64>,
    /// Mean of the second variable in each of its classes, ascending, in its SI unit.
    pub y: Vec<f64>,
    /// Torque in each class of the first variable (rows) and of the second (columns) less the mean torque, N m or N. Cells that no sample lies in have
    /// values by the table's smoothness.
    pub torque: Vec<Vec<f64>>,
    /// Standard deviation of the torque in each cell, from the scatter over blocks of one second, N m or N; too small in cells that no sample lies in.
    pub sigma: Vec<Vec<f64>>,
    /// As [`DependenceLaw::constant`].
    #[serde(skip)]
    pub constant: [f64; 2],
}

impl Dependence {
    /// Torque, N m or N, where the table is looked up: linear interpolation between the classes' means, bilinear over two variables, held constant
    /// beyond the ends.
    pub fn at(&self, Place { factor, x, y }: Place) -> f64 {
        let (constant, table) = match &self.grid {
            None => {
                let terms =
                    hats(&self.law.x, x).map(|(i, a)| a * self.law.torque.get(i).copied().unwrap_or(0.0));
                (self.law.constant, terms.iter().sum::<f64>())
            }
            Some(grid) => {
                let row = |i: usize| hats(&grid.y, y).map(|(k, b)| b * grid.torque[i][k]).iter().sum::<f64>();
                (grid.constant, hats(&grid.x, x).map(|(i, a)| a * row(i)).iter().sum())
            }
        };
        constant[1] + factor * (constant[0] + table)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over(law: DependenceLaw, grid: Option<DependenceGrid>) -> Dependence {
        let form = TableForm::over(MotionVariable::Position(0));
        Dependence { joint: 1, variable: "q1".to_owned(), form, unit: "rad", share: 0.5, law, grid }
    }

    #[test]
    fn a_table_is_followed_between_its_classes_and_held_beyond_them() {
        let law = DependenceLaw {
            x: vec![-1.0, 0.0, 2.0],
            torque: vec![0.5, -0.5, 1.5],
            sigma: vec![0.1; 3],
            constant: [8.0, 2.0],
        };
        let found = over(law, None);
        for (x, torque) in [(-5.0, 10.5), (-1.0, 10.5), (-0.5, 10.0), (1.0, 10.5), (2.0, 11.5), (9.0, 11.5)] {
            assert!((found.at(Place { factor: 1.0, x, y: 7.0 }) - torque).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn a_grid_is_followed_along_both_variables() {
        let law = DependenceLaw { x: vec![0.0], torque: vec![99.0], sigma: vec![1.0], constant: [99.0; 2] };
        let grid = DependenceGrid {
            variable: "dq1".to_owned(),
            unit: "rad/s",
            x: vec![0.0, 1.0],
            y: vec![0.0, 2.0, 3.0],
            torque: vec![vec![0.0, 2.0, 3.0], vec![10.0, 14.0, 16.0]],
            sigma: vec![],
            constant: [0.0; 2],
        };
        let found = over(law, Some(grid));
        // Between the nodes the torque is y + x * (10 + y).
        for (x, y) in [(0.0, 0.0), (0.0, 1.5), (1.0, 3.0), (0.3, 0.7), (0.5, 2.5)] {
            assert!((found.at(Place { factor: 1.0, x, y }) - (y + x * (10.0 + y))).abs() < 1e-12, "{x} {y}");
        }
        assert_eq!(found.at(Place { factor: 2.0, x: 5.0, y: -5.0 }), 20.0);
    }
}
