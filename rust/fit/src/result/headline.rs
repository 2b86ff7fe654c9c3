//! Choice of the causes that a diagnosis names: probable enough, with values that arms can have and sizes distinct from zero, no more effects than
//! allowed, and only where the model with them predicts no worse than the arm file and than the arm without causes. All others are listed as candidates, with reasons.
//!
//! The reported model has the named causes only, so that its gap is the one a reader gets who adds these causes to a simulation.

use crate::disturbance::push::{Conclusion, Disturbance};
use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::likelihood::horizon::HorizonBias;
use crate::likelihood::solve::Fit;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::numeric::products::rms;
use crate::predict::window::Dataset;
use crate::search::belief::Cause;
use crate::search::evidence::Weighed;
use crate::search::model_search::{Attribution, refresh};
use armgap_core::arm::Arm;
use armgap_core::effect::{NEVER, Trial};
use nalgebra::{DMatrix, DVector};

/// Probability below which a cause is not named.
const NAMEABLE: f64 = 0.3;

/// Probability below which a fitted value that arms hardly ever have (a negative spring stiffness) is not named. Single logs of a real arm whose
/// encoders have another zero in each log gave negative stiffnesses with probabilities up to 0.80 (docs/real-arm.md).
const RARE_VALUE_PROBABILITY: f64 = 0.9;

/// Gains of a drive, delivered over commanded torque: beyond this range, the unit of the torque column is wrong, not the drive.
const GAINS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// A cause or disturbance that was found and is not named, with the reason.
#[derive(Debug, Clone)]
pub struct Unnamed<T> {
    /// The cause or disturbance that is not named.
    pub found: T,
    /// Reason, in words, why the found cause or disturbance is not named.
    pub why: String,
}

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

/// Why an effect found with `probability`, whose values have standard deviations `sigma`, is not to be named; none if it may be.
pub fn unfit(effect: &EffectInstance, sigma: &[f64], probability: f64) -> Option<String> {
    if probability < NAMEABLE {
        return Some(format!("its probability is {probability:.2}"));
    }
    impossible(effect, probability).or_else(|| uncertain(effect, sigma))
}

/// Reason why the value of an effect is one that no arm has (a gain beyond drives, a negative stiffness); none if the value is possible.
fn impossible(effect: &EffectInstance, probability: f64) -> Option<String> {
    let value = effect.p[0];
    match effect.law.spec().name {
        "torque_gain" if !GAINS.contains(&value) => {
            Some(format!("a gain of {value:.3} is no drive's; the torque column may have another unit"))
        }
        "joint_spring" if value < 0.0 && probability < RARE_VALUE_PROBABILITY => {
            Some("its stiffness is negative, which no spring's is".to_owned())
        }
        "load_dependent_friction" if value < 0.0 && probability < RARE_VALUE_PROBABILITY => {
            Some("its friction falls with the load, which no bearing's or gear's does".to_owned())
        }
        _ => None,
    }
}

/// Reason why the size of an effect cannot be told from zero: its standard deviation is as large as the size; none if it can be. Effects with a
/// threshold or a transmission always pass, as the standard deviation of their size includes that of other values, and the model search has compared
/// the whole effect with its absence.
fn uncertain(effect: &EffectInstance, sigma: &[f64]) -> Option<String> {
    let spec = effect.law.spec();
    let amplitudes = spec.parameters.iter().zip(effect.p).zip(sigma).take(sizes(effect));
    let deviations = amplitudes.map(|((parameter, value), sigma)| {
        let neutral = if parameter.neutral < NEVER { parameter.neutral } else { 0.0 };
        ((value - neutral).abs(), *sigma)
    });
    let (size, sigma) = deviations.max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)))?;
    let largest = if spec.trial == Trial::Whole { f64::INFINITY } else { size };
    (sigma >= largest).then(|| {
        format!("its {} is not told from none: its standard deviation is as large", spec.parameters[0].name)
    })
}

/// Splits `all` into at most `allowed` items to be named, for which `why_not` gives no reason, and the rest with reasons.
fn sorted<T>(
    all: Vec<T>,
    allowed: usize,
    why_not: impl Fn(&T) -> Option<String>,
) -> (Vec<T>, Vec<Unnamed<T>>) {
    let (mut named, mut rest) = (Vec::new(), Vec::new());
    for found in all {
        match why_not(&found) {
            Some(why) => rest.push(Unnamed { found, why }),
            None if named.len() < allowed => named.push(found),
            None => {
                rest.push(Unnamed { found, why: format!("no more than {allowed} causes were to be named") });
            }
        }
    }
    (named, rest)
}

/// Why a cause with the values and standard deviations of a model is not to be named; none if it may be.
fn unfit_in<const P: usize>(model: &Fit<P>, cause: &Cause) -> Option<String> {
    unfit(&cause.effect, &sigma_at_its_shape(model, cause), cause.probability)
}

/// Why a cause has values that no arm has, or a size that is not told from none, whatever its probability; none if it has neither.
fn no_effect<const P: usize>(model: &Fit<P>, cause: &Cause) -> Option<String> {
    impossible(&cause.effect, cause.probability)
        .or_else(|| uncertain(&cause.effect, &sigma_at_its_shape(model, cause)))
}

/// Standard deviations of a cause's values, that of its size at the values of its shape.
fn sigma_at_its_shape<const P: usize>(model: &Fit<P>, cause: &Cause) -> Vec<f64> {
    let part = part_at_its_shape(model, &cause.effect);
    cause.sigma.iter().map(|sigma| sigma * part).collect()
}

/// Standard deviation of an effect's size at given values of its shape, as a part of its standard deviation; 1 if the effect has no shape, or the model does
/// not have the effect.
///
/// Where a size and a shape are fitted together, as the amplitude and the time constant of a friction that warms up slowly, the size alone may take any
/// value and the effect is certain nevertheless: whether there is one is asked at its shape.
fn part_at_its_shape<const P: usize>(model: &Fit<P>, effect: &EffectInstance) -> f64 {
    let effects = &model.hypothesis.effects;
    let Some(place) = effects.iter().position(|e| e.same_place(effect)) else { return 1.0 };
    let size = P + effects[..place].iter().map(EffectInstance::len).sum::<usize>();
    let shape: Vec<usize> = (size + sizes(effect)..size + effect.len()).collect();
    conditional_part(&model.covariance.matrix, size, &shape)
}

/// Number of leading values of an effect that are sizes: for an effect tested along a ray (`Trial::Ray`) all values tend to zero together, and the first
/// one is the size.
fn sizes(effect: &EffectInstance) -> usize {
    if effect.law.spec().trial == Trial::Ray { 1 } else { effect.amplitudes() }
}

/// Standard deviation of value `one` at given values `others`, as a part of its standard deviation, from a covariance; 1 where that is singular.
fn conditional_part(covariance: &DMatrix<f64>, one: usize, others: &[usize]) -> f64 {
    let among = DMatrix::from_fn(others.len(), others.len(), |i, j| covariance[(others[i], others[j])]);
    let with_one = DVector::from_fn(others.len(), |i, _| covariance[(others[i], one)]);
    let Some(factor) = among.cholesky() else { return 1.0 };
    let explained = with_one.dot(&factor.solve(&with_one)) / covariance[(one, one)];
    if explained.is_finite() { (1.0 - explained).clamp(0.0, 1.0).sqrt() } else { 1.0 }
}

/// Adds the squared biases of a cause's values to their variances.
fn widen<const P: usize>(cause: &mut Cause, bias: &HorizonBias<P>) {
    let Some(biases) = bias.of_effect(&cause.effect) else { return };
    for (sigma, bias) in cause.sigma.iter_mut().zip(biases) {
        *sigma = sigma.hypot(*bias);
    }
}

/// Whether errors `found`, one per joint, are larger than `given` in sum.
fn is_worse(found: &[f64], given: &[f64]) -> bool {
    found.iter().sum::<f64>() > given.iter().sum()
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
    pub fn headline(&mut self, conclusion: Conclusion<N, P>, most: usize) -> Headline<N, P> {
        let Conclusion { mut attribution, alone, mut disturbances } = conclusion;
        let (mut causes, mut candidates) = self.weighed_causes(&mut attribution, &disturbances, most);
        let pushes_allowed = if most > 0 { usize::MAX } else { 0 };
        disturbances.sort_by(|a, b| b.clarity().total_cmp(&a.clarity()));
        let (mut disturbances, disturbance_candidates) =
            sorted(disturbances, pushes_allowed, |e| unfit(&e.push, &e.sigma, e.probability));
        let mut changed = !disturbance_candidates.is_empty();
        if let Some(alone) = alone.filter(|_| changed && disturbances.is_empty()) {
            attribution = alone;
            self.take_all_windows();
            self.set_pushes(&[]);
            (causes, candidates) = self.weighed_causes(&mut attribution, &[], most);
            changed = false;
        }
        self.set_pushes(&disturbances);
        changed |= !candidates.is_empty();
        let Reported { mut model, mut weights, mut open, .. } =
            self.reported(&attribution, &causes, &disturbances, changed);
        // Without those that are not named, the others may have no size any more.
        while changed && !causes.is_empty() {
            refresh(&model, &mut causes);
            let (named, lost) = sorted(causes, most, |cause| unfit_in(&model, cause));
            causes = named;
            if lost.is_empty() {
                break;
            }
            candidates.extend(lost);
            Reported { model, weights, open, .. } = self.reported(&attribution, &causes, &disturbances, true);
        }
        if !candidates.is_empty()
            && let Some(last) = attribution.nodes.last()
        {
            // Pushes were looked for beside all causes that were found: what only the unnamed of these explain is left now.
            let error = |fit: &Fit<P>| self.holdout_error(&last.weights, &fit.hypothesis);
            let left = (error(&model) - error(&attribution.model)) / error(&attribution.refit);
            let left = if left > 0.0 { left.min(1.0) } else { 0.0 };
            for push in &mut disturbances {
                push.doubt_beside(left);
            }
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
    ) -> (Vec<Cause>, Vec<Unnamed<Cause>>) {
        self.weigh(attribution);
        let (mut causes, mut model) = (attribution.causes.clone(), attribution.model.clone());
        let mut candidates = Vec::new();
        while let Some(last) = attribution.nodes.last() {
            let (kept, lost) = sorted(causes, usize::MAX, |cause| no_effect(&model, cause));
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
        let (named, rest) = sorted(causes, most, |cause| unfit_in(&model, cause));
        candidates.extend(rest);
        (named, candidates)
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
    fn worse(
        &self,
        attribution: &Attribution<N, P>,
        model: &Fit<P>,
        weights: &SplitWeighting<N>,
    ) -> Option<&'static str> {
        let (data, measured) = (&self.holdout.data, &self.holdout.measured);
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
    use crate::search::acceptance::Ground;
    use crate::search::evidence::Evidence;
    use armgap_core::effect::find;

    fn effect(name: &str, p: [f64; 3]) -> EffectInstance {
        EffectInstance::new(find::<f64>(name).unwrap(), 0, p)
    }

    #[test]
    fn what_is_fit_to_be_named() {
        for (name, p, sigma, probability, fit) in [
            ("stribeck", [0.8, 0.3, 0.0], vec![0.03, 0.02], 0.99, true),
            ("stribeck", [0.8, 0.3, 0.0], vec![0.03, 0.02], 0.29, false),
            ("stribeck", [0.8, 0.3, 0.0], vec![0.8, 0.02], 0.99, false),
            ("stribeck", [0.8, 0.3, 0.0], vec![0.03, 3.0], 0.99, true),
            ("presliding", [0.4, 30.0, 0.0], vec![0.05, 20.0], 0.99, true),
            ("presliding", [1e-16, 300.0, 0.0], vec![0.008, 90.0], 0.99, false),
            ("payload", [15.6, 0.2, 0.0], vec![50.0, 0.1], 0.99, false),
            ("torque_gain", [1.02, 0.0, 0.0], vec![0.01], 0.9, true),
            ("torque_gain", [1.02, 0.0, 0.0], vec![0.03], 0.9, false),
            ("torque_gain", [20.0, 0.0, 0.0], vec![3.5], 0.9, false),
            ("torque_gain", [0.08, 0.0, 0.0], vec![0.001], 1.0, false),
            ("joint_spring", [-2.0, 0.1, 0.0], vec![0.1, 0.1], 0.4, false),
            ("joint_spring", [-2.0, 0.1, 0.0], vec![0.1, 0.1], 0.9, true),
            ("joint_spring", [2.0, 0.1, 0.0], vec![0.1, 0.1], 0.4, true),
            ("load_dependent_friction", [-0.1, 0.0, 0.0], vec![0.01], 0.8, false),
            ("load_dependent_friction", [-0.1, 0.0, 0.0], vec![0.01], 0.95, true),
            ("load_dependent_friction", [0.1, 0.0, 0.0], vec![0.01], 0.8, true),
            ("position_dependent_friction", [0.01, 0.5, 0.0], vec![0.1, 0.1], 0.9, true),
            ("torque_saturation", [12.0, 0.0, 0.0], vec![f64::INFINITY], 0.9, false),
        ] {
            let why = unfit(&effect(name, p), &sigma, probability);
            assert_eq!(why.is_none(), fit, "{name} {p:?} {sigma:?} {probability}: {why:?}");
        }
    }

    #[test]
    fn a_size_is_surer_at_a_given_shape() {
        let covariance = DMatrix::from_row_slice(3, 3, &[9.0, 0.0, 0.0, 0.0, 4.0, 5.7, 0.0, 5.7, 9.0]);
        let correlation: f64 = 5.7 / (2.0 * 3.0);
        let part = conditional_part(&covariance, 1, &[2]);
        assert!((part - (1.0 - correlation * correlation).sqrt()).abs() < 1e-12, "{part}");
        assert_eq!(conditional_part(&covariance, 1, &[0]), 1.0, "not correlated");
        assert_eq!(conditional_part(&covariance, 1, &[]), 1.0, "no shape");
        let unknown = DMatrix::from_diagonal_element(2, 2, f64::INFINITY);
        assert_eq!(conditional_part(&unknown, 0, &[1]), 1.0);
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
        let (mut named, mut rest) =
            (vec![cause.clone()], vec![Unnamed { found: cause, why: "small".to_owned() }]);
        withhold(&mut named, &mut rest, "by the arm file as it stands");
        assert!(named.is_empty() && rest.len() == 2 && rest[0].why.contains("worse than by the arm file"));
    }

    #[test]
    fn one_too_many_is_a_candidate() {
        let (named, rest) = sorted(vec![1, 2, 3, 4], 2, |x| (*x == 1).then(|| "small".to_owned()));
        assert_eq!(named, [2, 3]);
        let why: Vec<(i32, &str)> = rest.iter().map(|u| (u.found, u.why.as_str())).collect();
        assert_eq!(why, [(1, "small"), (4, "no more than 2 causes were to be named")]);
        let (none, all) = sorted(vec![7], 0, |_| None);
        assert!(none.is_empty() && all.len() == 1);
    }
}
