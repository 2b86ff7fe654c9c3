//! Forms of a torque as a table: the one or two variables that it depends on, and a factor of the motion that multiplies it.

use crate::locate::dependence::MotionVariable;
use nalgebra::SVector;

/// Radii of the stops of a joint's torque, relative to the standard deviation of the torque: with factors of two between them, some stop is within a
/// factor of 1.4 of any hysteresis that is wider than noise and narrower than the torque.
const STOPS: [f64; 4] = [0.05, 0.1, 0.2, 0.4];

/// Factor of the motion that multiplies a table; joints are counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Factor {
    /// None: the torque is a function of the variable alone.
    One,
    /// Direction in which a joint moves, -1 to 1: the torque is friction whose size depends on the variable.
    Direction(usize),
    /// Commanded torque of a joint, N m or N: the table is a gain less one.
    Torque(usize),
    /// Velocity of a joint, rad/s or m/s: the table is a viscous friction.
    Velocity(usize),
    /// Torque on a joint of the cause in whose place the table stands, N m or N: the table is the cause's size relative to the fitted one.
    Cause(usize),
}

/// Form of a torque as a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableForm {
    /// What the table is multiplied by.
    pub factor: Factor,
    /// What the table depends on.
    pub variable: MotionVariable,
    /// Second variable of a table over a grid of two; none for a table over one.
    pub second: Option<MotionVariable>,
}

/// Motion and torque of all joints at one sample of a log.
#[derive(Debug, Clone, Copy)]
pub struct MotionPoint<const N: usize> {
    /// Time since the log began, s.
    pub t: f64,
    /// Position, velocity and acceleration of all joints, SI.
    pub motion: [SVector<f64, N>; 3],
    /// Commanded torque, N m or N.
    pub tau: SVector<f64, N>,
    /// Torque of the cause in whose place a table stands, N m or N; zero where there is none.
    pub cause: SVector<f64, N>,
}

/// Where along a log a table is looked up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Factor that multiplies the table.
    pub factor: f64,
    /// Value of the table's variable.
    pub x: f64,
    /// Value of the second variable, 0 for a table over one.
    pub y: f64,
}

impl TableForm {
    /// A torque over one variable.
    pub fn over(variable: MotionVariable) -> Self {
        Self::times(Factor::One, variable)
    }

    /// A table over one variable, multiplied by a factor.
    pub fn times(factor: Factor, variable: MotionVariable) -> Self {
        Self { factor, variable, second: None }
    }

    /// Forms of the tables over one variable on joint `own` (from 0) that results may list: torque over each variable of the motion. `torques`:
    /// standard deviations of all joints' commanded torques, N m or N.
    pub fn listed(torques: &[f64], own: usize) -> Vec<Self> {
        MotionVariable::all(torques.len(), own).into_iter().map(Self::over).collect()
    }

    /// Forms of the tables on joint `own` (from 0) that may stand in the place of a named cause: those that results may list, dry friction whose size
    /// depends on positions, time or the joint's load, gain and viscous friction that depend on time or position, and hysteresis of the drive.
    /// `torques`: standard deviations of all joints' commanded torques, N m or N.
    pub fn rivals(torques: &[f64], own: usize) -> Vec<Self> {
        let n = torques.len();
        let time_or_place = [MotionVariable::Time, MotionVariable::Position(own)];
        let mut forms = Self::listed(torques, own);
        forms.extend(
            (1..n).map(|i| Self::times(Factor::Direction(own), MotionVariable::Position((own + i) % n))),
        );
        forms.push(Self::times(Factor::Direction(own), MotionVariable::Load(own)));
        for factor in [Factor::Direction(own), Factor::Torque(own), Factor::Velocity(own)] {
            forms.extend(time_or_place.map(|variable| Self::times(factor, variable)));
        }
        forms.extend(STOPS.map(|share| Self::over(MotionVariable::Stop(own, share * torques[own]))));
        forms
    }

    /// Forms of the tables on joint `own` (from 0) of `n` that take the form of a named cause further: a size of the cause that varies with a position, a
    /// velocity, the joint's load or time (varying coefficients: Hastie and Tibshirani, J. R. Stat. Soc. B 55, 1993), and a torque over the cause's own.
    /// The true form of a torque has a constant size.
    pub fn varied(n: usize, own: usize) -> Vec<Self> {
        let states = (0..n).flat_map(|j| [MotionVariable::Position(j), MotionVariable::Velocity(j)]);
        let variables = states.chain([MotionVariable::Load(own), MotionVariable::Time]);
        let sizes = variables.map(|variable| Self::times(Factor::Cause(own), variable));
        sizes.chain([Self::over(MotionVariable::Cause(own))]).collect()
    }

    /// Forms of the tables over two variables on joint `own` (from 0) of `n`: positions and velocities of all joints, each with each, and the joint's own
    /// commanded torque with its own position or velocity. Products of these, and laws multiplied by the size or the sign of a speed, are among them.
    pub fn over_two(n: usize, own: usize) -> Vec<Self> {
        let states = |j| [MotionVariable::Position(j), MotionVariable::Velocity(j)];
        let all: Vec<MotionVariable> = (0..n).flat_map(states).collect();
        let mut pairs: Vec<[MotionVariable; 2]> =
            all.iter().enumerate().flat_map(|(i, b)| all[..i].iter().map(move |a| [*a, *b])).collect();
        pairs.extend(states(own).map(|state| [MotionVariable::Torque(own), state]));
        pairs.into_iter().map(|[a, b]| Self { second: Some(b), ..Self::over(a) }).collect()
    }

    /// Whether the table is one over an acceleration or a command, which answer to the torque that the table stands for.
    pub fn answers_to_torque(self) -> bool {
        let answers = |variable| {
            matches!(
                variable,
                MotionVariable::Acceleration(_)
                    | MotionVariable::Torque(_)
                    | MotionVariable::Load(_)
                    | MotionVariable::Stop(..)
            )
        };
        matches!(self.factor, Factor::Torque(_)) || answers(self.variable) || self.second.is_some_and(answers)
    }

    /// Factor and variables at every point of a log; the direction is smoothed below the speeds `slow`, rad/s or m/s.
    pub fn along<const N: usize>(self, points: &[MotionPoint<N>], slow: &[f64; N]) -> Vec<Place> {
        let factor = |x: &MotionPoint<N>| match self.factor {
            Factor::One => 1.0,
            Factor::Direction(j) => (x.motion[1][j] / slow[j]).tanh(),
            Factor::Torque(j) => x.tau[j],
            Factor::Velocity(j) => x.motion[1][j],
            Factor::Cause(j) => x.cause[j],
        };
        let second = self.second.map_or_else(|| vec![0.0; points.len()], |second| second.along(points));
        let variables = self.variable.along(points).into_iter().zip(second);
        points.iter().map(factor).zip(variables).map(|(factor, (x, y))| Place { factor, x, y }).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accelerations_and_commands_answer_to_every_torque_and_positions_do_not() {
        use MotionVariable::{Acceleration, Load, Position, Stop, Time, Torque, Velocity};
        let over = TableForm::over;
        let answering = [Acceleration(0), Torque(0), Load(0), Stop(0, 0.1)].map(over);
        assert!(answering.iter().all(|form| form.answers_to_torque()));
        assert!(TableForm::times(Factor::Torque(0), Time).answers_to_torque());
        assert!(TableForm { second: Some(Torque(0)), ..over(Position(0)) }.answers_to_torque());
        let others = [Position(0), Velocity(0), Time].map(over);
        assert!(!others.iter().any(|form| form.answers_to_torque()));
        assert!(!TableForm { second: Some(Velocity(1)), ..over(Position(0)) }.answers_to_torque());
    }

    fn points() -> Vec<MotionPoint<1>> {
        let point = |k: u8| {
            let t = 0.1 * f64::from(k);
            let motion = [t.sin(), t.cos(), -t.sin()].map(|x| SVector::from([x]));
            MotionPoint { t, motion, tau: SVector::from([(3.0 * t).sin()]), cause: SVector::from([t.sin()]) }
        };
        (0..60).map(point).collect()
    }

    #[test]
    fn a_factor_multiplies_and_a_variable_is_looked_up() {
        let points = points();
        let along = |factor, variable| TableForm::times(factor, variable).along(&points, &[0.01]);
        for (k, x) in points.iter().enumerate() {
            let Place { factor: direction, x: load, .. } =
                along(Factor::Direction(0), MotionVariable::Load(0))[k];
            assert_eq!(load, x.tau[0].abs());
            assert!((direction - x.motion[1][0].signum()).abs() < 1e-3 || x.motion[1][0].abs() < 0.05);
            assert_eq!(
                along(Factor::Velocity(0), MotionVariable::Time)[k],
                Place { factor: x.motion[1][0], x: x.t, y: 0.0 }
            );
            assert_eq!(
                along(Factor::Cause(0), MotionVariable::Cause(0))[k],
                Place { factor: x.cause[0], x: x.cause[0], y: 0.0 }
            );
            assert_eq!(
                along(Factor::Torque(0), MotionVariable::Position(0))[k],
                Place { factor: x.tau[0], x: x.motion[0][0], y: 0.0 }
            );
        }
    }

    #[test]
    fn a_stop_is_what_a_play_keeps_back() {
        let points = points();
        let radius = 0.3;
        let form = TableForm::over(MotionVariable::Stop(0, radius));
        let mut play = points[0].tau[0];
        for (x, Place { x: stop, .. }) in points.iter().zip(form.along(&points, &[0.01])) {
            play = play.clamp(x.tau[0] - radius, x.tau[0] + radius);
            assert!((stop - (x.tau[0] - play)).abs() < 1e-12);
        }
    }

    #[test]
    fn tables_over_two_variables_take_each_pair_once() {
        let pairs: Vec<[String; 2]> = TableForm::over_two(2, 1)
            .into_iter()
            .map(|form| [form.variable, form.second.unwrap()].map(MotionVariable::name))
            .collect();
        let of = |a: &str, b: &str| [a.to_owned(), b.to_owned()];
        assert_eq!(pairs.len(), 8);
        assert!((1..8).all(|i| !pairs[..i].contains(&pairs[i]) && pairs[i][0] != pairs[i][1]));
        assert!(pairs.contains(&of("q1", "q2")) && pairs.contains(&of("dq1", "q2")));
        assert!(pairs.contains(&of("tau2", "dq2")) && !pairs.contains(&of("tau1", "q1")));
        let form =
            TableForm { second: Some(MotionVariable::Time), ..TableForm::over(MotionVariable::Torque(0)) };
        let points = points();
        for (x, place) in points.iter().zip(form.along(&points, &[0.01])) {
            assert_eq!(place, Place { factor: 1.0, x: x.tau[0], y: x.t });
        }
    }

    #[test]
    fn rivals_are_what_results_may_list_and_no_form_twice() {
        let (listed, rivals) = (TableForm::listed(&[1.0, 2.0], 1), TableForm::rivals(&[1.0, 2.0], 1));
        assert_eq!(rivals[..listed.len()], listed[..]);
        assert!((1..rivals.len()).all(|i| !rivals[..i].contains(&rivals[i])));
        assert!(listed.iter().all(|form| form.factor == Factor::One));
        let all = [rivals, TableForm::varied(2, 1)].concat();
        assert!((1..all.len()).all(|i| !all[..i].contains(&all[i])));
    }
}
