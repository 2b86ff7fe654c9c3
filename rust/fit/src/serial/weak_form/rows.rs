//! Regression of the weak form's rows, joint by joint, on the arm's parameters, given the torques of further terms.

mod first_order_test;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Number of rounds in which parameters are estimated and the rows' weights computed from the residuals.
const WEIGHT_ROUNDS: usize = 4;

/// Rows of one joint in the weak form: `y = psi theta + torques of terms`, one row per test function.
#[derive(Debug, Clone)]
pub struct JointRows {
    /// Applied torque of the joint, averaged with each test function as weight, one value per row, N m or N.
    pub y: Vec<f64>,
    /// Regressor of the parameters, row after row: [`Rows::parameters`] entries for each value of `y`.
    pub psi: Vec<f64>,
    /// Index of the block, a stretch of one second of a log, that each row belongs to.
    pub block: Vec<usize>,
    /// Standard deviation of each row due to the noise of positions, N m or N.
    pub floor: Vec<f64>,
}

/// Rows of the weak form of all joints.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Rows of each joint.
    pub joints: Vec<JointRows>,
    /// Number of columns of the regressor.
    pub parameters: usize,
    /// Number of blocks, stretches of one second, in all logs.
    pub blocks: usize,
    /// Lag, in rows, from which residuals count as independent.
    pub independent: usize,
}

/// Torque added to that of the arm's own parameters, by joint and row of the weak form, N m or N; `None` for joints that the torque does not act on.
pub type Signal = Vec<Option<Vec<f64>>>;

/// Gaussian prior of the regression's parameters, with the parameters that may not be negative.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Prior values of the parameters, SI.
    pub theta: Vec<f64>,
    /// Prior standard deviations of the parameters, SI; zero for a value that is not estimated.
    pub sigma: Vec<f64>,
    /// Whether each parameter is a coefficient that may not be negative.
    pub positive: Vec<bool>,
}

impl Prior {
    /// Squared distance of `theta` from the prior values, counted in standard deviations.
    pub fn cost(&self, theta: &[f64]) -> f64 {
        let off = |i: usize| {
            if self.sigma[i] > 0.0 { ((theta[i] - self.theta[i]) / self.sigma[i]).powi(2) } else { 0.0 }
        };
        (0..theta.len()).map(off).sum()
    }
}

/// Sum of several torque signals, by joint and row.
pub fn sum(rows: &Rows, signals: &[Signal]) -> Signal {
    let of = |j: usize| {
        let mut total: Option<Vec<f64>> = None;
        for part in signals.iter().filter_map(|s| s[j].as_ref()) {
            match &mut total {
                Some(total) => total.iter_mut().zip(part).for_each(|(a, b)| *a += b),
                None => total = Some(part.clone()),
            }
        }
        total
    };
    (0..rows.joints.len()).map(of).collect()
}

impl JointRows {
    /// Mean square of the residuals `r`, at least that of the position noise, (N m)^2 or N^2.
    fn variance(&self, r: &[f64]) -> f64 {
        let mean = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>() / (x.len() as f64).max(1.0);
        mean(r).max(mean(&self.floor))
    }

    /// Residuals of one joint's rows, N m or N: `y` less the torque of the parameters `theta` and a further torque (`beside`).
    fn residual(&self, theta: &[f64], beside: Option<&Vec<f64>>) -> Vec<f64> {
        let p = theta.len();
        let row = |i: usize| {
            let own: f64 = self.psi[i * p..(i + 1) * p].iter().zip(theta).map(|(a, b)| a * b).sum();
            self.y[i] - own - beside.map_or(0.0, |s| s[i])
        };
        (0..self.y.len()).map(row).collect()
    }
}

impl Rows {
    /// Residuals by joint and row, N m or N: `y` less the torque of the parameters `theta` and a further torque (`beside`).
    pub fn residual(&self, theta: &[f64], beside: &Signal) -> Vec<Vec<f64>> {
        self.joints.iter().zip(beside).map(|(rows, s)| rows.residual(theta, s.as_ref())).collect()
    }

    /// Weight of each joint's rows, 1/(N m)^2 or 1/N^2: one over the product of the residuals' variance, at least that of the position noise, and the
    /// number of correlated rows that count as one. A joint without rows has weight zero.
    pub fn weights(&self, residual: &[Vec<f64>]) -> Vec<f64> {
        let of = |(rows, r): (&JointRows, &Vec<f64>)| {
            let weight = 1.0 / (rows.variance(r) * correlation_length(r, self.independent));
            if weight.is_finite() { weight } else { 0.0 }
        };
        self.joints.iter().zip(residual).map(of).collect()
    }

    /// Number of independent rows of each joint: rows with the residuals `residual`, less those that others determine by correlation.
    pub fn independent_rows(&self, residual: &[Vec<f64>]) -> Vec<f64> {
        residual.iter().map(|r| r.len() as f64 / correlation_length(r, self.independent)).collect()
    }

    /// Sum of the weighted squared residuals by joint and block, a stretch of one second.
    pub fn costs(&self, weights: &[f64], residual: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let of = |j: usize| {
            let mut cost = vec![0.0; self.blocks];
            for (r, block) in residual[j].iter().zip(&self.joints[j].block) {
                cost[*block] += weights[j] * r * r;
            }
            cost
        };
        (0..self.joints.len()).map(of).collect()
    }
}

/// Number of correlated rows that count as one independent row: one plus twice the sum of the residuals' autocorrelations up to the first that is not
/// positive, and below the lag `independent`, in rows.
fn correlation_length(r: &[f64], independent: usize) -> f64 {
    let total: f64 = r.iter().map(|r| r * r).sum();
    let mut length = 1.0;
    for lag in 1..independent.min(r.len()) {
        let part: f64 = r.iter().zip(&r[lag..]).map(|(a, b)| a * b).sum();
        if part <= 0.0 || total <= 0.0 {
            break;
        }
        length += 2.0 * part / total;
    }
    length
}

/// Regression of the weak form's rows on the arm's parameters, with their prior.
pub struct Regression<'a> {
    /// Rows of the weak form.
    pub rows: &'a Rows,
    /// Prior of the arm's parameters.
    pub prior: &'a Prior,
    /// Weight of each joint's rows, 1/(N m)^2 or 1/N^2.
    pub weights: Vec<f64>,
    /// Normal matrix `Psi' W Psi` of the data, without the prior.
    normal: DMatrix<f64>,
    /// Cholesky factor of the normal matrix plus the prior's precision, with only the [`Self::fixed`] parameters held; `None` if singular.
    free: Option<Cholesky<f64, Dyn>>,
}

/// Parameters estimated by a regression in which a given torque is added to that of the parameters.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// Estimated parameters, SI.
    pub theta: Vec<f64>,
    /// Residuals by joint and row, N m or N.
    pub residual: Vec<Vec<f64>>,
    /// Weighted squared residuals plus squared distance from the prior.
    pub cost: f64,
    /// Squared distance of the parameters from the prior values, counted in standard deviations.
    pub prior_cost: f64,
}

impl<'a> Regression<'a> {
    /// A regression with given `weights` of each joint's rows, 1/(N m)^2 or 1/N^2.
    pub fn new(rows: &'a Rows, prior: &'a Prior, weights: Vec<f64>) -> Self {
        let p = rows.parameters;
        let mut normal = DMatrix::zeros(p, p);
        for (joint, weight) in rows.joints.iter().zip(&weights) {
            let psi = DMatrix::from_row_slice(joint.y.len(), p, &joint.psi);
            normal += *weight * psi.tr_mul(&psi);
        }
        let mut regression = Self { rows, prior, weights, normal, free: None };
        regression.free = regression.system(&regression.fixed());
        regression
    }

    /// A regression whose weights follow from the residuals of an estimate with the torque `beside` added to that of the parameters.
    pub fn reweighted(rows: &'a Rows, prior: &'a Prior, beside: &Signal) -> Self {
        let scale = |rows: &JointRows| {
            let square = rows.y.iter().map(|y| y * y).sum::<f64>() / rows.y.len().max(1) as f64;
            if square > 0.0 { 1.0 / (0.01 * square) } else { 0.0 }
        };
        let mut regression = Self::new(rows, prior, rows.joints.iter().map(scale).collect());
        for _ in 0..WEIGHT_ROUNDS {
            let found = regression.estimate(beside);
            regression = Self::new(rows, prior, rows.weights(&found.residual));
        }
        regression
    }

    /// Product `Psi' W s` of the weighted regressor with the torque signal `s`.
    fn along(&self, signal: &Signal) -> DVector<f64> {
        let p = self.rows.parameters;
        let mut total = DVector::zeros(p);
        for (j, s) in signal.iter().enumerate() {
            let Some(s) = s else { continue };
            for (row, s) in self.rows.joints[j].psi.chunks_exact(p).zip(s) {
                let scaled = self.weights[j] * s;
                total.iter_mut().zip(row).for_each(|(t, psi)| *t += scaled * psi);
            }
        }
        total
    }

    /// Weighted inner product `a' W b` of two torque signals.
    fn product(&self, a: &Signal, b: &Signal) -> f64 {
        let of = |j: usize| match (&a[j], &b[j]) {
            (Some(a), Some(b)) => self.weights[j] * a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>(),
            _ => 0.0,
        };
        (0..a.len()).map(of).sum()
    }

    /// Cholesky factor of the normal matrix plus the prior's precision, with the rows and columns of `held` parameters replaced by the identity;
    /// `None` if the matrix is not positive definite.
    fn system(&self, held: &[bool]) -> Option<Cholesky<f64, Dyn>> {
        let mut system = self.normal.clone();
        let p = self.rows.parameters;
        for i in 0..p {
            if held[i] {
                system.row_mut(i).fill(0.0);
                system.column_mut(i).fill(0.0);
                system[(i, i)] = 1.0;
            } else {
                system[(i, i)] += self.prior.sigma[i].powi(-2);
            }
        }
        system.cholesky()
    }

    /// Whether each parameter is fixed at its prior value, not estimated.
    fn fixed(&self) -> Vec<bool> {
        self.prior.sigma.iter().map(|s| *s <= 0.0).collect()
    }

    /// Estimates the parameters with the torque `beside` added to the torque of the parameters; [`Prior::positive`] parameters are held at zero where
    /// they would be negative.
    pub fn estimate(&self, beside: &Signal) -> Estimate {
        let p = self.rows.parameters;
        let torque: Signal = self
            .rows
            .joints
            .iter()
            .zip(beside)
            .map(|(rows, s)| {
                Some(match s {
                    Some(s) => rows.y.iter().zip(s).map(|(y, s)| y - s).collect(),
                    None => rows.y.clone(),
                })
            })
            .collect();
        let right = self.along(&torque);
        let mut held = self.fixed();
        let mut value = self.prior.theta.clone();
        for _ in 0..=p {
            let mut b = right.clone();
            for i in 0..p {
                if held[i] {
                    continue;
                }
                b[i] += self.prior.theta[i] * self.prior.sigma[i].powi(-2);
                for k in (0..p).filter(|k| held[*k]) {
                    b[i] -= self.normal[(i, k)] * value[k];
                }
            }
            for i in (0..p).filter(|i| held[*i]) {
                b[i] = value[i];
            }
            let Some(system) = self.system(&held) else { break };
            let found = system.solve(&b);
            value = found.iter().copied().collect();
            let negative: Vec<usize> =
                (0..p).filter(|i| !held[*i] && self.prior.positive[*i] && value[*i] < 0.0).collect();
            if negative.is_empty() {
                break;
            }
            for i in negative {
                (held[i], value[i]) = (true, 0.0);
            }
        }
        let residual = self.rows.residual(&value, beside);
        let prior_cost = self.prior.cost(&value);
        let data: f64 =
            residual.iter().zip(&self.weights).map(|(r, w)| w * r.iter().map(|r| r * r).sum::<f64>()).sum();
        Estimate { theta: value, residual, cost: data + prior_cost, prior_cost }
    }

    /// Standard deviations of the parameters, SI, from the inverse of the normal matrix plus the prior's precision; of fixed parameters those of the
    /// prior.
    pub fn sigma(&self) -> Vec<f64> {
        let fixed = self.fixed();
        let inverse = self.free.as_ref().map(Cholesky::inverse);
        (0..self.rows.parameters)
            .map(|i| match &inverse {
                Some(inverse) if !fixed[i] => inverse[(i, i)].max(0.0).sqrt(),
                _ => self.prior.sigma[i],
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    const ROWS: usize = 400;

    /// Rows of one joint with two parameters and a further torque of the given size: `y = 3 psi1 + 0.5 psi2 + size extra + noise`.
    fn rows(size: f64, noise: f64) -> (Rows, Signal) {
        let mut random = Random(3);
        let at = |k: usize, rate: f64| (rate * k as f64).sin();
        let psi: Vec<f64> = (0..ROWS).flat_map(|k| [at(k, 0.11), at(k, 0.23)]).collect();
        let extra: Vec<f64> = (0..ROWS).map(|k| at(k, 0.37)).collect();
        let y = (0..ROWS)
            .map(|k| 3.0 * psi[2 * k] + 0.5 * psi[2 * k + 1] + size * extra[k] + noise * random.normal())
            .collect();
        let block = (0..ROWS).map(|k| k / 20).collect();
        let joint = JointRows { y, psi, block, floor: vec![noise; ROWS] };
        (Rows { joints: vec![joint], parameters: 2, blocks: ROWS / 20, independent: 10 }, vec![Some(extra)])
    }

    fn prior(theta: [f64; 2], sigma: [f64; 2]) -> Prior {
        Prior { theta: theta.to_vec(), sigma: sigma.to_vec(), positive: vec![false, true] }
    }

    #[test]
    fn parameters_are_found_beside_a_known_torque() {
        let (rows, extra) = rows(1.0, 1e-3);
        let prior = prior([1.0, 1.0], [10.0, 10.0]);
        let regression = Regression::reweighted(&rows, &prior, &extra);
        let found = regression.estimate(&extra);
        assert!(
            (found.theta[0] - 3.0).abs() < 1e-3 && (found.theta[1] - 0.5).abs() < 1e-3,
            "{:?}",
            found.theta
        );
    }

    #[test]
    fn residuals_with_a_tested_torque_are_those_of_the_estimate_with_it() {
        let (rows, extra) = rows(0.4, 0.1);
        let prior = prior([1.0, 1.0], [10.0, 10.0]);
        let none = vec![None];
        let regression = Regression::reweighted(&rows, &prior, &none);
        let at = regression.estimate(&none);
        let column = std::slice::from_ref(&extra);
        let score = regression.score(&at, column, &[0.0]).unwrap();
        let beside =
            extra.iter().map(|s| s.as_ref().map(|s| s.iter().map(|s| score.size[0] * s).collect())).collect();
        let (first, fitted) =
            (regression.with_torques(&at, column, &score), regression.estimate(&beside).residual);
        assert!((score.size[0] - 0.4).abs() < 0.05, "{:?}", score.size);
        assert!(first[0].iter().zip(&fitted[0]).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    #[test]
    fn values_that_are_not_estimated_stay_and_coefficients_stay_positive() {
        let (rows, none) = (rows(0.0, 1e-3).0, vec![None]);
        let fixed = prior([2.0, 1.0], [0.0, 10.0]);
        assert_eq!(Regression::reweighted(&rows, &fixed, &none).estimate(&none).theta[0], 2.0);
        let mut turned = rows.clone();
        turned.joints[0].y.iter_mut().for_each(|y| *y = -*y);
        let free = prior([1.0, 1.0], [10.0, 10.0]);
        let found = Regression::reweighted(&turned, &free, &none).estimate(&none).theta;
        assert!((found[0] + 3.0).abs() < 0.3 && found[1] == 0.0, "{found:?}");
    }

    #[test]
    fn a_first_order_test_gives_the_size_and_what_the_cost_falls_by() {
        let (rows, extra) = rows(0.2, 1e-2);
        let (prior, none) = (prior([3.0, 0.5], [1.0, 1.0]), vec![None]);
        let regression = Regression::reweighted(&rows, &prior, &none);
        let before = regression.estimate(&none);
        let score = regression.score(&before, std::slice::from_ref(&extra), &[0.0]).unwrap();
        assert!((score.size[0] - 0.2).abs() < 5e-3, "{}", score.size[0]);
        let scaled: Signal = vec![extra[0].as_ref().map(|x| x.iter().map(|x| score.size[0] * x).collect())];
        let after = regression.estimate(&scaled);
        assert!((before.cost - after.cost - score.gain).abs() < 1e-6 * score.gain);
    }

    #[test]
    fn a_value_that_is_not_estimated_does_not_hide_a_term_of_its_kind() {
        let (rows, none) = (rows(0.0, 1e-3).0, vec![None]);
        let half = prior([1.0, 0.0], [10.0, 0.0]);
        let regression = Regression::reweighted(&rows, &half, &none);
        let term: Signal = vec![Some(rows.joints[0].psi.iter().skip(1).step_by(2).copied().collect())];
        let score = regression.score(&regression.estimate(&none), &[term], &[0.0]).unwrap();
        assert!((score.size[0] - 0.5).abs() < 0.01, "{}", score.size[0]);
    }

    #[test]
    fn the_sandwich_holds_its_level() {
        let (prior, none) = (prior([3.0, 0.5], [1.0, 1.0]), vec![None]);
        let mut random = Random(11);
        let (mut base, extra) = rows(0.0, 0.0);
        let clean = base.joints[0].y.clone();
        let mut outside = 0;
        for _ in 0..200 {
            // Noise that is correlated over several rows.
            let mut memory = 0.0;
            for (y, clean) in base.joints[0].y.iter_mut().zip(&clean) {
                memory = 0.7 * memory + 0.1 * random.normal();
                *y = clean + memory;
            }
            let regression = Regression::reweighted(&base, &prior, &none);
            let at = regression.estimate(&none);
            let column = std::slice::from_ref(&extra);
            let score = regression.score(&at, column, &[0.0]).unwrap();
            let sigma = regression.sandwich(&at.residual, column, &score)[(0, 0)].sqrt();
            outside += usize::from(score.size[0].abs() > 1.96 * sigma);
        }
        assert!((2..=24).contains(&outside), "{outside} of 200 outside 95 %");
    }

    #[test]
    fn correlated_residuals_weigh_less() {
        let mut random = Random(5);
        let white: Vec<f64> = (0..2000).map(|_| random.normal()).collect();
        let mut memory = 0.0;
        let coloured: Vec<f64> = white
            .iter()
            .map(|e| {
                memory = 0.8 * memory + e;
                memory
            })
            .collect();
        assert!(correlation_length(&white, 10) < 1.3);
        // The correlation length of a first-order autoregressive process is (1 + a) / (1 - a).
        assert!(
            (correlation_length(&coloured, 10) / 9.0 - 1.0).abs() < 0.35,
            "{}",
            correlation_length(&coloured, 10)
        );
    }
}
