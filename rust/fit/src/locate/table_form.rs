//! Forms of a torque as a table: the variable that it depends on, and a factor of the motion that multiplies it.

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
}

/// Form of a torque as a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableForm {
    /// What the table is multiplied by.
    pub factor: Factor,
    /// What the table depends on.
    pub variable: MotionVariable,
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
}

impl TableForm {
    /// Forms of the tables on joint `own` (from 0) that results may list: torque over one variable of the motion. `torques`: standard deviations of
    /// all joints' commanded torques, N m or N.
    pub fn listed(torques: &[f64], own: usize) -> Vec<Self> {
        let form = |variable| Self { factor: Factor::One, variable };
        MotionVariable::all(torques.len(), own).into_iter().map(form).collect()
    }

    /// Forms of the tables on joint `own` (from 0) that may stand in the place of a named cause: those that results may list, dry friction whose size
    /// depends on positions, time or the joint's load, gain and viscous friction that depend on time or position, and hysteresis of the drive.
    /// `torques`: standard deviations of all joints' commanded torques, N m or N.
    pub fn rivals(torques: &[f64], own: usize) -> Vec<Self> {
        let n = torques.len();
        let of = |factor, variable| Self { factor, variable };
        let time_or_place = [MotionVariable::Time, MotionVariable::Position(own)];
        let mut forms = Self::listed(torques, own);
        forms.extend((1..n).map(|i| of(Factor::Direction(own), MotionVariable::Position((own + i) % n))));
        forms.push(of(Factor::Direction(own), MotionVariable::Load(own)));
        for factor in [Factor::Direction(own), Factor::Torque(own), Factor::Velocity(own)] {
            forms.extend(time_or_place.map(|variable| of(factor, variable)));
        }
        forms.extend(STOPS.map(|share| of(Factor::One, MotionVariable::Stop(own, share * torques[own]))));
        forms
    }

    /// Factor and variable at every point of a log; the direction is smoothed below the speeds `slow`, rad/s or m/s.
    pub fn along<const N: usize>(self, points: &[MotionPoint<N>], slow: &[f64; N]) -> Vec<[f64; 2]> {
        let factor = |x: &MotionPoint<N>| match self.factor {
            Factor::One => 1.0,
            Factor::Direction(j) => (x.motion[1][j] / slow[j]).tanh(),
            Factor::Torque(j) => x.tau[j],
            Factor::Velocity(j) => x.motion[1][j],
        };
        points.iter().map(factor).zip(self.variable.along(points)).map(<[f64; 2]>::from).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<MotionPoint<1>> {
        let point = |k: u8| {
            let t = 0.1 * f64::from(k);
            let motion = [t.sin(), t.cos(), -t.sin()].map(|x| SVector::from([x]));
            MotionPoint { t, motion, tau: SVector::from([(3.0 * t).sin()]) }
        };
        (0..60).map(point).collect()
    }

    #[test]
    fn a_factor_multiplies_and_a_variable_is_looked_up() {
        let points = points();
        let along = |factor, variable| TableForm { factor, variable }.along(&points, &[0.01]);
        for (k, x) in points.iter().enumerate() {
            let [direction, load] = along(Factor::Direction(0), MotionVariable::Load(0))[k];
            assert_eq!(load, x.tau[0].abs());
            assert!((direction - x.motion[1][0].signum()).abs() < 1e-3 || x.motion[1][0].abs() < 0.05);
            assert_eq!(along(Factor::Velocity(0), MotionVariable::Time)[k], [x.motion[1][0], x.t]);
            assert_eq!(along(Factor::Torque(0), MotionVariable::Position(0))[k], [x.tau[0], x.motion[0][0]]);
        }
    }

    #[test]
    fn a_stop_is_what_a_play_keeps_back() {
        let points = points();
        let radius = 0.3;
        let form = TableForm { factor: Factor::One, variable: MotionVariable::Stop(0, radius) };
        let mut play = points[0].tau[0];
        for (x, [_, stop]) in points.iter().zip(form.along(&points, &[0.01])) {
            play = play.clamp(x.tau[0] - radius, x.tau[0] + radius);
            assert!((stop - (x.tau[0] - play)).abs() < 1e-12);
        }
    }

    #[test]
    fn rivals_are_what_results_may_list_and_no_form_twice() {
        let (listed, rivals) = (TableForm::listed(&[1.0, 2.0], 1), TableForm::rivals(&[1.0, 2.0], 1));
        assert_eq!(rivals[..listed.len()], listed[..]);
        assert!((1..rivals.len()).all(|i| !rivals[..i].contains(&rivals[i])));
        assert!(listed.iter().all(|form| form.factor == Factor::One));
    }
}
