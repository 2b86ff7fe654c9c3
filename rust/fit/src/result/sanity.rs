//! Checks of re-estimated parameters against what the arm file allows, and limits on the standard deviations of an arm file.

use armgap_core::arm::{ArmKind, Parameter};
use schemars::JsonSchema;
use serde::Serialize;

/// Distance of an estimated parameter from its nominal value, in standard deviations of the arm file, beyond which the arm file does not allow the
/// value: by chance, one in a million.
const FAR: f64 = 5.0;

/// Size of an estimated value, in its standard deviations, beyond which the sign of the value is known.
const SIGN_KNOWN: f64 = 2.0;

/// Ratio of a nominal to an estimated value, in size, below which the nominal value counts as zero and its sign as unknown.
const COMPARABLE: f64 = 0.2;

/// Ratio of the estimated to the prior standard deviation above which the logs say less about a parameter than the arm file does.
const UNSEEN: f64 = 0.71;

/// Message about parameters whose estimates stayed near the arm file's values while a gap remains.
const STUCK: &str = "beside so large a gap the logs say less about the parameters than the arm file does, and their values stayed near \
     it; check signs, zeros and units first";

/// Largest standard deviation of a parameter relative to its value (or to the largest value of the same unit). A value ten times as large then costs
/// one unit of squared deviation, which any log outweighs, and steps of finite differences, which are proportional to the standard deviation, lead to
/// no impossible arm.
const MAX_RELATIVE_SIGMA: f64 = 10.0;

/// Reason why a re-estimated parameter is not to be believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A gravity parameter has changed its sign.
    Sign,
    /// The value lies many standard deviations of the arm file from the nominal one.
    Sigma,
    /// The value stayed near the nominal one while a gap remains.
    Unmoved,
    /// A friction coefficient that the arm file has was estimated as zero.
    Zero,
}

/// A re-estimated parameter that is not to be believed as it stands.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Sanity {
    /// Name of the parameter whose re-estimated value is not to be believed.
    pub parameter: String,
    /// Reason why the re-estimated value of the parameter is not to be believed.
    pub kind: Kind,
    /// Reason in words, with the nominal and the re-estimated value of the parameter.
    pub message: String,
}

/// A parameter before and after its estimation, SI.
#[derive(Debug, Clone, Copy)]
pub struct Estimate {
    /// Value of the parameter in the arm file, SI.
    pub nominal: f64,
    /// Standard deviation of the parameter in the arm file, SI.
    pub prior: f64,
    /// Estimated value of the parameter, SI.
    pub value: f64,
    /// Standard deviation of the estimated value, SI.
    pub sigma: f64,
}

impl Estimate {
    /// Distance of the estimated from the nominal value, in standard deviations of the arm file.
    fn distance(&self) -> f64 {
        (self.value - self.nominal).abs() / self.prior
    }

    /// Whether the signs of the nominal and the estimated value are both known and differ.
    fn is_turned(&self) -> bool {
        self.nominal * self.value < 0.0
            && self.value.abs() > SIGN_KNOWN * self.sigma
            && self.nominal.abs() > COMPARABLE * self.value.abs()
    }

    /// Whether the estimate stayed near the nominal value because the logs say less about the parameter than the arm file does.
    fn is_unmoved(&self) -> bool {
        self.distance() < FAR && self.sigma > UNSEEN * self.prior
    }
}

/// Whether parameter `index` of an arm is a gravity torque: an inertial parameter with the unit of a torque or force.
fn is_gravity(kind: ArmKind, index: usize) -> bool {
    index < kind.inertial() && matches!(kind.parameters()[index].unit, "N m" | "N")
}

/// Re-estimated parameters that are not to be believed, with reasons; `remains` says whether a gap is left with the estimates.
pub fn sanity(kind: ArmKind, estimates: &[Estimate], remains: bool) -> Vec<Sanity> {
    let stuck = remains && estimates.iter().all(Estimate::is_unmoved);
    let one = |(i, (parameter, estimate)): (usize, (&Parameter, &Estimate))| {
        let named = (parameter.name, parameter.unit);
        if is_gravity(kind, i) && estimate.is_turned() {
            return Some(entry(named, Kind::Sign, turned(named, estimate)));
        }
        let found = off(named, estimate, i >= kind.inertial());
        found.or_else(|| stuck.then(|| entry(named, Kind::Unmoved, STUCK.to_owned())))
    };
    kind.parameters().iter().zip(estimates).enumerate().filter_map(one).collect()
}

/// Entry for a parameter, given by name and unit, whose estimate is far from the arm file's value, or that `may_be_zero` and came out as zero against the arm
/// file; none for other estimates.
pub fn off(parameter: (&str, &str), estimate: &Estimate, may_be_zero: bool) -> Option<Sanity> {
    if may_be_zero && estimate.value == 0.0 && estimate.nominal > SIGN_KNOWN * estimate.prior {
        let given = with_unit(estimate.nominal, parameter.1);
        let message = format!("{} came out as zero; the arm file has {given}", parameter.0);
        return Some(entry(parameter, Kind::Zero, message));
    }
    (estimate.prior > 0.0 && estimate.distance() > FAR)
        .then(|| entry(parameter, Kind::Sigma, far(parameter, estimate)))
}

fn entry((name, _): (&str, &str), kind: Kind, message: String) -> Sanity {
    Sanity { parameter: name.to_owned(), kind, message }
}

fn turned((name, unit): (&str, &str), estimate: &Estimate) -> String {
    let (from, to) = (with_unit(estimate.nominal, unit), with_unit(estimate.value, unit));
    format!(
        "{name} turned gravity over, from {from} to {to}: a zero of the positions or a sign may be another than the arm file's"
    )
}

fn far((name, unit): (&str, &str), estimate: &Estimate) -> String {
    let (from, to) = (with_unit(estimate.nominal, unit), with_unit(estimate.value, unit));
    let distance = estimate.distance();
    format!("{name} went from {from} to {to}, {distance:.0} standard deviations of the arm file")
}

fn with_unit(value: f64, unit: &str) -> String {
    format!("{} {unit}", significant(value))
}

/// A number with four significant digits, with an exponent below 1e-3 and from 1e5 on.
fn significant(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.3e}");
    }
    let places = if size == 0.0 { 0.0 } else { (3.0 - size.log10().floor()).clamp(0.0, 6.0) };
    format!("{value:.0$}", places as usize)
}

/// Standard deviations `sigma` of the parameters `theta`, each limited to ten times its parameter's value, or to ten times the largest value of the
/// same unit if that value is zero.
pub fn bounded_sigma(kind: ArmKind, theta: &[f64], sigma: &[f64]) -> Vec<f64> {
    let parameters = kind.parameters();
    let largest = |unit: &str| {
        let of_unit = parameters.iter().zip(theta).filter(|(p, _)| p.unit == unit);
        of_unit.map(|(_, value)| value.abs()).fold(0.0, f64::max)
    };
    let bounded = |(i, sigma): (usize, &f64)| {
        let size = if theta[i] == 0.0 { largest(parameters[i].unit) } else { theta[i].abs() };
        if size > 0.0 { sigma.min(MAX_RELATIVE_SIGMA * size) } else { *sigma }
    };
    sigma.iter().enumerate().map(bounded).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PENDULUM: ArmKind = ArmKind::Pendulum;

    /// Estimates of a pendulum's inertia, gravity, viscous and Coulomb friction near the arm file's values, with `odd` at `index`.
    fn with(index: usize, odd: Estimate) -> Vec<Estimate> {
        let nominal = [0.05, 0.6, 0.02, 0.1];
        let usual = |x: f64| Estimate { nominal: x, prior: 0.1 * x, value: 1.05 * x, sigma: 0.01 * x };
        let mut all: Vec<Estimate> = nominal.into_iter().map(usual).collect();
        all[index] = odd;
        all
    }

    fn found(index: usize, [nominal, prior, value, sigma]: [f64; 4], remains: bool) -> Vec<Kind> {
        let odd = Estimate { nominal, prior, value, sigma };
        sanity(PENDULUM, &with(index, odd), remains).into_iter().map(|s| s.kind).collect()
    }

    #[test]
    fn gravity_turned_over_is_said() {
        assert_eq!(found(1, [0.6, 0.06, -0.6, 0.01], false), [Kind::Sign]);
        assert_eq!(found(1, [-0.6, 0.06, 0.6, 0.01], false), [Kind::Sign]);
        assert_eq!(found(1, [0.6, 6.0, -0.6, 0.01], false), [Kind::Sign], "whatever the trust in it");
        assert_eq!(found(1, [0.6, 0.3, -0.01, 0.02], false), [], "nothing is known of this sign");
        assert_eq!(found(0, [0.05, 0.1, -0.01, 0.001], false), [], "no gravity");
    }

    #[test]
    fn a_value_far_from_its_arm_file_is_said() {
        assert_eq!(found(1, [0.6, 0.06, 0.91, 0.01], false), [Kind::Sigma]);
        assert_eq!(found(1, [0.6, 0.06, 0.89, 0.01], true), []);
        assert_eq!(found(3, [0.1, 0.05, 0.0, 0.01], false), [], "friction that may be zero");
        assert_eq!(found(3, [0.1, 0.02, 0.0, 0.01], false), [Kind::Zero]);
    }

    #[test]
    fn a_fit_that_did_not_move_is_said_beside_a_gap() {
        let still = |x: f64| Estimate { nominal: x, prior: 0.1 * x, value: 1.1 * x, sigma: 0.08 * x };
        let all: Vec<Estimate> = [5e5, 6e6, 0.02, 0.1].into_iter().map(still).collect();
        let kinds: Vec<Kind> = sanity(PENDULUM, &all, true).into_iter().map(|s| s.kind).collect();
        assert_eq!(kinds, [Kind::Unmoved; 4]);
        assert_eq!(sanity(PENDULUM, &all, false), []);
        let known = Estimate { sigma: 1e-3, ..still(0.6) };
        assert_eq!(sanity(PENDULUM, &[still(0.05), known, still(0.02), still(0.1)], true), []);
    }

    #[test]
    fn sigmas_are_bounded_by_the_values_they_are_of() {
        let bounded = bounded_sigma(PENDULUM, &[0.05, 0.6, 0.0, 0.1], &[1e12, 0.06, 1.0, 2.0]);
        assert_eq!(bounded, [0.5, 0.06, 1.0, 1.0]);
        let zero = bounded_sigma(ArmKind::Axis, &[2.0, 0.0, 1.0, 3.0], &[0.2, 1e9, 0.5, 1.5]);
        assert_eq!(zero, [0.2, 30.0, 0.5, 1.5]);
    }

    #[test]
    fn numbers_have_four_digits() {
        let texts = [0.0, 0.6, -10.912, 123.456, 4321.9, 2e7, 5e-5].map(significant);
        assert_eq!(texts, ["0", "0.6000", "-10.91", "123.5", "4322", "2.000e7", "5.000e-5"]);
    }
}
