//! A torque without a name as a term: a table over one variable of the motion.
//!
//! The table may take any form over its variable, so it shows what a law without a form of its own explains. The model search does not try it as a
//! cause: tables are the rivals of named causes, and say on which variable the torque depends that no effect explains.

use crate::locate::dependence::MotionVariable;
use crate::locate::table_form::{Factor, TableForm};
use crate::locate::variable_classes::{CLASSES, edges};
use crate::serial::term::{Term, TermKind};

/// Table of a joint's torque over classes of one variable of the motion; the term's parameters are the torques of the classes, N m or N, where the
/// table has a factor per unit of this factor.
#[derive(Debug, Clone)]
pub struct Table {
    /// Joint that the torque acts on, counted from 0.
    pub joint: usize,
    /// Variable that the torque depends on, and what the table is multiplied by.
    pub form: TableForm,
    /// Least value of the variable along the logs that the classes were made from.
    least: f64,
    /// Values of the variable between the classes, ascending.
    edges: Vec<f64>,
    /// Mean of the variable in each class along the logs that the classes were made from; `None` for a class without samples.
    pub mean: [Option<f64>; CLASSES],
    /// Mean square of the factor along these logs.
    pub factor_square: f64,
}

impl Table {
    /// A table with classes of equal count of the variable, from factor and variable at the samples of the logs; `None` where the variable or the
    /// factor does not change.
    pub fn new(joint: usize, form: TableForm, along: &[[f64; 2]]) -> Option<Self> {
        if along.is_empty() {
            return None;
        }
        let least = along.iter().fold(f64::INFINITY, |least, x| least.min(x[1]));
        let edges = edges(along.iter().map(|x| x[1]).collect(), CLASSES);
        let (mut sum, mut count) = ([0.0; CLASSES], [0.0; CLASSES]);
        for [_, x] in along {
            let class = edges.partition_point(|edge| edge <= x);
            sum[class] += x;
            count[class] += 1.0;
        }
        let mean = std::array::from_fn(|c| (count[c] > 0.0).then(|| sum[c] / count[c]));
        let factor_square = along.iter().map(|x| x[0] * x[0]).sum::<f64>() / along.len() as f64;
        let is_constant = mean.iter().flatten().count() < 2 || factor_square == 0.0;
        (!is_constant).then_some(Self { joint, form, least, edges, mean, factor_square })
    }

    /// Class of a value of the variable; values below the least belong to the class of the least.
    pub fn class(&self, x: f64) -> usize {
        let x = x.max(self.least);
        self.edges.partition_point(|edge| *edge <= x)
    }

    /// The table as a term with all of its torques zero.
    pub fn term(self) -> Term {
        let degrees = self.mean.iter().flatten().count() as f64;
        Term { kind: TermKind::Table(Box::new(self)), p: vec![0.0; CLASSES], degrees }
    }

    /// Whether the table's torque depends on the command of its own joint.
    pub fn changes_command(&self) -> bool {
        let own = match self.form.variable {
            MotionVariable::Torque(j) | MotionVariable::Load(j) | MotionVariable::Stop(j, _) => {
                j == self.joint
            }
            _ => false,
        };
        own || self.form.factor == Factor::Torque(self.joint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OVER_TIME: TableForm =
        TableForm { factor: Factor::One, variable: MotionVariable::Time, second: None };

    #[test]
    fn classes_are_of_equal_count_and_values_beyond_them_are_in_the_outer_ones() {
        let along: Vec<[f64; 2]> = (0..1600).map(|k| [1.0, f64::from(k * k)]).collect();
        let table = Table::new(0, OVER_TIME, &along).unwrap();
        let counts = along.iter().fold([0; CLASSES], |mut counts, x| {
            counts[table.class(x[1])] += 1;
            counts
        });
        assert_eq!(counts, [100; CLASSES]);
        assert_eq!((table.class(-5.0), table.class(1e9)), (0, CLASSES - 1));
        assert!((table.factor_square - 1.0).abs() < 1e-12);
    }

    #[test]
    fn values_below_the_least_are_in_its_class_where_many_samples_have_it() {
        let along: Vec<[f64; 2]> = (0..200).map(|k| [1.0, f64::from((k - 100).max(0))]).collect();
        let table = Table::new(0, OVER_TIME, &along).unwrap();
        let class = table.class(0.0);
        assert_eq!(table.class(-1e-9), class);
        assert!(table.mean[class].is_some_and(|mean| mean < 1.0), "{:?}", table.mean);
    }

    #[test]
    fn a_variable_or_factor_that_does_not_change_has_no_table() {
        assert!(Table::new(0, OVER_TIME, &[[1.0, 3.0]; 50]).is_none());
        let still: Vec<[f64; 2]> = (0..50).map(|k| [0.0, f64::from(k)]).collect();
        assert!(Table::new(0, OVER_TIME, &still).is_none());
        assert!(Table::new(0, OVER_TIME, &[]).is_none());
    }

    #[test]
    fn tables_over_the_own_command_change_it() {
        let of = |factor, variable| {
            let along: Vec<[f64; 2]> = (0..50).map(|k| [1.0, f64::from(k)]).collect();
            Table::new(1, TableForm::times(factor, variable), &along).unwrap().changes_command()
        };
        assert!(of(Factor::One, MotionVariable::Torque(1)) && of(Factor::Torque(1), MotionVariable::Time));
        assert!(
            of(Factor::One, MotionVariable::Stop(1, 0.1))
                && of(Factor::Direction(1), MotionVariable::Load(1))
        );
        assert!(!of(Factor::One, MotionVariable::Torque(0)) && !of(Factor::One, MotionVariable::Velocity(1)));
    }
}
