//! Friction regularisation: the width over which the sign of friction changes around standstill, fitted as a nuisance.
//!
//! Dry friction jumps; the friction of many simulators, and of joints that creep, follows `tanh(dq / width)`. The width is no cause of a gap that
//! has a name, but a model with another one misses every reversal, and what it misses there hides small causes.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::solve::{Effort, Fit, FitProblem};
use crate::model::hypothesis::Hypothesis;
use crate::numeric::minimum::minimum;
use crate::search::acceptance::{ABOVE_FLOOR, is_regularisation};
use crate::search::attribute::SearchNode;
use armgap_core::arm::Arm;
use rayon::prelude::*;

/// Where nothing is accepted, widths that are fitted first, relative to the slowest joint's RMS speed.
const WIDTHS: [f64; 6] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0];

/// A short fit keeps some of the values that suit the width they come from, which has been too small so far: the search goes down from the
/// best by the first factor and up by the second.
const REACH: [f64; 2] = [4.0, 16.0];

/// Evaluations of the search, each a fit of the parameters.
const EVALUATIONS: u64 = 9;

/// Data cost plus prior cost, parameters fitted, as a function of the width.
struct ByWidth<'a, A, const N: usize, const P: usize> {
    problem: &'a FitProblem<'a, A, N, P>,
    model: &'a Hypothesis<P>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> ByWidth<'_, A, N, P> {
    fn rounded_over(&self, width: f64) -> Hypothesis<P> {
        Hypothesis { smoothing: width, ..self.model.clone() }
    }

    fn cost_of(&self, width: f64) -> f64 {
        let fit = self.problem.solve(&self.rounded_over(width), Effort::ROUGH);
        fit.data_cost + fit.prior_cost
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The current model with friction regularised over the best width, if that explains most of the gap.
    pub fn regularisation(&self, node: &SearchNode<N, P>) -> Option<Fit<P>> {
        if node.excess() < ABOVE_FLOOR {
            return None;
        }
        let (base, model) = (&node.base.fit, &node.base.fit.hypothesis);
        let problem = self.problem(&node.weights.training);
        let by_width = ByWidth { problem: &problem, model };
        let slowest = self.scales.slowest();
        let fitted: Vec<(f64, f64)> =
            WIDTHS.par_iter().map(|part| (by_width.cost_of(part * slowest), part * slowest)).collect();
        let (least, width) = fitted.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        if least >= base.data_cost + base.prior_cost {
            return None;
        }
        let within = [(width / REACH[0]).ln(), (width * REACH[1]).ln()];
        let best = minimum(|logarithm| by_width.cost_of(logarithm.exp()), within, EVALUATIONS)?;
        let initial_guess = by_width.rounded_over(best.exp());
        let candidate = self.candidate(&node.weights, &initial_guess, model.effects.len(), Effort::FULL, &[]);
        is_regularisation(node, &candidate).then_some(candidate.fit)
    }
}
