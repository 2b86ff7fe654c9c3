//! One cause after another: the search, and what is dropped again.
//!
//! After every addition all causes are fitted together again, and one that has become idle is dropped.

use crate::attribute::{Contender, Stage};
use crate::belief::{Cause, name, temper};
use crate::decide::{CERTAIN, CLEAR, FAINTEST, RELEVANT, TRUST_GAIN, UNEXPLAINED, choose, noticeable};
use crate::model::{Hypothesis, Placed};
use crate::solve::{Effort, Fit};
use crate::study::{Study, Weights};
use crate::together::Both;
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
    /// The effect that was taken up after a stage.
    pub fn added(&self, stage: usize) -> Option<&Placed> {
        added(&self.stages.iter().collect::<Vec<_>>(), stage)
    }

    /// RMS error of the final model on the holdout relative to the motion.
    pub fn error(&self) -> f64 {
        self.stages.last().map_or(f64::INFINITY, Stage::relative_error)
    }

    /// Whether the final model leaves a gap of consequence that is more than noise.
    pub fn is_unexplained(&self) -> bool {
        self.stages.last().is_some_and(Stage::is_unexplained)
    }
}

/// The effect that was taken up after one of these stages.
pub(crate) fn added<'a, const N: usize, const P: usize>(
    stages: &[&'a Stage<N, P>],
    stage: usize,
) -> Option<&'a Placed> {
    let effects = |i: usize| stages.get(i).map(|s| &s.settled.hypothesis.effects);
    let before = effects(stage)?;
    effects(stage + 1)?.iter().find(|e| !before.iter().any(|known| known.same_place(e)))
}

/// Where a search stands.
pub(crate) struct Course<const N: usize, const P: usize> {
    pub causes: Vec<Cause>,
    /// The stages before this one.
    pub stages: Vec<Stage<N, P>>,
    pub stage: Stage<N, P>,
    pub smoothed: bool,
    /// Whether friction's rounding has been fitted.
    pub rounded: bool,
    /// Improvements of this size count, relative to the motion.
    pub threshold: f64,
    /// Whether it has gone back to a rival before.
    pub turned: bool,
}

impl<const N: usize, const P: usize> Course<N, P> {
    /// Takes up two causes; returns the fit with both.
    fn take_up(&mut self, both: Both<N, P>) -> Fit<P> {
        let fit = both.stage.contenders[both.choice].fit.clone();
        self.causes.extend(both.causes);
        self.stages.push(std::mem::replace(&mut self.stage, both.stage));
        fit
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Study<A, N, P> {
    /// Attributes the gap to at most `max_causes` effects, one of which may be known beforehand.
    pub fn attribute(&self, max_causes: usize, seed: u64, known: Option<Cause>) -> Attribution<N, P> {
        let nominal = Hypothesis::rigid(self.prior.theta);
        let scale = self.rough_scale(&nominal);
        let settled = self.settle(&nominal, scale);
        let mut stage = self.stage_around(settled.clone(), RELEVANT);
        let refit = stage.settled.clone();
        let noticeable = noticeable(stage.relative_error());
        let threshold = self.look_closer(&mut stage, settled, noticeable, CLEAR);
        let (causes, stages) = (Vec::new(), Vec::new());
        let mut course =
            Course { causes, stages, stage, smoothed: false, rounded: false, threshold, turned: false };
        if let Some(cause) = known.filter(|_| max_causes > 0) {
            let with = course.stage.settled.hypothesis.with(cause.effect);
            let fit = self.problem(&course.stage.weights.training).solve(&with, Effort::FULL);
            course.causes.push(cause);
            self.advance(&mut course, &fit, noticeable);
        }
        self.pursue(&mut course, noticeable, max_causes, seed);
        if course.stage.is_unexplained() && !course.causes.is_empty() && max_causes > 1 {
            course = self.retraced(course, noticeable, max_causes, seed);
        }
        let Course { mut causes, mut stages, stage, .. } = course;
        let mut model = stage.settled.clone();
        self.prune(&mut model, &mut causes, &stage);
        self.widen(&mut model, &stage.weights);
        stages.push(stage);
        refresh(&model, &mut causes);
        temper(&stages, &mut causes);
        Attribution { refit, model, causes, stages }
    }

    /// Takes up one cause after another, or two at once, until nothing more deserves it.
    pub(crate) fn pursue(&self, course: &mut Course<N, P>, noticeable: f64, max_causes: usize, seed: u64) {
        loop {
            // A cause that stands in for its rival leaves a gap that others would be taken up for.
            if let Some(other) = self.reconsidered(course, false, noticeable, max_causes, seed) {
                *course = other;
                return;
            }
            if course.causes.len() >= max_causes {
                break;
            }
            let stage = &course.stage;
            let next = if let Some((choice, ground)) = choose(stage, course.smoothed, course.threshold) {
                match stage.contenders[choice].effect {
                    Some(_) => course.causes.push(name(stage, choice, ground, seed)),
                    None => course.smoothed = true,
                }
                stage.contenders[choice].fit.clone()
            } else if let Some(fit) = (!course.rounded).then(|| self.rounded(stage)).flatten() {
                (course.smoothed, course.rounded) = (true, true);
                fit
            } else {
                let room = course.causes.len() + 2 <= max_causes;
                let pair = room.then(|| self.together(stage, None, course.threshold, seed)).flatten();
                let Some(both) = pair else { break };
                course.take_up(both)
            };
            self.advance(course, &next, noticeable);
        }
        if let Some(other) = self.reconsidered(course, true, noticeable, max_causes, seed) {
            *course = other;
        }
    }

    /// The same from the first stage by another pair of causes, where a search has ended beside a gap: the first cause may have stood in
    /// for both. Only a pair that explains nearly all of the gap counts.
    fn retraced(
        &self,
        mut course: Course<N, P>,
        noticeable: f64,
        max_causes: usize,
        seed: u64,
    ) -> Course<N, P> {
        let first = &course.stages[0];
        let taken = course.causes[0].effect;
        let Some(both) = self.together(first, Some(&taken), noticeable, seed) else { return course };
        course.stage = course.stages.swap_remove(0);
        course.stages.clear();
        course.causes.clear();
        (course.smoothed, course.rounded) = (false, false);
        let next = course.take_up(both);
        self.advance(&mut course, &next, noticeable);
        self.pursue(&mut course, noticeable, max_causes, seed);
        course
    }

    /// Goes on to the stage around `next`.
    pub(crate) fn advance(&self, course: &mut Course<N, P>, next: &Fit<P>, noticeable: f64) {
        let settled = self.settle(&next.hypothesis, course.stage.weights.training.scale);
        let stage = self.stage_around(settled.clone(), noticeable);
        course.stages.push(std::mem::replace(&mut course.stage, stage));
        course.threshold = self.look_closer(&mut course.stage, settled, noticeable, UNEXPLAINED);
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
    pub(crate) fn prune(&self, model: &mut Fit<P>, causes: &mut Vec<Cause>, stage: &Stage<N, P>) {
        let mut i = 0;
        while causes.len() > 1 && i < causes.len() {
            let full = self.judged(stage, model.clone(), None);
            let mut without = model.hypothesis.clone();
            without.effects.remove(i);
            let fit = self.problem(&stage.weights.training).solve(&without, Effort::FULL);
            let reduced = self.judged(stage, fit, None);
            let idle = full.z_over(&reduced) < CERTAIN
                && !stage.takes_outliers(&full, &reduced)
                && reduced.fit.prior_cost - full.fit.prior_cost < TRUST_GAIN;
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
                // A value that the training windows do not show may be known from those of the holdout.
                let known = cause.sigma.iter().copied().chain(std::iter::repeat(f64::INFINITY));
                let fitted = (first..first + effect.len()).map(|i| model.sigma(i));
                cause.sigma = fitted.zip(known).map(|(fitted, known)| fitted.min(known)).collect();
            }
            first += effect.len();
        }
    }
    causes.sort_by(|a, b| b.relevance.total_cmp(&a.relevance));
}
