//! Tables of torque over one variable of the motion, in the weak form.

use crate::locate::table_form::{MotionPoint, TableForm};
use crate::locate::variable_classes::CLASSES;
use crate::serial::term::table::Table;
use crate::serial::weak_form::equation::Equation;
use crate::serial::weak_form::intervals::Intervals;
use crate::serial::weak_form::rows::Signal;
use nalgebra::SVector;

impl<const N: usize, const P: usize> Equation<N, P> {
    /// Factor and variable of a table's form in the middle of every sample interval, log after log.
    pub(in crate::serial) fn table_variable(&self, form: TableForm) -> Vec<[f64; 2]> {
        self.logs.iter().flat_map(|log| along(log, form)).collect()
    }

    /// Torques of a table per unit of the torque of each class, by joint and row of the weak form.
    pub(in crate::serial) fn columns_of_table(&self, table: &Table) -> Vec<Signal> {
        let points: Vec<Vec<(f64, usize)>> = self
            .logs
            .iter()
            .map(|log| {
                along(log, table.form).into_iter().map(|[factor, x]| (factor, table.class(x))).collect()
            })
            .collect();
        let kept = &self.kept[table.joint];
        let mut columns = vec![vec![0.0; kept.len()]; CLASSES];
        for (row, i) in kept.iter().enumerate() {
            let phi = &self.functions[*i];
            let middles = &self.logs[phi.log].middles;
            for k in phi.reach() {
                let (factor, class) = points[phi.log][k];
                columns[class][row] += phi.weight(&middles[k]) * factor;
            }
        }
        let of_joint = |mut column: Vec<f64>| -> Signal {
            self.centre(table.joint, &mut column);
            let mut signal = vec![None; N];
            signal[table.joint] = Some(column);
            signal
        };
        columns.into_iter().map(of_joint).collect()
    }

    /// Torque of a table with the torques `p` of its classes, by joint and row of the weak form, N m or N.
    pub(in crate::serial) fn of_table(&self, table: &Table, p: &[f64]) -> Signal {
        let torques = |log: &Intervals<N>| -> Vec<f64> {
            along(log, table.form).into_iter().map(|[factor, x]| factor * p[table.class(x)]).collect()
        };
        let by_log = self.logs.iter().map(torques).collect();
        let mut all = std::array::from_fn(|_| None);
        all[table.joint] = Some(by_log);
        self.weak(&all)
    }
}

/// Factor and variable of a table's form in the middle of every sample interval of a log.
fn along<const N: usize>(log: &Intervals<N>, form: TableForm) -> Vec<[f64; 2]> {
    let point = |m: &crate::serial::weak_form::intervals::Middle<N>| MotionPoint {
        t: m.t,
        motion: [m.q, m.dq, m.ddq].map(SVector::from),
        tau: SVector::from(m.tau),
        cause: SVector::zeros(),
    };
    let points: Vec<MotionPoint<N>> = log.middles.iter().map(point).collect();
    form.along(&points, &log.slow).into_iter().map(|place| [place.factor, place.x]).collect()
}
