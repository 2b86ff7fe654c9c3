//! Dispersion factor: standard deviations widened by the difference between fits to the training logs and to the holdout.
//!
//! A covariance from one set of windows reflects the scatter of the windows around their common fit, but no error that all windows share, such as
//! that of an initial state behind a gear, or of friction that is smoother than the model's. An error that differs from motion to motion becomes
//! visible when the model is also fitted to further motions. Standard deviations are widened by the factor by which two fits differ more than their
//! covariances say (the dispersion ratio of Birge 1932, over all values that the logs determine, and each value's own contribution).

use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::solve::{Effort, Fit};
use armgap_core::arm::Arm;

/// Ratio of a value's standard deviation to its prior standard deviation below which a fit counts as determining the value.
const DETERMINED: f64 = 0.5;

/// Factor on the squared difference of one value between two fits, a single observation of one degree of freedom; the larger of the product and the
/// mean of the squared differences of all values is the square of the value's dispersion factor.
const OWN: f64 = 0.5;

/// Largest dispersion factor of a standard deviation.
const MAX_DISPERSION: f64 = 1e3;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Widens the standard deviations of a fit by its dispersion factor against a fit of the same model to the holdout; returns the holdout fit.
    pub fn apply_dispersion_factor(&self, fit: &mut Fit<P>, weights: &SplitWeighting<N>) -> Fit<P> {
        let other = self.judge(&weights.holdout).solve(&fit.hypothesis, Effort::FULL);
        let squares = self.squared_differences(fit, &other);
        let known: Vec<f64> = squares.iter().flatten().copied().collect();
        if known.is_empty() {
            return other;
        }
        let shared = known.iter().sum::<f64>() / known.len() as f64;
        let factor: Vec<f64> = squares
            .iter()
            .map(|own| {
                shared.max(own.unwrap_or(0.0) * OWN).clamp(1.0, MAX_DISPERSION * MAX_DISPERSION).sqrt()
            })
            .collect();
        // The standard deviation of an arm parameter is not widened beyond the arm file's, which holds without any log.
        let widest = |i: usize| if i < P { self.prior.sigma[i] } else { f64::INFINITY };
        let scale: Vec<f64> = (0..factor.len())
            .map(|i| {
                (factor[i] * fit.covariance.student_t_factor(i)).min((widest(i) / fit.sigma(i)).max(1.0))
            })
            .collect();
        for ((i, j), value) in indices(factor.len()).zip(fit.covariance.matrix.iter_mut()) {
            *value *= scale[i] * scale[j];
        }
        other
    }

    /// Squared difference of every value between two fits in units of the sum of its variances in both; `None` for values that the logs do not
    /// determine.
    fn squared_differences(&self, here: &Fit<P>, there: &Fit<P>) -> Vec<Option<f64>> {
        let (a, b) = (here.hypothesis.values(), there.hypothesis.values());
        let one = |i: usize| {
            let determined = |fit: &Fit<P>| i >= P || fit.sigma(i) < DETERMINED * self.prior.sigma[i];
            let variance = here.sigma(i).powi(2) + there.sigma(i).powi(2);
            let square = (a[i] - b[i]).powi(2) / variance;
            (determined(here) && determined(there) && square.is_finite()).then_some(square)
        };
        (0..a.len()).map(one).collect()
    }
}

/// Row and column indices of the entries of an `n` by `n` matrix, column by column.
fn indices(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |j| (0..n).map(move |i| (i, j)))
}
