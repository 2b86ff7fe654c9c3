//! Whether what a diagnosis has found may be named: with values that arms can have, a size that is told from none, and a form that the motion shows.

use crate::likelihood::solve::Fit;
use crate::log::input::Withheld;
use crate::model::hypothesis::EffectInstance;
use crate::search::belief::Cause;
use armgap_core::effect::{NEVER, Trial};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Probability below which a cause is not named.
const NAMEABLE: f64 = 0.3;

/// Probability below which a fitted value that arms hardly ever have (a negative spring stiffness) is not named. Single logs of a real arm whose
/// encoders have another zero in each log gave negative stiffnesses with probabilities up to 0.80 (docs/real-arm.md).
const RARE_VALUE_PROBABILITY: f64 = 0.9;

/// Gains of a drive, delivered over commanded torque: beyond this range, the unit of the torque column is wrong, not the drive.
const GAINS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Standard deviations by which the distance of a payload from its joint has to differ from none: a mass at the joint itself is one of the link before,
/// or of the joint's drive. Of two payloads that were right on 150 simulated cases one was at 2.1 and one at 6.6; of three that stood for wrong values of
/// an arm file two were at 0.2 and 1.5 (docs/decisions/065-asked-once-more.md).
const FAR_FROM_JOINT: f64 = 2.0;

/// A cause or disturbance that was found and is not named, with the reason.
#[derive(Debug, Clone)]
pub struct Unnamed<T> {
    /// The cause or disturbance that is not named.
    pub found: T,
    /// Reason, in words, why the found cause or disturbance is not named.
    pub why: String,
}

/// What decides, beside an effect itself, whether it may be named.
pub(crate) struct Naming<'a, const N: usize> {
    /// Travel of every joint over all logs, rad or m.
    pub travel: [f64; N],
    /// Effects that are not to be named, whatever their probability.
    pub withheld: &'a [Withheld],
}

impl<const N: usize> Naming<'_, N> {
    /// Why an effect found with `probability`, whose values have standard deviations `sigma`, is not to be named; none if it may be.
    pub fn unfit(&self, effect: &EffectInstance, sigma: &[f64], probability: f64) -> Option<String> {
        improbable(probability)
            .or_else(|| self.wrong_form(effect, probability))
            .or_else(|| uncertain(effect, sigma))
    }

    /// Why a cause with the values and standard deviations of a model is not to be named `beside` the others; none if it may be.
    pub fn unfit_in<const P: usize>(
        &self,
        model: &Fit<P>,
        cause: &Cause,
        beside: &[Cause],
    ) -> Option<String> {
        improbable(cause.probability).or_else(|| self.no_effect(model, cause, beside))
    }

    /// Why a cause has values that no arm has, a form that the logs do not show, or a size that is not told from none, whatever its probability; none if
    /// it has neither.
    pub fn no_effect<const P: usize>(
        &self,
        model: &Fit<P>,
        cause: &Cause,
        beside: &[Cause],
    ) -> Option<String> {
        self.wrong_form(&cause.effect, cause.probability)
            .or_else(|| uncertain(&cause.effect, &sigma_at_its_shape(model, cause)))
            .or_else(|| opposed(cause, beside))
    }

    fn wrong_form(&self, effect: &EffectInstance, probability: f64) -> Option<String> {
        let is_it = |w: &&Withheld| w.effect == effect.law.spec().name && w.joint == effect.joint_number();
        let withheld = self.withheld.iter().find(is_it).map(|w| w.why.clone());
        withheld
            .or_else(|| impossible(effect, probability))
            .or_else(|| part_of_a_wave(effect, self.travel[effect.joint]))
    }
}

fn improbable(probability: f64) -> Option<String> {
    (probability < NAMEABLE).then(|| format!("its probability is {probability:.2}"))
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

/// Reason why the wave of a torque ripple is not seen as one: less than one period of it lies within the joint's `travel`, rad or m, over which a sine is
/// like any smooth torque over position, as that of a spring, a counterbalance or a centre of mass beside the link's axis.
fn part_of_a_wave(effect: &EffectInstance, travel: f64) -> Option<String> {
    let is_part = effect.law.spec().name == "torque_ripple" && effect.p[1].abs() * travel < TAU;
    is_part.then(|| {
        "less than one of its periods lies within the joint's travel, so that any smooth torque over position looks like it"
            .to_owned()
    })
}

/// Reason why a drag is no effect of its own: with a stronger drag of the opposite sign, or a negative one beside a Stribeck friction, on the same joint it
/// is a part of a curve over speed that neither is.
fn opposed(cause: &Cause, beside: &[Cause]) -> Option<String> {
    let is_drag = |c: &Cause| matches!(c.effect.law.spec().name, "quadratic_drag" | "cubic_drag");
    let opposes = |other: &Cause| {
        let is_stronger_drag = is_drag(other)
            && other.effect.p[0] * cause.effect.p[0] < 0.0
            && other.relevance > cause.relevance;
        let is_stribeck = other.effect.law.spec().name == "stribeck" && cause.effect.p[0] < 0.0;
        other.effect.joint == cause.effect.joint && (is_stronger_drag || is_stribeck)
    };
    (is_drag(cause) && beside.iter().any(opposes)).then(|| {
        "with the friction beside it, which it opposes, it is part of a curve over speed that neither is"
            .to_owned()
    })
}

/// Reason why the size of an effect cannot be told from zero: its standard deviation is as large as the size; none if it can be. Effects with a
/// threshold or a transmission always pass, as the standard deviation of their size includes that of other values, and the model search has compared
/// the whole effect with its absence.
fn uncertain(effect: &EffectInstance, sigma: &[f64]) -> Option<String> {
    let spec = effect.law.spec();
    if spec.name == "payload" && sigma.get(1).is_some_and(|sigma| effect.p[1] < FAR_FROM_JOINT * sigma) {
        return Some(
            "its distance from the joint is not told from none: a mass there is no load of the last link"
                .to_owned(),
        );
    }
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
pub(crate) fn sorted<T>(
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::acceptance::Ground;
    use crate::search::evidence::Evidence;
    use armgap_core::effect::find;

    fn effect(name: &str, p: [f64; 3]) -> EffectInstance {
        EffectInstance::new(find::<f64>(name).unwrap(), 0, p)
    }

    fn drag(name: &str, size: f64, relevance: f64) -> Cause {
        Cause {
            effect: effect(name, [size, 0.0, 0.0]),
            sigma: vec![0.001],
            probability: 0.99,
            share: 0.5,
            relevance,
            look_alikes: Vec::new(),
            evidence: Evidence::default(),
            ground: Ground::Motion,
        }
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
            ("payload", [1.2, 0.007, 0.0], vec![0.27, 0.032], 0.99, false),
            ("payload", [0.15, 0.28, 0.0], vec![0.03, 0.04], 0.99, true),
            ("torque_ripple", [1.0, 1.24, 0.3], vec![0.01, 0.01, 0.01], 0.99, false),
            ("torque_ripple", [1.0, 2.2, 0.3], vec![0.01, 0.01, 0.01], 0.99, true),
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
            let naming = Naming { travel: [3.0], withheld: &[] };
            let why = naming.unfit(&effect(name, p), &sigma, probability);
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
    fn of_two_drags_that_oppose_each_other_the_weaker_is_no_effect_of_its_own() {
        let pair = [drag("quadratic_drag", -0.9, 0.2), drag("cubic_drag", 0.1, 0.1)];
        assert!(opposed(&pair[0], &pair).is_none() && opposed(&pair[1], &pair).is_some());
        let same = [drag("quadratic_drag", 0.9, 0.2), drag("cubic_drag", 0.1, 0.1)];
        assert!(same.iter().all(|cause| opposed(cause, &same).is_none()));
        let other = [drag("quadratic_drag", 0.9, 0.2), drag("stribeck", 0.1, 0.1)];
        assert!(other.iter().all(|cause| opposed(cause, &other).is_none()));
        let falling = [drag("quadratic_drag", -0.9, 0.2), drag("stribeck", 0.1, 0.1)];
        assert!(opposed(&falling[0], &falling).is_some() && opposed(&falling[1], &falling).is_none());
    }

    #[test]
    fn what_is_withheld_is_not_named() {
        let why = "its drive is limited".to_owned();
        let withheld = [Withheld { effect: "stribeck".to_owned(), joint: Some(1), why }];
        let naming = Naming { travel: [3.0], withheld: &withheld };
        let why = |name| naming.unfit(&effect(name, [0.8, 0.3, 0.0]), &[0.03, 0.02], 0.99);
        assert_eq!(why("stribeck").as_deref(), Some("its drive is limited"));
        assert_eq!(why("presliding"), None);
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
