//! Windows that pushes touch, and the fit of these pushes by output error: their impulses, times and durations together.

use super::push::SHORTEST;
use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::solve::scaled_inverse;
use crate::likelihood::weighting::Weighting;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use armgap_core::arm::Arm;
use armgap_core::effect::{Effect, PulseShape};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Longest duration of a fitted push, s.
const LONGEST: f64 = 2.5;

/// Largest number of Levenberg-Marquardt steps in the fit of a push.
const MAX_PUSH_ITERATIONS: usize = 12;

/// Largest number of attempts at each step in the fit of a push, each with more damping.
const ATTEMPTS: usize = 6;

/// Relative decrease of the cost below which the fit of a push ends.
const PUSH_COST_TOLERANCE: f64 = 1e-4;

/// Durations, s, from which the fit of a push is started besides the duration seen in the residual torque.
const LONGER: [f64; 2] = [0.04, 0.12];

/// Number of values of a push: impulse, time and duration.
const VALUES: usize = 3;

/// Displacement of the model's values along a principal axis of their covariance, for sensitivities by finite difference, in standard deviations.
const AXIS_STEP: f64 = 0.01;

/// Windows that pushes touch, with the residual of their predictions under any values of these pushes.
pub(super) struct Touched<'a, A, const N: usize, const P: usize> {
    pub arm: &'a A,
    pub model: &'a Hypothesis<P>,
    pub sample: WindowSet<N>,
    pub weighting: Weighting<N>,
    /// Pushes of the log whose values stay.
    pub known: Vec<EffectInstance>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Touched<'_, A, N, P> {
    /// The log's known pushes and the pushes `free`.
    pub(super) fn with(&self, free: &[EffectInstance]) -> Vec<EffectInstance> {
        self.known.iter().chain(free).copied().collect()
    }

    /// Whitened residual of the windows under the known pushes and the pushes `free`.
    pub(super) fn residual_of(&self, free: &[EffectInstance]) -> Vec<f64> {
        self.residual_under(self.model, free)
    }

    /// Whitened residual of the windows under `model`, the known pushes and the pushes `free`.
    fn residual_under(&self, model: &Hypothesis<P>, free: &[EffectInstance]) -> Vec<f64> {
        let mut data = self.sample.data.clone();
        data.tracks[0].pushes = self.with(free);
        let predicted = data.predict(self.arm, model, &self.weighting.offsets);
        self.weighting.residual(&self.sample.measured, &predicted)
    }

    /// Cost of the windows under the known pushes and the pushes `free`, by robust weights.
    pub(super) fn cost_of(&self, free: &[EffectInstance]) -> f64 {
        self.cost(&self.residual_of(free))
    }

    /// Cost of the windows, all of one weight, under the model `own`, with initial states fitted to this model, the known pushes and the pushes `free`.
    pub(super) fn cost_under(
        &self,
        context: &DiagnosisContext<A, N, P>,
        own: &Hypothesis<P>,
        free: &[EffectInstance],
    ) -> f64 {
        let mut data = self.sample.data.clone();
        data.tracks[0].pushes = self.with(free);
        let sample = WindowSet { data, measured: self.sample.measured.clone() };
        let weighting = context.weighting(&sample, own, self.weighting.scale, &self.weighting.zeros);
        let known = self.known.clone();
        let there = Touched { arm: self.arm, model: own, sample, weighting, known };
        let residual = there.residual_of(free);
        there.weighting.costs(&there.sample.data, &residual).iter().sum()
    }

    /// Cost of the windows with the whitened residual `r`, by robust weights.
    fn cost(&self, r: &[f64]) -> f64 {
        self.weighting.total(&self.weighting.costs(&self.sample.data, r))
    }

    /// The pushes `first` fitted as pushes of one shape, the shape whose fit by `minimise` has the lowest cost, and that cost.
    pub(super) fn of_all_shapes(
        &self,
        first: &[EffectInstance],
        minimise: impl Fn(&Self, Vec<EffectInstance>) -> (Vec<EffectInstance>, f64),
    ) -> (Vec<EffectInstance>, f64) {
        let fits = PulseShape::ALL.map(|shape| minimise(self, shaped(first, shape.law())));
        let [first, second] = fits;
        if second.1 < first.1 { second } else { first }
    }

    /// Lowest of the minima reached from the push `first` and from longer pushes at the same time, and its cost.
    pub(super) fn least(&self, first: EffectInstance) -> (EffectInstance, f64) {
        let from = |first: EffectInstance| {
            let (fitted, cost) = self.minimise(vec![first]);
            (fitted[0], cost)
        };
        LONGER.iter().fold(from(first), |best, duration| {
            let [impulse, time, _] = first.p;
            let other = from(EffectInstance { p: [impulse, time, *duration], ..first });
            if other.1 < best.1 { other } else { best }
        })
    }

    /// Levenberg-Marquardt minimum of impulse, time and duration of all pushes from the pushes `free`, and its cost.
    pub(super) fn minimise(&self, free: Vec<EffectInstance>) -> (Vec<EffectInstance>, f64) {
        let mut r = self.residual_of(&free);
        let (mut free, mut cost, mut damping) = (free, self.cost(&r), 1e-2);
        for _ in 0..MAX_PUSH_ITERATIONS {
            let jacobian = self.jacobian(&free, &r);
            let columns: Vec<&[f64]> = jacobian.iter().map(Vec::as_slice).collect();
            let gram = self.weighting.gram(&self.sample.data, &columns, &r).total;
            let before = cost;
            for _ in 0..ATTEMPTS {
                let Some(next) = damped_step(&free, &gram, damping) else { return (free, cost) };
                let there = self.residual_of(&next);
                let lower = self.cost(&there);
                if lower < cost {
                    (free, r, cost) = (next, there, lower);
                    damping = f64::max(damping * 0.2, 1e-9);
                    break;
                }
                damping *= 8.0;
            }
            if before - cost <= PUSH_COST_TOLERANCE * before {
                break;
            }
        }
        (free, cost)
    }

    /// What is not known of a push's impulse, time and duration because its course over time is not: what another shape changes, as far as that shape's
    /// residual stays with the push as fitted (by the ratio of both residuals' norms).
    fn doubt_of_shape(&self, push: &EffectInstance) -> [f64; 3] {
        let left = self.cost_of(&[*push]);
        let mut doubt = [0.0_f64; 3];
        for shape in PulseShape::ALL.into_iter().filter(|shape| Some(*shape) != push.law.pulse_shape()) {
            let (other, its) = self.minimise(shaped(&[*push], shape.law()));
            let stays = (left / its).min(1.0).sqrt();
            for (doubt, (other, own)) in doubt.iter_mut().zip(other[0].p.iter().zip(push.p)) {
                *doubt = doubt.max((other - own).abs() * stays);
            }
        }
        doubt
    }

    /// Standard deviations of a push's impulse, time and duration, for a variance of the residual by [`noise`], a model known up to `covariance`, and a
    /// course over time that is known up to [`Self::doubt_of_shape`].
    pub(super) fn sigma(&self, push: &EffectInstance, covariance: &DMatrix<f64>) -> Option<[f64; 3]> {
        let of_shape = self.doubt_of_shape(push);
        let r = self.residual_of(&[*push]);
        let noise = noise(self.cost(&r), self.sample.data.rows * N, self.sample.data.windows.len() * N);
        let doubts = self.doubts(push, &r, covariance);
        let own = self.jacobian(&[*push], &r);
        let columns: Vec<&[f64]> = own.iter().chain(&doubts).map(Vec::as_slice).collect();
        let k = columns.len();
        let gram = self.weighting.gram(&self.sample.data, &columns, &r).total;
        let mut normal = gram.view((0, 0), (k, k)).into_owned() / noise;
        for i in VALUES..k {
            normal[(i, i)] += 1.0;
        }
        let inverse = scaled_inverse(&normal)?;
        Some(std::array::from_fn(|i| inverse[(i, i)].sqrt().hypot(of_shape[i])))
    }

    /// Whitened changes of the predictions along the principal axes of the model's covariance, each by one standard deviation.
    fn doubts(&self, push: &EffectInstance, r: &[f64], covariance: &DMatrix<f64>) -> Vec<Vec<f64>> {
        let values = self.model.values();
        let scale = covariance.diagonal().map(|v| if v > 0.0 && v.is_finite() { v.sqrt() } else { 0.0 });
        let known = |i: usize| if scale[i] > 0.0 { 1.0 / scale[i] } else { 0.0 };
        let correlation = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
            if scale[i] > 0.0 && scale[j] > 0.0 { covariance[(i, j)] * known(i) * known(j) } else { 0.0 }
        });
        let axes = correlation.symmetric_eigen();
        let column = |k: usize| {
            let along = AXIS_STEP * axes.eigenvalues[k].max(0.0).sqrt();
            let moved: Vec<f64> = values
                .iter()
                .enumerate()
                .map(|(i, v)| v + along * scale[i] * axes.eigenvectors[(i, k)])
                .collect();
            let there = self.residual_under(&self.model.with_values(&moved), &[*push]);
            r.iter().zip(&there).map(|(a, b)| (a - b) / AXIS_STEP).collect()
        };
        (0..scale.len()).filter(|k| axes.eigenvalues[*k] > 1e-9).map(column).collect()
    }

    /// Derivatives of the whitened prediction by impulse, time and duration of every push of `free`.
    fn jacobian(&self, free: &[EffectInstance], r: &[f64]) -> Vec<Vec<f64>> {
        let slope = |i: usize| {
            let (push, value) = (i / VALUES, i % VALUES);
            let mut moved = free.to_vec();
            let step = if value == 0 { 1e-4 * free[push].p[0].abs().max(1e-12) } else { 1e-5 };
            moved[push].p[value] += step;
            r.iter().zip(&self.residual_of(&moved)).map(|(a, b)| (a - b) / step).collect()
        };
        (0..VALUES * free.len()).into_par_iter().map(slope).collect()
    }
}

/// The pushes with another course over time.
fn shaped(pushes: &[EffectInstance], law: &'static dyn Effect<f64>) -> Vec<EffectInstance> {
    pushes.iter().map(|push| EffectInstance { law, ..*push }).collect()
}

/// One damped Gauss-Newton step of impulses, times and durations; `None` for a normal matrix that is singular or not finite.
fn damped_step(free: &[EffectInstance], gram: &DMatrix<f64>, damping: f64) -> Option<Vec<EffectInstance>> {
    let count = VALUES * free.len();
    let mut normal = gram.view((0, 0), (count, count)).into_owned();
    for i in 0..count {
        normal[(i, i)] *= 1.0 + damping;
    }
    let inverse = scaled_inverse(&normal)?;
    let change = &inverse * DVector::from_fn(count, |i, _| gram[(i, count)]);
    if change.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let moved = free.iter().zip(change.as_slice().chunks_exact(VALUES)).map(|(push, change)| {
        let [impulse, time, duration] = push.p;
        let duration = (duration + change[2]).clamp(SHORTEST, LONGEST);
        EffectInstance { p: [impulse + change[0], time + change[1], duration], ..*push }
    });
    Some(moved.collect())
}

/// Variance of a whitened residual of `samples` values in `windows` windows, with the sum of squares `cost`, as that of independent values of equal
/// information: what exceeds white noise, as a push of another course over time leaves it, has one value per window and joint.
fn noise(cost: f64, samples: usize, windows: usize) -> f64 {
    1.0 + (cost - samples as f64).max(0.0) / windows.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    #[test]
    fn a_step_that_is_not_finite_is_none() {
        let law = find::<f64>("external_pulse").expect("known");
        let free = [EffectInstance::new(law, 0, [1.0, 2.0, 0.1])];
        let mut gram = DMatrix::<f64>::identity(4, 4);
        gram[(0, 3)] = 0.5;
        let step = damped_step(&free, &gram, 0.0).expect("regular");
        assert!((step[0].p[0] - 1.5).abs() < 1e-9 && step[0].p[1..2] == [2.0], "{:?}", step[0].p);
        gram[(1, 3)] = f64::NAN;
        assert!(damped_step(&free, &gram, 0.0).is_none());
    }

    #[test]
    fn what_exceeds_white_noise_counts_once_per_window() {
        assert_eq!(noise(350.0, 400, 4), 1.0);
        assert_eq!(noise(480.0, 400, 4), 21.0);
    }
}
