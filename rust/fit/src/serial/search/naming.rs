//! Rule by which a term of the final model is named as a cause: probable enough, and with a size that is distinct from none.

use crate::serial::constants::{DEFLECTION_STEPS, NAMED};
use crate::serial::search::Named;
use crate::serial::term::Term;
use armgap_core::effect::NEVER;

impl Named {
    /// Reason why the term is not named as a cause, from its probability and its values; `None` if it is. `rotary` holds whether each joint is rotary,
    /// `steps` the encoders' steps, rad or m.
    pub(in crate::serial) fn reason_against(&self, rotary: &[bool], steps: &[f64]) -> Option<String> {
        if self.probability < NAMED {
            return Some(format!(
                "its probability is {:.2}; from {NAMED} on a cause is named",
                self.probability
            ));
        }
        if self.term.members().iter().all(|member| is_unresolved(member, steps)) {
            return Some(format!(
                "its deflection is below {DEFLECTION_STEPS} encoder steps: dry friction does the same"
            ));
        }
        let first = self.term.joints().first().copied();
        let of_joint = first.is_none_or(|j| rotary[j - 1]);
        let neutral: Vec<f64> =
            self.term.members()[0].parameters(of_joint).iter().map(|p| p.neutral).collect();
        is_vague(&self.term.p, &neutral, &self.sigma)
            .then(|| "its size is not told from none: its standard deviation is as large".to_owned())
    }
}

/// Whether a term is presliding friction whose deflection the encoder does not resolve.
fn is_unresolved(term: &Term, steps: &[f64]) -> bool {
    let step = term.joint().and_then(|j| steps.get(j - 1));
    term.name() == "presliding"
        && step.is_some_and(|step| term.p[0].abs() < DEFLECTION_STEPS * step * term.p[1].abs())
}

/// Whether no parameter of a term differs from its value without effect by more than its standard deviation. The neutral values repeat for the laws
/// of a term on several joints; thresholds, whose neutral value is infinite, say nothing about the size.
fn is_vague(p: &[f64], neutral: &[f64], sigma: &[f64]) -> bool {
    let sizes = p.iter().zip(sigma).zip(neutral.iter().cycle()).filter(|(_, neutral)| **neutral < NEVER);
    let mut known = sizes.filter(|((_, sigma), _)| sigma.is_finite()).peekable();
    known.peek().is_some() && known.all(|((p, sigma), neutral)| (p - neutral).abs() <= *sigma)
}

#[cfg(test)]
mod tests {
    use super::{is_unresolved, is_vague};
    use crate::model::hypothesis::EffectInstance;
    use crate::serial::term::Term;
    use armgap_core::effect::find;

    #[test]
    fn a_size_within_its_standard_deviation_is_vague() {
        assert!(is_vague(&[8483.0, 0.2], &[0.0, 0.0], &[16168.0, 0.3]));
    }

    #[test]
    fn one_size_beyond_its_standard_deviation_is_enough() {
        assert!(!is_vague(&[8483.0, 0.2], &[0.0, 0.0], &[16168.0, 0.05]));
        assert!(!is_vague(&[1.3], &[1.0], &[0.1]));
    }

    #[test]
    fn presliding_within_an_encoder_step_is_dry_friction() {
        let term = |name: &str, p| Term::of_law(EffectInstance::new(find(name).unwrap(), 1, p));
        let steps = [1.0, 2.4e-5];
        assert!(is_unresolved(&term("presliding", [2.18, 4.9e5, 0.0]), &steps));
        assert!(!is_unresolved(&term("presliding", [2.18, 4.9e3, 0.0]), &steps));
        assert!(!is_unresolved(&term("stribeck", [2.18, 4.9e5, 0.0]), &steps));
        assert!(!is_unresolved(&term("presliding", [2.18, 4.9e5, 0.0]), &[]), "unknown steps");
    }

    #[test]
    fn thresholds_and_unknown_deviations_say_nothing() {
        assert!(is_vague(&[0.5, 1.0], &[f64::INFINITY, 0.0], &[0.01, 2.0]));
        assert!(!is_vague(&[0.5], &[0.0], &[f64::INFINITY]));
    }
}
