//! One cause after another: the search, and what is dropped again.
//!
//! After every addition all causes are fitted together again, and one that has become idle is dropped.

use crate::attribute::{Contender, Stage};
use crate::belief::{Cause, name, temper};
use crate::decide::{
    CERTAIN, CLEAR, CONSEQUENCE, FAINTEST, RELEVANT, TRUST_GAIN, UNEXPLAINED, choose, noticeable,
};
use crate::model::{Hypothesis, Placed};
use crate::solve::{Effort, Fit};
use crate::study::{Study, Weights};
use armgap_core::arm::Arm;

/// The whole course of an attribution.
pub struct Attribution<const N: usize, const P: usize> {
    /// Parameters re-estimated, no effects.
    pub refit: Fit<P>,
    /// The final model.
    pub model: Fit<P>,
    /// Accepted causes, strongest first.
    pub causes: Vec<Cause>,
    /// Every stage, the last one being the one that accepted nothing.
    pub stages: Vec<Stage<N, P>>,
}

impl<const N: usize, const P: usize> Attribution<N, P> {
    /// Whether the final model leaves a gap of consequence that is more than noise.
    pub fn is_unexplained(&self) -> bool {
        let last = self.stages.last();
        last.is_some_and(|s| s.excess() > UNEXPLAINED && s.relative_error() > CONSEQUENCE)
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Study<A, N, P> {
    /// Attributes the gap to at most `max_causes` effects.
    pub fn attribute(&self, max_causes: usize, seed: u64) -> Attribution<N, P> {
        let nominal = Hypothesis::rigid(self.prior.theta);
        let mut scale = self.rough_scale(&nominal);
        let settled = self.settle(&nominal, scale);
        let mut stage = self.stage_around(settled.clone(), RELEVANT);
        let refit = stage.settled.clone();
        let mut model = refit.clone();
        let (mut causes, mut stages): (Vec<Cause>, Vec<Stage<N, P>>) = (Vec::new(), Vec::new());
        let mut smoothed = false;
        let noticeable = noticeable(stage.relative_error());
        let mut threshold = self.look_closer(&mut stage, settled, noticeable, CLEAR);
        while causes.len() < max_causes {
            let Some((choice, ground)) = choose(&stage, smoothed, threshold) else {
                let Some(both) = (causes.len() + 2 <= max_causes)
                    .then(|| self.together(&stage, threshold, seed))
                    .flatten()
                else {
                    break;
                };
                model = both.stage.contenders[both.choice].fit.clone();
                causes.extend(both.causes);
                stages.push(stage);
                scale = both.stage.weights.training.scale;
                stages.push(both.stage);
                let settled = self.settle(&model.hypothesis, scale);
                stage = self.stage_around(settled.clone(), noticeable);
                threshold = self.look_closer(&mut stage, settled, noticeable, UNEXPLAINED);
                model = stage.settled.clone();
                continue;
            };
            let best = &stage.contenders[choice];
            model = best.fit.clone();
            match best.effect {
                Some(_) => causes.push(name(&stage, choice, ground, seed)),
                None => smoothed = true,
            }
            scale = stage.weights.training.scale;
            let settled = self.settle(&model.hypothesis, scale);
            let next = self.stage_around(settled.clone(), noticeable);
            stages.push(std::mem::replace(&mut stage, next));
            threshold = self.look_closer(&mut stage, settled, noticeable, UNEXPLAINED);
            model = stage.settled.clone();
        }
        self.prune(&mut model, &mut causes, &stage);
        self.widen(&mut model, &stage.weights);
        stages.push(stage);
        refresh(&model, &mut causes);
        temper(&stages, &mut causes);
        Attribution { refit, model, causes, stages }
    }

    /// Looks into a gap that is too small to matter by itself, and yet stands above the floor by the factor `clear`; returns which
    /// improvements count. `settled` is what the stage was made around.
    fn look_closer(
        &self,
        stage: &mut Stage<N, P>,
        settled: (Fit<P>, Weights<N>),
        noticeable: f64,
        clear: f64,
    ) -> f64 {
        if !(FAINTEST..=noticeable).contains(&stage.relative_error()) || stage.excess() <= clear {
            return noticeable;
        }
        *stage = self.stage_around(settled, FAINTEST);
        FAINTEST
    }

    /// Drops causes that the others have made idle.
    fn prune(&self, model: &mut Fit<P>, causes: &mut Vec<Cause>, stage: &Stage<N, P>) {
        let mut i = 0;
        while causes.len() > 1 && i < causes.len() {
            let full = self.judged(stage, model.clone(), None);
            let mut without = model.hypothesis.clone();
            without.effects.remove(i);
            let fit = self.problem(&stage.weights.training).solve(&without, Effort::FULL);
            let reduced = self.judged(stage, fit, None);
            let idle =
                full.z_over(&reduced) < CERTAIN && reduced.fit.prior_cost - full.fit.prior_cost < TRUST_GAIN;
            if idle {
                *model = reduced.fit;
                causes.remove(i);
                i = 0;
            } else {
                i += 1;
            }
        }
    }

    fn judged(&self, stage: &Stage<N, P>, fit: Fit<P>, effect: Option<Placed>) -> Contender<P> {
        let training = self.problem(&stage.weights.training).window_costs(&fit.hypothesis);
        let (holdout, error) = self.judged_on_holdout(&stage.weights, &fit);
        Contender { effect, size: 0.0, fit, training, holdout, error }
    }
}

/// Values and standard deviations of the causes from the final model.
fn refresh<const P: usize>(model: &Fit<P>, causes: &mut [Cause]) {
    for cause in causes.iter_mut() {
        let mut first = P;
        for effect in &model.hypothesis.effects {
            if effect.same_place(&cause.effect) {
                cause.effect = *effect;
                cause.sigma = (first..first + effect.len()).map(|i| model.sigma(i)).collect();
            }
            first += effect.len();
        }
    }
    causes.sort_by(|a, b| b.relevance.total_cmp(&a.relevance));
}
