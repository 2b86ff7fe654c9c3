//! Pushes that a drive makes itself: one that does not give all the torque it is asked for lacks it at a few instants, as if something pushed.
//!
//! A cause shows in the typical window; a limit that is reached once or twice in one log does not, and is found as pushes against the command.
//! One level that explains what all of them explain needs fewer values than they do.

use super::Disturbance;
use crate::acceptance::Ground;
use crate::belief::Cause;
use crate::context::{DiagnosisContext, SplitWeighting};
use crate::evidence::Evidence;
use crate::minimum::minimum;
use crate::model::{EffectInstance, Hypothesis};
use crate::model_search::Attribution;
use crate::track::Track;
use armgap_core::arm::Arm;
use armgap_core::effect::find;

/// The law of a limit.
const LAW: &str = "torque_saturation";

/// Part of what pushes explain that a limit must explain in their place.
const AS_MUCH: f64 = 0.9;

/// The level is looked for within this part of what the pushes' impulses say, by so many evaluations.
const NEAR: f64 = 0.1;
const EVALUATIONS: u64 = 14;

/// Step of the second derivative by the level, as a part of it.
const STEP: f64 = 1e-3;

/// Halvings that find the level of one push.
const HALVINGS: usize = 40;

/// What all windows miss by under a model that gives no more than a level, by that level.
struct ByLevel<'a, A, const N: usize, const P: usize> {
    context: &'a DiagnosisContext<A, N, P>,
    weights: &'a SplitWeighting<N>,
    model: &'a Hypothesis<P>,
    joint: usize,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> ByLevel<'_, A, N, P> {
    fn limited_to(&self, level: f64) -> Option<EffectInstance> {
        find::<f64>(LAW).map(|law| EffectInstance::new(law, self.joint, [level, 0.0, 0.0]))
    }

    fn cost_of(&self, level: f64) -> f64 {
        self.limited_to(level)
            .map_or(f64::INFINITY, |limit| cost(self.context, self.weights, &self.model.with(limit)))
    }

    /// Standard deviation of the best level, if what is left is one error per window.
    fn sigma(&self, best: f64) -> Option<f64> {
        let step = STEP * best;
        let [below, least, above] = [-step, 0.0, step].map(|h| self.cost_of(best + h));
        let curvature = (below - 2.0 * least + above) / step.powi(2);
        let windows = self.context.training.data.windows.len() + self.context.holdout.data.windows.len();
        (curvature > 0.0).then(|| (2.0 * least / windows as f64 / curvature).sqrt())
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The limit of a joint's torque that explains what its pushes explain, if there is one.
    pub(super) fn limit(&mut self, alone: &Attribution<N, P>, disturbances: &[Disturbance]) -> Option<Cause> {
        let effects = &alone.model.hypothesis.effects;
        let limited = |j: usize| effects.iter().any(|e| e.joint == j && e.law.spec().name == LAW);
        (0..N).filter(|j| !limited(*j)).find_map(|joint| {
            let own: Vec<Disturbance> =
                disturbances.iter().filter(|e| e.push.joint == joint).cloned().collect();
            if own.is_empty() { None } else { self.limit_of(joint, alone, &own) }
        })
    }

    fn limit_of(
        &mut self,
        joint: usize,
        alone: &Attribution<N, P>,
        disturbances: &[Disturbance],
    ) -> Option<Cause> {
        let levels: Vec<f64> =
            disturbances.iter().map(|e| level(self.track(e.place()), &e.push)).collect::<Option<_>>()?;
        let model = &alone.model.hypothesis;
        let weights = &alone.nodes.last()?.weights;
        self.set_pushes(disturbances);
        let pushed = cost(self, weights, model);
        self.set_pushes(&[]);
        let bare = cost(self, weights, model);
        if pushed >= bare {
            return None;
        }
        let by_level = ByLevel { context: self, weights, model, joint };
        let guess =
            levels.into_iter().min_by(|a, b| by_level.cost_of(*a).total_cmp(&by_level.cost_of(*b)))?;
        let near = [(1.0 - NEAR) * guess, (1.0 + NEAR) * guess];
        let best = minimum(|level| by_level.cost_of(level), near, EVALUATIONS)?;
        let explained = bare - by_level.cost_of(best);
        if explained < AS_MUCH * (bare - pushed) {
            return None;
        }
        let share = explained / bare;
        let sigma = vec![by_level.sigma(best)?];
        let probability = disturbances.iter().map(|e| e.probability).fold(0.0, f64::max);
        let effect = by_level.limited_to(best)?;
        Some(Cause {
            effect,
            sigma,
            probability,
            share,
            relevance: 0.0,
            look_alikes: Vec::new(),
            evidence: Evidence { selected: probability, ..Evidence::default() },
            ground: Ground::Motion,
        })
    }
}

/// What all windows miss by, none of them trusted less than others.
fn cost<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    weights: &SplitWeighting<N>,
    model: &Hypothesis<P>,
) -> f64 {
    let (training, holdout) = rayon::join(
        || context.problem(&weights.training).raw_costs(model),
        || context.judge(&weights.holdout).raw_costs(model),
    );
    training.iter().chain(&holdout).sum()
}

/// Level beyond which the command around a push against it amounts to the push's impulse.
fn level<const N: usize>(track: &Track<N>, push: &EffectInstance) -> Option<f64> {
    let [impulse, time, duration] = push.p;
    let first = track.t.partition_point(|t| *t < time - duration);
    let last = track.t.partition_point(|t| *t <= time + duration).min(track.len() - 1);
    let torque = |k: usize| -impulse.signum() * track.held[k][push.joint].mean();
    let beyond = |level: f64| -> f64 {
        (first..last).map(|k| (torque(k) - level).max(0.0) * (track.t[k + 1] - track.t[k])).sum()
    };
    let (mut low, mut high) = (0.0, (first..last).map(torque).fold(0.0, f64::max));
    if beyond(low) < impulse.abs() {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if beyond(middle) > impulse.abs() { low = middle } else { high = middle }
    }
    Some(low)
}
