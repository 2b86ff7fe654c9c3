//! Friction regularisation: the widths over which the sign of friction changes around standstill, fitted as a nuisance.
//!
//! Dry friction jumps at standstill; the friction of many simulators, and of joints that creep, follows `tanh(dq / width)`, on every joint with a
//! width of its own. The widths are no cause of a gap that has a name, but a model with wrong widths misses every reversal, and this error hides
//! small causes, or takes the name of an effect that acts at reversals too. So the model with the best widths is a rival of every candidate, and of
//! every cause that is to stay.

use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::solve::{Effort, Fit, FitProblem};
use crate::model::hypothesis::Hypothesis;
use crate::numeric::minimum::minimum;
use crate::search::acceptance::{ABOVE_FLOOR, is_regularisation};
use crate::search::attribute::{Candidate, SearchNode};
use armgap_core::arm::Arm;

/// Widths of friction regularisation that are tried on all joints at once, relative to the slowest joint's RMS speed.
const WIDTHS: [f64; 7] = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0];

/// Factors, either way, of the searches for widths of friction regularisation: the common width around the best tried, each joint's around that.
const REACH: [f64; 2] = [4.0, 20.0];

/// Evaluations of the cost in each search for a width: of the common width, and of one joint's own.
const EVALUATIONS: [u64; 2] = [6, 7];

/// Times that the widths of friction regularisation are searched, with the parameters fitted between.
const ROUNDS: usize = 2;

/// Widths of friction regularisation by joint, rad/s or m/s, of least cost, and that cost: the best of `tried` on all joints, then a common width
/// near it, then one for each joint.
fn least_widths<const N: usize>(
    cost: impl Fn([f64; N]) -> f64,
    tried: impl IntoIterator<Item = f64>,
) -> Option<([f64; N], f64)> {
    let mut best = tried
        .into_iter()
        .map(|width| ([width; N], cost([width; N])))
        .filter(|(_, cost)| cost.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut search = |joints: std::ops::Range<usize>, reach: f64, evaluations: u64| {
        let (from, least) = best;
        let at = |logarithm: f64| {
            let mut widths = from;
            widths[joints.clone()].fill(logarithm.exp());
            widths
        };
        let centre = from[joints.start].ln();
        let within = [centre - reach.ln(), centre + reach.ln()];
        let Some(found) = minimum(|x| cost(at(x)), within, evaluations) else { return };
        let reached = cost(at(found));
        if reached < least {
            best = (at(found), reached);
        }
    };
    search(0..N, REACH[0], EVALUATIONS[0]);
    if N > 1 {
        for joint in 0..N {
            search(joint..joint + 1, REACH[1], EVALUATIONS[1]);
        }
    }
    Some(best)
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The model with the widths of friction regularisation that suit the training windows best, its values estimated again to first order from its
    /// `jacobian`; none where no width does better than the model's own.
    pub(crate) fn with_best_widths(
        &self,
        problem: &FitProblem<A, N, P>,
        model: &Hypothesis<P>,
        jacobian: &[Vec<f64>],
    ) -> Option<Hypothesis<P>> {
        let slowest = self.scales.slowest();
        let cost = |widths: [f64; N]| problem.cost_refitted(&model.rounded_over(widths), jacobian);
        let now = problem.cost_refitted(model, jacobian);
        let (widths, least) = least_widths(cost, WIDTHS.map(|part| part * slowest))?;
        (least < now).then(|| model.rounded_over(widths))
    }

    /// Alternatives to a model: with the widths of friction regularisation that suit it best, and with dry friction if the model's friction is
    /// regularised now.
    pub fn regularisation_guesses(
        &self,
        model: &Hypothesis<P>,
        weights: &SplitWeighting<N>,
        jacobian: &[Vec<f64>],
    ) -> Vec<Hypothesis<P>> {
        let regularised = self.with_best_widths(&self.problem(&weights.training), model, jacobian);
        let exact = model.is_rounded().then(|| model.rounded_over([0.0; N]));
        regularised.into_iter().chain(exact).collect()
    }

    /// The best fit of a model to the training windows, with its own widths of friction regularisation or with those that suit it best: what a model
    /// with a further cause is compared with.
    pub(crate) fn fit_with_any_rounding(&self, model: &Hypothesis<P>, weights: &SplitWeighting<N>) -> Fit<P> {
        let problem = self.problem(&weights.training);
        let fit = problem.solve(model, Effort::FULL);
        let jacobian = problem.jacobian(&fit.hypothesis);
        let Some(regularised) = self.with_best_widths(&problem, &fit.hypothesis, &jacobian) else {
            return fit;
        };
        let other = problem.solve(&regularised, Effort::FULL);
        let cost = |fit: &Fit<P>| fit.data_cost + fit.prior_cost;
        if cost(&other) < cost(&fit) { other } else { fit }
    }

    /// Fit of the current model with friction regularised over the best widths; none if this does not explain most of the gap.
    pub fn regularisation(&self, node: &SearchNode<N, P>) -> Option<Fit<P>> {
        if node.excess() < ABOVE_FLOOR {
            return None;
        }
        let problem = self.problem(&node.weights.training);
        let mut best: Candidate<P> = node.base.clone();
        for _ in 0..ROUNDS {
            let model = &best.fit.hypothesis;
            let Some(regularised) = self.with_best_widths(&problem, model, &problem.jacobian(model)) else {
                break;
            };
            let found = self.candidate(&node.weights, &regularised, model.effects.len(), Effort::FULL, &[]);
            if found.fit.data_cost + found.fit.prior_cost >= best.fit.data_cost + best.fit.prior_cost {
                break;
            }
            best = found;
        }
        is_regularisation(node, &best).then_some(best.fit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum over joints of squared differences between the logarithms of given and best widths.
    fn apart<const N: usize>(best: [f64; N]) -> impl Fn([f64; N]) -> f64 {
        move |widths| (0..N).map(|j| (widths[j] / best[j]).ln().powi(2)).sum()
    }

    #[test]
    fn a_common_width_is_found_between_those_tried() {
        let (widths, cost) = least_widths(apart([0.005]), WIDTHS).expect("finite costs");
        assert!((widths[0] / 0.005).ln().abs() < 0.05 && cost < 0.0025, "{widths:?}");
    }

    #[test]
    fn every_joint_has_a_width_of_its_own() {
        for best in [[0.002, 0.03], [0.05, 0.004], [0.01, 0.01]] {
            let (widths, _) = least_widths(apart(best), WIDTHS).expect("finite costs");
            for (found, wanted) in widths.iter().zip(best) {
                assert!((found / wanted).ln().abs() < 0.2, "{widths:?} for {best:?}");
            }
        }
    }

    #[test]
    fn widths_that_cannot_be_simulated_are_passed_over() {
        let cost = |widths: [f64; 2]| if widths[0] < 0.01 { f64::NAN } else { widths[0] + widths[1] };
        let (widths, cost) = least_widths(cost, WIDTHS).expect("some are finite");
        assert!(widths[0] >= 0.01 && cost.is_finite());
        assert!(least_widths(|_: [f64; 2]| f64::INFINITY, WIDTHS).is_none());
    }
}
