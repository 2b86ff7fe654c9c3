//! Results about position controllers: their changed settings, look-alikes that no log of references and positions distinguishes, and estimated
//! gains.

use crate::result::report::{Cause, CauseValue, EquivalentSummary, SeveralJoints};
use crate::serial::controller::{JointController, PositionController};
use crate::serial::term::{Term, TermKind};

/// Controllers (`joints`) with the settings that controller terms among `terms` change.
pub(in crate::serial) fn with_settings(
    mut joints: Vec<JointController>,
    terms: &[Term],
) -> Vec<JointController> {
    for term in terms.iter().flat_map(Term::members) {
        if let TermKind::Controller(of) = term.kind {
            joints[of.joint] = of.on(&joints[of.joint], term.p[0]);
        }
    }
    joints
}

/// Look-alikes of a cause that no log of references and positions distinguishes from it.
pub(in crate::serial) fn behind_controller(
    cause: &Cause,
    controller: &PositionController,
) -> Vec<EquivalentSummary> {
    let Some(joint) = cause.joint else { return Vec::new() };
    let of = &controller.joints[joint - 1];
    let why = |effect, why: String| EquivalentSummary {
        effect,
        joint: cause.joint,
        on: SeveralJoints::default(),
        why,
        motion_separates: false,
    };
    match cause.effect {
        "torque_offset" if of.gains[0] > 0.0 => {
            let Some(offset) = cause.parameters.get("offset").and_then(CauseValue::one) else {
                return Vec::new();
            };
            let unit = if offset.unit == "N" { "m" } else { "rad" };
            let off = figure(offset.value / of.gains[0]);
            vec![why(
                "reference_offset",
                format!("a reference that is off by {off} {unit} gives the same torque"),
            )]
        }
        "controller_damping" => {
            let friction = why(
                "viscous_friction",
                "on the measured velocity the derivative gain acts as viscous friction does".to_owned(),
            );
            (!of.rate_of_error).then_some(friction).into_iter().collect()
        }
        _ => Vec::new(),
    }
}

/// Remark that lists the controllers' estimated gains, with their standard deviations and the arm file's values; `differences` from the arm file and
/// `sigma` are in the order of [`PositionController::estimated`].
pub(in crate::serial) fn gains_note(
    controller: &PositionController,
    differences: &[f64],
    sigma: &[f64],
) -> Option<String> {
    const NAMES: [&str; 3] = ["kp", "kd", "ki"];
    let of = |(((gain, j), difference), sigma): (((usize, usize), &f64), &f64)| {
        let stated = controller.joints[j].gains[gain];
        let (value, sigma) = (figure(stated + difference), figure(*sigma));
        format!("{}{} {value} ± {sigma} ({})", NAMES[gain], j + 1, figure(stated))
    };
    let all: Vec<String> = controller.estimated().into_iter().zip(differences).zip(sigma).map(of).collect();
    (!all.is_empty()).then(|| format!("gains of the controller, estimated (stated): {}", all.join(", ")))
}

/// The number `x` as text, with three significant figures.
fn figure(x: f64) -> String {
    let digits = if x == 0.0 { 0.0 } else { (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) };
    format!("{x:.*}", digits as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::report::{Named, Value};
    use crate::serial::controller::tests::SERVO;

    fn alike(effect: &'static str, rate_of_error: bool) -> Vec<&'static str> {
        let joints = vec![JointController { rate_of_error, ..SERVO }; 2];
        let controller = PositionController { joints, sigma: [vec![], vec![], vec![]] };
        let offset = ("offset".to_owned(), CauseValue::One(Value { value: 2.0, sigma: 0.1, unit: "N m" }));
        let parameters: Named<CauseValue> = std::iter::once(offset).collect();
        let cause = Cause {
            effect,
            title: effect,
            joint: Some(2),
            on: SeveralJoints::default(),
            probability: 1.0,
            parameters,
            closed: 0.5,
            equivalents: Vec::new(),
            evidence: None,
            sides: None,
            log: None,
            shape: None,
        };
        let found = behind_controller(&cause, &controller);
        assert!(found.iter().all(|e| e.joint == Some(2)));
        found.iter().map(|e| e.effect).collect()
    }

    #[test]
    fn another_damping_on_the_measured_velocity_may_be_friction() {
        assert_eq!(alike("controller_damping", false), ["viscous_friction"]);
        assert!(alike("controller_damping", true).is_empty());
    }

    #[test]
    fn an_offset_may_be_one_of_the_reference() {
        assert_eq!(alike("torque_offset", false), ["reference_offset"]);
        assert!(alike("stribeck", false).is_empty());
    }
}
