//! Choice of the causes that a diagnosis names: probable enough, with values that arms can have and sizes distinct from zero, no more effects than
//! allowed, and only where the model with them predicts no worse than the arm file and than the arm without causes. All others are listed as candidates, with reasons.
//!
//! The reported model has the named causes only, so that its gap is the one a reader gets who adds these causes to a simulation.

use crate::disturbance::push::{Conclusion, Disturbance};
use crate::likelihood::context::{DiagnosisContext, SplitWeighting, WindowSet};
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::likelihood::horizon::HorizonBias;
use crate::likelihood::solve::Fit;
use crate::log::input::Withheld;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::rms;
use crate::predict::window::Dataset;
use crate::result::nameable::{Naming, Unnamed, sorted};
use crate::search::belief::Cause;
use crate::search::evidence::Weighed;
use crate::search::model_search::{Attribution, refresh};
use armgap_core::arm::Arm;

/// Causes and disturbances that a diagnosis names or rejects, and the model with the named ones.
pub struct Headline<const N: usize, const P: usize> {
    /// Result of the model search.
    pub attribution: Attribution<N, P>,
    /// The arm with its parameters re-estimated and no effects, its standard deviations widened by the bias that the horizon tells.
    pub refit: Fit<P>,
    /// Fitted model with the named causes alone, its standard deviations widened by the bias that the horizon tells.
    pub with_causes: Fit<P>,
    /// Fitted model with the named causes alone.
    pub model: Fit<P>,
    /// Weights of the training and holdout windows under the reported model.
    pub weights: SplitWeighting<N>,
    /// Whether the model search ended with a cost above what noise explains.
    pub open: bool,
    /// Named causes, strongest first.
    pub causes: Vec<Cause>,
    /// Named external disturbances, the largest impulse in its standard deviations first.
    pub disturbances: Vec<Disturbance>,
    /// Effects that the model search accepted but the diagnosis does not name, each with the reason why not.
    pub candidates: Vec<Unnamed<Cause>>,
    /// External disturbances that were found and are not named, with reasons.
    pub disturbance_candidates: Vec<Unnamed<Disturbance>>,
}

/// Ratio of the errors of two models up to which held-out motion does not tell which is better: a stop that it does not reach, or a load that re-estimated
/// parameters absorb, changes them by chance. Three right causes of two simulators were withheld at ratios of 1.005 to 1.03.
const NO_WORSE: f64 = 1.05;

/// Adds the squared biases of a cause's values to their variances.
fn widen<const P: usize>(cause: &mut Cause, bias: &HorizonBias<P>) {
    let Some(biases) = bias.of_effect(&cause.effect) else { return };
    for (sigma, bias) in cause.sigma.iter_mut().zip(biases) {
        *sigma = sigma.hypot(*bias);
    }
}

/// Whether errors `found`, one per joint, are larger in sum than `given` by more than held-out motion may show by chance.
fn is_worse(found: &[f64], given: &[f64]) -> bool {
    found.iter().sum::<f64>() > NO_WORSE * given.iter().sum::<f64>()
}

/// Makes all named causes candidates, because predictions with them are worse than those of another model, given in words.
fn withhold(causes: &mut Vec<Cause>, candidates: &mut Vec<Unnamed<Cause>>, than: &str) {
    let why = format!(
        "with the re-estimated parameters and the causes to be named, held-out motion is predicted worse than {than}"
    );
    let withheld = causes.drain(..).map(|found| Unnamed { found, why: why.clone() });
    candidates.splice(0..0, withheld);
}

/// Fitted model with the causes and disturbances to be named.
struct Reported<const N: usize, const P: usize> {
    /// The model, fitted to the training logs.
    model: Fit<P>,
    /// Its weights of windows.
    weights: SplitWeighting<N>,
    /// Whether it leaves a gap open.
    open: bool,
    /// The model, fitted to the holdout.
    on_holdout: Fit<P>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Names at most `most` causes of a search's `conclusion`, and its external disturbances, and fits the model with them.
    ///
    /// A disturbance is an event of one log and no property of the arm, so that any number is named unless `most` is zero, the clearest first.
    /// Disturbances that are not named are taken out of the logs; if none is named, the search without disturbances counts.
    ///
    /// Effects that are `withheld` are candidates.
    pub fn headline(
        &mut self,
        conclusion: Conclusion<N, P>,
        most: usize,
        withheld: &[Withheld],
    ) -> Headline<N, P> {
        let Conclusion { mut attribution, alone, mut disturbances } = conclusion;
        let naming = Naming { travel: self.travel(), withheld };
        let (mut causes, mut candidates) =
            self.weighed_causes(&mut attribution, &disturbances, most, &naming);
        let pushes_allowed = if most > 0 { usize::MAX } else { 0 };
        disturbances.sort_by(|a, b| b.clarity().total_cmp(&a.clarity()));
        let unfit = |e: &Disturbance| naming.unfit(&e.push, &e.sigma, e.probability);
        let none_fit = disturbances.iter().all(|e| unfit(e).is_some());
        if !candidates.is_empty() && !disturbances.is_empty() {
            let left = self.left_by_unnamed(&attribution, &causes, &disturbances);
            for push in &mut disturbances {
                push.doubt_beside(left);
            }
        }
        let (disturbances, disturbance_candidates) = sorted(disturbances, pushes_allowed, unfit);
        let mut changed = !disturbance_candidates.is_empty();
        // Pushes that are only doubted beside what is not named leave nothing to the search that took their windows for the arm's motion.
        if let Some(alone) = alone.filter(|_| changed && (none_fit || most == 0)) {
            attribution = alone;
            self.take_all_windows();
            self.set_pushes(&[]);
            (causes, candidates) = self.weighed_causes(&mut attribution, &[], most, &naming);
            changed = false;
        }
        self.set_pushes(&disturbances);
        changed |= !candidates.is_empty();
        let Reported { mut model, mut weights, mut open, .. } =
            self.reported(&attribution, &causes, &disturbances, changed);
        // Without those that are not named, the others may have no size any more.
        while changed && !causes.is_empty() {
            refresh(&model, &mut causes);
            let all = causes.clone();
            let (named, lost) = sorted(causes, most, |cause| naming.unfit_in(&model, cause, &all));
            causes = named;
            if lost.is_empty() {
                break;
            }
            candidates.extend(lost);
            Reported { model, weights, open, .. } = self.reported(&attribution, &causes, &disturbances, true);
        }
        // Whether a gap is open is the search's answer, whose model may hold effects that are not named.
        let asked = (open || changed) && !causes.is_empty();
        let worse = if asked { self.worse(&attribution, &model, &weights) } else { None };
        if let Some(than) = worse {
            withhold(&mut causes, &mut candidates, than);
            Reported { model, weights, open, .. } = self.reported(&attribution, &causes, &disturbances, true);
        }
        refresh(&model, &mut causes);
        let (bias, refit) = rayon::join(
            || self.bias_by_horizon(&model, &weights),
            || self.refit_with_intervals(&attribution),
        );
        let mut with_causes = model.clone();
        if let Some(bias) = bias {
            bias.widen(&mut with_causes);
            for cause in &mut causes {
                widen(cause, &bias);
            }
        }
        Headline {
            attribution,
            refit,
            with_causes,
            model,
            weights,
            open,
            causes,
            disturbances,
            candidates,
            disturbance_candidates,
        }
    }

    /// At most `most` of a search's causes to be named, and the rest with the reasons why they are not; `disturbances` are those in the logs.
    ///
    /// Causes with values that no arm has, or without a size, only stand for what the library does not have. The others are weighed without them: what
    /// such a cause took is not explained.
    fn weighed_causes(
        &self,
        attribution: &mut Attribution<N, P>,
        disturbances: &[Disturbance],
        most: usize,
        naming: &Naming<'_, N>,
    ) -> (Vec<Cause>, Vec<Unnamed<Cause>>) {
        self.weigh(attribution);
        let (mut causes, mut model) = (attribution.causes.clone(), attribution.model.clone());
        let mut candidates = Vec::new();
        while let Some(last) = attribution.nodes.last() {
            let all = causes.clone();
            let (kept, lost) = sorted(causes, usize::MAX, |cause| naming.no_effect(&model, cause, &all));
            causes = kept;
            if lost.is_empty() || causes.is_empty() {
                candidates.extend(lost);
                break;
            }
            candidates.extend(lost);
            let beside = self.reported(attribution, &causes, disturbances, true);
            refresh(&beside.model, &mut causes);
            let (model_beside, on_holdout) = (&beside.model, &beside.on_holdout);
            self.weigh_in(&Weighed { last, model: model_beside, on_holdout, without: &[] }, &mut causes);
            model = beside.model;
        }
        let all = causes.clone();
        let (named, rest) = sorted(causes, most, |cause| naming.unfit_in(&model, cause, &all));
        candidates.extend(rest);
        (named, candidates)
    }

    /// Travel of every joint over all logs, rad or m.
    fn travel(&self) -> [f64; N] {
        let tracks = || self.training.data.tracks.iter().chain(&self.holdout.data.tracks);
        let positions = |j: usize| tracks().flat_map(move |track| track.q.iter().map(move |q| q[j]));
        std::array::from_fn(|j| {
            positions(j).fold(f64::NEG_INFINITY, f64::max) - positions(j).fold(f64::INFINITY, f64::min)
        })
    }

    /// Share, 0 to 1, of the gap that a search's model explains and the model with the causes to be named leaves: pushes were looked for beside all causes.
    fn left_by_unnamed(
        &self,
        attribution: &Attribution<N, P>,
        causes: &[Cause],
        disturbances: &[Disturbance],
    ) -> f64 {
        let Some(last) = attribution.nodes.last() else { return 0.0 };
        let error = |fit: &Fit<P>| self.holdout_error(&last.weights, &fit.hypothesis);
        let named = self.reported(attribution, causes, disturbances, true).model;
        let left = (error(&named) - error(&attribution.model)) / error(&attribution.refit);
        if left > 0.0 { left.min(1.0) } else { 0.0 }
    }

    /// The arm with its parameters re-estimated and no effects, its standard deviations widened as those of the model with causes are.
    fn refit_with_intervals(&self, attribution: &Attribution<N, P>) -> Fit<P> {
        let (mut refit, weights) = (attribution.refit.clone(), &attribution.nodes[0].weights);
        self.apply_dispersion_factor(&mut refit, weights);
        if let Some(bias) = self.bias_by_horizon(&refit, weights) {
            bias.widen(&mut refit);
        }
        refit
    }

    /// Model without causes, in words, that predicts the holdout better than a `model` with the named causes, beside the encoder zeros of its `weights`:
    /// the arm file as it stands, which knows of no pushes, or the arm with its parameters re-estimated, beside zeros of its own; none if neither does.
    /// All windows count, as in the reported gap: those in which pushes act were not fitted, and show best whether a model diverges.
    fn worse(
        &self,
        attribution: &Attribution<N, P>,
        model: &Fit<P>,
        weights: &SplitWeighting<N>,
    ) -> Option<&'static str> {
        let WindowSet { data, measured } = &self.all_windows(&self.holdout);
        let errors = |data: &Dataset<N>, hypothesis: &Hypothesis<P>, zeros: &EncoderZeros<N>| {
            rms::<N>(measured, &data.predict(&self.arm, hypothesis, &zeros.offsets(data)))
        };
        let found = errors(data, &model.hypothesis, &weights.holdout.zeros);
        let arm_file = Hypothesis::rigid(self.prior.theta);
        if is_worse(&found, &errors(&data.without_pushes(), &arm_file, &EncoderZeros::none())) {
            return Some("by the arm file as it stands");
        }
        let (refit, without) = self.settle(&attribution.refit.hypothesis, weights.training.scale);
        let given = errors(data, &refit.hypothesis, &without.holdout.zeros);
        is_worse(&found, &given).then_some("with the re-estimated parameters alone")
    }

    /// Fitted model with the named causes and disturbances alone; that of the model search where all that was found is named, else (`changed`) fitted
    /// again.
    fn reported(
        &self,
        attribution: &Attribution<N, P>,
        causes: &[Cause],
        disturbances: &[Disturbance],
        changed: bool,
    ) -> Reported<N, P> {
        let last = &attribution.nodes[attribution.nodes.len() - 1];
        let open = attribution.is_unexplained();
        if !changed {
            let [model, on_holdout] = [&attribution.model, &attribution.on_holdout].map(Clone::clone);
            return Reported { model, weights: last.weights.clone(), open, on_holdout };
        }
        // The last search node without effects: the arm with parameters re-estimated, and the friction regularisation that was fitted without effects.
        let bare = |i: &usize| attribution.nodes[*i].settled.hypothesis.effects.is_empty();
        let node = (0..attribution.nodes.len()).rfind(bare).map_or(last, |i| &attribution.nodes[i]);
        let (mut model, weights, open) = if causes.is_empty() && disturbances.is_empty() {
            (node.settled.clone(), node.weights.clone(), node.is_unexplained())
        } else {
            let from = if causes.is_empty() { &node.settled } else { &attribution.model };
            let mut hypothesis = from.hypothesis.clone();
            hypothesis.effects.retain(|e| causes.iter().any(|c| c.effect.same_place(e)));
            let (model, weights) = self.settle(&hypothesis, last.weights.training.scale);
            (model, weights, open)
        };
        let on_holdout = self.apply_dispersion_factor(&mut model, &weights);
        Reported { model, weights, open, on_holdout }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::hypothesis::EffectInstance;
    use crate::search::acceptance::Ground;
    use crate::search::evidence::Evidence;
    use armgap_core::effect::find;

    fn effect(name: &str, p: [f64; 3]) -> EffectInstance {
        EffectInstance::new(find::<f64>(name).unwrap(), 0, p)
    }

    #[test]
    fn causes_with_which_motion_is_predicted_worse_than_by_the_arm_file_are_candidates() {
        let cause = Cause {
            effect: effect("stribeck", [0.8, 0.3, 0.0]),
            sigma: vec![0.03, 0.02],
            probability: 0.99,
            share: 0.9,
            relevance: 0.1,
            look_alikes: Vec::new(),
            evidence: Evidence::default(),
            ground: Ground::Motion,
        };
        assert!(is_worse(&[0.5, 9.0], &[1.0, 2.0]) && !is_worse(&[0.5, 2.0], &[2.0, 1.0]));
        assert!(is_worse(&[1.0, 2.2], &[1.0, 2.0]) && !is_worse(&[1.0, 2.1], &[1.0, 2.0]), "by chance");
        let (mut named, mut rest) =
            (vec![cause.clone()], vec![Unnamed { found: cause, why: "small".to_owned() }]);
        withhold(&mut named, &mut rest, "by the arm file as it stands");
        assert!(named.is_empty() && rest.len() == 2 && rest[0].why.contains("worse than by the arm file"));
    }
}
