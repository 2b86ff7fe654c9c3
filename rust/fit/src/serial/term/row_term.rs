//! Terms along the sum or the difference of two adjacent joints' positions: gears, belts and tendons that both joints turn, cables past both joints.
//!
//! With the row `r = (1, s)` of a coupled transmission (Siciliano 2009, section 5.1) and the combined position `q_r = q_j + s q_k`, a torque `tau_r`
//! that acts along `q_r` is the torque `r' tau_r` on the joints. For the parts of the transmission that turn with `q_r`, `tau_r = inertia ddq_r +
//! viscous dq_r + coulomb sign(dq_r)`; for a spring that `q_r` extends, `tau_r = k (q_r - q0)`.

use crate::log::track::Track;
use crate::serial::term::{Term, TermKind, TermParameter};
use crate::serial::weak_form::equation::Equation;
use crate::serial::weak_form::intervals::{Intervals, Middle};
use crate::serial::weak_form::rows::Signal;
use armgap_core::chain::JointKind;
use armgap_core::effect::InputSegment;
use nalgebra::SVector;

/// A term that acts along the sum or the difference of two adjacent joints' positions, `q_r = q_j + factor q_k`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RowTerm {
    /// 0-based index of the first of the two adjacent joints; the second follows it.
    pub first: usize,
    /// Factor of the second joint's position in `q_r = q_first + factor q_second`: 1 or -1.
    pub factor: f64,
    /// Law of the torque as a function of a weighted sum of two coupled joints' positions; it acts on each joint in proportion to the joint's weight.
    pub law: RowLaw,
}

/// Law of the torque along a sum or a difference of two joints' positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RowLaw {
    /// Inertia, viscous and Coulomb friction of a coupled transmission; each of the three flags tells whether that parameter is estimated; else the
    /// parameter is zero.
    Transmission([bool; 3]),
    /// A linear spring with a stiffness, N m/rad (N/m), and a rest position, rad (m), of the sum or difference of the joints' positions.
    Spring,
}

impl RowTerm {
    /// Name of the term in results, such as `joint_spring`.
    pub fn name(&self) -> &'static str {
        match self.law {
            RowLaw::Transmission(_) => "coupled_transmission",
            RowLaw::Spring => "joint_spring",
        }
    }

    /// Title of the term in reports, such as `spring across two joints`.
    pub fn title(&self) -> &'static str {
        match self.law {
            RowLaw::Transmission(_) => "transmission that couples two joints",
            RowLaw::Spring => "spring across two joints",
        }
    }

    /// Number of the term's parameters.
    pub fn len(&self) -> usize {
        match self.law {
            RowLaw::Transmission(_) => 3,
            RowLaw::Spring => 2,
        }
    }

    /// Factors of the two adjacent joints' positions in the sum or difference that the term acts along: 1 and 1, or 1 and -1.
    pub fn row(&self) -> [i32; 2] {
        [1, if self.factor > 0.0 { 1 } else { -1 }]
    }

    /// Names, units and bounds of the term's parameters; `rotary` is whether both joints are rotary.
    pub fn parameters(&self, rotary: bool) -> Vec<TermParameter> {
        let units: &[(&str, &str, f64)] = match (self.law, rotary) {
            (RowLaw::Transmission(_), true) => {
                &[("inertia", "kg m^2", 0.0), ("viscous", "N m s/rad", 0.0), ("coulomb", "N m", 0.0)]
            }
            (RowLaw::Transmission(_), false) => {
                &[("inertia", "kg", 0.0), ("viscous", "N s/m", 0.0), ("coulomb", "N", 0.0)]
            }
            (RowLaw::Spring, true) => {
                &[("k", "N m/rad", f64::NEG_INFINITY), ("q0", "rad", f64::NEG_INFINITY)]
            }
            (RowLaw::Spring, false) => &[("k", "N/m", f64::NEG_INFINITY), ("q0", "m", f64::NEG_INFINITY)],
        };
        let of = |&(name, unit, lower): &(&'static str, &'static str, f64)| TermParameter {
            name,
            unit,
            bounds: [lower, f64::INFINITY],
            neutral: 0.0,
            inverse: None,
        };
        units.iter().map(of).collect()
    }

    /// Momentum, N m s (N s), and torque without the momentum's derivative, N m (N), along `q_j + factor q_k` in the middle of a sample interval, at
    /// parameters `p`.
    fn along<const N: usize>(&self, m: &Middle<N>, p: &[f64]) -> [f64; 2] {
        let of = |x: &[f64; N]| x[self.first] + self.factor * x[self.first + 1];
        match self.law {
            RowLaw::Transmission(_) => {
                let speed = of(&m.dq);
                [p[0] * of(&m.mean_dq), p[1] * speed + p[2] * direction(speed)]
            }
            RowLaw::Spring => [0.0, p[0] * (of(&m.q) - p[1])],
        }
    }

    /// Torque along `q_j + factor q_k` in the middle of a sample interval, N m or N, at parameters `p`.
    fn torque<const N: usize>(&self, m: &Middle<N>, p: &[f64]) -> f64 {
        let inertia = match self.law {
            RowLaw::Transmission(_) => p[0] * (m.ddq[self.first] + self.factor * m.ddq[self.first + 1]),
            RowLaw::Spring => 0.0,
        };
        inertia + self.along(m, p)[1]
    }
}

fn direction(speed: f64) -> f64 {
    if speed == 0.0 { 0.0 } else { speed.signum() }
}

/// Candidate terms along the sum and the difference of every two adjacent joints that are both rotary or both linear: coupled transmissions, springs.
pub fn candidates(kinds: &[JointKind]) -> Vec<Vec<Term>> {
    let pairs = (1..kinds.len()).filter(|k| kinds[*k] == kinds[k - 1]).map(|k| k - 1);
    let laws = [RowLaw::Transmission([true; 3]), RowLaw::Spring];
    let rows = pairs.flat_map(|first| [1.0, -1.0].map(|factor| (first, factor)));
    rows.flat_map(|(first, factor)| laws.map(|law| RowTerm { first, factor, law }))
        .map(|row| vec![Term::neutral(TermKind::Row(row))])
        .collect()
}

impl<const N: usize, const P: usize> Equation<N, P> {
    /// Torque of a term along the sum or the difference of two joints' positions, at parameters `p`, by joint and row of the weak form, N m or N.
    pub(in crate::serial) fn of_row(&self, row: &RowTerm, p: &[f64]) -> Signal {
        let changes: Vec<Vec<[SVector<f64, N>; 2]>> = self
            .logs()
            .iter()
            .map(|log| {
                let at = |m: &Middle<N>| row.along(m, p).map(|torque| row.on_both(torque));
                log.middles.iter().map(at).collect()
            })
            .collect();
        let mut signal = self.weak_parts(&changes);
        (0..N).filter(|j| *j != row.first && *j != row.first + 1).for_each(|j| signal[j] = None);
        signal
    }
}

impl RowTerm {
    fn on_both<const N: usize>(&self, torque: f64) -> SVector<f64, N> {
        let mut on = SVector::zeros();
        (on[self.first], on[self.first + 1]) = (torque, self.factor * torque);
        on
    }
}

/// Torques of `rows`, terms on two coupled joints with their parameters, on the joints along the measured motion of a log, by sample interval, N m
/// or N, as the integrator cannot simulate such terms.
pub fn torques_of_rows<const N: usize>(track: &Track<N>, rows: &[(RowTerm, Vec<f64>)]) -> Vec<[f64; N]> {
    let of = |m: &Middle<N>| {
        let mut torques = [0.0; N];
        for (row, p) in rows {
            let torque = row.torque(m, p);
            torques[row.first] += torque;
            torques[row.first + 1] += row.factor * torque;
        }
        torques
    };
    Intervals::new(track).middles.iter().map(of).collect()
}

/// A copy of a log whose motors' torques are less the torques `by`, N m or N, by sample interval.
pub fn without<const N: usize>(track: &Track<N>, by: &[[f64; N]]) -> Track<N> {
    let mut track = track.clone();
    for (segment, by) in track.held.iter_mut().flatten().zip(by.iter().flatten()) {
        let InputSegment { start, middle, end } = *segment;
        *segment = InputSegment { start: start - by, middle: middle - by, end: end - by };
    }
    track
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIDDLE: Middle<3> = Middle {
        t: 0.0,
        h: 0.01,
        q: [0.1, 0.2, 0.5],
        dq: [1.0, 2.0, 0.5],
        ddq: [0.0, 3.0, 1.0],
        mean_dq: [1.0, 2.0, 0.5],
        tau: [0.0; 3],
        rest: [false; 3],
    };

    fn row(factor: f64, law: RowLaw) -> RowTerm {
        RowTerm { first: 1, factor, law }
    }

    #[test]
    fn friction_and_inertia_are_of_the_sum_or_the_difference() {
        let sum = row(1.0, RowLaw::Transmission([true; 3]));
        assert_eq!(sum.along(&MIDDLE, &[2.0, 10.0, 0.3]), [5.0, 25.3]);
        let difference = row(-1.0, RowLaw::Transmission([true; 3]));
        assert_eq!(difference.torque(&MIDDLE, &[2.0, 10.0, 0.3]), 4.0 + 15.3);
        assert_eq!(difference.on_both::<3>(2.0), SVector::from([0.0, 2.0, -2.0]));
    }

    #[test]
    fn a_spring_pulls_both_joints_towards_its_rest() {
        let spring = row(1.0, RowLaw::Spring);
        assert!((spring.torque(&MIDDLE, &[10.0, 0.4]) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn rows_are_over_adjacent_joints_of_one_kind() {
        let kinds = [JointKind::Revolute, JointKind::Revolute, JointKind::Prismatic];
        let found = candidates(&kinds);
        assert_eq!(found.len(), 4);
        assert!(found.iter().all(|group| group[0].joints() == [1, 2] && group[0].joint().is_none()));
        let springs: Vec<_> = found.iter().filter(|group| group[0].name() == "joint_spring").collect();
        assert!(!springs[0][0].same_place(&springs[1][0]));
    }
}
