//! What the holdout says of a fit: its cost there, beside what noise alone leaves and what predicting no motion would leave.

use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::solve::Fit;
use armgap_core::arm::Arm;

/// Error relative to the motion within a window below which a gap is of no consequence, whatever the encoders resolve.
pub const CONSEQUENTIAL_ERROR: f64 = 1e-3;

/// Share of windows that are left out where only the size of a gap is in question.
const SPOILT: f64 = 0.02;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// RMS error of a fit on the holdout relative to the motion.
    pub(crate) fn relative_gap(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> f64 {
        let costs = self.judge(&weights.holdout).raw_costs(&fit.hypothesis);
        (without_worst(costs) / self.motion(weights)).sqrt()
    }

    /// Student-t costs of the holdout windows, and their plain cost but for the worst few.
    pub fn judged_on_holdout(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> (Vec<f64>, f64) {
        let raw = self.judge(&weights.holdout).raw_costs(&fit.hypothesis);
        (raw.iter().map(|cost| weights.holdout.student_t_cost(*cost)).collect(), without_worst(raw))
    }

    /// Cost of predictions of the holdout.
    pub fn holdout_cost(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> f64 {
        self.judged_on_holdout(weights, fit).0.iter().sum()
    }

    /// Cost of predicting that every joint stays at the initial position of its window.
    pub(crate) fn motion(&self, weights: &SplitWeighting<N>) -> f64 {
        self.holdout.motion(&weights.holdout.scale)
    }

    /// Cost that measurement noise alone leaves on the holdout.
    pub(crate) fn floor(&self, weights: &SplitWeighting<N>) -> f64 {
        let per_row: f64 = (0..N).map(|j| (self.noise[j] / weights.holdout.scale[j]).powi(2)).sum();
        per_row * self.holdout.data.rows as f64
    }
}

/// Whether a prior cost, the squared distance from the arm file's values in sigmas, is plausible by chance.
pub fn is_plausible<const P: usize>(prior_cost: f64) -> bool {
    prior_cost <= P as f64 + 3.0 * (2.0 * P as f64).sqrt()
}

/// Sum of all costs but the worst few, which a bad initial state may have spoilt.
fn without_worst(mut costs: Vec<f64>) -> f64 {
    costs.sort_by(f64::total_cmp);
    let kept = costs.len() - (costs.len() as f64 * SPOILT) as usize;
    costs.iter().take(kept).sum()
}
