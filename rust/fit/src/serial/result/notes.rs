//! Remarks of the result of a serial arm's diagnosis, and re-estimated parameters that are not to be believed.

use crate::result::sanity::{Estimate, Sanity, off};
use crate::serial::result::controller_report::gains_note;
use crate::serial::result::unexplained;
use crate::serial::search::Found;
use crate::serial::search::fitting::Fitted;
use crate::serial::{SerialArm, Set};

/// Remarks of the result: the share of each joint's torque that stays unexplained, joints that do not move in the training logs, and estimated gains
/// of controllers.
pub(in crate::serial) fn notes<const N: usize, const P: usize>(
    found: &Found,
    training: &Set<N, P>,
    holdout: &Set<N, P>,
    rotary: &[bool],
) -> Vec<String> {
    let mut notes = Vec::new();
    let shares = |set: &Fitted| -> String {
        let share = |s: Option<f64>| s.map_or_else(|| "-".to_owned(), |s| format!("{:.1}", 100.0 * s));
        unexplained(set, holdout).into_iter().map(share).collect::<Vec<_>>().join(", ")
    };
    notes.push(format!(
        "share of each joint's torque that stays unexplained on the holdout (RMS, %): {} with parameters re-estimated",
        shares(&found.refit)
    ));
    if !found.model.terms.is_empty() {
        notes.push(format!("the same with all terms found: {}", shares(&found.model)));
    }
    if found.refit.estimate.theta != found.refit_feasible.estimate.theta {
        notes.push(
            "the re-estimated parameters fit the torques, but no arm has their inertia matrix: predictions with them use values nearer to the arm file"
                .to_owned(),
        );
    }
    let still: Vec<String> = (0..rotary.len())
        .filter(|j| training.equation.rows.joints[*j].y.is_empty())
        .map(|j| (j + 1).to_string())
        .collect();
    if !still.is_empty() {
        notes.push(format!(
            "joint {} does not move in the training logs: nothing is said about it",
            still.join(", ")
        ));
    }
    let controller = holdout.equation.commanded.as_ref().map(|commanded| &commanded.controller);
    let gains = |c| gains_note(c, &found.reported.estimate.theta[P..], &found.sigma[1][P..]);
    notes.extend(controller.and_then(gains));
    notes
}

/// Remark on joints whose Coulomb friction is regularised, `None` if there are none; `widths` by joint, rad/s or m/s, zero for dry friction.
pub(in crate::serial) fn regularised(widths: &[f64]) -> Option<String> {
    let wide: Vec<String> = widths
        .iter()
        .enumerate()
        .filter(|(_, width)| **width > 0.0)
        .map(|(j, width)| format!("{width} on joint {}", j + 1))
        .collect();
    (!wide.is_empty()).then(|| {
        format!("the logs fit friction that changes its sign over a width better than dry friction, rad/s (m/s): {}", wide.join(", "))
    })
}

/// Re-estimated parameters that are not to be believed: friction and rotors of the arm file that came out as zero, and values far from the arm file's.
pub(in crate::serial) fn sanity(description: &SerialArm, theta: &[f64], sigma: &[f64]) -> Vec<Sanity> {
    let of = |(i, (name, unit)): (usize, (String, &'static str))| {
        let (nominal, prior) = (description.theta[i], description.sigma[i]);
        let estimate = Estimate { nominal, prior, value: theta[i], sigma: sigma[i] };
        off((&name, unit), &estimate, i >= 10 * description.chain.joints.len())
    };
    description.chain.parameters().into_iter().enumerate().filter_map(of).collect()
}

/// Remark on re-estimated parameters that are not to be believed, `None` if there are none.
pub(in crate::serial) fn sanity_note(found: &[Sanity]) -> Option<String> {
    let names: Vec<&str> = found.iter().map(|entry| entry.parameter.as_str()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "re-estimated values that are zero or far off against the arm file: {}; see `sanity`",
            names.join(", ")
        )
    })
}
