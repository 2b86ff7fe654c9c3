//! Whether re-estimated parameters are such as this arm can have, and the standard deviations that an arm file may ask for.

use armgap_core::arm::{ArmKind, Parameter};
use schemars::JsonSchema;
use serde::Serialize;

/// A value this many standard deviations of the arm file away is none that the arm file allows: by chance, one in a million.
const FAR: f64 = 5.0;

/// A sign is known where the value is this many of its standard deviations from zero.
const KNOWN: f64 = 2.0;

/// A nominal value smaller than this part of the estimated one stands for none, and so does its sign.
const COMPARABLE: f64 = 0.2;

/// Logs that leave more than this part of a parameter's prior deviation hardly say anything about it: less than the arm file does.
const UNSEEN: f64 = 0.71;

/// What is said of values that stayed where they were.
const STUCK: &str = "beside so large a gap the logs say less about the parameters than the arm file does, and their values stayed near \
     it; check signs, zeros and units first";

/// Largest standard deviation, in the value's own size (or that of the largest parameter of its unit): what lies a value ten times as
/// large away then costs one square, as good as nothing beside any log, and steps of finite differences, which go by it, stay on the arm.
const WIDEST: f64 = 10.0;

/// What is wrong with a re-estimated value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Gravity has turned over.
    Sign,
    /// Far outside what the arm file allows.
    Sigma,
    /// It stayed where it began, beside a gap.
    Unmoved,
    /// Friction that the arm file has is gone.
    Zero,
}

/// A re-estimated parameter that is not to be believed as it stands.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Sanity {
    /// Parameter.
    pub parameter: &'static str,
    /// What is wrong.
    pub kind: Kind,
    /// The same in words.
    pub message: String,
}

/// A parameter before and after its estimation.
#[derive(Debug, Clone, Copy)]
pub struct Estimate {
    /// Value of the arm file.
    pub nominal: f64,
    /// Its standard deviation there.
    pub prior: f64,
    /// Estimated value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

impl Estimate {
    fn distance(&self) -> f64 {
        (self.value - self.nominal).abs() / self.prior
    }

    /// Whether both signs are known and differ.
    fn is_turned(&self) -> bool {
        self.nominal * self.value < 0.0
            && self.value.abs() > KNOWN * self.sigma
            && self.nominal.abs() > COMPARABLE * self.value.abs()
    }

    fn is_unmoved(&self) -> bool {
        self.distance() < FAR && self.sigma > UNSEEN * self.prior
    }
}

/// Whether a parameter of an arm, by its index, is a torque of gravity: an inertial one in the unit of a torque or force.
fn is_gravity(kind: ArmKind, index: usize) -> bool {
    index < kind.inertial() && matches!(kind.parameters()[index].unit, "N m" | "N")
}

/// What is wrong with re-estimated parameters; `remains` says whether they leave a gap.
pub fn sanity(kind: ArmKind, estimates: &[Estimate], remains: bool) -> Vec<Sanity> {
    let stuck = remains && estimates.iter().all(Estimate::is_unmoved);
    let one = |(i, (parameter, estimate)): (usize, (&Parameter, &Estimate))| {
        let (found, message) = if is_gravity(kind, i) && estimate.is_turned() {
            (Kind::Sign, turned(parameter, estimate))
        } else if i >= kind.inertial() && estimate.value == 0.0 && estimate.nominal > KNOWN * estimate.prior {
            (
                Kind::Zero,
                format!(
                    "{} came out as zero; the arm file has {}",
                    parameter.name,
                    with_unit(estimate.nominal, parameter)
                ),
            )
        } else if estimate.distance() > FAR {
            (Kind::Sigma, far(parameter, estimate))
        } else if stuck {
            (Kind::Unmoved, STUCK.to_owned())
        } else {
            return None;
        };
        Some(Sanity { parameter: parameter.name, kind: found, message })
    };
    kind.parameters().iter().zip(estimates).enumerate().filter_map(one).collect()
}

fn turned(parameter: &Parameter, estimate: &Estimate) -> String {
    let (from, to) = (with_unit(estimate.nominal, parameter), with_unit(estimate.value, parameter));
    format!(
        "{} turned gravity over, from {from} to {to}: a zero of the positions or a sign may be another than the arm file's",
        parameter.name
    )
}

fn far(parameter: &Parameter, estimate: &Estimate) -> String {
    let (from, to) = (with_unit(estimate.nominal, parameter), with_unit(estimate.value, parameter));
    let distance = estimate.distance();
    format!("{} went from {from} to {to}, {distance:.0} standard deviations of the arm file", parameter.name)
}

fn with_unit(value: f64, parameter: &Parameter) -> String {
    format!("{} {}", significant(value), parameter.unit)
}

/// Four digits, with an exponent where they stand far from the point.
fn significant(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.3e}");
    }
    let places = if size == 0.0 { 0.0 } else { (3.0 - size.log10().floor()).clamp(0.0, 6.0) };
    format!("{value:.0$}", places as usize)
}

/// Standard deviations to estimate with, no wider than an arm can ask for.
pub fn bounded_sigma(kind: ArmKind, theta: &[f64], sigma: &[f64]) -> Vec<f64> {
    let parameters = kind.parameters();
    let largest = |unit: &str| {
        let of_unit = parameters.iter().zip(theta).filter(|(p, _)| p.unit == unit);
        of_unit.map(|(_, value)| value.abs()).fold(0.0, f64::max)
    };
    let bounded = |(i, sigma): (usize, &f64)| {
        let size = if theta[i] == 0.0 { largest(parameters[i].unit) } else { theta[i].abs() };
        if size > 0.0 { sigma.min(WIDEST * size) } else { *sigma }
    };
    sigma.iter().enumerate().map(bounded).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PENDULUM: ArmKind = ArmKind::Pendulum;

    /// Inertia, gravity, viscous and Coulomb friction as of the arm file, but for one.
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
