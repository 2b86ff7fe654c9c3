//! One law on several joints as one term, accepted or rejected as a whole, with values per joint or one value for all joints.

use crate::serial::term::{Term, TermKind};

/// One law on several joints, as one term of the model.
#[derive(Debug, Clone)]
pub struct SeveralJoints {
    /// The law on each of the term's joints, at initial values.
    pub members: Vec<Term>,
    /// Whether one value holds for all of the term's joints; else each joint has its own.
    pub common: bool,
}

impl Term {
    /// One term of the same law on several joints, each joint with its own values.
    pub fn on_joints(mut members: Vec<Self>) -> Self {
        members.sort_by_key(Self::joint);
        let p = members.iter().flat_map(|m| m.p.clone()).collect();
        let degrees = members.iter().map(|m| m.degrees).sum();
        Self { kind: TermKind::Joints(SeveralJoints { members, common: false }), p, degrees }
    }

    /// One term of the same law on several joints, with the mean of the members' values on all of them.
    pub fn common(mut members: Vec<Self>) -> Self {
        members.sort_by_key(Self::joint);
        let count = members.len() as f64;
        let mean = |i: usize| members.iter().map(|m| m.p[i]).sum::<f64>() / count;
        let (p, degrees) = ((0..members[0].p.len()).map(mean).collect(), members[0].degrees);
        Self { kind: TermKind::Joints(SeveralJoints { members, common: true }), p, degrees }
    }

    /// The term split into one term per joint, at current values; a copy of the term alone if it is not one law on several joints.
    pub fn members(&self) -> Vec<Self> {
        let TermKind::Joints(of) = &self.kind else { return vec![self.clone()] };
        let values = |i: usize| {
            let count = of.members[i].p.len();
            let first = if of.common { 0 } else { i * count };
            self.p[first..first + count].to_vec()
        };
        of.members.iter().enumerate().map(|(i, member)| member.with(values(i))).collect()
    }

    /// The term that a change of parameter `k` changes, and the parameter's index in it: the law on a single joint if every joint has values of its
    /// own, else the whole term.
    pub fn moved_by(&self, k: usize) -> (Self, usize) {
        match &self.kind {
            TermKind::Joints(of) if !of.common => {
                let count = of.members[0].p.len();
                (self.members().swap_remove(k / count), k % count)
            }
            _ => (self.clone(), k),
        }
    }

    /// Whether the term has one value for several joints.
    pub fn has_common_value(&self) -> bool {
        matches!(&self.kind, TermKind::Joints(of) if of.common)
    }

    /// Whether the term is one law on several joints.
    pub fn is_on_several_joints(&self) -> bool {
        matches!(self.kind, TermKind::Joints(_))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::hypothesis::EffectInstance;
    use armgap_core::effect::find;

    fn stribeck(joint: usize, amplitude: f64) -> Term {
        Term::of_law(EffectInstance::new(find("stribeck").unwrap(), joint, [amplitude, 0.1, 0.0]))
    }

    #[test]
    fn a_law_on_several_joints_has_the_values_of_each() {
        let term = Term::on_joints(vec![stribeck(2, 3.0), stribeck(0, 1.0)]);
        assert_eq!((term.p.as_slice(), term.degrees), (&[1.0, 0.1, 3.0, 0.1][..], 4.0));
        assert_eq!((term.joint(), term.joints()), (None, vec![1, 3]));
        let moved = term.with(vec![1.0, 0.1, 5.0, 0.2]).members();
        assert_eq!((moved[1].joint(), moved[1].p.as_slice()), (Some(3), &[5.0, 0.2][..]));
        let (member, parameter) = term.moved_by(2);
        assert_eq!((member.joint(), parameter), (Some(3), 0));
    }

    #[test]
    fn a_common_value_is_one_parameter() {
        let delay = |joint, p| {
            Term::of_law(EffectInstance::new(find("actuator_delay").unwrap(), joint, [p, 0.0, 0.0]))
        };
        let term = Term::common(vec![delay(0, 0.01), delay(1, 0.02)]);
        assert!((term.p[0] - 0.015).abs() < 1e-12 && term.degrees == 1.0);
        assert!(term.members().iter().all(|m| m.p == term.p));
    }

    #[test]
    fn it_takes_the_place_of_the_law_on_each_of_its_joints() {
        let term = Term::on_joints(vec![stribeck(0, 1.0), stribeck(2, 3.0)]);
        assert!(term.same_place(&stribeck(2, 1.0)) && !term.same_place(&stribeck(1, 1.0)));
    }
}
