//! Pushes in windows whose prediction errors are far larger than typical.
//!
//! Accelerations are known from an encoder far worse than positions, so a light push may be lost in the noise of the residual torque and still move
//! its joint by many times the typical prediction error. Where the model describes all but a few windows of a log to the noise, those few windows are
//! examined: a push is fitted, from the one that explains most of a window's errors to first order.

use super::own::Own;
use super::push::{Disturbance, Place, PushState};
use super::search::MAX_PUSHES;
use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::weighting::Weighting;
use crate::model::hypothesis::EffectInstance;
use armgap_core::arm::Arm;
use armgap_core::effect::{Quantity, find};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Cost of a window, relative to that of a typical window, from which a push is looked for in the window.
pub(super) const OUTLYING: f64 = 30.0;

/// Least share that a push in an outlying window must explain of the cost of the windows that it touches.
const OUTLYING_EXPLAINED_SHARE: f64 = 0.8;

/// Least impulse of a push in an outlying window, in standard deviations of the impulse: the window of a less certain push is outlying for another
/// reason, such as a wrong instant at which a joint comes to rest.
const OUTLYING_IMPULSE: f64 = 5.0;

/// Durations of pushes that are tried in an outlying window, s.
const DURATIONS: [f64; 3] = [0.01, 0.05, 0.15];

/// Spacing of the times at which pushes are tried in an outlying window, s.
const TRIAL_TIME_STEP: f64 = 0.02;

/// Impulse of a push, relative to its typical size, for derivatives by finite difference.
const SLIGHT: f64 = 1e-6;

/// Probability of a push in windows of the cost `cost` that typically have the cost `typical`: a half up to [`OUTLYING`] typical costs, and rising to one
/// beyond.
pub(super) fn outlying_probability(cost: f64, typical: f64) -> f64 {
    1.0 - 0.5 * (OUTLYING * typical / cost).min(1.0)
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Adds to the pushes of a log those that explain outlying windows, at most up to `MAX_PUSHES`.
    pub(super) fn in_outlying_windows(
        &self,
        place: Place,
        state: &PushState<'_, N, P>,
        own: &Own<'_, A, N, P>,
        disturbances: &mut Vec<Disturbance>,
    ) {
        let state = &PushState { min_relevance: state.faintest, ..*state };
        while disturbances.len() < MAX_PUSHES {
            let rough = self.in_worst_window(place, state, disturbances);
            let sized = rough.and_then(|rough| self.sized(&rough, rough.push, state, own, disturbances));
            let Some(disturbance) = sized.filter(|e| {
                e.share > OUTLYING_EXPLAINED_SHARE
                    && e.push.p[0].abs() > OUTLYING_IMPULSE * e.sigma[0]
                    && !disturbances.iter().any(|known| known.overlaps(e))
            }) else {
                return;
            };
            disturbances.push(disturbance);
        }
    }

    /// The push that explains most of the cost of the window with the largest cost, to first order; `None` if that cost is not far above the typical
    /// one.
    pub(super) fn in_worst_window(
        &self,
        place: Place,
        state: &PushState<'_, N, P>,
        disturbances: &[Disturbance],
    ) -> Option<Disturbance> {
        let known: Vec<EffectInstance> =
            disturbances.iter().filter(|e| e.place() == place).map(|e| e.push).collect();
        let windows = |wanted: &dyn Fn(usize) -> bool| {
            let whole = [&self.training, &self.holdout][place.0];
            let mut data = whole.data.of_track(place.1, |w| wanted(w.first));
            data.tracks[0].pushes.clone_from(&known);
            let sample = WindowSet::new(data);
            let weighting = self.weighting(&sample, state.model, state.scale, state.zeros);
            let predicted = sample.data.predict(&self.arm, state.model, &weighting.offsets);
            let residual = weighting.residual(&sample.measured, &predicted);
            (sample, weighting, residual)
        };
        let (all, weighting, residual) = windows(&|_| true);
        let costs = weighting.costs(&all.data, &residual);
        let worst = (0..costs.len()).max_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
        if costs[worst] < OUTLYING * weighting.typical {
            return None;
        }
        let firsts: Vec<usize> = all.data.windows.iter().map(|w| w.first).collect();
        let near = worst.saturating_sub(1)..(worst + 2).min(firsts.len());
        let (sample, weighting, residual) = windows(&|first| firsts[near.clone()].contains(&first));
        let (window, track) = (&all.data.windows[worst], &sample.data.tracks[0]);
        let (from, to) = (track.t[window.first], track.t[window.last]);
        let law = find::<f64>("external_pulse")?;
        let tried: Vec<(usize, f64, f64)> = (0..N)
            .flat_map(|joint| DURATIONS.map(|duration| (joint, duration)))
            .flat_map(|(joint, duration)| {
                let count = ((to - from + duration) / TRIAL_TIME_STEP).ceil() as usize;
                (0..=count)
                    .map(move |i| (joint, duration, from - 0.5 * duration + i as f64 * TRIAL_TIME_STEP))
            })
            .collect();
        let gains: Vec<(f64, EffectInstance)> = tried
            .into_par_iter()
            .filter_map(|(joint, duration, time)| {
                let impulse = SLIGHT * self.scales.size(Quantity::Impulse, joint);
                let push = EffectInstance::new(law, joint, [impulse, time, duration]);
                self.first_order(&sample, &weighting, &residual, &known, push, state)
            })
            .collect();
        let (_, push) = gains.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Disturbance {
            holdout: place.0 == 1,
            track: place.1,
            push,
            sigma: [0.0; 3],
            share: 0.0,
            probability: outlying_probability(costs[worst], weighting.typical),
            light: false,
        })
    }

    /// Decrease of the cost by a push at the time and of the duration of `push`, to first order, and the push with its best impulse.
    fn first_order(
        &self,
        sample: &WindowSet<N>,
        weighting: &Weighting<N>,
        residual: &[f64],
        known: &[EffectInstance],
        push: EffectInstance,
        state: &PushState<'_, N, P>,
    ) -> Option<(f64, EffectInstance)> {
        let mut data = sample.data.clone();
        data.tracks[0].pushes = known.iter().copied().chain([push]).collect();
        let predicted = data.predict(&self.arm, state.model, &weighting.offsets);
        let pushed = weighting.residual(&sample.measured, &predicted);
        let slope: Vec<f64> = residual.iter().zip(&pushed).map(|(r, p)| (r - p) / push.p[0]).collect();
        let gram: DMatrix<f64> = weighting.gram(&sample.data, &[&slope], residual).total;
        let (square, product) = (gram[(0, 0)], gram[(0, 1)]);
        (square > 0.0).then(|| {
            let [_, time, duration] = push.p;
            (product * product / square, EffectInstance { p: [product / square, time, duration], ..push })
        })
    }
}
