//! Interleaved cross-validation, for training and holdout logs of which only one excites an effect.
//!
//! A joint limit may be reached only by the motion of the holdout, and a spring may differ from friction only at the holdout's speeds. No effect
//! fitted to the training logs explains such a gap, so that even the right effect is not accepted; and of an effect that only the training logs
//! excite, the holdout shows nothing. So where a diagnosis ends with a gap, or the training logs show one that the holdout does not, every log is
//! cut into stretches, of which every other one is fitted to and the rest judged on. Both kinds of motion are then in both sets, and an effect that
//! explains nearly all of the gap has been judged on stretches that it was not fitted to.

use crate::likelihood::context::DiagnosisContext;
use crate::log::cut::cut;
use crate::log::input::LogData;
use crate::search::attribute::SearchNode;
use crate::search::belief::left_over;
use crate::search::model_search::Attribution;
use armgap_core::arm::Arm;

/// Number of stretches into which interleaved cross-validation cuts a log, if the log is long enough.
const STRETCHES: usize = 6;

/// Least number of windows in a stretch of a log that interleaved cross-validation cuts.
const WINDOWS: usize = 4;

/// Largest share of the gap before any cause that may remain for the causes found by interleaved cross-validation to be accepted.
const LEFT: f64 = 0.1;

/// Ratio of the final mean square prediction errors, each relative to the motion within its windows, of a model search on interleaved stretches over one on
/// the logs as given, below which the causes of the interleaved search are accepted although a gap remains.
const MUCH_LESS: f64 = 0.1;

/// Ratio of the final model's mean square prediction errors, holdout over training logs, above which the holdout shows an effect that the training
/// logs do not.
const MORE: f64 = 2.0;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Whether a model search ended with a much larger prediction error on the holdout than on the training logs: interleaved cross-validation
    /// may then find more than the logs as they are divided.
    pub(crate) fn holdout_shows_more(&self, attribution: &Attribution<N, P>) -> bool {
        let Some(last) = attribution.nodes.last() else { return false };
        let per_row = |costs: &[f64], rows: usize| costs.iter().sum::<f64>() / rows as f64;
        let [training, holdout] = [&self.training, &self.holdout].map(|sample| self.all_windows(sample));
        let costs = self.on(&holdout, &last.weights.holdout).raw_costs(&last.base.fit.hypothesis);
        per_row(&costs, holdout.data.rows) > MORE * per_row(&last.base.fit.costs, training.data.rows)
    }
}

/// A new training set and a new holdout, from alternate stretches of all logs; none if any log is too short for two stretches of several windows of
/// `horizon` seconds.
pub fn crosswise<'a>(
    training: &[LogData<'a>],
    holdout: &[LogData<'a>],
    horizon: f64,
) -> Option<[Vec<LogData<'a>>; 2]> {
    let mut sides = [Vec::new(), Vec::new()];
    // A training log begins with a stretch to learn from, a holdout log with one to judge on.
    for (turn, logs) in [training, holdout].into_iter().enumerate() {
        for log in logs {
            let count = (cut(log.t, horizon).len() / WINDOWS).min(STRETCHES);
            if count < 2 {
                return None;
            }
            let edge = |i: usize| i * log.t.len() / count;
            for i in 0..count {
                sides[(turn + i) % 2].push(stretch(log, edge(i)..edge(i + 1)));
            }
        }
    }
    Some(sides)
}

/// The samples `range` of a log as a log of its own, named by the log and the times of its first and last sample.
fn stretch<'a>(log: &LogData<'a>, range: std::ops::Range<usize>) -> LogData<'a> {
    let joints = log.q.len() / log.t.len();
    let rows = range.start * joints..range.end * joints;
    let t = &log.t[range.clone()];
    let whole = match log.name.rsplit_once(" (") {
        Some((before, within)) if within.contains(" to ") && within.ends_with(" s)") => before,
        _ => &log.name,
    };
    LogData {
        name: format!("{whole} ({} to {} s)", millis(t[0]), millis(t[t.len() - 1])),
        source: log.source.clone(),
        t,
        q: &log.q[rows.clone()],
        moment: log.moment.map(|moment| &moment[rows.clone()]),
        tau: &log.tau[rows],
        reference: None,
        tables: log.tables.iter().map(|table| &table[range.clone()]).collect(),
    }
}

/// A time in s rounded to the millisecond.
fn millis(t: f64) -> f64 {
    (t * 1e3).round() / 1e3
}

/// Whether a model search on interleaved stretches (`crosswise`) explains the gap that the search on the logs as given (`plain`) has left.
pub fn explains<const N: usize, const P: usize>(
    crosswise: &Attribution<N, P>,
    plain: &Attribution<N, P>,
) -> bool {
    let error = |a: &Attribution<N, P>| a.nodes.last().map_or(f64::INFINITY, SearchNode::relative_error);
    let less = !crosswise.is_unexplained() || is_much_less(error(crosswise), error(plain));
    !crosswise.causes.is_empty() && less && left_over(&crosswise.nodes) < LEFT
}

/// Whether an RMS prediction error relative to the motion is so much less than another one that the causes behind it are accepted although a gap remains.
/// Costs in units of the noise floor would not tell: each search weights its windows by its own residuals, and the floor with them.
fn is_much_less(error: f64, plain: f64) -> bool {
    error.powi(2) < MUCH_LESS * plain.powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_relative_to_the_motion_decide() {
        // A contact that the holdout alone reaches: 601 noise floors are left crosswise, 2181 on the logs as given, under other weights.
        assert!(is_much_less(0.0018, 0.4303));
        assert!(!is_much_less(0.0306, 0.0427), "half of the mean square error of a real arm");
    }

    #[test]
    fn both_kinds_of_motion_are_on_both_sides_and_no_sample_on_two() {
        let t: Vec<f64> = (0..2000).map(|k| f64::from(k) * 5e-3).collect();
        let values: Vec<f64> = (0..4000).map(f64::from).collect();
        let log = |name: &str| LogData {
            name: name.to_owned(),
            source: name.to_owned(),
            t: &t,
            q: &values,
            tau: &values,
            reference: None,
            moment: None,
            tables: vec![&values[..2000]],
        };
        let (training, holdout) = ([log("a")], [log("b (last part) (0 to 9.995 s)")]);
        let sides = crosswise(&training, &holdout, 0.25).unwrap();
        let names = |i: usize| sides[i].iter().map(|l| l.name.as_str()).collect::<Vec<_>>();
        assert_eq!(names(0)[..2], ["a (0 to 1.66 s)", "a (3.33 to 4.995 s)"]);
        assert_eq!(names(1)[3], "b (last part) (0 to 1.66 s)");
        for name in ["a", "b"] {
            let mut rows: Vec<f64> = sides
                .iter()
                .flatten()
                .filter(|l| l.name.starts_with(name))
                .flat_map(|l| l.q.to_vec())
                .collect();
            rows.sort_by(f64::total_cmp);
            assert_eq!(rows, values);
        }
        assert!(sides.iter().flatten().all(|l| l.q.len() == 2 * l.t.len() && l.tables[0].len() == l.t.len()));
        assert!(crosswise(&training, &holdout, 2.0).is_none());
    }
}
