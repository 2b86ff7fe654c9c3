//! Friction regularisation: the widths over which the sign of friction changes around standstill, fitted as a nuisance.
//!
//! Dry friction jumps at standstill; the friction of many simulators, and of joints that creep, follows `tanh(dq / width)`, on every joint with a
//! width of its own. The widths are never named as a cause, but a model with wrong widths mispredicts every reversal, and this error hides small
//! causes, or is attributed to an effect that acts at reversals too. So the model with the best widths is a rival of every candidate.

use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::jacobian::Sensitivities;
use crate::likelihood::solve::{Effort, Fit, FitProblem};
use crate::model::hypothesis::Hypothesis;
use crate::numeric::minimum::minimum;
use crate::predict::rollouts::MAX_SUBSTEPS_FRICTION;
use crate::search::acceptance::{ABOVE_FLOOR, is_regularisation};
use crate::search::attribute::{Candidate, SearchNode};
use armgap_core::arm::Arm;
use armgap_core::integrate::largest_stable_rate;

/// Widths of friction regularisation that are tried on all joints at once, relative to the slowest joint's RMS speed.
const RELATIVE_WIDTHS: [f64; 7] = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0];

/// Ranges of the searches for widths of friction regularisation, as factors above and below the centre: of the common width around the best of
/// `RELATIVE_WIDTHS`, and of each joint's width around the common one.
const WIDTH_RANGES: [f64; 2] = [4.0, 20.0];

/// Number of evaluations of the cost in each search for a width of friction regularisation: of the width common to all joints, and of one joint's
/// own.
const EVALUATIONS: [u64; 2] = [6, 7];

/// Search that refines a joint's width of friction regularisation after the parameters are fitted again: range as a factor above and below the
/// present width, and number of evaluations of the cost.
const WIDTH_REFINEMENT: (f64, u64) = (1.5, 6);

/// Largest number of rounds in which the widths of friction regularisation are refined, with the parameters fitted between the rounds.
const WIDTH_ROUNDS: usize = 3;

/// Widths of friction regularisation by joint, rad/s or m/s, and the cost of the model with these widths.
type Widths<const N: usize> = ([f64; N], f64);

/// Widths of lowest cost with one width for all of `joints`, within the factor `reach` above and below the first of these joints' width in `best`;
/// `best` itself if none has a lower cost.
fn nearby<const N: usize>(
    cost: &impl Fn([f64; N]) -> f64,
    best: Widths<N>,
    joints: std::ops::Range<usize>,
    (reach, evaluations): (f64, u64),
) -> Widths<N> {
    let (from, least) = best;
    let at = |logarithm: f64| {
        let mut widths = from;
        widths[joints.clone()].fill(logarithm.exp());
        widths
    };
    let centre = from[joints.start].ln();
    let found = minimum(|x| cost(at(x)), [centre - reach.ln(), centre + reach.ln()], evaluations);
    let found = found.map(|x| (at(x), cost(at(x))));
    found.filter(|(_, reached)| *reached < least).unwrap_or(best)
}

/// Widths of friction regularisation of least cost: the best of `tried` on all joints, then a common width near it, then one for each joint; none if
/// no cost is finite.
fn least_widths<const N: usize>(
    cost: impl Fn([f64; N]) -> f64,
    tried: impl IntoIterator<Item = f64>,
) -> Option<Widths<N>> {
    let mut best = tried
        .into_iter()
        .map(|width| ([width; N], cost([width; N])))
        .filter(|(_, cost)| cost.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    best = nearby(&cost, best, 0..N, (WIDTH_RANGES[0], EVALUATIONS[0]));
    if N > 1 {
        for joint in 0..N {
            best = nearby(&cost, best, joint..joint + 1, (WIDTH_RANGES[1], EVALUATIONS[1]));
        }
    }
    Some(best)
}

/// Widths of friction regularisation of least cost near the widths `from`, joint by joint; a joint of exact friction, whose width is zero, keeps it.
fn refined_widths<const N: usize>(cost: impl Fn([f64; N]) -> f64, from: [f64; N]) -> Widths<N> {
    (0..N)
        .filter(|j| from[*j] > 0.0)
        .fold((from, cost(from)), |best, joint| nearby(&cost, best, joint..joint + 1, WIDTH_REFINEMENT))
}

/// Widths of friction regularisation, each raised to the joint's `narrowest` if it is smaller, rad/s or m/s; the zero widths of exact friction
/// remain.
fn no_narrower<const N: usize>(widths: [f64; N], narrowest: [f64; N]) -> [f64; N] {
    std::array::from_fn(|j| if widths[j] > 0.0 { widths[j].max(narrowest[j]) } else { 0.0 })
}

/// The tried widths in increasing order, each raised to the smallest of the joints' `narrowest` widths if it is smaller, and equal ones listed once.
fn distinct<const N: usize>(tried: [f64; RELATIVE_WIDTHS.len()], narrowest: [f64; N]) -> Vec<f64> {
    let least = narrowest.into_iter().fold(f64::INFINITY, f64::min);
    let mut distinct: Vec<f64> = tried.into_iter().map(|width| width.max(least)).collect();
    distinct.dedup();
    distinct
}

/// Narrowest widths of friction regularisation by joint, rad/s or m/s, with which the integration steps of predictions are stable at the beginning of
/// every window.
fn narrowest_widths<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &FitProblem<A, N, P>,
    model: &Hypothesis<P>,
) -> Option<[f64; N]> {
    let plant = model.rounded_over([1.0; N]).plant(problem.arm)?;
    let mut narrowest = [0.0_f64; N];
    for window in &problem.data.windows {
        let rate = largest_stable_rate(problem.data.tracks[window.track].period(), MAX_SUBSTEPS_FRICTION);
        for (most, width) in narrowest.iter_mut().zip(plant.widths_at_rate(&window.initial_state.q, rate)) {
            *most = most.max(width);
        }
    }
    Some(narrowest)
}

/// The model with the widths of friction regularisation that `search` finds, given the cost of widths and the narrowest ones; none where the cost is
/// no lower than with the model's own widths. Costs are those after the model's values are estimated again to first order, from its `jacobian`.
fn with_widths<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &FitProblem<A, N, P>,
    model: &Hypothesis<P>,
    jacobian: &Sensitivities<N>,
    search: impl Fn(&dyn Fn([f64; N]) -> f64, [f64; N]) -> Option<Widths<N>>,
) -> Option<Hypothesis<P>> {
    let narrowest = narrowest_widths(problem, model)?;
    let regularised = |widths: [f64; N]| model.rounded_over(no_narrower(widths, narrowest));
    let cost = |widths: [f64; N]| problem.cost_refitted(&regularised(widths), jacobian);
    let (widths, least) = search(&cost, narrowest)?;
    (least < problem.cost_refitted(model, jacobian)).then(|| regularised(widths))
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The model with the widths of friction regularisation of lowest cost on the training windows, where the cost is that after the model's values
    /// are estimated again to first order from its `jacobian`; none where no width does better than the model's own.
    pub(crate) fn with_best_widths(
        &self,
        problem: &FitProblem<A, N, P>,
        model: &Hypothesis<P>,
        jacobian: &Sensitivities<N>,
    ) -> Option<Hypothesis<P>> {
        let tried = RELATIVE_WIDTHS.map(|part| part * self.scales.slowest());
        let search =
            |cost: &dyn Fn([f64; N]) -> f64, narrowest| least_widths(cost, distinct(tried, narrowest));
        with_widths(problem, model, jacobian, search)
    }

    /// Alternatives to a model: one with the widths of friction regularisation of lowest cost, and one with exact dry friction if the model's
    /// friction is regularised.
    pub fn regularisation_guesses(
        &self,
        model: &Hypothesis<P>,
        weights: &SplitWeighting<N>,
        jacobian: &Sensitivities<N>,
    ) -> Vec<Hypothesis<P>> {
        let regularised = self.with_best_widths(&self.problem(&weights.training), model, jacobian);
        let exact = model.is_rounded().then(|| model.rounded_over([0.0; N]));
        regularised.into_iter().chain(exact).collect()
    }

    /// Fit of the current model with friction regularised over the best widths; none if this does not explain most of the gap.
    pub fn regularisation(&self, node: &SearchNode<N, P>) -> Option<Fit<P>> {
        if node.excess() < ABOVE_FLOOR {
            return None;
        }
        let problem = self.problem(&node.weights.training);
        let model = &node.base.fit.hypothesis;
        let regularised = self.with_best_widths(&problem, model, &problem.jacobian(model))?;
        let found = self.candidate(&node.weights, &regularised, model.effects.len(), Effort::FULL, None);
        let best = self.with_widths_refined(node, found);
        is_regularisation(node, &best).then_some(best.fit)
    }

    /// A candidate with its widths of friction regularisation and its parameters refined in turn, as long as the cost falls.
    pub(crate) fn with_widths_refined(
        &self,
        node: &SearchNode<N, P>,
        mut best: Candidate<P>,
    ) -> Candidate<P> {
        let problem = self.problem(&node.weights.training);
        let cost = |of: &Candidate<P>| of.fit.data_cost + of.fit.prior_cost;
        for _ in 0..WIDTH_ROUNDS {
            let model = &best.fit.hypothesis;
            let own = std::array::from_fn(|j| model.rounding[j]);
            let near = |cost: &dyn Fn([f64; N]) -> f64, _| Some(refined_widths(cost, own));
            let Some(refined) = with_widths(&problem, model, &problem.jacobian(model), near) else { break };
            let found = self.candidate(&node.weights, &refined, model.effects.len(), Effort::FULL, None);
            if cost(&found) >= cost(&best) {
                break;
            }
            best = found;
        }
        best
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
        let (widths, cost) = least_widths(apart([0.005]), RELATIVE_WIDTHS).expect("finite costs");
        assert!((widths[0] / 0.005).ln().abs() < 0.05 && cost < 0.0025, "{widths:?}");
    }

    #[test]
    fn every_joint_has_a_width_of_its_own() {
        for best in [[0.002, 0.03], [0.05, 0.004], [0.01, 0.01]] {
            let (widths, _) = least_widths(apart(best), RELATIVE_WIDTHS).expect("finite costs");
            for (found, wanted) in widths.iter().zip(best) {
                assert!((found / wanted).ln().abs() < 0.2, "{widths:?} for {best:?}");
            }
        }
    }

    #[test]
    fn widths_that_cannot_be_simulated_are_passed_over() {
        let cost = |widths: [f64; 2]| if widths[0] < 0.01 { f64::NAN } else { widths[0] + widths[1] };
        let (widths, cost) = least_widths(cost, RELATIVE_WIDTHS).expect("some are finite");
        assert!(widths[0] >= 0.01 && cost.is_finite());
        assert!(least_widths(|_: [f64; 2]| f64::INFINITY, RELATIVE_WIDTHS).is_none());
    }

    #[test]
    fn widths_near_the_best_are_refined() {
        let (widths, cost) = refined_widths(apart([0.0076, 0.02]), [0.0084, 0.018]);
        for (found, wanted) in widths.iter().zip([0.0076_f64, 0.02]) {
            assert!((found / wanted).ln().abs() < 0.02, "{widths:?}");
        }
        assert!(cost < 1e-3);
        let (widths, _) = refined_widths(|widths| apart([0.0076])([widths[0]]), [0.0084, 0.0]);
        assert_eq!(widths[1], 0.0, "exact friction stays exact");
    }

    #[test]
    fn no_width_is_narrower_than_can_be_simulated() {
        let narrowest = [0.004, 0.01];
        assert_eq!(no_narrower([0.001, 0.02], narrowest), [0.004, 0.02]);
        assert_eq!(no_narrower([0.0, 0.002], narrowest), [0.0, 0.01]);
        assert_eq!(distinct(RELATIVE_WIDTHS, narrowest), [0.004, 0.01, 0.03, 0.1, 0.3, 1.0]);
        assert_eq!(distinct(RELATIVE_WIDTHS, [0.0; 2]), RELATIVE_WIDTHS);
    }
}
