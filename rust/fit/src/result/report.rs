//! Types of the result: the schema `armgap.diagnosis/1`, and the curves that a report draws.

use crate::locate::dependence::Dependence;
use crate::locate::energy::Energy;
use crate::locate::regimes::{Location, Regime};
use crate::result::sanity::Sanity;
use crate::result::verdict::Verdict;
use armgap_core::transmission::Sides;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde::Serialize;
use std::collections::BTreeMap;

/// Values by name, in alphabetical order of the names.
pub type Named<T> = BTreeMap<String, T>;

/// A number with its standard deviation and unit.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Value {
    /// Value, SI.
    pub value: f64,
    /// Standard deviation of the value, SI.
    pub sigma: f64,
    /// SI unit of the value and its standard deviation.
    pub unit: &'static str,
}

/// Numbers of several joints, in the order of the joints, with their standard deviations and unit.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Values {
    /// Values by joint, SI.
    pub value: Vec<f64>,
    /// Standard deviations of the values by joint, SI.
    pub sigma: Vec<f64>,
    /// SI unit of the values and their standard deviations.
    pub unit: &'static str,
}

/// Value of a cause's parameter: a number, or one number per joint for a cause on several joints.
#[derive(Debug, Clone, JsonSchema, Serialize)]
#[serde(untagged)]
pub enum CauseValue {
    /// Value of a cause on one joint, on two coupled joints, or on the whole arm.
    One(Value),
    /// Values, joint by joint, of a cause that is the same law on several joints.
    Each(Values),
}

impl CauseValue {
    /// The value of a cause that is not on several joints; none otherwise.
    pub const fn one(&self) -> Option<&Value> {
        match self {
            Self::One(value) => Some(value),
            Self::Each(_) => None,
        }
    }
}

/// Joints of a cause that acts on several joints, or on a sum or difference of two; empty for a cause on one joint or on the whole arm.
#[derive(Debug, Clone, Default, PartialEq, Eq, JsonSchema, Serialize)]
pub struct SeveralJoints {
    /// 1-based numbers of the joints that a cause on several joints acts on.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 1)))]
    pub joints: Option<Vec<usize>>,
    /// Factors of two joints' motion in the sum or difference that a cause acts on.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row: Option<[i32; 2]>,
}

/// JSON Schema (draft 2020-12) of a diagnosis as the core writes it.
pub fn schema() -> Schema {
    SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<Diagnosis>()
}

/// Result of a diagnosis.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Diagnosis {
    /// Name of the schema.
    #[schemars(extend("const" = "armgap.diagnosis/1"))]
    pub schema: &'static str,
    /// Answer of the diagnosis in one word.
    pub verdict: Verdict,
    /// Prediction errors on the holdout by joint, of the arm file as it is and with the named causes.
    pub gap: Gap,
    /// Share of each joint in the gap, and the regimes in which the gap is large.
    #[serde(rename = "where")]
    pub places: Vec<Location>,
    /// Energy balance of each joint's residual torque.
    pub energy: Vec<Energy>,
    /// Named causes, strongest first.
    pub causes: Vec<Cause>,
    /// Causes that were found and are not named, with reasons.
    pub candidates: Vec<Candidate>,
    /// Effects that were looked for and not found.
    pub ruled_out: Vec<RuledOut>,
    /// Parameters of the arm: nominal, re-estimated, and re-estimated together with the causes.
    pub parameters: Parameters,
    /// Re-estimated parameters of the reported model that are not to be believed as they stand.
    pub sanity: Vec<Sanity>,
    /// Kind, joints and parameter names of the diagnosed arm.
    pub arm: ArmSummary,
    /// Logs that the models were fitted to.
    pub training: Vec<LogSummary>,
    /// Logs that the models were judged on.
    pub holdout: Vec<LogSummary>,
    /// All candidates that the first step of the model search fitted, best first.
    pub ranking: Vec<Ranked>,
    /// Steps of the model search, in order.
    pub stages: Vec<StageSummary>,
    /// Prediction errors by joint and regime of the motion.
    pub regimes: Vec<Regime>,
    /// Variables that the residual torque of the final model depends on, strongest first.
    pub unnamed: Vec<Dependence>,
    /// Measured and predicted positions on the holdout, window by window.
    pub series: Vec<Series>,
    /// Measured positions of whole holdout logs, and positions simulated from their first sample.
    pub free_run_series: Vec<FreeRunSeries>,
    /// Noise and encoder steps of the position measurement.
    pub noise: Noise,
    /// Settings of the diagnosis.
    pub options: OptionSummary,
    /// Version of the armgap library that made the diagnosis.
    pub version: &'static str,
    /// Computing time of the diagnosis, s.
    pub seconds: f64,
    /// Remarks on the result, in words.
    pub notes: Vec<String>,
}

/// Position errors of predictions on the holdout, RMS per joint, rad or m.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Gap {
    /// Prediction horizon, s.
    pub horizon_s: f64,
    /// Unit of the position errors; of an arm with joints of both kinds that of its first joint (see `arm.joint_unit`).
    pub unit: &'static str,
    /// RMS position error by joint of the arm file as it is, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub before: Vec<f64>,
    /// RMS position error by joint with the arm's parameters re-estimated, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub refit: Vec<f64>,
    /// RMS position error by joint with parameters re-estimated and the named causes, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
    /// Noise floor by joint: RMS position error of a perfect model, from measurement noise alone, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub floor: Vec<f64>,
    /// RMS displacement of the arm over the horizon by joint, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub motion: Vec<f64>,
    /// Share of the gap above the noise floor that the named causes and re-estimated parameters close.
    #[schemars(range(max = 1))]
    pub closed: f64,
    /// 95 % interval of the closed share of the gap.
    pub closed_ci: [f64; 2],
    /// Share of the gap above the noise floor, with parameters re-estimated, that the named causes leave.
    #[schemars(range(min = 0, max = 1))]
    pub unexplained: f64,
    /// RMS position errors at other prediction horizons.
    pub horizons: Vec<AtHorizon>,
    /// RMS position errors of simulations of whole holdout logs from their first sample.
    pub free_run: FreeRun,
    /// Gap on the second halves of the holdout logs, with the encoder zeros of each recording known; only where encoder zeros differ between
    /// recordings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_halves: Option<SecondHalves>,
    /// Gap on the training logs; only where no cause is named, they show a gap, and the holdout shows none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingErrors>,
}

/// RMS position errors, over the horizon, on the training logs, with parameters re-estimated from them.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct TrainingErrors {
    /// RMS position error by joint, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
    /// RMS position error by joint of a perfect model, rad or m: noise of the measurements and of the measured initial states.
    #[schemars(inner(range(min = 0)))]
    pub floor: Vec<f64>,
}

/// RMS position errors, over the horizon, on the second half of each holdout log, with the named causes.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct SecondHalves {
    /// RMS position error by joint with positions as they were measured, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
    /// RMS position error by joint, rad or m, with the encoder zeros that the first half of each log shows.
    #[schemars(inner(range(min = 0)))]
    pub with_zeros: Vec<f64>,
}

/// RMS position errors at one prediction horizon, per joint.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct AtHorizon {
    /// Prediction horizon, s.
    pub horizon_s: f64,
    /// RMS position error by joint of the arm file as it is, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub before: Vec<f64>,
    /// RMS position error by joint with the arm's parameters re-estimated, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub refit: Vec<f64>,
    /// RMS position error by joint with parameters re-estimated and the named causes, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
    /// Noise floor by joint: RMS position error of a perfect model, from measurement noise alone, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub floor: Vec<f64>,
}

/// RMS position errors of free runs: whole holdout logs simulated from their first sample.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct FreeRun {
    /// RMS position error by joint of the arm file as it is in free run, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub before: Vec<f64>,
    /// RMS position error by joint with the named causes in free run, rad or m.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
}

/// A cause of the gap: an effect, where it acts, its values and its probability.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Cause {
    /// Name of the effect in the library.
    pub effect: &'static str,
    /// Title of the effect in plain words.
    pub title: &'static str,
    /// 1-based joint that the cause acts on; none for the whole arm or for several joints.
    #[schemars(range(min = 1))]
    pub joint: Option<usize>,
    /// Joints of a cause on several joints.
    #[serde(flatten)]
    pub on: SeveralJoints,
    /// Probability that the effect, or one of its equivalents, is in the arm.
    #[schemars(range(min = 0, max = 1))]
    pub probability: f64,
    /// Fitted parameters of the effect, by name.
    pub parameters: Named<CauseValue>,
    /// Share of the gap above the noise floor that the cause removed when it was added.
    pub closed: f64,
    /// Effects that the diagnosed logs cannot distinguish from the cause.
    pub equivalents: Vec<EquivalentSummary>,
    /// Figures from which the probability of the cause follows; none for external disturbances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence: Option<crate::search::evidence::Evidence>,
    /// Sides of the transmission on which encoder and friction are; only for effects with a transmission.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sides: Option<SidesSummary>,
    /// Name of the log in which an external disturbance happened.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log: Option<String>,
    /// Form of the law: a disturbance's `rectangle` or `bell` (a raised cosine of equal variance over time), load friction's `torque`, `twice_per_turn`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<&'static str>,
}

/// Sides of a transmission, `motor` or `link`, on which encoder and friction are.
#[derive(Debug, Clone, Copy, JsonSchema, Serialize)]
pub struct SidesSummary {
    /// Side of the transmission that the encoder measures.
    pub encoder: &'static str,
    /// Side of the transmission that friction acts on.
    pub friction: &'static str,
    /// Whether the rotor of an elastic transmission moves with the joints before its own: `rides`, or `geared` where it hardly does.
    pub rotor: &'static str,
}

impl SidesSummary {
    /// Sides of a transmission in words.
    pub fn of(sides: Sides) -> Self {
        let word = |at_motor| if at_motor { "motor" } else { "link" };
        let rotor = if sides.rotor_rides { "rides" } else { "geared" };
        Self { encoder: word(sides.encoder_at_motor), friction: word(sides.friction_at_motor), rotor }
    }
}

/// A cause that was found and is not named.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Candidate {
    /// Effect, joint, values and probability of the cause.
    #[serde(flatten)]
    pub cause: Cause,
    /// Reason why the cause is not named.
    pub why: String,
}

/// An effect that the diagnosed logs cannot distinguish from a cause.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct EquivalentSummary {
    /// Name of the effect in the library.
    pub effect: &'static str,
    /// 1-based joint that the effect acts on; none for the whole arm or for several joints.
    #[schemars(range(min = 1))]
    pub joint: Option<usize>,
    /// Joints of an effect on several joints.
    #[serde(flatten)]
    pub on: SeveralJoints,
    /// Reason why the effect and the cause cannot be told apart.
    pub why: String,
    /// Whether another motion may tell them apart; if not, `why` says what does, where anything is known to.
    pub motion_separates: bool,
}

/// Status of an effect that was looked for and is not a cause, the surest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, JsonSchema, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// The logs would show the effect if it were larger than its bound.
    Absent,
    /// The logs neither show the effect nor rule it out.
    Undecided,
    /// The motion of the logs leaves no trace of the effect.
    #[serde(rename = "not excited")]
    NotExcited,
}

/// An effect that was looked for and is not a cause.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct RuledOut {
    /// Name of the effect in the library.
    pub effect: &'static str,
    /// 1-based joint that the effect was looked for on; none for the whole arm or for several joints.
    #[schemars(range(min = 1))]
    pub joint: Option<usize>,
    /// Joints of an effect on several joints.
    #[serde(flatten)]
    pub on: SeveralJoints,
    /// Whether the effect is absent, undecided or not excited.
    pub status: Status,
    /// Upper bound of the effect's size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<Bound>,
    /// Reason for the status of the effect.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// Upper confidence bound of the size of an effect that was not found; for backlash the smallest of the sizes tried from which on all are excluded.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Bound {
    /// Name of the bounded parameter of the effect.
    pub parameter: &'static str,
    /// Largest deviation of the parameter from its neutral value, SI.
    pub value: f64,
    /// SI unit of the bound.
    pub unit: &'static str,
    /// Confidence level of the bound, 0 to 1.
    pub level: f64,
}

/// Parameters of the arm by name: nominal, re-estimated, and re-estimated together with the causes.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Parameters {
    /// Parameters of the arm file.
    pub nominal: Named<Value>,
    /// Parameters re-estimated on the training logs without effects.
    pub refit: Named<Value>,
    /// Parameters re-estimated on the training logs together with the named causes.
    pub with_causes: Named<Value>,
}

/// Kind, joints and parameter names of the diagnosed arm.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct ArmSummary {
    /// Kind of arm.
    pub kind: &'static str,
    /// Number of joints.
    pub n_joints: usize,
    /// Names of the arm's parameters in the order of `theta`.
    pub parameter_names: Vec<String>,
    /// SI units of the arm's parameters in the order of `theta`.
    pub parameter_units: Vec<&'static str>,
    /// Unit of each joint's position, rad or m.
    pub joint_unit: Vec<&'static str>,
}

/// Name, length and windows of a log.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct LogSummary {
    /// Name of the log.
    pub name: String,
    /// Number of samples in the log.
    pub samples: usize,
    /// Duration of the log, s.
    pub duration_s: f64,
    /// Number of prediction windows cut from the log.
    pub windows: usize,
    /// Encoder readings at the model's zero position in this log, less their part common to all recordings; where there are several training
    /// recordings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_zero: Option<Values>,
}

/// An effect that the first step of the model search fitted as a candidate.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Ranked {
    /// Name of the candidate effect in the library.
    pub effect: &'static str,
    /// Title of the candidate effect in plain words.
    pub title: &'static str,
    /// 1-based joint that the candidate effect acts on; none for the whole arm.
    #[schemars(range(min = 1))]
    pub joint: Option<usize>,
    /// Share of the holdout's gap above the noise floor that the candidate removes.
    pub closed: f64,
    /// Squared distance of the arm's parameters, fitted with the candidate, from their prior values, in standard deviations.
    pub trust: f64,
    /// RMS position error on the holdout with the candidate, by joint, rad or m.
    pub rms: Vec<f64>,
    /// Fitted parameters of the candidate effect, by name.
    pub parameters: Named<Value>,
}

/// One step of the model search.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct StageSummary {
    /// Effect that the step added; none for a step that added none.
    pub added: Option<EquivalentSummary>,
    /// RMS position error on the holdout before the step, by joint, rad or m.
    pub rms: Vec<f64>,
    /// Ratio of the cost of the holdout before the step to the cost that measurement noise alone leaves.
    pub excess: f64,
    /// Squared distance of the arm's parameters from their prior values before the step, in standard deviations.
    pub trust: f64,
    /// RMS position error on the holdout before the step, relative to the RMS motion within the windows.
    pub relative_error: f64,
}

/// Measured and predicted positions of one joint in one log, window by window.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Series {
    /// Name of the log.
    pub log: String,
    /// 1-based joint.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// Times of the drawn samples, s.
    pub t: Vec<f64>,
    /// Measured positions of the joint, rad or m.
    pub measured: Vec<f64>,
    /// Positions predicted with the arm file as it is, rad or m.
    pub before: Vec<f64>,
    /// Positions predicted with the arm's parameters re-estimated, rad or m.
    pub refit: Vec<f64>,
    /// Positions predicted with the named causes, rad or m.
    pub after: Vec<f64>,
    /// Indices of the drawn samples at which a new window starts.
    pub window_start: Vec<usize>,
    /// Measured position from which each window is predicted, rad or m.
    pub initial_position: Vec<f64>,
    /// Measured velocity from which each window is predicted, rad/s or m/s.
    pub initial_velocity: Vec<f64>,
}

/// Measured positions of one joint over a whole log, and positions simulated from the log's first sample.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct FreeRunSeries {
    /// Name of the log.
    pub log: String,
    /// 1-based joint.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// Times of the drawn samples, s.
    pub t: Vec<f64>,
    /// Measured positions of the joint, rad or m.
    pub measured: Vec<f64>,
    /// Positions simulated with the arm file as it is, rad or m.
    pub before: Vec<f64>,
    /// Positions simulated with the named causes, rad or m.
    pub after: Vec<f64>,
}

/// Noise and encoder steps of the position measurement, by joint.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Noise {
    /// Standard deviation of the position noise by joint, rad or m.
    pub position_sigma: Vec<f64>,
    /// Encoder step by joint, rad or m; zero where none is seen.
    pub encoder_step: Vec<f64>,
}

/// Settings of a diagnosis.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct OptionSummary {
    /// Prediction horizon, s.
    pub horizon_s: f64,
    /// Largest number of effects that may be named; pushes are named besides unless it is zero.
    pub max_causes: usize,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Largest width over joints for which the logs fit friction smoothed around standstill, rad/s or m/s; zero for dry friction.
    pub friction_smoothing: f64,
    /// Width by joint over which friction is smoothed around standstill, rad/s or m/s; zero for dry friction.
    pub friction_widths: Vec<f64>,
}
