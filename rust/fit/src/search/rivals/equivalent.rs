//! Pairs of effects that no log of motion alone distinguishes.

use crate::model::hypothesis::EffectInstance;

/// An effect that cannot be distinguished from a given effect, with the reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Equivalent {
    /// Name of the effect in the library.
    pub effect: &'static str,
    /// 1-based joint of the effect; none for effects of the whole arm.
    pub joint: Option<usize>,
    /// Reason why the effect and the given effect cannot be distinguished.
    pub why: String,
    /// Whether another motion may distinguish them.
    pub motion_separates: bool,
}

/// Why a torque offset and a Coulomb friction that differs by direction are the same to every motion, beside another Coulomb coefficient.
const SAME_WHILE_MOVING: &str =
    "the same function of time while the joint moves; a reading at rest with the motor off separates them";

/// Why no motion of any arm distinguishes the effects named `a` and `b` on the same joints; `None` if one may.
pub fn on_same_joints(a: &str, b: &str) -> Option<&'static str> {
    matches!((a, b), ("torque_offset", "coulomb_asymmetry") | ("coulomb_asymmetry", "torque_offset"))
        .then_some(SAME_WHILE_MOVING)
}

/// Effects that give the same motion as `effect` on an arm with `joints` joints, under any torques.
pub fn known(effect: &EffectInstance, joints: usize) -> Vec<Equivalent> {
    let joint = effect.joint_number();
    let one = |effect, joint, why: &str| {
        vec![Equivalent { effect, joint, why: why.to_owned(), motion_separates: false }]
    };
    match effect.law.spec().name {
        "coulomb_asymmetry" => one("torque_offset", joint, SAME_WHILE_MOVING),
        "torque_offset" => one("coulomb_asymmetry", joint, SAME_WHILE_MOVING),
        "base_tilt" => one(
            "encoder_offset",
            Some(1),
            "both turn gravity by one angle; a level on the base separates them",
        ),
        "encoder_offset" if joint == Some(1) => {
            one("base_tilt", None, "both turn gravity by one angle; a level on the base separates them")
        }
        "rotor_inertia" if joint == Some(2) => one(
            "rotor_coupling",
            None,
            "the same motion with theta3 moved by as much; the rotor's own inertia separates them",
        ),
        "torque_gain" => (1..=joints)
            .filter(|j| Some(*j) != joint)
            .map(|j| Equivalent {
                effect: "torque_gain",
                joint: Some(j),
                why: "the inverse gain there with all parameters scaled; a known added mass separates them"
                    .to_owned(),
                motion_separates: false,
            })
            .collect(),
        _ => Vec::new(),
    }
}

/// Whether two effects are the same, or give the same motion under any torques, on an arm with `joints` joints.
pub fn are(a: &EffectInstance, b: &EffectInstance, joints: usize) -> bool {
    let among = |a: &EffectInstance, b: &EffectInstance| {
        let (name, joint) = (b.law.spec().name, b.joint_number());
        known(a, joints).iter().any(|e| e.effect == name && e.joint == joint)
    };
    a.same_place(b) || among(a, b) || among(b, a)
}

/// Pairs of effects that no motion distinguishes at any values of the arm's parameters, the commoner one first: readings of current and position have
/// zero errors more often than friction differs by direction, or a base is out of level.
const COMMONER: [(&str, &str); 2] = [("torque_offset", "coulomb_asymmetry"), ("encoder_offset", "base_tilt")];

/// Whether `a` gives the same motion as `b` with the arm's parameters as they are, on an arm with `joints` joints, and is the commoner of the two.
pub fn is_commoner(a: &EffectInstance, b: &EffectInstance, joints: usize) -> bool {
    COMMONER.contains(&(a.law.spec().name, b.law.spec().name)) && are(a, b, joints)
}

/// Effects that cannot be distinguished from `effect`: those known to give the same motion, then the look-alikes found in the logs, none twice. `moved`
/// returns the parameters of the arm at whose other values a look-alike needs the torques of `effect` in every state, `None` if it does not.
pub fn all(
    effect: &EffectInstance,
    look_alikes: &[EffectInstance],
    joints: usize,
    moved: impl Fn(&EffectInstance) -> Option<Vec<&'static str>>,
) -> Vec<Equivalent> {
    let mut list = known(effect, joints);
    for other in look_alikes {
        let (name, joint) = (other.law.spec().name, other.joint_number());
        if list.iter().any(|e| e.effect == name && e.joint == joint) {
            continue;
        }
        let moved = moved(other);
        let motion_separates = moved.is_none();
        let why = match moved.as_deref() {
            None => "explains these logs about as well; other motions may separate them".to_owned(),
            Some([]) => {
                "gives the same torque in every state, at other values; no motion separates them".to_owned()
            }
            Some(parameters) => {
                let names = parameters.join(", ");
                format!(
                    "gives the same torque in every state with {names} at other values; no motion separates them, a measured {names} does"
                )
            }
        };
        list.push(Equivalent { effect: name, joint, why, motion_separates });
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    fn placed(name: &str, joint: usize) -> EffectInstance {
        EffectInstance::new(find::<f64>(name).expect("in the catalogue"), joint, [0.0; 3])
    }

    #[test]
    fn only_what_no_motion_tells_apart_is_the_same() {
        let same = [("torque_offset", 1, "coulomb_asymmetry", 1), ("base_tilt", 0, "encoder_offset", 0)];
        let other = [("torque_offset", 1, "coulomb_asymmetry", 0), ("actuator_lag", 0, "actuator_delay", 0)];
        for (a, i, b, j) in same {
            assert!(are(&placed(a, i), &placed(b, j), 2) && are(&placed(b, j), &placed(a, i), 2), "{a} {b}");
        }
        for (a, i, b, j) in other {
            assert!(!are(&placed(a, i), &placed(b, j), 2), "{a} {b}");
        }
        assert!(are(&placed("torque_gain", 0), &placed("torque_gain", 1), 2));
        assert!(on_same_joints("torque_offset", "coulomb_asymmetry").is_some());
        assert!(is_commoner(&placed("torque_offset", 1), &placed("coulomb_asymmetry", 1), 2));
        assert!(!is_commoner(&placed("coulomb_asymmetry", 1), &placed("torque_offset", 1), 2));
        assert!(!is_commoner(&placed("torque_offset", 1), &placed("coulomb_asymmetry", 0), 2));
        assert!(
            !is_commoner(&placed("encoder_offset", 1), &placed("base_tilt", 0), 2),
            "joint 2 has its own zero"
        );
        assert!(on_same_joints("torque_offset", "joint_spring").is_none());
        let found = [placed("hardening_spring", 0), placed("torque_ripple", 0), placed("payload", 0)];
        let moved = |other: &EffectInstance| match other.law.spec().name {
            "hardening_spring" => Some(Vec::new()),
            "payload" => Some(vec!["theta3"]),
            _ => None,
        };
        let list = all(&placed("joint_spring", 0), &found, 2, moved);
        assert_eq!(list.iter().map(|e| e.motion_separates).collect::<Vec<_>>(), [false, true, false]);
        assert!(list[0].why.ends_with("no motion separates them"), "{list:?}");
        assert!(
            list[1].why.contains("other motions may") && list[2].why.ends_with("a measured theta3 does"),
            "{list:?}"
        );
        assert!(are(&placed("payload", 0), &placed("payload", 0), 2));
    }
}
