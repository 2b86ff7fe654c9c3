//! Dependences of the residual torque that no effect explains: tables over one variable of the motion.
//!
//! For every joint the residual torque by inverse dynamics is regressed on one variable of the motion at a time, as a table over classes of equal
//! count (the regressogram of Tukey 1961), together with the arm's own parameters, because a torque that the model leaves out has biased their fitted
//! values. Residual torque, regressor and classes pass the same low-pass filter, so that neither noise of the acceleration nor a lag affects only one
//! of them. Tables are added one after another (forward selection). A table counts if it predicts logs that it was not fitted to: each log in turn is
//! left out, and its residual under the table of the remaining logs is compared with its residual under the parameters alone. The scatter of the gain
//! over blocks of one second shows whether the gain may be due to chance.

use crate::locate::dependence::{Dependence, DependenceLaw};
use crate::locate::table_form::{MotionPoint, TableForm};
use crate::locate::variable_classes::{CLASSES, Classes};
use crate::log::track::Track;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::low_pass::LowPass;
use crate::predict::residual_torque::{
    InverseDynamicsResidual, half_width, inverse_dynamics_residuals, rms, rms_speeds, slow_speeds,
};
use armgap_core::arm::Arm;
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Standard deviation in time of the Gaussian low-pass filter of residual torques, s: cut-off 7 Hz, above arms' motion and below most noise of
/// encoders' second differences.
const LOW_PASS_S: f64 = 0.02;

/// Spacing in time of the points at which residual torques are regressed, s: about the standard deviation of the low-pass filter.
const GRID_S: f64 = 0.02;

/// Share of the time around a point at which a joint may be at rest, with undetermined friction, from which the point is left out of the regression.
const AT_REST_SHARE: f64 = 0.1;

/// Length of the blocks over which gains in prediction are taken as independent, s: residual torques are correlated over 0.05 to 0.3 s.
const BLOCK_S: f64 = 1.0;

/// Number of points that count as one independent point, because their errors are correlated by the low-pass filter and by the residual torque
/// itself.
const CORRELATED: f64 = 10.0;

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

/// Residual torque of one log under a model by inverse dynamics, sample by sample.
pub struct LogResidual<const N: usize> {
    /// Samples of the log except a few at either end.
    pub samples: Vec<InverseDynamicsResidual<N>>,
    /// Median sample period of the log, s.
    period: f64,
    /// Standard deviation of the position measurement per joint, rad or m.
    noise: [f64; N],
    /// Speeds below which a joint may be at rest, rad/s or m/s.
    slow: [f64; N],
    /// Whether the torques of the tables are fitted to this log; all logs serve to judge which tables there are.
    teaches: bool,
}

impl<const N: usize> LogResidual<N> {
    /// Residual torque of a log under a model; `None` where the model cannot be simulated.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        arm: &A,
        track: &Track<N>,
        model: &Hypothesis<P>,
        teaches: bool,
    ) -> Option<Self> {
        let slow = slow_speeds(track, &rms_speeds(track));
        let slowest = slow.iter().copied().fold(f64::INFINITY, f64::min);
        let half = half_width(track);
        let samples = inverse_dynamics_residuals(arm, track, model, &track.pushes, half, slowest)?;
        (samples.len() > 2).then(|| Self {
            samples,
            period: track.period(),
            noise: track.noise,
            slow,
            teaches,
        })
    }

    fn times(&self) -> Vec<f64> {
        self.samples.iter().map(|x| x.t - self.samples[0].t).collect()
    }

    /// Factor and variable of a form at every sample.
    pub fn along(&self, form: TableForm) -> Vec<[f64; 2]> {
        let first = self.samples[0].t;
        let point =
            |x: &InverseDynamicsResidual<N>| MotionPoint { t: x.t - first, motion: x.motion, tau: x.tau };
        let points: Vec<MotionPoint<N>> = self.samples.iter().map(point).collect();
        form.along(&points, &self.slow)
    }
}

/// Low-passed residual torque of one joint over all logs, with all variables that it may depend on.
#[derive(Debug, Clone, Default)]
struct Rest {
    /// Variables that the residual torque may depend on, cut into classes.
    variables: Vec<Classes>,
    /// Residual torque at each point, N m or N.
    torque: Vec<f64>,
    /// Sum of squares, over all points, of the residual torque due to noise of the positions.
    noise: f64,
    /// Regressor row at each point without tables: torque on the joint, N m or N, due to one standard deviation (arm file) of each of the arm's
    /// parameters, and last the constant 1.
    base: Vec<Vec<f64>>,
    /// Index of the log that each point belongs to.
    log: Vec<usize>,
    /// Whether the torques of the tables are fitted to each log.
    teaches: Vec<bool>,
    /// Index of the block of one second that each point belongs to, counted through all logs.
    block: Vec<usize>,
}

/// Options of the search for dependences of the residual torque.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// Largest number of tables for one joint.
    pub most: usize,
    /// Whether the joints are rotary rather than linear.
    pub rotary: bool,
    /// Forms that the tables of a joint (from 0) may have, where the joints' commanded torques have these standard deviations, N m or N.
    pub forms: fn(&[f64], usize) -> Vec<TableForm>,
}

/// Dependences of all joints' residual torques on variables of the motion, strongest first; `sigma`: standard deviations of the parameters `theta`.
pub fn dependences<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: &A,
    theta: &[f64; P],
    sigma: &[f64; P],
    logs: &[LogResidual<N>],
    wanted: Wanted,
) -> Vec<Dependence> {
    let of_joint = |j| Rest::of_joint(arm, theta, sigma, logs, j, wanted).dependences(j + 1, wanted);
    let mut found: Vec<Dependence> = (0..N).flat_map(of_joint).collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found
}

impl Rest {
    /// Low-passed residual torque of joint `j` (from 0) over all logs, with all variables that it may depend on.
    fn of_joint<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        arm: &A,
        theta: &[f64; P],
        sigma: &[f64; P],
        logs: &[LogResidual<N>],
        j: usize,
        wanted: Wanted,
    ) -> Self {
        let mut rest = Self::default();
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
            let columns: Vec<Vec<f64>> =
                (0..P).map(|i| series(&|x| sigma[i] * column(arm, &x.motion, i, &log.slow)[j])).collect();
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
            rest.teaches.push(log.teaches);
            kept.push(points);
        }
        let cut = |form| Classes::new(form, logs, &lows, &kept);
        rest.variables = (wanted.forms)(&torques(logs), j).into_iter().map(cut).collect();
        rest
    }

    fn blocks(&self) -> usize {
        self.block.last().map_or(0, |b| b + 1)
    }

    fn logs(&self) -> usize {
        self.teaches.len()
    }

    /// Regression of the residual torque on the arm's parameters and on tables over the variables `laws`.
    fn regression<'a>(&'a self, laws: Vec<&'a Classes>) -> Regression<'a> {
        let own = self.base.first().map_or(0, Vec::len);
        let k = own + CLASSES * laws.len();
        let mut normal = vec![(DMatrix::zeros(k, k), DVector::zeros(k)); self.logs()];
        for (i, y) in self.torque.iter().enumerate() {
            let row = row(&self.base[i], &laws, i);
            let (matrix, right) = &mut normal[self.log[i]];
            matrix.ger(1.0, &row, &row, 1.0);
            right.axpy(*y, &row, 1.0);
        }
        // The prior of the parameters is the arm file's; a class counts as if it had one further point, with a typical factor and zero torque.
        let variance = self.torque.iter().map(|y| y * y).sum::<f64>() / self.torque.len().max(1) as f64;
        let of_table = |i: usize| if i < own { 1.0 } else { laws[(i - own) / CLASSES].factor_square };
        let precision = (0..k).map(|i| if i + 1 < own { CORRELATED * variance } else { of_table(i) });
        let ridge = DMatrix::from_diagonal(&DVector::from_iterator(k, precision));
        Regression { rest: self, laws, normal, ridge }
    }

    /// Dependences of the joint's residual torque, found by forward selection, in the order in which they were added.
    fn dependences(&self, joint: usize, wanted: Wanted) -> Vec<Dependence> {
        let mut found: Vec<Dependence> = Vec::new();
        if self.blocks() < FEWEST_BLOCKS || self.logs() < 2 {
            return found;
        }
        let mut taken: Vec<&Classes> = Vec::new();
        let Some(plain) = self.regression(Vec::new()).left_out() else { return found };
        let whole = squares(&plain) - self.noise;
        let mut before = plain;
        while found.len() < wanted.most && whole > self.noise {
            let with = |law| taken.iter().copied().chain(std::iter::once(law)).collect::<Vec<&Classes>>();
            let open = self.variables.iter().filter(|v| taken.iter().all(|t| t.form != v.form));
            let left = open.filter_map(|law| Some((law, self.regression(with(law)).left_out()?)));
            let Some((law, left)) = left.min_by(|(_, a), (_, b)| squares(a).total_cmp(&squares(b))) else {
                break;
            };
            let share = (squares(&before) - squares(&left)) / whole;
            if share < TABLE_EXPLAINED_SHARE || certainty(&before, &left, self) < CERTAIN_TABLE {
                break;
            }
            let Some(table) = self.regression(with(law)).last_law() else { break };
            found.push(Dependence {
                joint,
                variable: law.form.variable.name(),
                form: law.form,
                unit: law.form.variable.unit(wanted.rotary),
                share: share.min(1.0),
                law: table,
            });
            taken.push(law);
            before = left;
        }
        found
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

/// Regression of a residual torque on parameters and tables, with the normal equations of every log.
struct Regression<'a> {
    rest: &'a Rest,
    laws: Vec<&'a Classes>,
    normal: Vec<(DMatrix<f64>, DVector<f64>)>,
    ridge: DMatrix<f64>,
}

/// Regressor row of a point: the row `base` without tables, then the share of every class of each table's variable around the point.
fn row(base: &[f64], laws: &[&Classes], point: usize) -> DVector<f64> {
    let shares = laws.iter().flat_map(|law| law.share[point]);
    DVector::from_iterator(base.len() + CLASSES * laws.len(), base.iter().copied().chain(shares))
}

impl Regression<'_> {
    /// Sum of the normal equations of the logs selected by `wanted`, with the prior precision.
    fn system(&self, wanted: impl Fn(usize) -> bool) -> (DMatrix<f64>, DVector<f64>) {
        let mut whole = (self.ridge.clone(), DVector::zeros(self.ridge.nrows()));
        for (_, (matrix, right)) in self.normal.iter().enumerate().filter(|(log, _)| wanted(*log)) {
            whole.0 += matrix;
            whole.1 += right;
        }
        whole
    }

    fn row(&self, point: usize) -> DVector<f64> {
        row(&self.rest.base[point], &self.laws, point)
    }

    /// Residual torque at a point after subtraction of the regression with the coefficients `values`.
    fn left(&self, values: &DVector<f64>, point: usize) -> f64 {
        self.rest.torque[point] - self.row(point).dot(values)
    }

    /// Residual torque of each point after subtraction of the regression fitted to all logs but the point's own, N m or N; `None` if such a fit is
    /// singular.
    fn left_out(&self) -> Option<Vec<f64>> {
        let values: Vec<DVector<f64>> = (0..self.rest.logs())
            .map(|log| {
                let (matrix, right) = self.system(|other| other != log);
                matrix.cholesky().map(|system| system.solve(&right))
            })
            .collect::<Option<_>>()?;
        Some((0..self.rest.torque.len()).map(|i| self.left(&values[self.rest.log[i]], i)).collect())
    }

    /// Last table of the regression, fitted to the logs with `teaches`: torque by class, and standard deviation from the scatter of the blocks'
    /// scores (sandwich estimate).
    fn last_law(&self) -> Option<DependenceLaw> {
        let teaches = &self.rest.teaches;
        let (matrix, right) = self.system(|log| teaches[log]);
        let system = matrix.cholesky()?;
        let values = system.solve(&right);
        let k = values.len();
        let first = k - CLASSES;
        let last = self.laws.last()?;
        let mut scores = vec![DVector::<f64>::zeros(k); self.rest.blocks()];
        let mut weight = [0.0; CLASSES];
        for i in (0..self.rest.torque.len()).filter(|i| teaches[self.rest.log[*i]]) {
            scores[self.rest.block[i]].axpy(self.left(&values, i), &self.row(i), 1.0);
            (0..CLASSES).for_each(|c| weight[c] += last.share[i][c].abs());
        }
        let scatter = scores.iter().fold(DMatrix::zeros(k, k), |sum, s| sum + s * s.transpose());
        let inverse = system.inverse();
        let covariance = &inverse * scatter * &inverse;
        let all: f64 = weight.iter().sum();
        let mean: f64 = (0..CLASSES).map(|c| weight[c] * values[first + c]).sum::<f64>() / all;
        let intercept = values[self.rest.base.first()?.len() - 1];
        let constant = [mean, intercept];
        let mut law = DependenceLaw { x: Vec::new(), torque: Vec::new(), sigma: Vec::new(), constant };
        for (c, x) in last.mean.iter().enumerate().filter_map(|(c, x)| Some((c, (*x)?))) {
            // Standard deviation of the class's torque less the mean over the classes, as `law.torque` is such a difference.
            let apart = DVector::from_fn(CLASSES, |i, _| f64::from(u8::from(i == c)) - weight[i] / all);
            let own = covariance.view((first, first), (CLASSES, CLASSES));
            law.x.push(x);
            law.torque.push(values[first + c] - mean);
            law.sigma.push((apart.transpose() * own * &apart)[0].max(0.0).sqrt());
        }
        Some(law)
    }
}

/// Standard deviations of all joints' commanded torques over all logs, N m or N.
fn torques<const N: usize>(logs: &[LogResidual<N>]) -> [f64; N] {
    std::array::from_fn(|j| {
        let all = || logs.iter().flat_map(|log| &log.samples).map(|x| x.tau[j]);
        let mean = all().sum::<f64>() / all().count().max(1) as f64;
        rms(all().map(|tau| tau - mean))
    })
}

fn squares(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

/// Decrease of the sum of squares from residuals `before` to `after`, in standard deviations from its scatter over blocks.
fn certainty(before: &[f64], after: &[f64], rest: &Rest) -> f64 {
    let mut gains = vec![0.0; rest.blocks()];
    for (block, (a, b)) in rest.block.iter().zip(before.iter().zip(after)) {
        gains[*block] += a * a - b * b;
    }
    let n = gains.len() as f64;
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
    mean * n / (n * variance).sqrt().max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::dependence::MotionVariable;
    use crate::locate::table_form::Factor;
    use crate::numeric::random::Random;
    use armgap_core::arm::TwoLink;

    fn found_in(logs: &[LogResidual<2>]) -> Vec<Dependence> {
        found_among(TableForm::listed, logs)
    }

    fn found_among(forms: fn(&[f64], usize) -> Vec<TableForm>, logs: &[LogResidual<2>]) -> Vec<Dependence> {
        let arm = TwoLink { gravity: 9.81, length1: 0.3 };
        dependences(&arm, &[0.1; 9], &[0.01; 9], logs, Wanted { most: MAX_TABLES, rotary: true, forms })
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
            LogResidual { samples, period: 0.005, noise: [0.0; 2], slow: [0.05; 2], teaches: true }
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
    fn a_drift_is_a_law_of_time() {
        let found = found_in(&logs(0.5, |_, x| [0.1 * x.t, 0.0]));
        assert_eq!((found[0].joint, found[0].variable.as_str()), (1, "t"));
    }

    #[test]
    fn what_one_log_alone_shows_is_no_law() {
        let found = found_in(&logs(0.9, |number, x| {
            [if number == 1 { (3.0 * x.motion[0][0]).sin() } else { 0.0 }, 0.0]
        }));
        assert!(found.iter().all(|d| d.variable != "q1"), "{found:?}");
    }

    #[test]
    fn friction_whose_size_varies_is_a_table_times_the_direction() {
        let friction = |x: &InverseDynamicsResidual<2>| {
            let jump = if x.t > 4.0 { 0.5 } else { -0.5 };
            [jump * x.motion[1][0].signum(), 0.5 * x.tau[1].abs() * x.motion[1][1].signum()]
        };
        let found = found_among(TableForm::rivals, &logs(0.5, |_, x| friction(x)));
        let first = |joint: usize| found.iter().find(|d| d.joint == joint + 1).map(|d| d.form);
        let of = |joint: usize, variable| Some(TableForm { factor: Factor::Direction(joint), variable });
        assert_eq!(first(0), of(0, MotionVariable::Time), "{found:?}");
        assert_eq!(first(1), of(1, MotionVariable::Load(1)), "{found:?}");
    }
}
