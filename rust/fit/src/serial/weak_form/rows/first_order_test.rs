//! First-order (score) tests of further torques against the residuals of a regression (Rao 1948), with covariances robust to correlated residuals.

use super::{Estimate, Regression, Signal};
use nalgebra::{DMatrix, DVector};

impl Regression<'_> {
    /// First-order (score) test of further torques, each of size 1 in `columns`, against the residual of the estimate `at`, with the parameters
    /// re-estimated at the same time; `ridge` is the prior precision (inverse variance) of each torque's size around zero. `None` if a matrix is
    /// singular or a torque is not finite.
    pub fn score(&self, at: &Estimate, columns: &[Signal], ridge: &[f64]) -> Option<Score> {
        let k = columns.len();
        let fixed = self.fixed();
        let system = self.free.as_ref()?;
        // Parameters that are not estimated cannot take over a part of the torque.
        let estimated = |mut along: DVector<f64>| {
            along.iter_mut().zip(&fixed).filter(|(_, fixed)| **fixed).for_each(|(x, _)| *x = 0.0);
            along
        };
        let along: Vec<DVector<f64>> = columns.iter().map(|c| estimated(self.along(c))).collect();
        let solved: Vec<DVector<f64>> = along.iter().map(|b| system.solve(b)).collect();
        let residual: Signal = at.residual.iter().cloned().map(Some).collect();
        let slope = DVector::from_fn(k, |i, _| self.product(&columns[i], &residual));
        let own = DMatrix::from_fn(k, k, |i, j| self.product(&columns[i], &columns[j]));
        let information = DMatrix::from_fn(k, k, |i, j| own[(i, j)] - along[i].dot(&solved[j]));
        let held = DMatrix::from_fn(k, k, |i, j| information[(i, j)] + if i == j { ridge[i] } else { 0.0 });
        let inverse = crate::likelihood::solve::scaled_inverse(&held)?;
        let size = &inverse * &slope;
        let gain = slope.dot(&size);
        let is_finite = gain.is_finite() && size.iter().all(|size| size.is_finite());
        is_finite.then(|| Score { size: size.iter().copied().collect(), gain, information, inverse, solved })
    }

    /// Size of a `torque` that is part of the model with the estimate `at`, relative to its size there, by an `instrument`, and the size's standard deviation,
    /// robust to correlated residuals (instrumental variables, Söderström and Stoica 1989, section 8.2, with the parameters re-estimated). A torque
    /// that is computed from logged torques contains the disturbances that act on the arm, and explains them; the instrument does not contain them.
    /// `None` where no parameter is estimated.
    pub fn instrumented(&self, at: &Estimate, torque: &Signal, instrument: &Signal) -> Option<[f64; 2]> {
        let fixed = self.fixed();
        let estimated = |signal: &Signal| {
            let mut along = self.along(signal);
            along.iter_mut().zip(&fixed).filter(|(_, fixed)| **fixed).for_each(|(x, _)| *x = 0.0);
            along
        };
        let imitated = self.free.as_ref()?.solve(&estimated(instrument));
        let shared = self.product(instrument, torque) - imitated.dot(&estimated(torque));
        let mut blocks = vec![0.0; self.rows.blocks];
        for (j, rows) in self.rows.joints.iter().enumerate() {
            let psi = rows.psi.chunks_exact(self.rows.parameters);
            for ((row, (r, psi)), block) in at.residual[j].iter().zip(psi).enumerate().zip(&rows.block) {
                let own = instrument[j].as_ref().map_or(0.0, |z| z[row]);
                let by_parameters: f64 = psi.iter().zip(imitated.iter()).map(|(a, b)| a * b).sum();
                blocks[*block] += self.weights[j] * r * (own - by_parameters);
            }
        }
        let used = blocks.iter().filter(|b| **b != 0.0).count() as f64;
        let scatter = blocks.iter().map(|b| b * b).sum::<f64>() * used / (used - 1.0).max(1.0);
        Some([1.0 + blocks.iter().sum::<f64>() / shared, scatter.sqrt() / shared.abs()])
    }

    /// The estimate `at` with the torques `columns` added at the sizes of their first-order test `score`, and the parameters changed with them, to
    /// first order: its residuals.
    pub fn with_torques(&self, at: &Estimate, columns: &[Signal], score: &Score) -> Vec<Vec<f64>> {
        let p = self.rows.parameters;
        let mut residual = at.residual.clone();
        for ((column, solved), size) in columns.iter().zip(&score.solved).zip(&score.size) {
            for (j, rows) in self.rows.joints.iter().enumerate() {
                for (row, r) in residual[j].iter_mut().enumerate() {
                    let psi = &rows.psi[row * p..(row + 1) * p];
                    let imitated: f64 = psi.iter().zip(solved.iter()).map(|(a, b)| a * b).sum();
                    *r -= size * (column[j].as_ref().map_or(0.0, |c| c[row]) - imitated);
                }
            }
        }
        residual
    }

    /// Covariance of the sizes of further torques, each of size 1 in `columns`, from the scatter of their scores over blocks, with the residuals of a
    /// model that includes the torques: robust to correlated residuals (sandwich estimator).
    pub fn sandwich(&self, residual: &[Vec<f64>], columns: &[Signal], score: &Score) -> DMatrix<f64> {
        let (k, p) = (columns.len(), self.rows.parameters);
        let mut blocks = vec![DVector::<f64>::zeros(k); self.rows.blocks];
        for (j, rows) in self.rows.joints.iter().enumerate() {
            for (row, r) in residual[j].iter().enumerate() {
                let psi = &rows.psi[row * p..(row + 1) * p];
                let weighted = self.weights[j] * r;
                let total = &mut blocks[rows.block[row]];
                for i in 0..k {
                    let own = columns[i][j].as_ref().map_or(0.0, |c| c[row]);
                    let imitated: f64 = psi.iter().zip(score.solved[i].iter()).map(|(a, b)| a * b).sum();
                    total[i] += weighted * (own - imitated);
                }
            }
        }
        let used = blocks.iter().filter(|b| b.iter().any(|x| *x != 0.0)).count() as f64;
        let mut scatter = DMatrix::<f64>::zeros(k, k);
        for block in &blocks {
            scatter += block * block.transpose();
        }
        let small_sample = used / (used - 1.0).max(1.0);
        &score.inverse * scatter * &score.inverse * small_sample
    }
}

impl Score {
    /// Information of the data on the size of torque `i`, with the parameters re-estimated, without the prior precision of the size.
    pub fn information(&self, i: usize) -> f64 {
        self.information[(i, i)]
    }

    /// Covariance of the torques' sizes if the weights of the rows describe the residuals' noise and correlation; see [`Regression::sandwich`] for
    /// the robust covariance.
    pub fn inverse(&self) -> &DMatrix<f64> {
        &self.inverse
    }
}

/// Result of a first-order (score) test of torques that are added to the torque of the parameters.
#[derive(Debug, Clone)]
pub struct Score {
    /// Estimated sizes of the tested torques, as factors on these torques.
    pub size: Vec<f64>,
    /// Decrease of the cost, to first order, when the tested torques are added.
    pub gain: f64,
    /// Information matrix of the data on the sizes of the tested torques, with the parameters re-estimated.
    information: DMatrix<f64>,
    /// Inverse of the information matrix plus the prior precision of the sizes.
    inverse: DMatrix<f64>,
    /// Change of the parameters whose torque comes closest, by weighted least squares, to each tested torque.
    solved: Vec<DVector<f64>>,
}
