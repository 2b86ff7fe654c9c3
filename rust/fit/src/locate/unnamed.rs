//! Dependences of the residual torque that no effect explains: tables over one variable of the motion, or over two.
//!
//! For every joint the residual torque by inverse dynamics is regressed on one variable of the motion at a time, or on two together, as a piecewise
//! linear table with nodes at the means of classes of equal count, beside the arm's own parameters, because a torque that the model leaves out has
//! biased their fitted values. Residual torque, regressor and table pass the same low-pass filter, so that neither noise of the acceleration nor a
//! lag affects only one of them. Tables are added one after another (forward selection). A table counts if it predicts logs that it was not fitted to: each log in turn is
//! left out, and its residual under the table of the remaining logs is compared with its residual under the parameters alone. The scatter of the gain
//! over blocks of one second shows whether the gain may be due to chance.

use crate::likelihood::solve::Prior;
use crate::locate::dependence::{Dependence, DependenceGrid, DependenceLaw};
use crate::locate::log_residual::LogResidual;
use crate::locate::table_form::TableForm;
use crate::locate::table_regression::{LeftOut, Rest, Table, squares};
use crate::locate::variable_classes::Classes;
use crate::numeric::low_pass::LowPass;
use crate::predict::residual_torque::{InverseDynamicsResidual, rms};
use armgap_core::arm::Arm;
use nalgebra::{SMatrix, SVector};

/// Standard deviation in time of the Gaussian low-pass filter of residual torques, s: cut-off 7 Hz, above arms' motion and below most noise of
/// encoders' second differences.
const LOW_PASS_S: f64 = 0.02;

/// Spacing in time of the points at which residual torques are regressed, s: about the standard deviation of the low-pass filter.
const GRID_S: f64 = 0.02;

/// Share of the time around a point at which a joint may be at rest, with undetermined friction, from which the point is left out of the regression.
const AT_REST_SHARE: f64 = 0.1;

/// Length of the blocks over which gains in prediction are taken as independent, s: residual torques are correlated over 0.05 to 0.3 s.
const BLOCK_S: f64 = 1.0;

/// Least decrease of the squared residual torque of left-out logs by a table, in standard deviations of this decrease. Where the torque does not
/// depend on the variable, a table predicts left-out logs worse than no table.
const CERTAIN_TABLE: f64 = 2.0;

/// Least share of the residual torque's variance beyond noise that a table must explain.
const TABLE_EXPLAINED_SHARE: f64 = 0.15;

/// Largest number of tables for one joint. No table is fitted where the mean square of the residual torque is at most twice what noise of the
/// positions contributes.
pub const MAX_TABLES: usize = 3;

/// Least number of blocks of one second in all logs for tables to be fitted.
const FEWEST_BLOCKS: usize = 6;

/// Options of the search for dependences of the residual torque.
#[derive(Clone, Copy)]
pub struct Wanted<'a> {
    /// Largest number of tables for one joint.
    pub most: usize,
    /// Whether the joints are rotary rather than linear.
    pub rotary: bool,
    /// Forms that the tables of a joint (from 0) may have, where the joints' commanded torques have these standard deviations, N m or N.
    pub forms: &'a dyn Fn(&[f64], usize) -> Vec<TableForm>,
}

/// Dependences of all joints' residual torques on variables of the motion, strongest first; `theta`: parameters behind the residual torques.
pub fn dependences<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: &A,
    theta: &[f64; P],
    prior: &Prior<P>,
    logs: &[LogResidual<N>],
    wanted: Wanted<'_>,
) -> Vec<Dependence> {
    let of_joint = |j| Rest::of_joint(arm, theta, prior, logs, j, wanted).dependences(j + 1, wanted);
    let mut found: Vec<Dependence> = (0..N).flat_map(of_joint).collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found
}

impl Rest {
    /// Low-passed residual torque of joint `j` (from 0) over all logs, with all variables that it may depend on.
    fn of_joint<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        arm: &A,
        theta: &[f64; P],
        prior: &Prior<P>,
        logs: &[LogResidual<N>],
        j: usize,
        wanted: Wanted<'_>,
    ) -> Self {
        let away = (0..P).map(|i| (theta[i] - prior.theta[i]) / prior.sigma[i]).collect();
        let mut rest = Self { away, ..Self::default() };
        let lows: Vec<LowPass> =
            logs.iter().map(|log| LowPass::new(&log.times(), GRID_S, LOW_PASS_S)).collect();
        let mut kept: Vec<Vec<usize>> = Vec::new();
        for (index, (log, low)) in logs.iter().zip(&lows).enumerate() {
            let series = |f: &dyn Fn(&InverseDynamicsResidual<N>) -> f64| {
                low.apply(&log.samples.iter().map(f).collect::<Vec<f64>>())
            };
            let still = series(&|x| f64::from(u8::from(x.motion[1][j].abs() < log.slow[j])));
            let points: Vec<usize> = (0..low.grid.len()).filter(|i| still[*i] < AT_REST_SHARE).collect();
            let torque = series(&|x| x.residual[j]);
            let columns: Vec<Vec<f64>> = (0..P)
                .map(|i| series(&|x| prior.sigma[i] * column(arm, &x.motion, i, &log.slow)[j]))
                .collect();
            // Variance of the second derivative of white noise behind a Gaussian low-pass.
            let curvature = 3.0 * log.period / (8.0 * std::f64::consts::PI.sqrt() * LOW_PASS_S.powi(5));
            let middle = &log.samples[log.samples.len() / 2].motion[0];
            let inertia = arm.inertia(theta, middle);
            let variance: f64 =
                (0..N).map(|i| (inertia[(j, i)] * log.noise[i]).powi(2)).sum::<f64>() * curvature;
            rest.noise += variance * points.len() as f64;
            let mut last = None;
            for i in &points {
                let block = (low.grid[*i] / BLOCK_S).floor() as usize;
                let next = rest.block.last().map_or(0, |b| b + usize::from(last != Some(block)));
                last = Some(block);
                rest.block.push(next);
                rest.log.push(index);
                rest.torque.push(torque[*i]);
                rest.base.push(columns.iter().map(|c| c[*i]).chain(std::iter::once(1.0)).collect());
            }
            rest.in_training.push(log.in_training);
            kept.push(points);
        }
        let cut = |form| Classes::new(form, logs, &lows, &kept);
        rest.variables = (wanted.forms)(&torques(logs), j).into_iter().map(cut).collect();
        rest
    }

    /// Dependences of the joint's residual torque, found by forward selection, in the order in which they were added.
    fn dependences(&self, joint: usize, wanted: Wanted<'_>) -> Vec<Dependence> {
        let mut found: Vec<Dependence> = Vec::new();
        if self.blocks() < FEWEST_BLOCKS || self.logs() < 2 {
            return found;
        }
        let mut taken: Vec<&Classes> = Vec::new();
        let Some(LeftOut { left: plain, .. }) = self.regression(Vec::new()).left_out() else { return found };
        let whole = squares(&plain) - self.noise;
        let mut before = plain;
        while found.len() < wanted.most && whole > self.noise {
            let with = |law| taken.iter().copied().chain(std::iter::once(law)).collect::<Vec<&Classes>>();
            let open = self.variables.iter().filter(|v| taken.iter().all(|t| t.form != v.form));
            let tried: Vec<(&Classes, LeftOut)> =
                open.filter_map(|law| Some((law, self.regression(with(law)).left_out()?))).collect();
            let best = |of_two: bool| {
                let of = tried.iter().filter(|(law, _)| law.form.second.is_some() == of_two);
                of.min_by(|(_, a), (_, b)| squares(&a.left).total_cmp(&squares(&b.left)))
            };
            let less = |before: &[f64], left: &[f64]| squares(before) - squares(left);
            let counts = |before: &[f64], left: &[f64], whole: f64| {
                less(before, left) >= TABLE_EXPLAINED_SHARE * whole
                    && self.certainty(before, left) >= CERTAIN_TABLE
            };
            let one = best(false).filter(|(_, found)| counts(&before, &found.left, whole));
            let two = best(true).filter(|(_, found)| {
                // A table over two variables has to predict a good part of what the best one over one leaves.
                let better = |one: &LeftOut| counts(&one.left, &found.left, squares(&one.left) - self.noise);
                counts(&before, &found.left, whole) && one.is_none_or(|(_, one)| better(one))
            });
            let Some((law, LeftOut { priors, left })) = two.or(one) else { break };
            let Some(table) = self.regression(with(law)).last_table(priors.stiffness) else { break };
            let share = (less(&before, left) / whole).min(1.0);
            let Some(entry) = self.entry(law.form, table, share, (joint, wanted.rotary)) else { break };
            found.push(entry);
            taken.push(law);
            before.clone_from(left);
        }
        found
    }

    /// A fitted table on `joint`, counted from 1, with a share of the residual torque's variance, as an entry of results; of two variables the one that
    /// alone predicts more comes first. None where no table over that variable alone can be fitted.
    fn entry(
        &self,
        form: TableForm,
        table: Table,
        share: f64,
        (joint, rotary): (usize, bool),
    ) -> Option<Dependence> {
        let law = |table: Table| DependenceLaw {
            x: table.nodes[0].clone(),
            torque: table.torque,
            sigma: table.sigma,
            constant: table.constant,
        };
        let made = |form: TableForm, law, grid| Dependence {
            joint,
            variable: form.variable.name(),
            form,
            unit: form.variable.unit(rotary),
            share,
            law,
            grid,
        };
        let Some(second) = form.second else { return Some(made(form, law(table), None)) };
        let alone = |variable| {
            let classes = self.variables.iter().find(|v| v.form == TableForm::over(variable))?;
            let regression = self.regression(vec![classes]);
            let LeftOut { priors, left } = regression.left_out()?;
            Some((squares(&left), regression.last_table(priors.stiffness)?))
        };
        let (one, two) = (alone(form.variable)?, alone(second)?);
        let (form, over_first, table) = if two.0 < one.0 {
            let turned = TableForm { variable: second, second: Some(form.variable), ..form };
            (turned, two.1, table.transposed())
        } else {
            (form, one.1, table)
        };
        let second = form.second?;
        let grid = DependenceGrid {
            variable: second.name(),
            unit: second.unit(rotary),
            torque: table.rows(&table.torque),
            sigma: table.rows(&table.sigma),
            constant: table.constant,
            x: table.nodes[0].clone(),
            y: table.nodes[1].clone(),
        };
        Some(made(form, law(over_first), Some(grid)))
    }
}

/// Torque of all joints per unit of the arm's parameter `i` in a motion `[q, dq, ddq]`; the sign in Coulomb friction is smoothed below the speeds
/// `slow`, rad/s or m/s.
fn column<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: &A,
    [q, dq, ddq]: &[SVector<f64, N>; 3],
    i: usize,
    slow: &[f64; N],
) -> SVector<f64, N> {
    if let Some(j) = i.checked_sub(A::INERTIAL + N).filter(|j| *j < N) {
        return SVector::from_fn(|k, _| if k == j { (dq[j] / slow[j]).tanh() } else { 0.0 });
    }
    let regressor: SMatrix<f64, N, P> = arm.regressor(q, dq, ddq);
    regressor.column(i).into_owned()
}

/// Standard deviations of all joints' commanded torques over all logs, N m or N.
fn torques<const N: usize>(logs: &[LogResidual<N>]) -> [f64; N] {
    std::array::from_fn(|j| {
        let all = || logs.iter().flat_map(|log| &log.samples).map(|x| x.tau[j]);
        let mean = all().sum::<f64>() / all().count().max(1) as f64;
        rms(all().map(|tau| tau - mean))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::dependence::MotionVariable;
    use crate::locate::table_form::Factor;
    use crate::numeric::random::Random;
    use armgap_core::arm::TwoLink;

    fn found_in(logs: &[LogResidual<2>]) -> Vec<Dependence> {
        found_among(&TableForm::listed, logs)
    }

    fn found_among(
        forms: &dyn Fn(&[f64], usize) -> Vec<TableForm>,
        logs: &[LogResidual<2>],
    ) -> Vec<Dependence> {
        let arm = TwoLink { gravity: 9.81, length1: 0.3 };
        let prior = Prior { theta: [0.1; 9], sigma: [0.01; 9], inertial: 5 };
        dependences(&arm, &[0.1; 9], &prior, logs, Wanted { most: MAX_TABLES, rotary: true, forms })
    }

    /// Logs of two joints that oscillate at different rates, with a given torque on each joint and noise; `memory` is the part of the noise that
    /// persists from sample to sample.
    fn logs(
        memory: f64,
        torque: impl Fn(usize, &InverseDynamicsResidual<2>) -> [f64; 2],
    ) -> Vec<LogResidual<2>> {
        let mut random = Random(5);
        let log = |number: usize, random: &mut Random| {
            let phase = number as f64;
            let mut slow = [0.0; 2];
            let samples = (0..2000)
                .map(|k| {
                    let t = 0.005 * f64::from(k);
                    let q = SVector::from([(2.1 * t + phase).sin(), 0.8 * (3.7 * t - phase).sin()]);
                    let dq = SVector::from([2.1 * (2.1 * t + phase).cos(), 2.96 * (3.7 * t - phase).cos()]);
                    let tau = SVector::from([(5.3 * t + 2.0 * phase).sin(), (4.1 * t).cos()]);
                    let ddq = -q + 0.3 * tau;
                    let mut x =
                        InverseDynamicsResidual { t, motion: [q, dq, ddq], tau, residual: SVector::zeros() };
                    let own = torque(number, &x);
                    for j in 0..2 {
                        slow[j] = memory * slow[j] + (1.0 - memory * memory).sqrt() * 0.2 * random.normal();
                        x.residual[j] = own[j] + slow[j];
                    }
                    x
                })
                .collect();
            let (noise, slow, cause) = ([0.0; 2], [0.05; 2], Vec::new());
            LogResidual { samples, period: 0.005, noise, slow, in_training: true, cause }
        };
        (0..3).map(|number| log(number, &mut random)).collect()
    }

    #[test]
    fn nothing_is_found_in_noise() {
        for memory in [0.0, 0.9, 0.98] {
            let found = found_in(&logs(memory, |_, _| [0.0; 2]));
            assert!(found.is_empty(), "{memory}: {found:?}");
        }
    }

    #[test]
    fn a_torque_that_depends_on_the_other_joint_is_found_with_its_law() {
        let law = |q: f64| 0.5 * (2.0 * q).sin();
        let found = found_in(&logs(0.9, |_, x| [0.0, law(x.motion[0][0])]));
        assert_eq!(found.len(), 1, "{found:?}");
        let Dependence { joint, variable, law: table, .. } = &found[0];
        assert_eq!((*joint, variable.as_str()), (2, "q1"));
        let mean = table.torque.iter().sum::<f64>() / table.x.len() as f64;
        let centre = table.x.iter().map(|x| law(*x)).sum::<f64>() / table.x.len() as f64;
        let beside = table.x.iter().zip(table.torque.iter().zip(&table.sigma));
        let off =
            beside.filter(|(x, (y, s))| (*y - mean - law(**x) + centre).abs() > 3.0 * **s + 0.02).count();
        assert!(off <= 1, "{table:?}");
    }

    #[test]
    fn torques_on_both_joints_are_found_strongest_first() {
        let found = found_in(&logs(0.5, |_, x| [0.3 * x.tau[0], 0.6 * (3.0 * x.motion[0][0]).sin()]));
        let names: Vec<_> = found.iter().map(|d| (d.joint, d.variable.as_str())).collect();
        assert_eq!(names[0], (2, "q1"));
        assert!(names.contains(&(1, "tau1")), "{names:?}");
    }

    #[test]
    fn a_torque_over_two_variables_is_a_grid_and_one_over_one_variable_is_none() {
        let forms = |torques: &[f64], own: usize| {
            let of_two = TableForm::over_two(torques.len(), own);
            TableForm::listed(torques, own).into_iter().chain(of_two).collect()
        };
        let product = |q: f64, dq: f64| 0.4 * q * dq.abs();
        let of = |x: &InverseDynamicsResidual<2>| {
            let [q, dq, _] = x.motion;
            [(2.0 * q[0]).sin(), product(q[1], dq[0])]
        };
        let found = found_among(&forms, &logs(0.5, |_, x| of(x)));
        let on = |joint: usize| found.iter().find(|d| d.joint == joint).unwrap();
        assert!(on(1).variable == "q1" && on(1).grid.is_none(), "{found:?}");
        let grid = on(2).grid.as_ref().expect("two variables");
        assert_eq!((on(2).variable.as_str(), grid.variable.as_str()), ("q2", "dq1"));
        assert!(on(2).share > 0.8, "{}", on(2).share);
        let (mut missed, mut all) = (0.0, 0.0);
        for (x, row) in grid.x.iter().zip(&grid.torque) {
            for (y, torque) in grid.y.iter().zip(row) {
                missed += (torque - product(*x, *y)).powi(2);
                all += product(*x, *y).powi(2);
            }
        }
        assert!(missed < 0.1 * all, "{missed} of {all}");
    }

    #[test]
    fn a_drift_is_a_law_of_time() {
        let found = found_in(&logs(0.5, |_, x| [0.1 * x.t, 0.0]));
        assert_eq!((found[0].joint, found[0].variable.as_str()), (1, "t"));
    }

    /// Fitted beside a drift, parameters have taken up a part of it: their errors, several standard deviations large, must neither hide the drift nor
    /// become laws.
    #[test]
    fn a_drift_is_told_from_the_errors_it_made_in_the_parameters() {
        let arm = TwoLink { gravity: 9.81, length1: 0.3 };
        let found = found_in(&logs(0.5, |_, x| {
            let [q, dq, ddq] = x.motion;
            let off = -0.05 * arm.regressor(&q, &dq, &ddq).column(0);
            [0.1 * x.t + off[0], off[1]]
        }));
        let listed: Vec<_> = found.iter().map(|d| (d.joint, d.variable.as_str())).collect();
        assert_eq!(listed, [(1, "t")], "{found:?}");
        assert!(found[0].share > 0.7, "{}", found[0].share);
    }

    #[test]
    fn what_one_log_alone_shows_is_no_law() {
        let found = found_in(&logs(0.9, |number, x| {
            [if number == 1 { (3.0 * x.motion[0][0]).sin() } else { 0.0 }, 0.0]
        }));
        assert!(found.iter().all(|d| d.variable != "q1"), "{found:?}");
    }

    #[test]
    fn a_size_of_the_cause_that_varies_is_a_table_times_the_cause_and_a_constant_one_is_flat() {
        let cause = |x: &InverseDynamicsResidual<2>| (3.0 * x.motion[0][0]).sin();
        let forms = |torques: &[f64], own: usize| {
            let rivals = TableForm::rivals(torques, own).into_iter();
            rivals.chain(TableForm::over_two(2, own)).chain(TableForm::varied(2, own)).collect()
        };
        let first = |size: &dyn Fn(f64) -> f64| {
            let mut logs = logs(0.5, |_, x| [size(x.motion[0][1]) * cause(x), 0.0]);
            for log in &mut logs {
                log.cause = log.samples.iter().map(|x| SVector::from([cause(x), 0.0])).collect();
            }
            found_among(&forms, &logs).swap_remove(0)
        };
        let size = |q2: f64| 1.0 + 0.8 * q2;
        let varying = first(&size);
        assert_eq!(varying.form, TableForm::times(Factor::Cause(0), MotionVariable::Position(1)));
        for (q2, torque) in varying.law.x.iter().zip(&varying.law.torque) {
            assert!((torque + varying.law.constant[0] - size(*q2)).abs() < 0.1, "{varying:?}");
        }
        let constant = first(&|_| 1.0);
        assert_eq!(constant.form.factor, Factor::Cause(0));
        assert!((constant.law.constant[0] - 1.0).abs() < 0.05, "{constant:?}");
        assert!(constant.law.torque.iter().all(|torque| torque.abs() < 0.1), "{constant:?}");
    }

    #[test]
    fn friction_whose_size_varies_is_a_table_times_the_direction() {
        let friction = |x: &InverseDynamicsResidual<2>| {
            let jump = if x.t > 4.0 { 0.5 } else { -0.5 };
            [jump * x.motion[1][0].signum(), 0.5 * x.tau[1].abs() * x.motion[1][1].signum()]
        };
        let found = found_among(&TableForm::rivals, &logs(0.5, |_, x| friction(x)));
        let first = |joint: usize| found.iter().find(|d| d.joint == joint + 1).map(|d| d.form);
        let of = |joint: usize, variable| Some(TableForm::times(Factor::Direction(joint), variable));
        assert_eq!(first(0), of(0, MotionVariable::Time), "{found:?}");
        assert_eq!(first(1), of(1, MotionVariable::Load(1)), "{found:?}");
    }
}
