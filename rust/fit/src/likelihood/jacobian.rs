//! Jacobian of the predictions by the free values, at a point of a fit, with columns reused between neighbouring points.

use crate::likelihood::solve::{Effort, FitProblem, scaled_inverse};
use crate::likelihood::weighting::Gram;
use crate::model::hypothesis::Hypothesis;
use crate::predict::log_inputs::LogInputs;
use armgap_core::arm::Arm;

/// Part of a Jacobian column's squared length that is independent of the other columns, below which the column counts as collinear and no columns of
/// a neighbouring point are reused.
const COLLINEAR_BELOW: f64 = 0.05;

/// Jacobian of the predictions by all free values of a hypothesis, with the inner products of its columns under one weighting.
pub struct Sensitivities<const N: usize> {
    /// Whitened Jacobian columns, one for each free value.
    pub(crate) columns: Vec<Vec<f64>>,
    /// Inner products of the columns.
    gram: Gram,
    /// Inputs of the logs under the hypothesis.
    pub(crate) inputs: Option<LogInputs<N>>,
}

impl<const N: usize> Sensitivities<N> {
    /// Jacobian of a fit's predictions at a hypothesis.
    pub(crate) fn new<A: Arm<f64, N, P>, const P: usize>(
        problem: &FitProblem<A, N, P>,
        hypothesis: &Hypothesis<P>,
    ) -> Self {
        let (residual, inputs) = problem.residual_beside(hypothesis, None);
        let all: Vec<usize> = (0..hypothesis.values().len()).collect();
        let columns = problem.sensitivities(hypothesis, &residual, inputs.as_ref(), &all, false);
        let gram = problem.weighting.gram(problem.data, &views(&columns), &residual);
        Self { columns, gram, inputs }
    }

    /// Inner products of the columns and another residual.
    pub(crate) fn gram_with<A: Arm<f64, N, P>, const P: usize>(
        &self,
        problem: &FitProblem<A, N, P>,
        residual: &[f64],
    ) -> Gram {
        problem.weighting.gram_beyond(&self.gram, problem.data, &views(&self.columns), residual)
    }
}

/// Columns as slices.
fn views(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}

/// Jacobian columns of the free values, the first ones possibly reused from a neighbouring point, and their inner products.
pub(crate) struct Jacobian<'a> {
    reused_columns: &'a [Vec<f64>],
    computed: Vec<Vec<f64>>,
    pub(crate) gram: Gram,
    /// Whether the whole Jacobian is that of an earlier point of the fit.
    pub(crate) is_reused: bool,
}

impl<'a> Jacobian<'a> {
    /// Jacobian with all columns computed at the current point.
    pub(crate) fn new<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        problem: &FitProblem<A, N, P>,
        at: &Linearisation<N, P>,
        effort: Effort,
    ) -> Self {
        Self::with(problem, at, None, effort)
    }

    /// Jacobian with the columns `known` reused for the first values, unless the computed columns are collinear with them.
    pub(crate) fn reusing<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        problem: &FitProblem<A, N, P>,
        at: &Linearisation<N, P>,
        known: Option<&'a Sensitivities<N>>,
        effort: Effort,
    ) -> Self {
        let jacobian = Self::with(problem, at, known, effort);
        let apart = jacobian.reused_columns() == 0 || jacobian.are_distinct();
        if apart { jacobian } else { Self::new(problem, at, effort) }
    }

    fn with<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        problem: &FitProblem<A, N, P>,
        at: &Linearisation<N, P>,
        known: Option<&'a Sensitivities<N>>,
        effort: Effort,
    ) -> Self {
        let reused_columns = known.map_or(&[][..], |known| &known.columns);
        let rest: Vec<usize> = (reused_columns.len()..at.hypothesis.values().len()).collect();
        let (inputs, held) = (at.inputs.as_ref(), effort.holds_latent_states);
        let computed = problem.sensitivities(&at.hypothesis, &at.residual, inputs, &rest, held);
        let gram = known.map_or_else(Gram::default, |known| known.gram.clone());
        let mut jacobian = Self { reused_columns, computed, gram, is_reused: false };
        jacobian.reuse_at(problem, at);
        jacobian.is_reused = false;
        jacobian
    }

    /// Whether no computed Jacobian column is collinear with the other columns.
    fn are_distinct(&self) -> bool {
        let count = self.reused_columns() + self.computed.len();
        let normal = self.gram.total.view((0, 0), (count, count)).into_owned();
        scaled_inverse(&normal).is_some_and(|inverse| {
            let left = |i: usize| 1.0 / (inverse[(i, i)] * normal[(i, i)]);
            (self.reused_columns()..count).all(|i| normal[(i, i)] <= 0.0 || left(i) > COLLINEAR_BELOW)
        })
    }

    /// Whether all Jacobian columns were computed at the current point.
    pub(crate) fn is_current(&self) -> bool {
        self.reused_columns() == 0 && !self.is_reused
    }

    /// Number of Jacobian columns reused from a neighbouring point.
    pub(crate) fn reused_columns(&self) -> usize {
        self.reused_columns.len()
    }

    /// Reuses the Jacobian's columns at another point, with new inner products with the residual.
    pub(crate) fn reuse_at<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        &mut self,
        problem: &FitProblem<A, N, P>,
        at: &Linearisation<N, P>,
    ) {
        let columns: Vec<&[f64]> =
            self.reused_columns.iter().chain(&self.computed).map(Vec::as_slice).collect();
        self.gram = problem.weighting.gram_beyond(&self.gram, problem.data, &columns, &at.residual);
        self.is_reused = true;
    }
}

/// A point of a fit: a hypothesis with its whitened residual, the cost of every window, their weighted sum and the prior cost.
pub(crate) struct Linearisation<const N: usize, const P: usize> {
    pub(crate) hypothesis: Hypothesis<P>,
    pub(crate) residual: Vec<f64>,
    pub(crate) costs: Vec<f64>,
    pub(crate) data_cost: f64,
    pub(crate) prior_cost: f64,
    /// Inputs of the logs under the hypothesis.
    pub(crate) inputs: Option<LogInputs<N>>,
}

impl<const N: usize, const P: usize> Linearisation<N, P> {
    /// The point of a hypothesis; `known` are the inputs of the logs under another hypothesis, shared where they are the same.
    pub(crate) fn new<A: Arm<f64, N, P>>(
        problem: &FitProblem<A, N, P>,
        hypothesis: Hypothesis<P>,
        known: Option<&LogInputs<N>>,
    ) -> Self {
        let (residual, inputs) = problem.residual_beside(&hypothesis, known);
        let costs = problem.weighting.costs(problem.data, &residual);
        let data_cost = problem.weighting.total(&costs);
        let prior_cost = problem.prior.cost(&hypothesis.theta);
        Self { hypothesis, residual, costs, data_cost, prior_cost, inputs }
    }

    pub(crate) fn cost(&self) -> f64 {
        self.data_cost + self.prior_cost
    }
}
