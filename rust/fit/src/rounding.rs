//! Friction that is rounded around standstill: the width over which its sign changes, fitted as a nuisance.
//!
//! Dry friction jumps; the friction of many simulators, and of joints that creep, follows `tanh(dq / width)`. The width is no cause of a gap that
//! has a name, but a model with another one misses every reversal, and what it misses there hides small causes.

use crate::attribute::Stage;
use crate::decide::{ABOVE_FLOOR, is_rounded};
use crate::model::Hypothesis;
use crate::solve::{Effort, Fit, Problem};
use crate::study::Study;
use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::brent::BrentOpt;
use armgap_core::arm::Arm;
use rayon::prelude::*;

/// Widths that are looked at first, relative to the slowest joint's RMS speed.
const WIDTHS: [f64; 6] = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0];

/// Parameters fitted to dry friction favour widths that are too small: the search goes down by the first factor and up by the second.
const REACH: [f64; 2] = [4.0, 16.0];

/// Evaluations of the search, each a fit of the parameters.
const EVALUATIONS: u64 = 9;

/// The cost of the data and of trust, parameters fitted, by the logarithm of the width.
struct ByWidth<'a, A, const N: usize, const P: usize> {
    problem: &'a Problem<'a, A, N, P>,
    model: &'a Hypothesis<P>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> CostFunction for ByWidth<'_, A, N, P> {
    type Param = f64;
    type Output = f64;

    fn cost(&self, width: &f64) -> Result<f64, Error> {
        let start = Hypothesis { smoothing: width.exp(), ..self.model.clone() };
        let fit = self.problem.solve(&start, Effort::ROUGH);
        Ok(fit.data_cost + fit.prior_cost)
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Study<A, N, P> {
    /// The current model with friction rounded over the best width, if that explains most of the gap.
    pub fn rounded(&self, stage: &Stage<N, P>) -> Option<Fit<P>> {
        if stage.excess() < ABOVE_FLOOR {
            return None;
        }
        let model = &stage.base.fit.hypothesis;
        let problem = self.problem(&stage.weights.training);
        let width = if model.smoothing > 0.0 { model.smoothing } else { self.likely_width(&problem, model)? };
        let by_width = ByWidth { problem: &problem, model };
        let search = BrentOpt::new((width / REACH[0]).ln(), (width * REACH[1]).ln());
        let found = Executor::new(by_width, search)
            .configure(|state| state.max_iters(EVALUATIONS))
            .timer(false)
            .run()
            .ok()?;
        let width = found.state.get_best_param()?.exp();
        let start = Hypothesis { smoothing: width, ..model.clone() };
        let contender = self.contender(&stage.weights, &start, model.effects.len(), Effort::FULL, &[]);
        is_rounded(stage, &contender).then_some(contender.fit)
    }

    /// The best of a few widths beside the parameters as they are, if it is better than dry friction.
    fn likely_width(&self, problem: &Problem<'_, A, N, P>, model: &Hypothesis<P>) -> Option<f64> {
        let cost = |smoothing: f64| {
            let rounded = Hypothesis { smoothing, ..model.clone() };
            problem.window_costs(&rounded).iter().sum::<f64>()
        };
        let slowest = self.scales.speed.iter().copied().fold(f64::INFINITY, f64::min);
        let widths: Vec<(f64, f64)> =
            WIDTHS.par_iter().map(|part| (cost(part * slowest), part * slowest)).collect();
        let (least, width) = widths.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        (least < cost(0.0)).then_some(width)
    }
}
