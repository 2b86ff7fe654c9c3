//! Rows of the filtered dynamic model over a whole log, `psi theta = y` (Reyes and Kelly 1997, equations 23 and 24).
//!
//! States lie half-way between samples, where a difference of positions gives the velocity to second order; the torque changes at the
//! sample between two states.

use crate::model::arm::WithArm;
use armgap_core::arm::Arm;
use armgap_core::cpu::Portable;
use armgap_core::filter::{CachedCoefficients, Cutoff};
use armgap_core::regression::{AllColumns, FilteredDynamic, SampleInterval, Snapshot, Variant};
use nalgebra::SVector;

/// A log from which regression rows are computed; rows of `q` and `tau` (one entry per joint) follow each other.
#[derive(Debug, Clone)]
pub struct RegressionRows<'a> {
    /// Cut-off of the first-order filters, rad/s.
    pub cutoff: f64,
    /// Sample times, s.
    pub t: &'a [f64],
    /// Measured positions, rad or m, row by row.
    pub q: &'a [f64],
    /// Torques held from each sample to the next, N m or N, row by row.
    pub tau: &'a [f64],
}

/// Regression rows of the filtered dynamic model, one per sample and joint; NaN at the first two samples.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    /// Regressor entries, ordered by sample, joint, parameter.
    pub psi: Vec<f64>,
    /// Filtered torques, N m or N, ordered by sample, joint.
    pub y: Vec<f64>,
}

impl WithArm for RegressionRows<'_> {
    type Output = Rows;

    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        _: [f64; P],
    ) -> Rows {
        let samples = self.t.len();
        let first = samples.min(2);
        let mut rows = Rows { psi: vec![f64::NAN; first * N * P], y: vec![f64::NAN; first * N] };
        if samples < 3 {
            return rows;
        }
        let row = |x: &[f64], k: usize| SVector::<f64, N>::from_fn(|j, _| x[k * N + j]);
        let between = |k: usize| {
            let (a, b, h) = (row(self.q, k - 1), row(self.q, k), self.t[k] - self.t[k - 1]);
            Snapshot { q: (a + b) * 0.5, dq: (b - a) / h }
        };
        let cutoff = Cutoff { rad_per_s: self.cutoff };
        let mut model = FilteredDynamic::new(&arm, Variant::Exact, &cutoff, &between(1));
        rows.psi.reserve((samples - first) * N * P);
        for k in 2..samples {
            let (before, after) = ((self.t[k - 1] - self.t[k - 2]) * 0.5, (self.t[k] - self.t[k - 1]) * 0.5);
            let interval = SampleInterval {
                h: before + after,
                split: before,
                first: row(self.tau, k - 2),
                second: row(self.tau, k - 1),
                middle: row(self.q, k - 1),
            };
            let (psi, y) =
                model.update::<Portable, A, _, P>(&arm, &AllColumns, Variant::Exact, &between(k), &interval);
            rows.psi.extend(psi.iter().flatten());
            rows.y.extend(y);
        }
        rows
    }
}

/// Filtered torques of one joint, N m or N: `y` of [`Rows`] for torques `tau` held from each sample to the next, without the regressor.
///
/// `t` are the sample times [s], `cutoff` is in rad/s; NaN at the first two samples.
pub fn filtered_torques(t: &[f64], tau: &[f64], cutoff: f64) -> Vec<f64> {
    let samples = t.len().min(tau.len());
    let mut y = vec![f64::NAN; samples.min(2)];
    y.reserve(samples);
    let coefficients = CachedCoefficients::new(&Cutoff { rad_per_s: cutoff });
    let (mut before, mut after) = (coefficients, coefficients);
    let mut torque = 0.0;
    for k in 2..samples {
        let half = [(t[k - 1] - t[k - 2]) * 0.5, (t[k] - t[k - 1]) * 0.5];
        torque = before.step(half[0]).held::<Portable>(torque, tau[k - 2]);
        torque = after.step(half[1]).held::<Portable>(torque, tau[k - 1]);
        y.push(torque);
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::arm::ArmDescription;
    use armgap_core::arm::ArmKind;

    /// Rows of a mass under constant force satisfy `m ddq + b dq = f` once the filters have settled.
    #[test]
    fn rows_times_parameters_are_the_torque() {
        let (m, b, f, h) = (2.0, 0.5, 3.0, 0.002);
        let t: Vec<f64> = (0..2000).map(|k| k as f64 * h).collect();
        let q: Vec<f64> = t.iter().map(|t| f / b * (t - m / b * (1.0 - (-b / m * t).exp()))).collect();
        let tau = vec![f; t.len()];
        let arm = ArmDescription {
            kind: ArmKind::Axis,
            gravity: 9.81,
            theta: vec![m, 0.0, b, 0.0],
            sigma: vec![1.0; 4],
            counts_per_rev: None,
            torque_limit: None,
            link_length: None,
            encoder_at_motor: None,
            friction_at_motor: None,
            gear_ratio: None,
        };
        let work = RegressionRows { cutoff: 30.0, t: &t, q: &q, tau: &tau };
        let rows = arm.dispatch(work).expect("an axis has four parameters");
        let worst = (500..t.len()).map(|k| {
            let sum: f64 = (0..4).map(|i| rows.psi[k * 4 + i] * arm.theta[i]).sum();
            (sum - rows.y[k]).abs()
        });
        assert!(rows.y[0].is_nan() && rows.y[1].is_nan());
        let alone = filtered_torques(&t, &tau, 30.0);
        assert!(
            alone[1].is_nan() && alone.iter().zip(&rows.y).skip(2).all(|(a, b)| (a - b).abs() < 1e-12 * f)
        );
        assert!(worst.fold(0.0, f64::max) < 1e-5 * f);
    }
}
