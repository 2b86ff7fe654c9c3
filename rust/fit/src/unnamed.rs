//! What the rest depends on: laws without a name through the residual torque that the final model leaves.
//!
//! For every joint the residual torque is regressed on one variable of the motion at a time, as a table over classes of equal count (the regressogram of
//! Tukey 1961), beside the arm's own parameters: what is missing has moved these, and the residual torque of a fitted model is what they leave of
//! it. Laws are added one after another (forward selection). A law counts if it predicts logs that it was not fitted to: each log in turn is left
//! out, and what the law of the others leaves there is compared with what the parameters alone leave. The scatter of that over blocks of a second says
//! whether chance would do the same.

use crate::locate::ResidualTorque;
use armgap_core::arm::Arm;
use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::Serialize;

/// Classes of a variable: a law that turns twice over the travel still shows, and each holds some hundred samples of a log of ten seconds.
const CLASSES: usize = 16;

/// Length of the blocks over which the gain is taken as independent, s: residual torques have memories of 0.05 to 0.3 s.
const BLOCK_S: f64 = 1.0;

/// Samples of the residual torque that count as one, as their errors are correlated: the curvature of an error is taken over seventeen of them.
const CORRELATED: f64 = 10.0;

/// Gain in predicting logs that were left out, in its standard deviations, from which a law is believed. By chance a law predicts worse than none. On 16
/// development cases the right variable led in 13, eleven of them from here on, and wrong ones that matter stayed below 2.0; with 2.5 ten are found.
const CERTAIN: f64 = 2.0;

/// Share of the residual torque's variance beyond noise below which a law does not matter: wrong variables reached 0.12, beside another one that was right 0.19.
const MATTERS: f64 = 0.15;

/// Laws of one joint at most. There are none where what stays is no more than twice what the noise of positions makes.
const MOST: usize = 3;

/// Fewest blocks in which a law is judged.
const FEWEST_BLOCKS: usize = 6;

/// A dependence of the residual torque that no effect of the library explains.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Dependence {
    /// 1-based joint that the torque acts on.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// What it depends on: `q1`, `dq1`, `ddq1`, `tau1` and so on, or `t`, the time since the log began.
    pub variable: String,
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
}

/// Residual torque of one joint, sample by sample, with everything that it may depend on.
#[derive(Debug, Clone, Default)]
struct Rest {
    /// Name, unit and values of each variable.
    variables: Vec<(String, &'static str, Vec<f64>)>,
    /// Residual torque.
    torque: Vec<f64>,
    /// Variance that the noise of positions puts into all of it together.
    noise: f64,
    /// Torque of each of the arm's parameters per standard deviation of the arm file, sample by sample, and one.
    base: Vec<Vec<f64>>,
    /// Log that each sample belongs to.
    log: Vec<usize>,
    /// Block of a log that each sample belongs to, counted through all logs.
    block: Vec<usize>,
}

/// What the residual torques of all joints depend on, strongest first. `sets` are samples of several logs each, `sigma` the standard
/// deviations of the arm file's parameters.
pub fn dependences<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: &A,
    sigma: &[f64; P],
    sets: &[Vec<ResidualTorque<N>>],
    rotary: bool,
) -> Vec<Dependence> {
    let mut found: Vec<Dependence> =
        (0..N).flat_map(|j| of_joint(j + 1, &Rest::of_joint(arm, sigma, sets, j, rotary))).collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    found
}

impl Rest {
    /// The residual torque of joint `j` in several sets of logs.
    fn of_joint<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        arm: &A,
        sigma: &[f64; P],
        sets: &[Vec<ResidualTorque<N>>],
        j: usize,
        rotary: bool,
    ) -> Self {
        let mut rest = Self::default();
        let all = || sets.iter().flatten();
        let [position, velocity, acceleration, torque] =
            if rotary { ["rad", "rad/s", "rad/s^2", "N m"] } else { ["m", "m/s", "m/s^2", "N"] };
        let mut add = |name: String, unit, of: &dyn Fn(&ResidualTorque<N>) -> f64| {
            rest.variables.push((name, unit, all().map(of).collect()));
        };
        for i in (0..N).map(|i| (j + i) % N) {
            add(format!("q{}", i + 1), position, &|x| x.q[i]);
            add(format!("dq{}", i + 1), velocity, &|x| x.dq[i]);
            add(format!("ddq{}", i + 1), acceleration, &|x| x.ddq[i]);
            add(format!("tau{}", i + 1), torque, &|x| x.tau[i]);
        }
        add("t".to_owned(), "s", &|x| x.t);
        rest.torque = all().map(|x| x.residual[j]).collect();
        rest.noise = all().map(|x| x.noise[j]).sum();
        let row = |x: &ResidualTorque<N>| -> Vec<f64> {
            let psi = arm.regressor(&x.q, &x.dq, &x.ddq);
            (0..P).map(|i| psi[(j, i)] * sigma[i]).chain(std::iter::once(1.0)).collect()
        };
        rest.base = all().map(row).collect();
        let (mut log, mut block, mut last) = (0, 0, None);
        for (set, samples) in sets.iter().enumerate() {
            for x in samples {
                let here = (set, x.track, (x.t / BLOCK_S).floor() as usize);
                if let Some((old_set, old_track, _)) = last.filter(|before| *before != here) {
                    block += 1;
                    log += usize::from((old_set, old_track) != (set, x.track));
                }
                last = Some(here);
                rest.log.push(log);
                rest.block.push(block);
            }
        }
        rest
    }

    fn blocks(&self) -> usize {
        self.block.last().map_or(0, |b| b + 1)
    }

    fn logs(&self) -> usize {
        self.log.last().map_or(0, |l| l + 1)
    }

    /// The regression of the residual torque on the arm's parameters and on laws over these classes.
    fn regression<'a>(&'a self, laws: Vec<&'a [usize]>) -> Regression<'a> {
        let own = self.base.first().map_or(0, Vec::len);
        let k = own + CLASSES * laws.len();
        let mut normal = vec![(DMatrix::zeros(k, k), DVector::zeros(k)); self.logs()];
        for (i, y) in self.torque.iter().enumerate() {
            let row = row(&self.base[i], laws.iter().map(|class| class[i]), k);
            let (matrix, right) = &mut normal[self.log[i]];
            matrix.ger(1.0, &row, &row, 1.0);
            right.axpy(*y, &row, 1.0);
        }
        // Parameters are known as well as the arm file says; a class counts as if one sample more had shown no torque there.
        let variance = self.torque.iter().map(|y| y * y).sum::<f64>() / self.torque.len().max(1) as f64;
        let precision = (0..k).map(|i| if i < own - 1 { CORRELATED * variance } else { 1.0 });
        Regression {
            rest: self,
            laws,
            normal,
            ridge: DMatrix::from_diagonal(&DVector::from_iterator(k, precision)),
        }
    }
}

/// A regression of a residual torque, with the normal equations of every log.
struct Regression<'a> {
    rest: &'a Rest,
    laws: Vec<&'a [usize]>,
    normal: Vec<(DMatrix<f64>, DVector<f64>)>,
    ridge: DMatrix<f64>,
}

/// One row: the torques of the parameters, one, and which class of each law the sample is in.
fn row(base: &[f64], classes: impl Iterator<Item = usize>, k: usize) -> DVector<f64> {
    let mut row = DVector::zeros(k);
    row.rows_mut(0, base.len()).copy_from_slice(base);
    for (law, class) in classes.enumerate() {
        row[base.len() + CLASSES * law + class] = 1.0;
    }
    row
}

impl Regression<'_> {
    /// Sum of the normal equations of the logs that are wanted, with the prior.
    fn system(&self, wanted: impl Fn(usize) -> bool) -> (DMatrix<f64>, DVector<f64>) {
        let mut whole = (self.ridge.clone(), DVector::zeros(self.ridge.nrows()));
        for (_, (matrix, right)) in self.normal.iter().enumerate().filter(|(log, _)| wanted(*log)) {
            whole.0 += matrix;
            whole.1 += right;
        }
        whole
    }

    /// What these values leave of sample `i`.
    fn left(&self, values: &DVector<f64>, i: usize) -> f64 {
        let row = row(&self.rest.base[i], self.laws.iter().map(|class| class[i]), values.len());
        self.rest.torque[i] - row.dot(values)
    }

    /// What the other logs leave of each sample, none where they determine nothing.
    fn left_out(&self) -> Option<Vec<f64>> {
        let values: Vec<DVector<f64>> = (0..self.rest.logs())
            .map(|log| {
                let (matrix, right) = self.system(|other| other != log);
                matrix.cholesky().map(|system| system.solve(&right))
            })
            .collect::<Option<_>>()?;
        Some((0..self.rest.torque.len()).map(|i| self.left(&values[self.rest.log[i]], i)).collect())
    }

    /// The last law, of all logs: its torque by class and its standard deviation from the scatter of the blocks' scores (sandwich).
    fn last_law(&self, x: &[f64]) -> Option<DependenceLaw> {
        let (matrix, right) = self.system(|_| true);
        let system = matrix.cholesky()?;
        let values = system.solve(&right);
        let k = values.len();
        let mut scores = vec![DVector::<f64>::zeros(k); self.rest.blocks()];
        for i in 0..self.rest.torque.len() {
            let left = self.left(&values, i);
            let row = row(&self.rest.base[i], self.laws.iter().map(|class| class[i]), k);
            scores[self.rest.block[i]].axpy(left, &row, 1.0);
        }
        let scatter = scores.iter().fold(DMatrix::zeros(k, k), |sum, s| sum + s * s.transpose());
        let inverse = system.inverse();
        let covariance = &inverse * scatter * &inverse;
        let first = k - CLASSES;
        let class = self.laws.last()?;
        let (mut sum, mut count) = ([0.0; CLASSES], [0.0; CLASSES]);
        for (x, c) in x.iter().zip(class.iter()) {
            sum[*c] += x;
            count[*c] += 1.0;
        }
        let all: f64 = count.iter().sum();
        let mean: f64 = (0..CLASSES).map(|c| count[c] * values[first + c]).sum::<f64>() / all;
        let mut law = DependenceLaw { x: Vec::new(), torque: Vec::new(), sigma: Vec::new() };
        for c in (0..CLASSES).filter(|c| count[*c] > 0.0) {
            // Of the difference from the mean, as the torque is one.
            let weight = DVector::from_fn(CLASSES, |i, _| f64::from(u8::from(i == c)) - count[i] / all);
            let own = covariance.view((first, first), (CLASSES, CLASSES));
            law.x.push(sum[c] / count[c]);
            law.torque.push(values[first + c] - mean);
            law.sigma.push((weight.transpose() * own * &weight)[0].max(0.0).sqrt());
        }
        Some(law)
    }
}

/// The laws of one joint, in the order in which they were added.
fn of_joint(joint: usize, rest: &Rest) -> Vec<Dependence> {
    let mut found: Vec<Dependence> = Vec::new();
    if rest.blocks() < FEWEST_BLOCKS || rest.logs() < 2 {
        return found;
    }
    let classes: Vec<Vec<usize>> = rest.variables.iter().map(|(_, _, x)| classes(x)).collect();
    let mut taken: Vec<usize> = Vec::new();
    let Some(plain) = rest.regression(Vec::new()).left_out() else { return found };
    let whole = squares(&plain) - rest.noise;
    let mut before = plain;
    while found.len() < MOST && whole > rest.noise {
        let with = |i: usize| -> Vec<&[usize]> {
            taken.iter().chain(std::iter::once(&i)).map(|law| classes[*law].as_slice()).collect()
        };
        let open = (0..classes.len()).filter(|i| !taken.contains(i));
        let left = open.filter_map(|i| Some((i, rest.regression(with(i)).left_out()?)));
        let Some((i, left)) = left.min_by(|(_, a), (_, b)| squares(a).total_cmp(&squares(b))) else { break };
        let share = (squares(&before) - squares(&left)) / whole;
        if share < MATTERS || certainty(&before, &left, rest) < CERTAIN {
            break;
        }
        let (variable, unit, x) = &rest.variables[i];
        let Some(law) = rest.regression(with(i)).last_law(x) else { break };
        found.push(Dependence { joint, variable: variable.clone(), unit, share: share.min(1.0), law });
        taken.push(i);
        before = left;
    }
    found
}

fn squares(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

/// Class of each value: quantiles, equal values in one class.
fn classes(x: &[f64]) -> Vec<usize> {
    let mut sorted = x.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mut edges: Vec<f64> = (1..CLASSES).map(|k| sorted[k * sorted.len() / CLASSES]).collect();
    edges.dedup();
    x.iter().map(|x| edges.partition_point(|edge| edge <= x)).collect()
}

/// By how much the squares fall from one list to the other, in standard deviations from the scatter over the blocks.
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
    use crate::random::Random;
    use armgap_core::arm::TwoLink;
    use nalgebra::SVector;

    fn found_in(logs: &[Vec<ResidualTorque<2>>]) -> Vec<Dependence> {
        dependences(&TwoLink { gravity: 9.81, length1: 0.3 }, &[0.01; 9], logs, true)
    }

    /// Logs of two joints that swing at rates of their own, with a torque on each joint and noise; `memory` is the part of the noise that stays
    /// from sample to sample.
    fn logs(memory: f64, torque: impl Fn(&ResidualTorque<2>) -> [f64; 2]) -> Vec<Vec<ResidualTorque<2>>> {
        let mut random = Random(5);
        let log = |track: usize, random: &mut Random| -> Vec<ResidualTorque<2>> {
            let phase = track as f64;
            let mut slow = [0.0; 2];
            (0..2000)
                .map(|k| {
                    let t = 0.005 * f64::from(k);
                    let q = SVector::from([(2.1 * t + phase).sin(), 0.8 * (3.7 * t - phase).sin()]);
                    let dq = SVector::from([2.1 * (2.1 * t + phase).cos(), 2.96 * (3.7 * t - phase).cos()]);
                    let tau = SVector::from_fn(|_, _| random.normal());
                    let ddq = -q + 0.3 * tau;
                    let zero = SVector::zeros();
                    let mut x = ResidualTorque {
                        track,
                        t,
                        q,
                        dq,
                        ddq,
                        tau,
                        reversal: [false; 2],
                        residual: zero,
                        noise: zero,
                    };
                    let own = torque(&x);
                    for j in 0..2 {
                        slow[j] = memory * slow[j] + (1.0 - memory * memory).sqrt() * 0.2 * random.normal();
                        x.residual[j] = own[j] + slow[j];
                    }
                    x
                })
                .collect()
        };
        vec![[log(0, &mut random), log(1, &mut random)].concat(), log(0, &mut random)]
    }

    #[test]
    fn nothing_is_found_in_noise() {
        for memory in [0.0, 0.9, 0.98] {
            let found = found_in(&logs(memory, |_| [0.0; 2]));
            assert!(found.is_empty(), "{memory}: {found:?}");
        }
    }

    #[test]
    fn a_torque_that_depends_on_the_other_joint_is_found_with_its_law() {
        let law = |q: f64| 0.5 * (2.0 * q).sin();
        let found = found_in(&logs(0.9, |x| [0.0, law(x.q[0])]));
        assert_eq!(found.len(), 1, "{found:?}");
        let Dependence { joint, variable, share, law: table, .. } = &found[0];
        assert_eq!((*joint, variable.as_str()), (2, "q1"));
        assert!((0.6..0.85).contains(share), "{share}");
        let mean = table.torque.iter().sum::<f64>() / table.x.len() as f64;
        let centre = table.x.iter().map(|x| law(*x)).sum::<f64>() / table.x.len() as f64;
        let beside = table.x.iter().zip(table.torque.iter().zip(&table.sigma));
        let off =
            beside.filter(|(x, (y, s))| (*y - mean - law(**x) + centre).abs() > 3.0 * **s + 0.02).count();
        assert!(off <= 1, "{table:?}");
    }

    #[test]
    fn torques_on_both_joints_are_found_strongest_first() {
        let found = found_in(&logs(0.5, |x| [0.3 * x.tau[0], 0.6 * (3.0 * x.q[0]).sin()]));
        let names: Vec<_> = found.iter().map(|d| (d.joint, d.variable.as_str())).collect();
        assert_eq!(names, [(2, "q1"), (1, "tau1")]);
    }

    #[test]
    fn a_drift_is_a_law_of_time() {
        let found = found_in(&logs(0.5, |x| [0.1 * x.t, 0.0]));
        assert_eq!((found[0].joint, found[0].variable.as_str()), (1, "t"));
    }

    #[test]
    fn what_one_log_alone_shows_is_no_law() {
        let found = found_in(&logs(0.9, |x| [if x.track == 1 { (3.0 * x.q[0]).sin() } else { 0.0 }, 0.0]));
        assert!(found.iter().all(|d| d.variable != "q1"), "{found:?}");
    }
}
