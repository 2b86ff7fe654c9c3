//! Minimum of a function of one variable between bounds, by Brent's method.

use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::brent::BrentOpt;

struct Function<F>(F);

impl<F: Fn(f64) -> f64> CostFunction for Function<F> {
    type Param = f64;
    type Output = f64;

    fn cost(&self, x: &f64) -> Result<f64, Error> {
        Ok((self.0)(*x))
    }
}

/// Argument between `low` and `high` at which `f` is smallest, after at most `evaluations` iterations.
pub fn minimum(f: impl Fn(f64) -> f64, [low, high]: [f64; 2], evaluations: u64) -> Option<f64> {
    let found = Executor::new(Function(f), BrentOpt::new(low, high))
        .configure(|state| state.max_iters(evaluations))
        .timer(false)
        .run()
        .ok()?;
    found.state.get_best_param().copied()
}
