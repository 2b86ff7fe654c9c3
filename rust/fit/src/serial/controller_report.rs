//! What a result says of position controllers: their settings, look-alikes that no log of references and positions tells apart, and estimated gains.

use super::controller::{JointController, PositionController};
use super::term::{Term, TermKind};
use crate::report::{Cause, EquivalentSummary};

/// Controllers with the settings that terms say.
pub(super) fn with_settings(mut joints: Vec<JointController>, terms: &[Term]) -> Vec<JointController> {
    for term in terms {
        if let TermKind::Controller(of) = term.kind {
            joints[of.joint] = of.on(&joints[of.joint], term.p[0]);
        }
    }
    joints
}

/// What no log of references and positions tells from a cause.
pub(super) fn behind_controller(cause: &Cause, controller: &PositionController) -> Option<EquivalentSummary> {
    let joint = cause.joint?;
    let of = &controller.joints[joint - 1];
    let why = |effect, why: String| EquivalentSummary { effect, joint: cause.joint, why };
    match cause.effect {
        "torque_offset" if of.gains[0] > 0.0 => {
            let offset = cause.parameters.get("offset")?;
            let unit = if offset.unit == "N" { "m" } else { "rad" };
            let off = figure(offset.value / of.gains[0]);
            Some(why(
                "reference_offset",
                format!("a reference that is off by {off} {unit} gives the same torque"),
            ))
        }
        "controller_damping" if !of.rate_of_error => Some(why(
            "viscous_friction",
            "on the measured velocity the derivative gain acts as viscous friction does".to_owned(),
        )),
        _ => None,
    }
}

/// Remark on gains that were estimated.
pub(super) fn gains_note(
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

/// A number with three significant figures.
fn figure(x: f64) -> String {
    let digits = if x == 0.0 { 0.0 } else { (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) };
    format!("{x:.*}", digits as usize)
}
