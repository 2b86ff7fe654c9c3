//! Cost of a fit on the holdout (sum of squared weighted residuals), compared with the cost of noise alone and of predicting no motion.

use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::solve::Fit;
use crate::model::hypothesis::Hypothesis;
use armgap_core::arm::Arm;

/// RMS prediction error, relative to the RMS motion within a window, below which a gap is of no consequence, at any resolution of the encoders.
pub const CONSEQUENTIAL_ERROR: f64 = 1e-3;

/// Share of the windows, those with the largest costs, that is left out when the size of a gap is computed.
const SPOILT: f64 = 0.02;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// RMS prediction error of a fit on the holdout relative to the RMS motion within a window; the few windows with the largest costs are left out
    /// of the error.
    pub(crate) fn relative_gap(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> f64 {
        (self.holdout_error(weights, &fit.hypothesis) / self.motion(weights)).sqrt()
    }

    /// Sum of the holdout windows' costs without robust weights under a model, the few largest left out.
    pub(crate) fn holdout_error(&self, weights: &SplitWeighting<N>, model: &Hypothesis<P>) -> f64 {
        without_worst(self.judge(&weights.holdout).raw_costs(model))
    }

    /// Student-t cost of every holdout window under a fit, and the sum of the windows' costs without robust weights, the few largest left out.
    pub fn judged_on_holdout(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> (Vec<f64>, f64) {
        let raw = self.judge(&weights.holdout).raw_costs(&fit.hypothesis);
        (raw.iter().map(|cost| weights.holdout.student_t_cost(*cost)).collect(), without_worst(raw))
    }

    /// Sum of the Student-t costs of all holdout windows under a fit.
    pub fn holdout_cost(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> f64 {
        self.judged_on_holdout(weights, fit).0.iter().sum()
    }

    /// Cost on the holdout of predicting that every joint stays at the initial position of its window.
    pub(crate) fn motion(&self, weights: &SplitWeighting<N>) -> f64 {
        self.holdout.motion(&weights.holdout.scale)
    }

    /// Expected cost of the holdout windows if their residuals were measurement noise alone.
    pub(crate) fn floor(&self, weights: &SplitWeighting<N>) -> f64 {
        let per_row: f64 = (0..N).map(|j| (self.noise[j] / weights.holdout.scale[j]).powi(2)).sum();
        per_row * self.holdout.data.rows as f64
    }
}

/// Whether a prior cost (squared distance of the `P` parameters from the arm file's values in units of sigma) may be due to chance: at most three
/// standard deviations above the mean of a chi-squared variable with `P` degrees of freedom.
pub fn is_plausible<const P: usize>(prior_cost: f64) -> bool {
    prior_cost <= P as f64 + 3.0 * (2.0 * P as f64).sqrt()
}

/// Sum of the windows' costs without the few largest, which may be due to a badly measured initial state.
fn without_worst(mut costs: Vec<f64>) -> f64 {
    costs.sort_by(f64::total_cmp);
    let kept = costs.len() - (costs.len() as f64 * SPOILT) as usize;
    costs.iter().take(kept).sum()
}
