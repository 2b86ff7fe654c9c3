//! Gauss-Newton with Levenberg's damping over the arm's parameters and those of the effects together (output error).
//!
//! Minimises `cost = |residual|^2 (weighted) + |(theta - nominal) / sigma|^2`, where the second term is the prior, from the arm
//! file's values and sigmas, over the free values within their bounds.

use crate::likelihood::covariance::ParameterCovariance;
use crate::likelihood::jacobian::{Jacobian, Linearisation, Sensitivities};
use crate::likelihood::scale::Scales;
use crate::likelihood::weighting::{Gram, Weighting};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::log_inputs::LogInputs;
use crate::predict::window::Dataset;
use crate::progress::ProgressReporter;
use armgap_core::arm::Arm;
use armgap_core::rollout::WIDTH;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Displacement of a free value for derivatives by forward differences, relative to the value's typical size; events in rollouts are located to
/// 1e-12, so a forward difference is good to 1e-6.
const RELATIVE_STEP: f64 = 1e-6;

/// Largest error of the predicted decrease of the cost, relative to the decrease that ends a search, after which the Jacobian may end the search
/// at the next point.
const MAX_DECREASE_ERROR: f64 = 0.5;

/// Decrease of the cost predicted by a reused Jacobian, relative to the decrease that ends a search, below which the search ends.
const MIN_PREDICTED_DECREASE: f64 = 0.1;

/// Largest error of the predicted decrease of the cost, relative to the predicted decrease, at which Jacobian columns of a neighbouring hypothesis
/// are kept, or the whole Jacobian of an earlier point of a search that does not end on it.
const SERVES: f64 = 0.25;

/// Effort of a search for the minimum of the cost: limits of iterations and convergence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Largest number of Gauss-Newton iterations.
    pub iterations: usize,
    /// Relative decrease of the cost by an iteration below which the search ends.
    pub enough: f64,
    /// Whether the Jacobian of an earlier point may end the search.
    pub ends_on_reused: bool,
    /// Whether derivatives by the arm's own parameters leave out that these change latent states before the windows begin.
    pub holds_latent_states: bool,
}

impl Effort {
    /// Effort of a rough fit, enough to rank candidates.
    pub const ROUGH: Self =
        Self { iterations: 4, enough: 1e-2, ends_on_reused: true, holds_latent_states: true };
    /// Effort of a full fit, to the minimum of the cost.
    pub const FULL: Self =
        Self { iterations: 15, enough: 1e-4, ends_on_reused: false, holds_latent_states: false };
}

/// Normal prior of the arm's parameters, independent for each parameter.
#[derive(Debug, Clone, Copy)]
pub struct Prior<const P: usize> {
    /// Nominal parameters, from the arm file.
    pub theta: [f64; P],
    /// Prior standard deviations of the parameters, from the arm file.
    pub sigma: [f64; P],
    /// Number of inertial parameters, which come first; the remaining ones are friction coefficients and may not be negative.
    pub inertial: usize,
}

impl<const P: usize> Prior<P> {
    /// Prior cost of the parameters `theta`: squared distance from the arm file's values in units of sigma.
    pub fn cost(&self, theta: &[f64; P]) -> f64 {
        (0..P).map(|i| ((theta[i] - self.theta[i]) / self.sigma[i]).powi(2)).sum()
    }
}

/// Data of a fit, weighting of its residuals and prior of its parameters.
pub struct FitProblem<'a, A, const N: usize, const P: usize> {
    /// Model of the arm (dynamics without effects).
    pub arm: &'a A,
    /// Logs cut into windows.
    pub data: &'a Dataset<N>,
    /// Measured positions of the windows, rad or m, by window, sample and joint.
    pub measured: &'a [f64],
    /// Weighting of the residuals.
    pub weighting: &'a Weighting<N>,
    /// Prior of the arm's parameters.
    pub prior: &'a Prior<P>,
    /// Typical sizes of the effects' parameters.
    pub scales: &'a Scales<N>,
    /// Receiver of progress reports, with cancellation.
    pub progress: &'a ProgressReporter,
}

/// Result of a fit: hypothesis of lowest cost, its cost and the covariance of its values.
#[derive(Debug, Clone)]
pub struct Fit<const P: usize> {
    /// Hypothesis of lowest cost found.
    pub hypothesis: Hypothesis<P>,
    /// Cost of the data: weighted sum of squared residuals.
    pub data_cost: f64,
    /// Prior cost: squared distance of the arm's parameters from the arm file's values in units of sigma.
    pub prior_cost: f64,
    /// Covariance of the hypothesis's free values.
    pub covariance: ParameterCovariance,
    /// Cost of every window without its robust weight.
    pub costs: Vec<f64>,
}

impl<const P: usize> Fit<P> {
    /// Standard deviation of the free value with index `i`.
    pub fn sigma(&self, i: usize) -> f64 {
        self.covariance.matrix[(i, i)].max(0.0).sqrt()
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> FitProblem<'_, A, N, P> {
    /// Whitened residual of a hypothesis, measured minus predicted, by window, sample and joint.
    pub fn residual(&self, hypothesis: &Hypothesis<P>) -> Vec<f64> {
        self.residual_beside(hypothesis, None).0
    }

    /// Whitened residual of a hypothesis, and the inputs of the logs under it; `known` are those under another hypothesis, shared where they are the
    /// same.
    pub(crate) fn residual_beside(
        &self,
        hypothesis: &Hypothesis<P>,
        known: Option<&LogInputs<N>>,
    ) -> (Vec<f64>, Option<LogInputs<N>>) {
        self.progress.check();
        let (predicted, inputs) =
            self.data.predict_beside(self.arm, hypothesis, &self.weighting.offsets, known);
        (self.weighting.residual(self.measured, &predicted), inputs)
    }

    /// Student-t cost of every window under a hypothesis.
    pub fn window_costs(&self, hypothesis: &Hypothesis<P>) -> Vec<f64> {
        self.raw_costs(hypothesis).into_iter().map(|cost| self.weighting.student_t_cost(cost)).collect()
    }

    /// Cost of every window under a hypothesis, without robust weights.
    pub fn raw_costs(&self, hypothesis: &Hypothesis<P>) -> Vec<f64> {
        self.weighting.costs(self.data, &self.residual(hypothesis))
    }

    /// Whitened sensitivities of the prediction to the free values with indices `which`, given the residual at `hypothesis` and the inputs of the
    /// logs there. With `held`, those to the arm's own parameters leave out that these change latent states before the windows begin: of theta1 by
    /// 7 % for a shaft of 12 Hz with encoder and friction on the motor, by 23 % for one of 7 Hz.
    pub(crate) fn sensitivities(
        &self,
        hypothesis: &Hypothesis<P>,
        residual: &[f64],
        inputs: Option<&LogInputs<N>>,
        which: &[usize],
        held: bool,
    ) -> Vec<Vec<f64>> {
        let values = hypothesis.values();
        let steps = self.steps(hypothesis);
        let of_arm = inputs.filter(|_| held).map(LogInputs::with_latent_states_held);
        let moved = |i: usize| {
            let mut moved = values.clone();
            moved[i] += steps[i];
            hypothesis.with_values(&moved)
        };
        let moved: Vec<_> = which.iter().map(|&i| moved(i)).collect();
        let known: Vec<_> =
            which.iter().map(|&i| if i < P { of_arm.as_ref().or(inputs) } else { inputs }).collect();
        let column = |(&i, there): (&usize, Vec<f64>)| {
            residual.iter().zip(&there).map(|(here, there)| (here - there) / steps[i]).collect()
        };
        which.par_iter().zip(self.residuals_beside(&moved, &known)).map(column).collect()
    }

    /// Whitened residuals of hypotheses that differ in values alone; `known` are the inputs of the logs under another hypothesis for each, shared where
    /// they are the same. Latent states of several hypotheses are simulated at a time.
    pub(crate) fn residuals_beside(
        &self,
        hypotheses: &[Hypothesis<P>],
        known: &[Option<&LogInputs<N>>],
    ) -> Vec<Vec<f64>> {
        let some = |(hypotheses, known): (&[Hypothesis<P>], &[Option<&LogInputs<N>>])| {
            let inputs = self.data.inputs_beside(self.arm, hypotheses, known);
            let residual = |(hypothesis, inputs): (&Hypothesis<P>, &Option<LogInputs<N>>)| {
                self.residual_beside(hypothesis, inputs.as_ref()).0
            };
            hypotheses.par_iter().zip(&inputs).map(residual).collect::<Vec<_>>()
        };
        hypotheses.par_chunks(WIDTH).zip(known.par_chunks(WIDTH)).flat_map(some).collect()
    }

    /// Jacobian of the prediction by all free values.
    pub fn jacobian(&self, hypothesis: &Hypothesis<P>) -> Sensitivities<N> {
        Sensitivities::new(self, hypothesis)
    }

    /// Displacements of the free values for sensitivities by forward differences, inward at an upper bound.
    fn steps(&self, hypothesis: &Hypothesis<P>) -> Vec<f64> {
        let sizes = self.sizes(hypothesis);
        let (_, upper) = self.bounds(hypothesis);
        let values = hypothesis.values();
        (0..values.len())
            .map(|i| {
                let step = RELATIVE_STEP * sizes[i];
                if values[i] + step > upper[i] { -step } else { step }
            })
            .collect()
    }

    /// Typical sizes of the free values (`theta`, then the effects' parameters), SI.
    pub fn sizes(&self, hypothesis: &Hypothesis<P>) -> Vec<f64> {
        let theta = (0..P).map(|i| self.prior.theta[i].abs().max(self.prior.sigma[i]));
        let effects = hypothesis.effects.iter().flat_map(|e| self.scales.of(e));
        theta.chain(effects).collect()
    }

    /// Lower and upper bounds of the free values.
    fn bounds(&self, hypothesis: &Hypothesis<P>) -> (Vec<f64>, Vec<f64>) {
        let friction = |i: usize| {
            if i < self.prior.inertial { f64::NEG_INFINITY } else { 0.0 }
        };
        let mut lower: Vec<f64> = (0..P).map(friction).collect();
        let mut upper = vec![f64::INFINITY; P];
        for effect in &hypothesis.effects {
            for (i, parameter) in effect.law.spec().parameters.iter().enumerate() {
                let [least, most] = effect.bounds(i);
                let reach = self.scales.largest(parameter.quantity, effect.joint);
                let centre = self.scales.centre(parameter, effect.joint);
                let slowest = self.scales.fewest_cycles(parameter.quantity, effect.joint);
                lower.push(least.max(centre - reach).max(slowest));
                upper.push(most.min(centre + reach));
            }
        }
        (lower, upper)
    }

    /// Minimises the cost over all free values, starting from `initial_guess`.
    pub fn solve(&self, initial_guess: &Hypothesis<P>, effort: Effort) -> Fit<P> {
        self.solve_reusing(initial_guess, effort, None)
    }

    /// Minimises the cost from `initial_guess`, reusing the Jacobian columns `known` of a neighbouring hypothesis for the first values as long as the
    /// cost falls as these columns predict. The Jacobian of an earlier point is reused too, by a full fit as long as the cost falls as it predicts,
    /// but for its end.
    pub fn solve_reusing(
        &self,
        initial_guess: &Hypothesis<P>,
        effort: Effort,
        known: Option<&Sensitivities<N>>,
    ) -> Fit<P> {
        let (lower, upper) = self.bounds(initial_guess);
        let inputs = known.and_then(|known| known.inputs.as_ref());
        let mut at = Linearisation::new(self, initial_guess.clone(), inputs);
        let mut damping = 1e-4;
        let mut jacobian = Jacobian::reusing(self, &at, known, effort);
        'search: for _ in 0..effort.iterations {
            let (normal, gradient) =
                self.normal_equations(&jacobian.gram, at.hypothesis.values().len(), &at.hypothesis);
            let now = at.hypothesis.values();
            let mut fall = None;
            for _ in 0..6 {
                let next = step(&normal, &gradient, damping, &now, &lower, &upper);
                let values = inside(&now, next, [&lower, &upper], P);
                let change = DVector::from_fn(now.len(), |i, _| values[i] - now[i]);
                let foreseen = change.dot(&(2.0 * &gradient - &normal * &change));
                if jacobian.is_reused && foreseen < MIN_PREDICTED_DECREASE * effort.enough * at.cost() {
                    if effort.ends_on_reused {
                        break 'search;
                    }
                    break;
                }
                let trial = Linearisation::new(self, at.hypothesis.with_values(&values), at.inputs.as_ref());
                if trial.cost() < at.cost() {
                    fall = Some((at.cost() - trial.cost(), foreseen));
                    at = trial;
                    damping = (damping * 0.1).max(1e-9);
                    break;
                }
                if !jacobian.is_current() {
                    break;
                }
                damping = (damping * 10.0).min(1e6);
            }
            let enough = effort.enough * at.cost();
            match fall {
                None if !jacobian.is_current() => jacobian = Jacobian::new(self, &at, effort),
                Some((fall, foreseen)) if fall > enough => {
                    let missed = (fall - foreseen).abs();
                    let serves = missed < SERVES * foreseen;
                    let is_kept = if effort.ends_on_reused {
                        missed < MAX_DECREASE_ERROR * enough
                    } else {
                        serves && jacobian.reused_columns() == 0
                    };
                    if is_kept {
                        jacobian.reuse_at(self, &at);
                    } else if serves && jacobian.reused_columns() > 0 {
                        jacobian = Jacobian::reusing(self, &at, known, effort);
                    } else {
                        jacobian = Jacobian::new(self, &at, effort);
                    }
                }
                Some(_) if jacobian.is_reused && !effort.ends_on_reused => {
                    jacobian = Jacobian::new(self, &at, effort);
                }
                _ => break,
            }
        }
        self.progress.unit();
        let covariance = self.covariance(&jacobian.gram, &at);
        let Linearisation { hypothesis, data_cost, prior_cost, costs, .. } = at;
        Fit { hypothesis, data_cost, prior_cost, covariance, costs }
    }

    /// Cost at a hypothesis after a first-order re-estimate of its free values, with the Jacobian of a neighbouring hypothesis; infinite where it
    /// cannot be computed.
    pub(crate) fn cost_refitted(&self, hypothesis: &Hypothesis<P>, jacobian: &Sensitivities<N>) -> f64 {
        let (residual, _) = self.residual_beside(hypothesis, jacobian.inputs.as_ref());
        let gram = jacobian.gram_with(self, &residual);
        let k = gram.total.nrows() - 1;
        let (normal, gradient) = self.normal_equations(&gram, k, hypothesis);
        let as_it_is = gram.total[(k, k)] + self.prior.cost(&hypothesis.theta);
        let fall = inverse_of_seen(&normal).map_or(0.0, |inverse| gradient.dot(&(inverse * &gradient)));
        let cost = as_it_is - fall;
        if cost.is_finite() { cost } else { f64::INFINITY }
    }

    /// Normal matrix and right-hand side of a Gauss-Newton step over the free values, whose columns are the first `k` of `gram`, with the prior.
    pub(crate) fn normal_equations(
        &self,
        gram: &Gram,
        k: usize,
        hypothesis: &Hypothesis<P>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let residual = gram.total.ncols() - 1;
        let mut normal = gram.total.view((0, 0), (k, k)).into_owned();
        let mut gradient = gram.total.column(residual).rows(0, k).into_owned();
        for i in 0..P {
            let precision = 1.0 / self.prior.sigma[i].powi(2);
            normal[(i, i)] += precision;
            gradient[i] += precision * (self.prior.theta[i] - hypothesis.theta[i]);
        }
        (normal, gradient)
    }

    /// Covariance of the free values at a point of the fit.
    fn covariance(&self, gram: &Gram, at: &Linearisation<N, P>) -> ParameterCovariance {
        let (lower, upper) = self.bounds(&at.hypothesis);
        let prior_precision: Vec<f64> =
            (0..lower.len()).map(|i| if i < P { self.prior.sigma[i].powi(-2) } else { 0.0 }).collect();
        let range: Vec<f64> = lower.iter().zip(&upper).map(|(l, u)| u - l).collect();
        ParameterCovariance::new(gram, &self.data.blocks(), &prior_precision, &range)
    }
}

/// Values `next` after a step from the values `now`; those from index `free` on move by at most nine tenths of the distance to their lower bound, or
/// to an upper bound at zero, because an effect whose amplitude reaches zero has zero derivatives and could not return.
fn inside(now: &[f64], mut next: Vec<f64>, [lower, upper]: [&[f64]; 2], free: usize) -> Vec<f64> {
    for i in free..next.len() {
        if lower[i].is_finite() {
            next[i] = next[i].max(lower[i] + 0.1 * (now[i] - lower[i]));
        }
        if upper[i] < 0.0 {
            next[i] = next[i].min(upper[i] - 0.1 * (upper[i] - now[i]));
        }
    }
    next
}

/// Values after one damped Gauss-Newton step; values at a bound that the step would cross stay at the bound.
fn step(
    normal: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
    values: &[f64],
    lower: &[f64],
    upper: &[f64],
) -> Vec<f64> {
    let at_bound = |i: usize| {
        (values[i] <= lower[i] && gradient[i] < 0.0) || (values[i] >= upper[i] && gradient[i] > 0.0)
    };
    // A value that changes no prediction stays where it is.
    let seen = |i: usize| normal[(i, i)] > 0.0;
    let free: Vec<usize> = (0..values.len()).filter(|&i| seen(i) && !at_bound(i)).collect();
    let mut reduced = DMatrix::from_fn(free.len(), free.len(), |a, b| normal[(free[a], free[b])]);
    for a in 0..free.len() {
        reduced[(a, a)] *= 1.0 + damping;
    }
    let right = DVector::from_fn(free.len(), |a, _| gradient[free[a]]);
    let mut next = values.to_vec();
    if let Some(inverse) = scaled_inverse(&reduced) {
        let change = inverse * right;
        for (a, &i) in free.iter().enumerate().filter(|(a, _)| change[*a].is_finite()) {
            next[i] = (values[i] + change[a]).clamp(lower[i], upper[i]);
        }
    }
    next
}

/// Inverse of a symmetric positive definite matrix, scaled to a unit diagonal first.
pub fn scaled_inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let k = matrix.nrows();
    let scale = DVector::from_fn(k, |i, _| 1.0 / matrix[(i, i)].max(1e-300).sqrt());
    let mut scaled = DMatrix::from_fn(k, k, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    for i in 0..k {
        scaled[(i, i)] += 1e-12;
    }
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(k, k, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// Inverse of a normal matrix over the values that change some prediction; zero rows for values that change none, such as those of a joint limit that
/// no window reaches.
pub fn inverse_of_seen(normal: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let seen: Vec<usize> = (0..normal.nrows()).filter(|&i| normal[(i, i)] > 0.0).collect();
    let reduced = DMatrix::from_fn(seen.len(), seen.len(), |a, b| normal[(seen[a], seen[b])]);
    let inverse = scaled_inverse(&reduced)?;
    let mut whole = DMatrix::zeros(normal.nrows(), normal.nrows());
    for (a, &i) in seen.iter().enumerate() {
        for (b, &j) in seen.iter().enumerate() {
            whole[(i, j)] = inverse[(a, b)];
        }
    }
    Some(whole)
}

/// The effect switched off: amplitudes at their neutral values, shape parameters unchanged.
pub fn neutral(effect: &EffectInstance) -> EffectInstance {
    let mut off = *effect;
    for (value, parameter) in off.p.iter_mut().zip(effect.law.spec().parameters).take(effect.amplitudes()) {
        *value = parameter.neutral;
    }
    off
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_changes_nothing_leaves_the_others_their_inverse() {
        let normal = DMatrix::from_row_slice(3, 3, &[4.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 2.0]);
        let inverse = inverse_of_seen(&normal).unwrap();
        let product = &normal * &inverse;
        for (i, j) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
            assert!((product[(i, j)] - f64::from(u8::from(i == j))).abs() < 1e-9);
        }
        assert!(inverse.row(1).iter().chain(inverse.column(1).iter()).all(|x| *x == 0.0));
    }
}
