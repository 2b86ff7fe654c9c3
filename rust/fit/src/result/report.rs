//! The diagnosis as data: the schema `armgap.diagnosis/1` and what a report draws besides.

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

/// Named values, in alphabetical order of their names.
pub type Named<T> = BTreeMap<String, T>;

/// A number with its uncertainty.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Value {
    /// Value, SI.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// SI unit.
    pub unit: &'static str,
}

/// The same of several joints, in their order.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Values {
    /// Values, SI.
    pub value: Vec<f64>,
    /// Standard deviations.
    pub sigma: Vec<f64>,
    /// SI unit.
    pub unit: &'static str,
}

/// Value of a cause's parameter: a number, or one per joint of a cause on several.
#[derive(Debug, Clone, JsonSchema, Serialize)]
#[serde(untagged)]
pub enum CauseValue {
    /// Value of a cause on one joint, on two coupled joints, or on the whole arm.
    One(Value),
    /// Of the same law on several joints.
    Each(Values),
}

impl CauseValue {
    /// The number, of one.
    pub const fn one(&self) -> Option<&Value> {
        match self {
            Self::One(value) => Some(value),
            Self::Each(_) => None,
        }
    }
}

/// Where something is that is neither on one joint nor on the whole arm.
#[derive(Debug, Clone, Default, JsonSchema, Serialize)]
pub struct SeveralJoints {
    /// 1-based joints, of what is on several at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 1)))]
    pub joints: Option<Vec<usize>>,
    /// Factors of two joints' motion, of what acts on a sum or a difference of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub row: Option<[i32; 2]>,
}

/// JSON Schema (draft 2020-12) of what the core says of a diagnosis.
pub fn schema() -> Schema {
    SchemaSettings::draft2020_12().for_serialize().into_generator().into_root_schema_for::<Diagnosis>()
}

/// A diagnosis.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Diagnosis {
    /// Name of this schema.
    #[schemars(extend("const" = "armgap.diagnosis/1"))]
    pub schema: &'static str,
    /// What it comes to.
    pub verdict: Verdict,
    /// How far.
    pub gap: Gap,
    /// Where.
    #[serde(rename = "where")]
    pub places: Vec<Location>,
    /// Energy balance of each joint's residual torque.
    pub energy: Vec<Energy>,
    /// Which.
    pub causes: Vec<Cause>,
    /// What was found and is not fit to be named.
    pub candidates: Vec<Candidate>,
    /// Effects that were looked for and not found.
    pub ruled_out: Vec<RuledOut>,
    /// The arm's parameters.
    pub parameters: Parameters,
    /// Re-estimated parameters, of the model reported, that are not to be believed as they stand.
    pub sanity: Vec<Sanity>,
    /// The arm.
    pub arm: ArmSummary,
    /// Logs the model was fitted to.
    pub training: Vec<LogSummary>,
    /// Logs it was judged on.
    pub holdout: Vec<LogSummary>,
    /// All fitted candidates of the first search node, best first.
    pub ranking: Vec<Ranked>,
    /// The steps of the model search.
    pub stages: Vec<StageSummary>,
    /// The gap by joint and regime.
    pub regimes: Vec<Regime>,
    /// What the residual torque that the final model leaves depends on, strongest first.
    pub unnamed: Vec<Dependence>,
    /// Predictions on the holdout, window by window.
    pub series: Vec<Series>,
    /// Predictions of the whole holdout from its first sample.
    pub free_run_series: Vec<FreeRunSeries>,
    /// What the position measurement looks like.
    pub noise: Noise,
    /// Settings.
    pub options: OptionSummary,
    /// Version of this library.
    pub version: &'static str,
    /// Time it took, s.
    pub seconds: f64,
    /// Remarks.
    pub notes: Vec<String>,
}

/// How far predictions miss on the holdout, RMS per joint.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Gap {
    /// Prediction horizon, s.
    pub horizon_s: f64,
    /// Unit of the position errors; of an arm with joints of both kinds that of its first joint (see `arm.joint_unit`).
    pub unit: &'static str,
    /// Arm file as it is.
    #[schemars(inner(range(min = 0)))]
    pub before: Vec<f64>,
    /// Parameters re-estimated.
    #[schemars(inner(range(min = 0)))]
    pub refit: Vec<f64>,
    /// The named causes added.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
    /// What measurement noise alone leaves.
    #[schemars(inner(range(min = 0)))]
    pub floor: Vec<f64>,
    /// RMS displacement of the arm over the horizon.
    #[schemars(inner(range(min = 0)))]
    pub motion: Vec<f64>,
    /// Share of the gap above the floor that is closed.
    #[schemars(range(max = 1))]
    pub closed: f64,
    /// 95 % interval of it.
    pub closed_ci: [f64; 2],
    /// Share of the gap above the floor with parameters re-estimated that the named causes leave.
    #[schemars(range(min = 0, max = 1))]
    pub unexplained: f64,
    /// RMS errors at other prediction horizons.
    pub horizons: Vec<AtHorizon>,
    /// Over the whole holdout from its first sample.
    pub free_run: FreeRun,
    /// What encoder zeros that differ between recordings make of the gap; where they do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_halves: Option<SecondHalves>,
}

/// RMS position errors, over the horizon, on the second half of each holdout log, with the named causes added.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct SecondHalves {
    /// With positions as they were measured.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
    /// With the encoder zeros that the first half of each log shows.
    #[schemars(inner(range(min = 0)))]
    pub with_zeros: Vec<f64>,
}

/// RMS errors at one prediction horizon, per joint.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct AtHorizon {
    /// Prediction horizon, s.
    pub horizon_s: f64,
    /// Arm file as it is.
    #[schemars(inner(range(min = 0)))]
    pub before: Vec<f64>,
    /// Parameters re-estimated.
    #[schemars(inner(range(min = 0)))]
    pub refit: Vec<f64>,
    /// Causes added.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
    /// What measurement noise alone leaves.
    #[schemars(inner(range(min = 0)))]
    pub floor: Vec<f64>,
}

/// RMS errors in free run.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct FreeRun {
    /// Arm file as it is.
    #[schemars(inner(range(min = 0)))]
    pub before: Vec<f64>,
    /// Causes added.
    #[schemars(inner(range(min = 0)))]
    pub after: Vec<f64>,
}

/// One cause.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Cause {
    /// Effect.
    pub effect: &'static str,
    /// Name for people.
    pub title: &'static str,
    /// 1-based joint.
    #[schemars(range(min = 1))]
    pub joint: Option<usize>,
    /// Its joints, where it is on several.
    #[serde(flatten)]
    pub on: SeveralJoints,
    /// Probability.
    #[schemars(range(min = 0, max = 1))]
    pub probability: f64,
    /// Its parameters.
    pub parameters: Named<CauseValue>,
    /// Share of the gap above the floor it removed when it was added.
    pub closed: f64,
    /// What this log does not tell from it.
    pub equivalents: Vec<EquivalentSummary>,
    /// What it rests on; none for external disturbances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence: Option<crate::search::evidence::Evidence>,
    /// Where encoder and friction sit; of effects with a transmission.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sides: Option<SidesSummary>,
    /// The log that an external disturbance belongs to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub log: Option<String>,
}

/// Sides of a transmission: `motor` or `link`.
#[derive(Debug, Clone, Copy, JsonSchema, Serialize)]
pub struct SidesSummary {
    /// Side that the encoder measures.
    pub encoder: &'static str,
    /// Side that friction acts on.
    pub friction: &'static str,
    /// How the rotor of an elastic transmission moves with the joints before its own: `rides`, or `geared` where it hardly does.
    pub rotor: &'static str,
}

impl SidesSummary {
    /// In words.
    pub fn of(sides: Sides) -> Self {
        let word = |at_motor| if at_motor { "motor" } else { "link" };
        let rotor = if sides.rotor_rides { "rides" } else { "geared" };
        Self { encoder: word(sides.encoder_at_motor), friction: word(sides.friction_at_motor), rotor }
    }
}

/// A cause that is not named.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Candidate {
    /// The cause.
    #[serde(flatten)]
    pub cause: Cause,
    /// Why it is not fit to be named.
    pub why: String,
}

/// A look-alike.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct EquivalentSummary {
    /// Effect.
    pub effect: &'static str,
    /// 1-based joint.
    #[schemars(range(min = 1))]
    pub joint: Option<usize>,
    /// Its joints, where it is on several.
    #[serde(flatten)]
    pub on: SeveralJoints,
    /// Why.
    pub why: String,
}

/// What is known of a candidate that is not a cause, the surest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, JsonSchema, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// These logs would show it if it were larger than its bound.
    Absent,
    /// These logs neither show it nor rule it out.
    Undecided,
    /// The motion of these logs leaves no trace of it.
    #[serde(rename = "not excited")]
    NotExcited,
}

/// A candidate that is not a cause.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct RuledOut {
    /// Effect.
    pub effect: &'static str,
    /// 1-based joint.
    #[schemars(range(min = 1))]
    pub joint: Option<usize>,
    /// Its joints, where it is on several.
    #[serde(flatten)]
    pub on: SeveralJoints,
    /// What is known of it.
    pub status: Status,
    /// Upper bound of its size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<Bound>,
    /// Reason.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// An upper bound.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Bound {
    /// Parameter.
    pub parameter: &'static str,
    /// Largest deviation from its neutral value.
    pub value: f64,
    /// SI unit.
    pub unit: &'static str,
    /// Confidence level.
    pub level: f64,
}

/// The arm's parameters before, re-estimated, and with the causes.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Parameters {
    /// Arm file.
    pub nominal: Named<Value>,
    /// Re-estimated.
    pub refit: Named<Value>,
    /// Re-estimated with the causes.
    pub with_causes: Named<Value>,
}

/// The arm in brief.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct ArmSummary {
    /// Kind.
    pub kind: &'static str,
    /// Joints.
    pub n_joints: usize,
    /// Parameter names in the order of `theta`.
    pub parameter_names: Vec<String>,
    /// Their units.
    pub parameter_units: Vec<&'static str>,
    /// Unit of each joint's position.
    pub joint_unit: Vec<&'static str>,
}

/// A log in brief.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct LogSummary {
    /// Name.
    pub name: String,
    /// Samples.
    pub samples: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Windows.
    pub windows: usize,
    /// What its encoders show where the model's positions are zero, beside what all recordings share; where there are several training recordings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_zero: Option<Values>,
}

/// A fitted candidate.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Ranked {
    /// Effect.
    pub effect: &'static str,
    /// Name for people.
    pub title: &'static str,
    /// 1-based joint.
    #[schemars(range(min = 1))]
    pub joint: Option<usize>,
    /// Share of the holdout's gap above the floor it removes.
    pub closed: f64,
    /// Squared distance of the arm's parameters from their prior values, in sigmas, with it.
    pub trust: f64,
    /// RMS on the holdout per joint.
    pub rms: Vec<f64>,
    /// Its parameters.
    pub parameters: Named<Value>,
}

/// One step of the model search.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct StageSummary {
    /// What the step added.
    pub added: Option<EquivalentSummary>,
    /// RMS on the holdout per joint before the step.
    pub rms: Vec<f64>,
    /// Cost above the noise floor before the step, as a factor.
    pub excess: f64,
    /// Squared distance of the arm's parameters from their prior values, in sigmas, before the step.
    pub trust: f64,
    /// RMS error before the step relative to the motion within the windows.
    pub relative_error: f64,
}

/// Measured and predicted positions of one joint.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Series {
    /// Log.
    pub log: String,
    /// 1-based joint.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// Times, s.
    pub t: Vec<f64>,
    /// Measured.
    pub measured: Vec<f64>,
    /// Arm file as it is.
    pub before: Vec<f64>,
    /// Parameters re-estimated.
    pub refit: Vec<f64>,
    /// Causes added.
    pub after: Vec<f64>,
    /// Indices at which a new window starts.
    pub window_start: Vec<usize>,
    /// Measured position from which each window is predicted.
    pub initial_position: Vec<f64>,
    /// Measured velocity from which each window is predicted.
    pub initial_velocity: Vec<f64>,
}

/// Measured and predicted positions in free run.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct FreeRunSeries {
    /// Log.
    pub log: String,
    /// 1-based joint.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// Times, s.
    pub t: Vec<f64>,
    /// Measured.
    pub measured: Vec<f64>,
    /// Arm file as it is.
    pub before: Vec<f64>,
    /// Causes added.
    pub after: Vec<f64>,
}

/// Measurement noise.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Noise {
    /// Standard deviation of the positions per joint.
    pub position_sigma: Vec<f64>,
    /// Encoder step per joint, zero where none is seen.
    pub encoder_step: Vec<f64>,
}

/// Settings of a diagnosis.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct OptionSummary {
    /// Horizon, s.
    pub horizon_s: f64,
    /// Causes at most.
    pub max_causes: usize,
    /// Seed.
    pub seed: u64,
    /// Largest width over which the logs asked for friction to be smoothed, rad/s; zero for dry friction.
    pub friction_smoothing: f64,
    /// That width joint by joint.
    pub friction_widths: Vec<f64>,
}
