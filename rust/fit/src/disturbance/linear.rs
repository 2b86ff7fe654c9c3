//! Linear fit of possible model errors and of Gaussian pulses (pushes) to the residual torque of one log.

use super::bell::Bell;
use super::residual::{Joint, Residual};
use super::scatter::scatter;
use crate::likelihood::solve::scaled_inverse;
use crate::numeric::products::{cross, product};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Correlation time of the residual torque in the fit of model errors, s.
const MODEL_TIME: f64 = 0.25;

/// Correlation time of the residual torque in the test of pushes, s.
const JUDGED_TIME: f64 = 0.06;

/// Least standard deviation of the residual torque, relative to the joint's typical torque, in the weights of the fit of model errors: the torque of
/// a joint that is hardly driven could otherwise be explained by parameters of no consequence.
const MODEL_SCATTER: f64 = 0.05;

/// Least part of a Gaussian pulse, as a weighted square, that the other columns of the linear fit must leave unexplained for the pulse to be
/// distinguished from them.
const DISTINCT: f64 = 0.15;

/// First guess of the residual torque's standard deviation, relative to the joint's typical torque.
const FIRST_SCATTER: f64 = 0.15;

/// Number of rounds in which the standard deviation of the residual torque is estimated again.
const SCATTER_ROUNDS: usize = 4;

/// Prior standard deviation of a push's height relative to the typical torque of its joint.
const PRIOR_PUSH_HEIGHT: f64 = 20.0;

/// Result of a linear fit of model errors and Gaussian pulses to residual torques.
pub struct Fitted {
    /// Residual torque after the fit, per joint and grid point, N m or N.
    left: Vec<Vec<f64>>,
    /// Inverse of the normal matrix of the linear fit.
    inverse: DMatrix<f64>,
    /// Gaussian pulses that take part in the fit.
    pub bells: Vec<Bell>,
    /// Weights per joint and grid point: for the test of pulses, and for the fit of model errors.
    weights: Vec<[Vec<f64>; 2]>,
}

/// Least-squares problem of one log: its residual torque as a sum of possible model errors and of Gaussian pulses (pushes), with the standard
/// deviation of the residual torque at each joint and grid point, which sets the weights.
pub struct Linear<'a, const N: usize> {
    /// Residual torque of the log with the columns of possible model errors.
    pub residual: &'a Residual<N>,
    /// Share of the time, 0 to 1, that each joint moves around each grid point.
    pub moving: Vec<Vec<f64>>,
    /// Standard deviation of the residual torque, N m or N, per joint and grid point.
    pub(super) scatter: Vec<Vec<f64>>,
    /// Indices of the columns of model errors that act on each joint.
    acting: Vec<Vec<usize>>,
}

impl<'a, const N: usize> Linear<'a, N> {
    /// Data of a linear fit of the residual torque, with the first guess of the residual torque's standard deviation.
    pub fn new(residual: &'a Residual<N>) -> Self {
        let moving = |x: &Joint| x.rest.iter().map(|r| (1.0 - r).clamp(0.0, 1.0)).collect();
        let acting = |x: &Joint| {
            (0..x.columns.len()).filter(|c| x.columns[*c].iter().any(|value| *value != 0.0)).collect()
        };
        let first = |x: &Joint| vec![FIRST_SCATTER * x.typical.max(1e-9); residual.t.len()];
        Self {
            residual,
            moving: residual.joints.iter().map(moving).collect(),
            scatter: residual.joints.iter().map(first).collect(),
            acting: residual.joints.iter().map(acting).collect(),
        }
    }

    /// Fits all columns of model errors and the given pulses, with the standard deviation of the residual torque re-estimated from what the fit
    /// leaves.
    pub fn settle(&mut self, bells: &[Bell]) -> Option<Fitted> {
        let mut fitted = self.fit(bells)?;
        for _ in 0..SCATTER_ROUNDS {
            self.scatter =
                (0..N).into_par_iter().map(|j| scatter(self.residual, j, &fitted.left[j])).collect();
            fitted = self.fit(bells)?;
        }
        Some(fitted)
    }

    /// Weighted linear least-squares fit of all columns of model errors and of the given pulses, at the present weights; `None` if it is singular.
    pub fn fit(&self, bells: &[Bell]) -> Option<Fitted> {
        let residual = self.residual;
        let (c, k) = (residual.prior.len(), residual.prior.len() + bells.len());
        let (mut normal, mut right) = (DMatrix::<f64>::zeros(k, k), DVector::<f64>::zeros(k));
        for (i, (expected, sigma)) in residual.prior.iter().enumerate() {
            let precision = sigma.powi(-2).min(1e24);
            normal[(i, i)] += precision;
            right[i] += precision * expected;
        }
        for (i, bell) in bells.iter().enumerate() {
            normal[(c + i, c + i)] +=
                (PRIOR_PUSH_HEIGHT * residual.joints[bell.joint].typical.max(1e-9)).powi(-2);
        }
        let rows: Vec<DMatrix<f64>> = (0..N).map(|j| self.rows(j, bells)).collect();
        let weights: Vec<[Vec<f64>; 2]> = (0..N).map(|j| self.weights(j)).collect();
        for j in 0..N {
            let own = bells.iter().enumerate().filter(|(_, bell)| bell.joint == j).map(|(b, _)| c + b);
            let acting: Vec<usize> = self.acting[j].iter().copied().chain(own).collect();
            let columns: Vec<&[f64]> = acting.iter().map(|i| rows[j].column(*i).data.into_slice()).collect();
            let weighted: Vec<Vec<f64>> = columns.iter().map(|x| times(x, &weights[j][1])).collect();
            let weighted: Vec<&[f64]> = weighted.iter().map(Vec::as_slice).collect();
            let parts: Vec<&[f64]> =
                columns.iter().copied().chain([residual.joints[j].lack.as_slice()]).collect();
            for (row, i) in cross(&weighted, &parts).chunks_exact(parts.len()).zip(&acting) {
                for (product, other) in row.iter().zip(&acting) {
                    normal[(*i, *other)] += product;
                }
                right[*i] -= row[acting.len()];
            }
        }
        let inverse = scaled_inverse(&normal)?;
        let values = &inverse * right;
        let left = (0..N).map(|j| {
            let joint = &residual.joints[j];
            let change = &rows[j] * &values;
            let held = joint.rest.iter().map(|rest| joint.holding * rest);
            let lack = joint.lack.iter().zip(change.iter()).map(|(r, d)| r + d);
            lack.zip(held).map(|(r, held)| r.signum() * (r.abs() - held).max(0.0)).collect()
        });
        let left = left.collect();
        Some(Fitted { left, inverse, bells: bells.to_vec(), weights })
    }

    /// Weights of joint `j`'s grid points for the test of pulses and for the fit of model errors.
    fn weights(&self, j: usize) -> [Vec<f64>; 2] {
        let tempering = self.residual.step / MODEL_TIME;
        let least = MODEL_SCATTER * self.residual.joints[j].typical;
        [0.0, least].map(|least| {
            let points = self.moving[j].iter().zip(&self.scatter[j]);
            points.map(|(moving, scatter)| tempering * moving / scatter.max(least).powi(2)).collect()
        })
    }

    /// Torque of joint `j` per unit of every column of model errors, then of every pulse, by grid point; pulses count negative.
    fn rows(&self, j: usize, bells: &[Bell]) -> DMatrix<f64> {
        let joint = &self.residual.joints[j];
        let c = joint.columns.len();
        DMatrix::from_fn(self.residual.t.len(), c + bells.len(), |i, k| match k.checked_sub(c) {
            None => joint.columns[k][i],
            Some(b) if bells[b].joint == j => -bells[b].at(self.residual.t[i]),
            Some(_) => 0.0,
        })
    }

    /// A Gaussian pulse with the height, N m or N, that best fits the torque left by `fitted`, and its size in standard deviations; size zero where
    /// the columns of the fit can imitate the pulse.
    pub fn weigh(&self, fitted: &Fitted, bell: &Bell) -> Bell {
        let (residual, j) = (self.residual, bell.joint);
        let (first, last) = self.reach(bell);
        let shape = bell.over(&residual.t[first..last], residual.step);
        let [judged, heeded] = [0, 1].map(|w| times(&shape, &fitted.weights[j][w][first..last]));
        let (columns, acting) = (&residual.joints[j].columns, &self.acting[j]);
        let torques = acting.iter().map(|i| &columns[*i]).chain([&fitted.left[j]]);
        let parts: Vec<&[f64]> = torques.map(|x| &x[first..last]).collect();
        let (c, k) = (columns.len(), columns.len() + fitted.bells.len());
        // Inner products of the pulse with the columns, under the weights for the test of pulses and under those for the fit of model errors.
        let products = cross(&[&judged, &heeded], &parts);
        let mut shared = DMatrix::<f64>::zeros(k, 2);
        for (s, weighted) in [&judged, &heeded].into_iter().enumerate() {
            for (i, product) in acting.iter().zip(&products[s * parts.len()..]) {
                shared[(*i, s)] = *product;
            }
            for (b, other) in fitted.bells.iter().enumerate().filter(|(_, b)| b.joint == j) {
                let times = residual.t[first..last].iter();
                shared[(c + b, s)] = -times.zip(weighted).map(|(t, w)| w * other.at(*t)).sum::<f64>();
            }
        }
        let (along, full) = (products[acting.len()], product(&judged, &shape));
        let imitated = shared.column(0).dot(&(&fitted.inverse * shared.column(1)));
        let own = (full - imitated).max(0.02 * full).max(1e-300);
        let size = along / own.sqrt() * (MODEL_TIME / JUDGED_TIME).sqrt();
        let distinct = own > DISTINCT * full;
        let sigma = (JUDGED_TIME / MODEL_TIME / own).sqrt();
        Bell { height: along / own, sigma, z: if distinct { size.abs() } else { 0.0 }, ..*bell }
    }

    /// Range of times, s, in which a pulse of standard deviation `width` lies within the log.
    pub fn span(&self, width: f64) -> (f64, f64) {
        let t = &self.residual.t;
        (t[0] + 2.0 * width, t[t.len() - 1] - 2.0 * width)
    }

    /// Index range of the grid points within four standard deviations of a pulse.
    fn reach(&self, bell: &Bell) -> (usize, usize) {
        let t = &self.residual.t;
        let from = bell.time - 4.0 * bell.width;
        let to = bell.time + 4.0 * bell.width;
        (t.partition_point(|t| *t < from), t.partition_point(|t| *t <= to))
    }
}

/// Values times weights.
fn times(values: &[f64], weights: &[f64]) -> Vec<f64> {
    values.iter().zip(weights).map(|(value, weight)| value * weight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_act_on_one_joint_are_fitted_to_it() {
        let t: Vec<f64> = (0..500).map(|i| 0.01 * f64::from(i)).collect();
        let wave = |rate: f64| -> Vec<f64> { t.iter().map(|t| (rate * t).sin()).collect() };
        let zero = vec![0.0; t.len()];
        // The first column acts on the first joint, the second on the second, the third on both.
        let columns = [vec![wave(2.0), zero.clone(), wave(5.0)], vec![zero.clone(), wave(3.0), wave(7.0)]];
        let sizes = [0.7, -0.4, 0.2];
        let joint = |columns: Vec<Vec<f64>>| {
            let lack = (0..t.len()).map(|i| columns.iter().zip(sizes).map(|(c, size)| -size * c[i]).sum());
            Joint { lack: lack.collect(), columns, rest: zero.clone(), holding: 0.0, typical: 1.0 }
        };
        let residual = Residual {
            step: 0.01,
            joints: columns.map(joint),
            prior: vec![(0.0, 1e3); 3],
            activity: vec![vec![1.0; t.len()]],
            t: t.clone(),
        };
        let linear = Linear::new(&residual);
        assert_eq!(linear.acting, [[0, 2], [1, 2]]);
        let fitted = linear.fit(&[]).expect("regular");
        assert!(fitted.left.iter().flatten().all(|left| left.abs() < 1e-6));
        let pulse = Bell { joint: 1, time: 2.5, width: 0.09, height: 0.0, sigma: 0.0, z: 0.0 };
        assert!(linear.weigh(&fitted, &pulse).height.abs() < 1e-5);
    }
}
