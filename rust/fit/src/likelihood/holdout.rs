//! Cost of a fit on the holdout, compared with the cost of noise alone and of predicting no motion.

use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::solve::Fit;
use armgap_core::arm::Arm;

/// RMS error relative to the motion within a window below which a gap is of no consequence, at any resolution of the encoders.
pub const CONSEQUENTIAL_ERROR: f64 = 1e-3;

/// Share of the windows, the worst ones, left out of the size of a gap.
const SPOILT: f64 = 0.02;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// RMS prediction error of a fit on the holdout relative to the RMS motion within a window.
    pub(crate) fn relative_gap(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> f64 {
        let costs = self.judge(&weights.holdout).raw_costs(&fit.hypothesis);
        (without_worst(costs) / self.motion(weights)).sqrt()
    }

    /// Student-t costs of the holdout windows, and the sum of their plain costs without the worst few.
    pub fn judged_on_holdout(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> (Vec<f64>, f64) {
        let raw = self.judge(&weights.holdout).raw_costs(&fit.hypothesis);
        (raw.iter().map(|cost| weights.holdout.student_t_cost(*cost)).collect(), without_worst(raw))
    }

    /// Sum of the plain costs of the holdout windows under a fit, without the worst few.
    pub fn holdout_cost(&self, weights: &SplitWeighting<N>, fit: &Fit<P>) -> f64 {
        self.judged_on_holdout(weights, fit).0.iter().sum()
    }

    /// Cost on the holdout of predicting that every joint stays at the initial position of its window.
    pub(crate) fn motion(&self, weights: &SplitWeighting<N>) -> f64 {
        self.holdout.motion(&weights.holdout.scale)
    }

    /// Cost that measurement noise alone leaves on the holdout.
    pub(crate) fn floor(&self, weights: &SplitWeighting<N>) -> f64 {
        let per_row: f64 = (0..N).map(|j| (self.noise[j] / weights.holdout.scale[j]).powi(2)).sum();
        per_row * self.holdout.data.rows as f64
    }
}

/// Whether a prior cost, the squared distance from the arm file's values in units of sigma, is plausible by chance.
pub fn is_plausible<const P: usize>(prior_cost: f64) -> bool {
    prior_cost <= P as f64 + 3.0 * (2.0 * P as f64).sqrt()
}

/// Sum of the windows' costs without the worst few, which a bad initial state may have spoilt.
fn without_worst(mut costs: Vec<f64>) -> f64 {
    costs.sort_by(f64::total_cmp);
    let kept = costs.len() - (costs.len() as f64 * SPOILT) as usize;
    costs.iter().take(kept).sum()
}
