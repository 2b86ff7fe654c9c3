//! Gaussian low-pass from uneven samples onto a regular grid, and differences on the grid.

use crate::numeric::products::product;

/// Gaussian low-pass from uneven samples onto a regular grid.
pub struct LowPass {
    /// Times of the grid, s.
    pub grid: Vec<f64>,
    /// Spacing of the grid, s.
    pub step: f64,
    /// Kernel of each grid point: the index of the first sample within four standard deviations of the Gaussian from the grid point's time, and the
    /// weights of the samples from that one on.
    pub kernels: Vec<(usize, Vec<f64>)>,
}

impl LowPass {
    /// Low-pass of standard deviation `width`, s, from samples at the times `t` onto a grid of spacing `step`, s.
    pub fn new(t: &[f64], step: f64, width: f64) -> Self {
        let (first, last) = (t[0], t[t.len() - 1]);
        let count = ((last - first) / step).floor() as usize;
        let grid: Vec<f64> = (0..=count).map(|i| first + i as f64 * step).collect();
        let kernels = grid.iter().map(|at| kernel(t, *at, step, width)).collect();
        Self { grid, step, kernels }
    }

    /// Weighted means of the samples `x` around every grid point.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        self.kernels.iter().map(|(first, weights)| product(weights, &x[*first..])).collect()
    }
}

/// Index of the first sample within four standard deviations of the instant `at`, and weights of the samples from that one on; each sample weighs in
/// proportion to its time interval.
fn kernel(t: &[f64], at: f64, step: f64, width: f64) -> (usize, Vec<f64>) {
    let reach = 4.0 * width;
    let (a, b) = (t.partition_point(|&t| t < at - reach), t.partition_point(|&t| t <= at + reach));
    let weight = |k: usize| {
        let before = if k > 0 { t[k] - t[k - 1] } else { step };
        before.min(width) * (-0.5 * ((t[k] - at) / width).powi(2)).exp()
    };
    let mut weights: Vec<f64> = (a..b).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        for weight in &mut weights {
            *weight /= sum;
        }
    }
    (a, weights)
}

/// Derivative of values on a grid of spacing `step` by central differences.
pub fn slope(x: &[f64], step: f64) -> Vec<f64> {
    let at = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(x.len() - 1));
        (x[b] - x[a]) / ((b - a).max(1) as f64 * step)
    };
    (0..x.len()).map(at).collect()
}
