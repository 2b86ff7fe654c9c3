//! Output-error fit of a push (external disturbance): impulse, time and duration that minimise the prediction errors of the windows that the push
//! touches.

use super::outlying::outlying_probability;
use super::own::Own;
use super::push::{Disturbance, Place, PushState, SHORTEST};
use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::solve::scaled_inverse;
use crate::likelihood::weighting::Weighting;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::window::Dataset;
use armgap_core::arm::Arm;
use armgap_core::effect::{Effect, PulseShape};
use armgap_core::transmission::LatentState;
use nalgebra::{DMatrix, DVector, Vector3};

/// Largest distance in time, s, from a push's Gaussian pulse to a window that takes part in the fit of the push.
const MAX_WINDOW_DISTANCE: f64 = 0.25;

/// Impulse up to which a push on an arm whose model has backlash is none, relative to the largest impulse that rotor and link exchange through the
/// backlash in the log: a wrong instant or strength of an impact leaves such an impulse. Pushes that nobody gave had 0.02 to 0.12, those that were given
/// 0.24 and more (docs/decisions/025-knocks.md).
const OF_AN_IMPACT: f64 = 0.2;

/// Longest duration of a fitted push, s.
const LONGEST: f64 = 2.5;

/// Least share of the cost of the windows that a push touches which the push must remove to be kept where the model leaves errors unexplained.
const HELPS: f64 = 0.05;

/// Least share of the windows' cost, with the model refitted to the recording, that a push must remove to be kept where the model leaves errors
/// unexplained; the model fitted to the recording with the push is compared with the model fitted without it.
const HELPS_OWN: f64 = 0.02;

/// Least share that a push must explain of the cost of the windows that it touches before its size by output error is believed.
const PUSH_EXPLAINED_SHARE: f64 = 0.5;

/// Largest shift of a push's time by the output-error fit, relative to the push's duration.
const MOVED: f64 = 0.3;

/// Shift of a push's time by the output-error fit that is always allowed, s.
const MOVED_LEAST: f64 = 0.1;

/// Largest factor by which the output-error fit may change the impulse of a push where the model leaves errors unexplained.
const CHANGED: f64 = 1.5;

/// Largest number of Levenberg-Marquardt steps in the fit of a push.
const MAX_PUSH_ITERATIONS: usize = 12;

/// Largest number of attempts at each step in the fit of a push, each with more damping.
const ATTEMPTS: usize = 6;

/// Relative decrease of the cost below which the fit of a push ends.
const PUSH_COST_TOLERANCE: f64 = 1e-4;

/// Durations, s, from which the fit of a push is started besides the duration seen in the residual torque.
const LONGER: [f64; 2] = [0.04, 0.12];

/// Number of rounds in which initial states and weights of the windows are recomputed with a fitted push in the model.
const PUSH_ROUNDS: usize = 2;

/// Displacement of the model's values along a principal axis of their covariance, for sensitivities by finite difference, in standard deviations.
const AXIS_STEP: f64 = 0.01;

/// Windows that a push touches, with the residual of their predictions under any values of the push.
struct Touched<'a, A, const N: usize, const P: usize> {
    arm: &'a A,
    model: &'a Hypothesis<P>,
    sample: WindowSet<N>,
    weighting: Weighting<N>,
    known: &'a [EffectInstance],
    push: EffectInstance,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Whether the prediction errors of a log leave room for a push that matters; always true where the model leaves errors unexplained.
    pub(super) fn could_hold_a_push(&self, (set, track): Place, state: &PushState<'_, N, P>) -> bool {
        if state.remainder {
            return true;
        }
        let whole = [&self.training, &self.holdout][set];
        let data = whole.data.of_track(track, |_| true).without_pushes();
        let (weighting, predicted) = self.at_measured_starts(&data, state);
        let residual = weighting.residual(&data.measured(), &predicted);
        weighting.costs(&data, &residual).iter().sum::<f64>() > least_gain(whole, state)
    }

    /// Largest impulse, N m s (N s), that a rotor and its link exchange through backlash in a log under `model`; zero for a model without backlash.
    fn impact_impulse(&self, (set, track): Place, model: &Hypothesis<P>) -> f64 {
        if !model.effects.iter().any(EffectInstance::is_backlash) {
            return 0.0;
        }
        let data = [&self.training, &self.holdout][set].data.of_track(track, |_| true);
        impact_impulse(&data, &self.arm, model)
    }

    /// Weighting around the model and the model's predictions, with every window at its measured initial state.
    fn at_measured_starts(&self, data: &Dataset<N>, state: &PushState<'_, N, P>) -> (Weighting<N>, Vec<f64>) {
        let offsets = state.zeros.offsets(data);
        let predicted = data.predict(&self.arm, state.model, &offsets);
        let weighting = Weighting::new(data, &self.arm, state.model, state.scale, offsets, &predicted);
        (weighting.with_zeros(state.zeros.clone()), predicted)
    }

    /// The push `rough` with the impulse, time and duration fitted by output error, and the share of the cost that the push explains; `None` if the
    /// share is too small.
    ///
    /// The share counts from the cost of the model without the push, or of the model refitted to the recording alone if that is less. Where the model
    /// leaves errors unexplained and the output error explains too little to be believed, or leaves the impulse unknown, `rough` is returned unchanged if
    /// the push lowers the cost under the model or under the refitted one. `known` are the recording's further pushes, and `meanwhile` first estimates of
    /// those that act on other joints at the same time, beside which the push is fitted; its share counts from the cost without them.
    pub(super) fn sized(
        &self,
        rough: Disturbance,
        state: &PushState<'_, N, P>,
        own: &Own<'_, A, N, P>,
        known: &[Disturbance],
        meanwhile: &[Disturbance],
    ) -> Option<Disturbance> {
        let whole = if rough.holdout { &self.holdout } else { &self.training };
        let sample = WindowSet { data: whole.data.without_pushes(), measured: whole.measured.clone() };
        let data = around(&sample, &rough);
        if data.windows.is_empty() {
            return state.remainder.then_some(rough);
        }
        let least = least_gain(&sample, state);
        let usual = self.weighting(&sample, state.model, state.scale, state.zeros).typical
            * data.windows.len() as f64;
        let (weighting, _) = self.at_measured_starts(&data, state);
        let sample = WindowSet::new(data);
        let in_this_log = |e: &&Disturbance| e.place() == rough.place();
        let before: Vec<EffectInstance> = known.iter().filter(in_this_log).map(|e| e.push).collect();
        let here: Vec<EffectInstance> =
            before.iter().copied().chain(meanwhile.iter().map(|e| e.push)).collect();
        let mut touched = Touched {
            arm: &self.arm,
            model: state.model,
            sample,
            weighting,
            known: &before,
            push: rough.push,
        };
        let p = Vector3::from(rough.push.p);
        let none = Vector3::new(0.0, p[1], p[2]);
        let mut bare = touched.cost(&touched.residual_of(&none));
        if !state.remainder {
            bare = touched.cost_under(self, own.bare(), &none).min(bare);
        }
        touched.known = &here;
        let seen = touched.cost(&touched.residual_of(&p));
        // Where the model leaves errors unexplained, a search from other durations would fit these errors instead of the push.
        let (law, mut fitted, left) = touched
            .of_all_shapes(|touched| if state.remainder { touched.minimise(p) } else { touched.least(p) });
        let share = |left: f64| (bare - left) / (bare - usual.min(0.5 * bare)).max(1e-300);
        let believed = share(left) > PUSH_EXPLAINED_SHARE && bare - left > least;
        if believed && close(&fitted, &p, state.remainder) {
            touched.push.law = law;
            for _ in 0..PUSH_ROUNDS {
                touched.sample.data.tracks[0].pushes = touched.with(&fitted);
                touched.weighting = self.weighting(&touched.sample, state.model, state.scale, state.zeros);
                (fitted, _) = touched.minimise(fitted);
            }
            let push = EffectInstance { p: fitted.into(), ..touched.push };
            let share = share(left);
            let largest = self.impact_impulse(rough.place(), state.model);
            let sigma = if fitted[0].abs() < OF_AN_IMPACT * largest {
                None
            } else {
                touched.sigma(&fitted, state.covariance)
            };
            let sized = sigma.map(|sigma| Disturbance { push, sigma, share, ..rough });
            if !state.remainder {
                // Windows far above the typical one show a push that is lost in the scatter of the residual torque.
                let probability = rough.probability.max(outlying_probability(bare, usual));
                return sized.map(|sized| Disturbance { probability, ..sized });
            }
            if sized.as_ref().is_some_and(Disturbance::is_known) {
                return sized;
            }
        }
        if !state.remainder {
            return None;
        }
        touched.push.law = rough.push.law;
        if share(seen) > HELPS {
            return Some(Disturbance { share: share(seen), ..rough });
        }
        let others: Vec<&Disturbance> = known.iter().collect();
        let with: Vec<&Disturbance> = known.iter().chain([&rough]).collect();
        let without = touched.cost_under(self, &own.beside(&others), &none);
        let share = 1.0 - touched.cost_under(self, &own.beside(&with), &p) / without;
        (share > HELPS_OWN).then_some(Disturbance { share, ..rough })
    }
}

/// Least decrease of the windows' cost by a push that is large enough to matter.
fn least_gain<const N: usize, const P: usize>(sample: &WindowSet<N>, state: &PushState<'_, N, P>) -> f64 {
    state.min_relevance.powi(2) * sample.motion(&state.scale)
}

/// Variance of a whitened residual of `samples` values in `windows` windows, with the sum of squares `cost`, as that of independent values of equal
/// information: what exceeds white noise, as a push of another course over time leaves it, has one value per window and joint.
fn noise(cost: f64, samples: usize, windows: usize) -> f64 {
    1.0 + (cost - samples as f64).max(0.0) / windows.max(1) as f64
}

/// Largest momentum of a rotor against its link, N m s (N s), in the first log of `data` under a model.
fn impact_impulse<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    data: &Dataset<N>,
    arm: &A,
    model: &Hypothesis<P>,
) -> f64 {
    let (Some(plant), Some(inputs)) = (model.plant(arm), data.log_inputs(arm, model)) else { return 0.0 };
    let momentum = |latent: &LatentState<f64, N>| {
        let of = |j: usize| Some(plant.drivetrain().get(j)?.inertia * latent.deflection_rate[j].abs());
        (0..N).filter_map(of).fold(0.0, f64::max)
    };
    inputs.latent(0).unwrap_or_default().iter().map(momentum).fold(0.0, f64::max)
}

/// Whether the fitted push (impulse, time, duration) agrees in time and sign with the one seen in the residual torque; where the model leaves errors
/// unexplained (`remainder`) also in size, as the fit may have taken up part of these errors.
fn close(fitted: &Vector3<f64>, seen: &Vector3<f64>, remainder: bool) -> bool {
    let ratio = fitted[0] / seen[0];
    let near = (fitted[1] - seen[1]).abs() < (MOVED * seen[2]).max(MOVED_LEAST);
    near && if remainder { ratio > 1.0 / CHANGED && ratio < CHANGED } else { ratio > 0.0 }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Touched<'_, A, N, P> {
    /// The log's known pushes and one more push with impulse, time and duration `p`.
    fn with(&self, p: &Vector3<f64>) -> Vec<EffectInstance> {
        self.known.iter().copied().chain([EffectInstance { p: (*p).into(), ..self.push }]).collect()
    }

    /// Whitened residual of the windows under a push with impulse, time and duration `p`.
    fn residual_of(&self, p: &Vector3<f64>) -> Vec<f64> {
        self.residual_under(self.model, p)
    }

    /// Whitened residual of the windows under `model` and a push with impulse, time and duration `p`.
    fn residual_under(&self, model: &Hypothesis<P>, p: &Vector3<f64>) -> Vec<f64> {
        let mut data = self.sample.data.clone();
        data.tracks[0].pushes = self.with(p);
        let predicted = data.predict(self.arm, model, &self.weighting.offsets);
        self.weighting.residual(&self.sample.measured, &predicted)
    }

    /// Cost of the windows under the model `own`, with initial states fitted to this model, and a push with impulse, time and duration `p`.
    fn cost_under(&self, context: &DiagnosisContext<A, N, P>, own: &Hypothesis<P>, p: &Vector3<f64>) -> f64 {
        let mut data = self.sample.data.clone();
        data.tracks[0].pushes = self.with(p);
        let sample = WindowSet { data, measured: self.sample.measured.clone() };
        let weighting = context.weighting(&sample, own, self.weighting.scale, &self.weighting.zeros);
        let there =
            Touched { arm: self.arm, model: own, sample, weighting, known: self.known, push: self.push };
        let residual = there.residual_of(p);
        there.weighting.costs(&there.sample.data, &residual).iter().sum()
    }

    /// Cost of the windows with the whitened residual `r`, by robust weights.
    fn cost(&self, r: &[f64]) -> f64 {
        self.weighting.total(&self.weighting.costs(&self.sample.data, r))
    }

    /// Shape of the push whose fit by `minimise` has the lowest cost, with impulse, time and duration, and that cost.
    fn of_all_shapes(
        &mut self,
        minimise: impl Fn(&Self) -> (Vector3<f64>, f64),
    ) -> (&'static dyn Effect<f64>, Vector3<f64>, f64) {
        let rough = self.push.law;
        let fits = PulseShape::ALL.map(|shape| {
            self.push.law = shape.law();
            let (fitted, left) = minimise(self);
            (self.push.law, fitted, left)
        });
        self.push.law = rough;
        let [first, second] = fits;
        if second.2 < first.2 { second } else { first }
    }

    /// Lowest of the minima reached from the first guess `p` and from longer pushes at the same time: impulse, time and duration, and cost.
    fn least(&self, p: Vector3<f64>) -> (Vector3<f64>, f64) {
        LONGER.iter().fold(self.minimise(p), |best, duration| {
            let other = self.minimise(Vector3::new(p[0], p[1], *duration));
            if other.1 < best.1 { other } else { best }
        })
    }

    /// Levenberg-Marquardt minimum from the first guess `p`: impulse, time and duration of the push, and cost.
    fn minimise(&self, p: Vector3<f64>) -> (Vector3<f64>, f64) {
        let (mut p, mut r) = (p, self.residual_of(&p));
        let (mut cost, mut damping) = (self.cost(&r), 1e-2);
        for _ in 0..MAX_PUSH_ITERATIONS {
            let jacobian = self.jacobian(&p, &r);
            let gram =
                self.weighting.gram(&self.sample.data, &jacobian.each_ref().map(Vec::as_slice), &r).total;
            let before = cost;
            for _ in 0..ATTEMPTS {
                let Some(next) = damped_step(&p, &gram, damping) else { return (p, cost) };
                let there = self.residual_of(&next);
                let lower = self.cost(&there);
                if lower < cost {
                    (p, r, cost) = (next, there, lower);
                    damping = f64::max(damping * 0.2, 1e-9);
                    break;
                }
                damping *= 8.0;
            }
            if before - cost <= PUSH_COST_TOLERANCE * before {
                break;
            }
        }
        (p, cost)
    }

    /// What is not known of a push's impulse, time and duration because its course over time is not: what another shape changes, as far as that shape's
    /// residual stays with the push as fitted (by the ratio of both residuals' norms).
    fn doubt_of_shape(&mut self, p: &Vector3<f64>) -> Vector3<f64> {
        let law = self.push.law;
        let left = self.cost(&self.residual_of(p));
        let mut doubt = Vector3::zeros();
        for shape in PulseShape::ALL.into_iter().filter(|shape| Some(*shape) != law.pulse_shape()) {
            self.push.law = shape.law();
            let (other, its) = self.minimise(*p);
            doubt = doubt.sup(&((other - p).abs() * (left / its).min(1.0).sqrt()));
        }
        self.push.law = law;
        doubt
    }

    /// Standard deviations of a push's impulse, time and duration, for a variance of the residual by [`noise`], a model known up to `covariance`, and a
    /// course over time that is known up to [`Self::doubt_of_shape`].
    fn sigma(&mut self, p: &Vector3<f64>, covariance: &DMatrix<f64>) -> Option<[f64; 3]> {
        let of_shape = self.doubt_of_shape(p);
        let r = self.residual_of(p);
        let noise = noise(self.cost(&r), self.sample.data.rows * N, self.sample.data.windows.len() * N);
        let doubts = self.doubts(p, &r, covariance);
        let own = self.jacobian(p, &r);
        let columns: Vec<&[f64]> = own.iter().chain(&doubts).map(Vec::as_slice).collect();
        let k = columns.len();
        let gram = self.weighting.gram(&self.sample.data, &columns, &r).total;
        let mut normal = gram.view((0, 0), (k, k)).into_owned() / noise;
        for i in 3..k {
            normal[(i, i)] += 1.0;
        }
        let inverse = scaled_inverse(&normal)?;
        Some(std::array::from_fn(|i| inverse[(i, i)].sqrt().hypot(of_shape[i])))
    }

    /// Whitened changes of the predictions along the principal axes of the model's covariance, each by one standard deviation.
    fn doubts(&self, p: &Vector3<f64>, r: &[f64], covariance: &DMatrix<f64>) -> Vec<Vec<f64>> {
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
            let there = self.residual_under(&self.model.with_values(&moved), p);
            r.iter().zip(&there).map(|(a, b)| (a - b) / AXIS_STEP).collect()
        };
        (0..scale.len()).filter(|k| axes.eigenvalues[*k] > 1e-9).map(column).collect()
    }

    /// Derivatives of the whitened prediction by a push's impulse, time and duration.
    fn jacobian(&self, p: &Vector3<f64>, r: &[f64]) -> [Vec<f64>; 3] {
        let steps = [1e-4 * p[0].abs().max(1e-12), 1e-5, 1e-5];
        let slope = |i: usize| {
            let mut moved = *p;
            moved[i] += steps[i];
            r.iter().zip(&self.residual_of(&moved)).map(|(a, b)| (a - b) / steps[i]).collect()
        };
        std::array::from_fn(slope)
    }
}

/// One damped Gauss-Newton step of a push's impulse, time and duration; `None` for a singular normal matrix.
fn damped_step(p: &Vector3<f64>, gram: &DMatrix<f64>, damping: f64) -> Option<Vector3<f64>> {
    let mut normal = gram.view((0, 0), (3, 3)).into_owned();
    for i in 0..3 {
        normal[(i, i)] *= 1.0 + damping;
    }
    let inverse = scaled_inverse(&normal)?;
    let change = &inverse * DVector::from_fn(3, |i, _| gram[(i, 3)]);
    let duration = (p[2] + change[2]).clamp(SHORTEST, LONGEST);
    Some(Vector3::new(p[0] + change[0], p[1] + change[1], duration))
}

/// Windows that a push touches, as a dataset of the push's log alone.
fn around<const N: usize>(sample: &WindowSet<N>, disturbance: &Disturbance) -> Dataset<N> {
    let track = &sample.data.tracks[disturbance.track];
    let [_, time, duration] = disturbance.push.p;
    let reach = 0.75 * duration + MAX_WINDOW_DISTANCE;
    sample
        .data
        .of_track(disturbance.track, |w| track.t[w.first] < time + reach && track.t[w.last] > time - reach)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::track::Track;
    use armgap_core::arm::Pendulum;
    use armgap_core::effect::find;

    #[test]
    fn what_exceeds_white_noise_counts_once_per_window() {
        assert_eq!(noise(350.0, 400, 4), 1.0);
        assert_eq!(noise(480.0, 400, 4), 21.0);
    }

    /// Rotor behind backlash beside a link that is held: after a reversal of the torque it crosses the whole gap under this torque alone.
    #[test]
    fn the_impulse_of_an_impact_is_that_of_a_rotor_after_free_flight_through_the_gap() {
        let (inertia, gap, share, torque): (f64, f64, f64, f64) = (0.1, 0.01, 0.25, 0.5);
        let t: Vec<f64> = (0..600).map(|k| 1e-3 * f64::from(k)).collect();
        let tau: Vec<f64> = t.iter().map(|t| if *t < 0.3 { torque } else { -torque }).collect();
        let data = Dataset::new(vec![Track::<1>::new("", &t, &vec![0.0; t.len()], &tau, Some([1e-6]))], 0.1);
        let arm = Pendulum { gravity: 9.81 };
        let rigid = Hypothesis::rigid([inertia, 0.0, 0.0, 0.0]);
        let law = find::<f64>("backlash").expect("known");
        let with = rigid.with(EffectInstance::new(law, 0, [gap, share, 0.0]));
        let momentum = (2.0 * torque * gap * share * inertia).sqrt();
        let impulse = impact_impulse(&data, &arm, &with);
        assert!(impulse > 0.95 * momentum && impulse < 1.001 * momentum, "{impulse} for {momentum}");
        assert_eq!(impact_impulse(&data, &arm, &rigid), 0.0);
    }
}
