//! The verdict of a diagnosis, as a function of the prediction errors and of whether a cause is named.

use schemars::JsonSchema;
use serde::Serialize;

/// Ratio of a prediction error to the estimated noise floor above which the error is more than noise. Four times the true floor is more than noise,
/// as RMS errors of even ten windows, each with one initial state, scatter by less than a factor of two; and on one joint of twenty the estimated
/// floor is 1.25 times the true one (docs/input-defects.md).
pub const ABOVE_NOISE: f64 = 3.2;

/// Share of a joint's error that re-estimated parameters must remove to be called an improvement.
const IMPROVEMENT: f64 = 0.2;

/// Ratio of an error to its noise floor below which nothing is left to improve: the floor itself is known to a factor of about 1.4.
const IMPROVABLE: f64 = 2.0;

/// Verdict of a diagnosis in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The gap is within noise, or of no consequence in relation to the motion.
    None,
    /// Re-estimated parameters close the gap: the structure of the model is right, its values were wrong.
    Parameters,
    /// One or more causes are named.
    Effect,
    /// A gap remains that no named cause explains.
    Unexplained,
}

/// Errors from which a verdict follows; lists have one entry per joint: RMS position errors on the holdout over the horizon, rad or m.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// Whether a cause is named.
    pub named: bool,
    /// Whether the model search ended with a cost above what noise explains.
    pub open: bool,
    /// Whether the training logs show a gap that the holdout does not (`training_gap`).
    pub in_training: bool,
    /// RMS position error by joint of the arm file as it is, rad or m.
    pub before: &'a [f64],
    /// RMS position error by joint with parameters re-estimated, rad or m.
    pub refit: &'a [f64],
    /// RMS position error by joint of the reported model, rad or m.
    pub after: &'a [f64],
    /// Noise floor by joint: RMS position error of a perfect model, rad or m.
    pub floor: &'a [f64],
    /// RMS displacement of the arm over the horizon by joint, rad or m.
    pub motion: &'a [f64],
    /// Error, as a part of the displacement, below which a gap is of no consequence.
    pub consequence: f64,
}

impl Evidence<'_> {
    /// Whether the reported model leaves a gap of consequence that is more than noise.
    pub fn remains(&self) -> bool {
        self.open || self.in_training || self.stands_out(self.after)
    }

    fn stands_out(&self, error: &[f64]) -> bool {
        stands_out(error, self.floor, self.motion, self.consequence)
    }

    /// Verdict that follows from the errors and from whether a cause is named.
    pub fn verdict(&self) -> Verdict {
        match () {
            () if self.named => Verdict::Effect,
            () if self.remains() => Verdict::Unexplained,
            // A gap that only re-estimated parameters bring down to the noise is more than noise with the arm file as it is.
            () if is_improved(self.before, self.refit, self.floor) || self.stands_out(self.before) => {
                Verdict::Parameters
            }
            () => Verdict::None,
        }
    }
}

/// Whether the error of some joint is noticeably lower `after` than `before`, in view of its noise `floor`; all in rad or m, by joint.
pub(crate) fn is_improved(before: &[f64], after: &[f64], floor: &[f64]) -> bool {
    let steps = before.iter().zip(after).zip(floor);
    steps
        .into_iter()
        .any(|((before, after), floor)| before - after > IMPROVEMENT * before && *before > IMPROVABLE * floor)
}

/// Whether the `error` of some joint is several noise floors and larger than the part `consequence` of the joint's motion; all in rad or m, by joint.
pub(crate) fn stands_out(error: &[f64], floor: &[f64], motion: &[f64], consequence: f64) -> bool {
    let limits = floor.iter().zip(motion);
    error.iter().zip(limits).any(|(e, (floor, motion))| *e > ABOVE_NOISE * floor && *e > consequence * motion)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::holdout::CONSEQUENTIAL_ERROR;

    const FLOOR: f64 = 1e-3;

    /// Verdict on two joints, of which the second has errors of `errors` noise floors (arm file, re-estimated, reported model) and a motion of
    /// `motion` floors.
    fn of(errors: [f64; 3], motion: f64, open: bool, named: bool) -> Verdict {
        let [before, refit, after] = errors.map(|e| [0.1 * FLOOR, e * FLOOR]);
        let (floor, motion) = ([FLOOR; 2], [1.0, motion * FLOOR]);
        let (before, refit, after) = (&before, &refit, &after);
        Evidence {
            named,
            open,
            in_training: false,
            before,
            refit,
            after,
            floor: &floor,
            motion: &motion,
            consequence: CONSEQUENTIAL_ERROR,
        }
        .verdict()
    }

    #[test]
    fn a_gap_of_the_training_logs_alone_is_unexplained() {
        let quiet = [FLOOR];
        let evidence = |in_training, named| Evidence {
            named,
            open: false,
            in_training,
            before: &quiet,
            refit: &quiet,
            after: &quiet,
            floor: &quiet,
            motion: &[1.0],
            consequence: CONSEQUENTIAL_ERROR,
        };
        assert_eq!(evidence(false, false).verdict(), Verdict::None);
        assert_eq!(evidence(true, false).verdict(), Verdict::Unexplained);
        assert_eq!(evidence(true, true).verdict(), Verdict::Effect);
    }

    #[test]
    fn verdicts_follow_from_the_table() {
        for (errors, motion, wanted, what) in [
            ([1.0, 1.0, 1.0], 1e3, Verdict::None, "within noise"),
            ([1.9, 0.5, 0.5], 1e3, Verdict::None, "too little to improve"),
            ([3.0, 2.8, 2.8], 1e3, Verdict::None, "hardly improved"),
            ([3.0, 1.0, 1.0], 1e3, Verdict::Parameters, "improved"),
            ([100.0, 1.2, 1.2], 1e3, Verdict::Parameters, "values far off"),
            ([3.3, 3.1, 3.1], 1e3, Verdict::Parameters, "brought just below what stands out"),
            ([100.0, 3.3, 3.3], 1e3, Verdict::Unexplained, "improved, and several floors left"),
            ([3.3, 3.3, 3.3], 1e3, Verdict::Unexplained, "several floors"),
            ([4.1, 4.1, 4.1], 1e4, Verdict::None, "several floors of no consequence"),
            ([100.0, 5.0, 5.0], 1e4, Verdict::Parameters, "what is left is of no consequence"),
            ([1.0, 5.0, 5.0], 1e3, Verdict::Unexplained, "worse than before"),
            ([5.0, 5.0, 3.0], 1e3, Verdict::Parameters, "a nuisance takes what is left"),
        ] {
            assert_eq!(of(errors, motion, false, false), wanted, "{what}");
            assert_eq!(of(errors, motion, false, true), Verdict::Effect, "{what}, with a name");
            assert_eq!(
                of(errors, motion, true, false),
                Verdict::Unexplained,
                "{what}, beside an open search"
            );
        }
    }

    #[test]
    fn no_error_of_several_true_floors_is_called_noise_under_a_floor_that_is_claimed_too_high() {
        // Ratios of the estimated to the true noise floor: the 5 and 95 % points, and 1.
        for claimed in [0.82, 1.0, 1.25] {
            let left = 4.01 / claimed;
            assert_eq!(of([100.0, left, left], 1e3, false, false), Verdict::Unexplained, "{claimed}");
            assert_eq!(of([left; 3], 1e3, false, false), Verdict::Unexplained, "{claimed}");
        }
        // An error of twice the true floor is still noise under an estimated floor that is too low.
        for claimed in [0.82, 1.0, 1.25] {
            assert_eq!(of([2.0 / claimed; 3], 1e3, false, false), Verdict::None, "{claimed}");
        }
    }

    #[test]
    fn one_joint_is_enough_and_a_still_one_has_its_own_measure() {
        let floor = [1e-4, 1e-4];
        let joints = |after: [f64; 2], motion: [f64; 2]| {
            let (named, open) = (false, false);
            Evidence {
                named,
                open,
                in_training: false,
                before: &after,
                refit: &after,
                after: &after,
                floor: &floor,
                motion: &motion,
                consequence: CONSEQUENTIAL_ERROR,
            }
            .verdict()
        };
        assert_eq!(
            joints([2e-2, 1e-4], [0.3, 300.0]),
            Verdict::Unexplained,
            "joint 2's motion hides nothing"
        );
        assert_eq!(joints([1e-4, 2e-2], [0.3, 300.0]), Verdict::None);
        assert_eq!(
            joints([5e-4, 1e-4], [0.0, 0.3]),
            Verdict::Unexplained,
            "a joint that should not have moved"
        );
    }

    #[test]
    fn what_remains_and_the_verdict_agree() {
        for after in [0.5, 3.1, 3.3, 50.0] {
            for motion in [1.0, 1e3, 1e6] {
                for open in [false, true] {
                    let (errors, floor, motion) = ([after * FLOOR], [FLOOR], [motion * FLOOR]);
                    let evidence = Evidence {
                        named: false,
                        open,
                        in_training: false,
                        before: &errors,
                        refit: &errors,
                        after: &errors,
                        floor: &floor,
                        motion: &motion,
                        consequence: CONSEQUENTIAL_ERROR,
                    };
                    assert_eq!(evidence.remains(), evidence.verdict() == Verdict::Unexplained);
                }
            }
        }
    }

    #[test]
    fn verdicts_are_written_as_the_schema_has_them() {
        let all = [Verdict::None, Verdict::Parameters, Verdict::Effect, Verdict::Unexplained];
        assert_eq!(serde_json::to_string(&all).unwrap(), r#"["none","parameters","effect","unexplained"]"#);
    }
}
