//! Whether the size of an effect is told from none, beside the sizes that effects which are not in the arm have by chance.

use crate::likelihood::solve::{Fit, neutral};
use crate::model::hypothesis::EffectInstance;
use armgap_core::effect::{MAX_PARAMETERS, Trial};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Number of effects that are not in the arm of which the one with the largest size, in standard deviations, may be taken for a cause: fewer than the
/// candidates, as their sizes are correlated. Of 100 causes on arms of another simulator seven wrong ones at 0.5 and above have sizes of 1.4 to 2.9
/// standard deviations and fall below 0.5, and one right one with them; with 10 one of the seven stays, with 40 two more right ones fall.
const BY_CHANCE: f64 = 20.0;

/// Probability that none of [`BY_CHANCE`] effects that are not in the arm has a size as many standard deviations from none as the effect with index `place`
/// in a fit: as its amplitudes, or as the compliance or width of a transmission. None for other effects, and where no standard deviation is known.
pub(super) fn size_certainty<const P: usize>(place: usize, fit: &Fit<P>) -> Option<f64> {
    let effects = &fit.hypothesis.effects;
    let effect = &effects[place];
    let first = P + effects[..place].iter().map(EffectInstance::len).sum::<usize>();
    let off = neutral(effect);
    let (sizes, none) = match effect.law.spec().trial {
        Trial::Whole if effect.law.has_transmission() => (1, [0.0; MAX_PARAMETERS]),
        Trial::Whole | Trial::Disturbance => return None,
        _ => (effect.amplitudes(), off.p),
    };
    let by_chance = |i: usize| {
        let deviations = (effect.p[i] - none[i]).abs() / fit.sigma(first + i);
        let degrees = fit.covariance.degrees_of_freedom[first + i];
        let known = StudentsT::new(0.0, 1.0, degrees).ok()?;
        deviations.is_finite().then(|| 2.0 * known.sf(deviations))
    };
    let least = (0..sizes).filter_map(by_chance).reduce(f64::min)?;
    Some((1.0 - least).powf(BY_CHANCE * sizes as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::covariance::ParameterCovariance;
    use crate::model::hypothesis::Hypothesis;
    use armgap_core::effect::find;
    use nalgebra::DMatrix;

    /// Certainty of the size of an effect with the values `p` and the standard deviations `sigma`, with nine degrees of freedom.
    fn of(name: &str, p: [f64; 3], sigma: [f64; 3]) -> Option<f64> {
        let effect = EffectInstance::new(find(name).unwrap(), 0, p);
        let hypothesis = Hypothesis::rigid([1.0; 2]).with(effect);
        let mut matrix = DMatrix::zeros(2 + effect.len(), 2 + effect.len());
        (0..effect.len()).for_each(|i| matrix[(2 + i, 2 + i)] = sigma[i] * sigma[i]);
        let covariance = ParameterCovariance { matrix, degrees_of_freedom: vec![9.0; 2 + effect.len()] };
        size_certainty(0, &Fit { hypothesis, data_cost: 0.0, prior_cost: 0.0, covariance, costs: Vec::new() })
    }

    #[test]
    fn the_best_of_twenty_absent_effects_is_two_deviations_off_by_chance() {
        let gain = |off: f64| of("torque_gain", [1.0 + off, 0.0, 0.0], [0.1; 3]).unwrap();
        assert!(gain(0.14) < 0.05 && (0.4..0.6).contains(&gain(0.25)) && gain(0.6) > 0.99);
        // Of two amplitudes the larger counts, among twice as many.
        let both = |a: f64, b: f64| of("encoder_eccentricity", [a, b, 0.0], [0.1; 3]).unwrap();
        assert!(both(0.7, 0.0) > 0.99 && both(0.25, 0.0) < gain(0.25));
    }

    #[test]
    fn of_a_transmission_the_compliance_or_width_counts() {
        let shaft = of("joint_elasticity", [100.0, 1.0, 0.01], [10.0, 5.0, 0.02]).unwrap();
        assert!(shaft > 0.99, "damping and rotor are not told from none");
        assert!(of("joint_elasticity", [100.0, 1.0, 0.01], [80.0, 0.01, 1e-4]).unwrap() < 0.05);
        assert_eq!(of("torque_saturation", [3.0, 0.0, 0.0], [1.0; 3]), None);
    }
}
