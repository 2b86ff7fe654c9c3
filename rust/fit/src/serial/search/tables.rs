//! Tables of torque over one variable of the motion: what the torque that no effect explains depends on, and the rivals of named causes.
//!
//! A term is named where it imitates a missing torque better than the other candidates do. A table can take any form over its variable: where a table
//! in the place of the term leaves less of the holdout, the form of the term is wrong. Tables are judged by the same evidence as terms
//! ([`Search::evidence`]).

use crate::locate::dependence::{Dependence, DependenceLaw, MotionVariable};
use crate::locate::table_form::TableForm;
use crate::locate::variable_classes::CLASSES;
use crate::result::verdict::ABOVE_NOISE;
use crate::serial::constants::{MOST_TABLES, PRICE, RIVAL_FINALISTS};
use crate::serial::search::Search;
use crate::serial::search::evidence::likelihood_gain;
use crate::serial::search::fitting::Fitted;
use crate::serial::term::table::Table;
use crate::serial::term::{Term, TermKind};
use crate::serial::weak_form::rows::{Estimate, Regression};
use rayon::prelude::*;

/// Forms of the tables on a joint (from 0) of an arm whose joints' torques have given standard deviations, N m or N.
type Forms = fn(&[f64], usize) -> Vec<TableForm>;

impl Search<'_> {
    /// Standard deviations of all joints' torques along the training logs, N m or N.
    fn torque_deviations(&self) -> Vec<f64> {
        let deviation = |joint: usize| {
            let form = TableForm::over(MotionVariable::Torque(joint));
            let values: Vec<f64> = self.training.table_variable(form).into_iter().map(|x| x[1]).collect();
            let count = values.len().max(1) as f64;
            let mean = values.iter().sum::<f64>() / count;
            (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt()
        };
        (0..self.rotary.len()).map(deviation).collect()
    }

    /// Tables on `joints` (from 0) with the torques that a first-order test suggests in addition to a model's terms, and by how much the
    /// logarithm of the likelihood ratio that each promises exceeds its price, both doubled; those that are worth their price, largest excess first.
    fn screened_tables(
        &self,
        regression: &Regression,
        model: &Fitted,
        joints: &[usize],
        forms: Forms,
    ) -> Vec<(Term, f64)> {
        let deviations = self.torque_deviations();
        let has = |form: &TableForm, joint: usize| {
            model.terms.iter().any(|term| {
                matches!(&term.kind, TermKind::Table(table) if table.form == *form && table.joint == joint)
            })
        };
        let wanted: Vec<(usize, TableForm)> = joints
            .iter()
            .filter(|joint| !self.training.rows().joints[**joint].y.is_empty())
            .flat_map(|joint| forms(&deviations, *joint).into_iter().map(move |form| (*joint, form)))
            .filter(|(joint, form)| !has(form, *joint))
            .collect();
        let mut found: Vec<(Term, f64)> = wanted
            .into_par_iter()
            .filter_map(|(joint, form)| {
                let table = Table::new(joint, form, &self.training.table_variable(form))?;
                self.test_table(regression, &model.estimate, table)
            })
            .filter(|(_, excess)| excess.is_finite() && *excess > 0.0)
            .collect();
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found
    }

    /// First-order test of a table; returns the table as a term with the torques that the test suggests, and by how much the decrease of the cost
    /// exceeds the table's price.
    fn test_table(&self, regression: &Regression, at: &Estimate, table: Table) -> Option<(Term, f64)> {
        let joint = table.joint;
        let columns = self.training.columns_of_table(&table);
        let term = table.term();
        let score = regression.score(at, &columns, &self.ridge_of(&term, CLASSES, regression))?;
        let term = term.with(score.size.clone());
        let gain = if term.changes_command() {
            self.scaled_gain(regression, at, &term, joint, score.gain)
        } else {
            score.gain
        };
        let before = regression.weights[joint] * at.residual[joint].iter().map(|r| r * r).sum::<f64>();
        let excess = likelihood_gain(gain, before) - table_price(&term);
        Some((term, excess))
    }

    /// The model of least [`Fitted::total`] with one more table, accepted for what it explains, on one of `joints` (from 0); `None` where no table is
    /// accepted.
    fn with_table(
        &self,
        regression: &Regression,
        model: &Fitted,
        joints: &[usize],
        forms: Forms,
    ) -> Option<Fitted> {
        let last = model.terms.len();
        let screened = self.screened_tables(regression, model, joints, forms);
        screened
            .into_iter()
            .take(RIVAL_FINALISTS)
            .map(|(term, _)| {
                let mut terms = model.terms.clone();
                terms.push(term);
                self.fit(regression, terms, &model.estimate.theta)
            })
            .filter(|with| self.evidence(regression, model, with, last).explains())
            .min_by(|a, b| a.total().total_cmp(&b.total()))
    }

    /// The model `without` a cause, with the table in the cause's place that explains most on the joints (from 0) that the cause acts on; `None`
    /// where no table is accepted.
    pub(in crate::serial) fn rival_table(
        &self,
        regression: &Regression,
        without: &Fitted,
        joints: &[usize],
    ) -> Option<Fitted> {
        self.with_table(regression, without, joints, TableForm::rivals)
    }

    /// Laws without a name that explain what a model leaves: tables over one variable each, added one after another as long as one is accepted, those
    /// that explain most first.
    pub(in crate::serial) fn unnamed(&self, regression: &Regression, model: &Fitted) -> Vec<Dependence> {
        let joints: Vec<usize> = (0..self.rotary.len()).collect();
        let whole = self.held_above_noise(regression, model);
        let (mut model, mut found) = (model.clone(), Vec::new());
        for _ in 0..MOST_TABLES {
            let Some(with) = self.with_table(regression, &model, &joints, TableForm::listed) else { break };
            found.extend(self.dependence(regression, [&model, &with], &whole));
            model = with;
        }
        found.sort_by(|a, b| b.share.total_cmp(&a.share));
        found
    }

    /// Squared holdout residuals of a model above those of the position noise, by joint.
    fn held_above_noise(&self, regression: &Regression, model: &Fitted) -> Vec<f64> {
        let left = |(costs, floor): (&Vec<f64>, f64)| (costs.iter().sum::<f64>() - floor).max(0.0);
        model.costs[1].iter().zip(self.floor(regression)).map(left).collect()
    }

    /// The last term of the model `with`, a table, as a law that results list; `whole` is what all tables together could explain, by joint
    /// ([`Self::held_above_noise`]).
    fn dependence(
        &self,
        regression: &Regression,
        [without, with]: [&Fitted; 2],
        whole: &[f64],
    ) -> Option<Dependence> {
        let term = with.terms.last()?;
        let TermKind::Table(table) = &term.kind else { return None };
        let columns = self.training.columns_of_table(table);
        let score = regression.score(&with.estimate, &columns, &self.ridge_of(term, CLASSES, regression))?;
        let covariance = regression.sandwich(&with.estimate.residual, &columns, &score);
        let held = |set: &Fitted| set.costs[1][table.joint].iter().sum::<f64>();
        let fell = held(without) - held(with);
        let present: Vec<usize> = (0..CLASSES).filter(|c| table.mean[*c].is_some()).collect();
        // Classes are of equal count, so the mean torque over the classes is that along the logs.
        let count = present.len() as f64;
        let mean = present.iter().map(|c| term.p[*c]).sum::<f64>() / count;
        let sigma = |c: usize| {
            let part = |i: usize| f64::from(u8::from(i == c)) - 1.0 / count;
            let square =
                |i: &usize| present.iter().map(|k| part(*i) * covariance[(*i, *k)] * part(*k)).sum::<f64>();
            present.iter().map(square).sum::<f64>().max(0.0).sqrt()
        };
        Some(Dependence {
            joint: table.joint + 1,
            variable: table.form.variable.name(),
            form: table.form,
            unit: table.form.variable.unit(self.rotary[table.form.variable.joint().unwrap_or(table.joint)]),
            share: (fell / whole[table.joint].max(f64::MIN_POSITIVE)).clamp(0.0, 1.0),
            // Terms are torques that the motion needs; a law without a name is a torque that acts on the joint.
            law: DependenceLaw {
                x: present.iter().filter_map(|c| table.mean[*c]).collect(),
                torque: present.iter().map(|c| mean - term.p[*c]).collect(),
                sigma: present.iter().map(|c| sigma(*c)).collect(),
                constant: [-mean, 0.0],
            },
            grid: None,
        })
    }
}

/// Twice the logarithm of the likelihood ratio from which a table is accepted: as for one term among some 400 candidates, and for its classes by
/// Akaike's criterion.
pub(in crate::serial) fn table_price(term: &Term) -> f64 {
    PRICE + 2.0 * term.degrees
}

/// Squared holdout residuals above those of the position noise (`floor`, by joint) that a model with a `rival` in a cause's place leaves, relative to
/// those that the model with the cause leaves, on `joints` (from 0): 0 to 1. Where the cause leaves no more than noise, 1.
pub(in crate::serial) fn left_by_rival(
    model: &Fitted,
    rival: &Fitted,
    floor: &[f64],
    joints: &[usize],
) -> f64 {
    let left = |set: &Fitted| -> f64 {
        joints.iter().map(|j| (set.costs[1][*j].iter().sum::<f64>() - floor[*j]).max(0.0)).sum()
    };
    let noise = joints.iter().map(|j| floor[*j]).sum::<f64>();
    if left(model) < ABOVE_NOISE * ABOVE_NOISE * noise {
        return 1.0;
    }
    let ratio = left(rival) / left(model);
    if ratio.is_finite() { ratio.clamp(0.0, 1.0) } else { 1.0 }
}

/// Probability that a cause is no substitute for something else, beside a rival that leaves the share `left`, 0 to 1, of what the cause leaves: `p`
/// without the rival, with its odds multiplied by a power of the share.
pub(in crate::serial) fn beside_rival(p: f64, left: f64, power: i32) -> f64 {
    let factor = left.clamp(0.0, 1.0).powi(power);
    p * factor / (1.0 - p + p * factor).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaving(costs: [f64; 2]) -> Fitted {
        let by_joint: Vec<Vec<f64>> = costs.iter().map(|cost| vec![0.5 * cost; 2]).collect();
        let estimate = Estimate { theta: vec![], residual: vec![], cost: 0.0, prior_cost: 0.0 };
        Fitted { terms: Vec::new(), estimate, costs: [vec![], by_joint], held: vec![] }
    }

    #[test]
    fn what_a_rival_leaves_is_counted_above_the_noise_on_the_joints_of_the_cause() {
        let (cause, rival) = (leaving([210.0, 150.0]), leaving([110.0, 5.0]));
        assert!((left_by_rival(&cause, &rival, &[10.0; 2], &[0]) - 0.5).abs() < 1e-12);
        assert!((left_by_rival(&cause, &rival, &[10.0; 2], &[1]) - 0.0).abs() < 1e-12);
        assert_eq!(left_by_rival(&rival, &cause, &[10.0; 2], &[0]), 1.0);
        // A cause that leaves nine times the noise in squares, and a rival that leaves none: both within noise.
        assert_eq!(left_by_rival(&leaving([90.0; 2]), &leaving([8.0; 2]), &[10.0; 2], &[0, 1]), 1.0);
    }

    #[test]
    fn a_rival_that_leaves_as_much_changes_nothing_and_one_that_leaves_half_multiplies_the_odds() {
        assert_eq!(beside_rival(0.8, 1.0, 4), 0.8);
        assert!((beside_rival(0.8, 0.5, 4) - 0.2).abs() < 1e-12);
        assert_eq!(beside_rival(1.0, 0.5, 4), 1.0);
        assert_eq!(beside_rival(1.0, 0.0, 4), 0.0);
    }
}
