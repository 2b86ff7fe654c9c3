//! Where the gap lies: residual torque of each joint over the regimes of its motion.
//!
//! The prediction of a window and its measurement have the same logged torque as input, so their difference is smooth; its second derivative is the
//! residual acceleration, and `M(q)` times the residual acceleration is the residual torque.

use crate::log::track::Track;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::smooth::local_cubic;
use crate::predict::window::{Dataset, InitialStateOffset};
use armgap_core::arm::Arm;
use nalgebra::SVector;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

/// Half width, in samples, of the local cubic whose curvature is the residual acceleration: the largest, and the smallest in windows of few samples.
const CURVATURE_HALF_WIDTH: [usize; 2] = [8, 3];

/// Time from a sign change of a joint's velocity within which the joint counts as near a reversal, s.
const REVERSAL_S: f64 = 0.05;

/// Fewest samples of a bin that may stand out.
const FEWEST_IN_BIN: usize = 5;

/// Number of bins of a variable over which residual torques are averaged.
const BINS: usize = 6;

/// Ratio of the mean square residual torque in a regime to that of the joint over all samples from which the regime stands out.
const REGIME_CONTRAST: f64 = 1.6;

/// State and residual torque of all joints at one sample.
#[derive(Debug, Clone, Copy)]
pub struct ResidualTorque<const N: usize> {
    /// Index of the sample's log.
    pub track: usize,
    /// Time within the log, s.
    pub t: f64,
    /// Measured positions, rad or m.
    pub q: SVector<f64, N>,
    /// Measured velocities, rad/s or m/s.
    pub dq: SVector<f64, N>,
    /// Commanded torques, N m or N.
    pub tau: SVector<f64, N>,
    /// Whether each joint is near a reversal.
    pub reversal: [bool; N],
    /// Residual torques, N m or N: `M` times the second derivative of measured minus predicted position.
    pub residual: SVector<f64, N>,
}

/// Residual torque at every other sample of all windows under each of several hypotheses.
pub fn residual_torques<A: Arm<f64, N, P>, const N: usize, const P: usize, const H: usize>(
    arm: &A,
    data: &Dataset<N>,
    offsets: &[InitialStateOffset<N>],
    hypotheses: [&Hypothesis<P>; H],
) -> [Vec<ResidualTorque<N>>; H] {
    let predicted = hypotheses.map(|h| data.predict(arm, h, offsets));
    let windows: Vec<Vec<[ResidualTorque<N>; H]>> = data
        .windows
        .par_iter()
        .map(|window| {
            let track = &data.tracks[window.track];
            let times = &track.t[window.first + 1..=window.last];
            let [most, fewest] = CURVATURE_HALF_WIDTH;
            let half = most.min(times.len().saturating_sub(1) / 2);
            let rows = if half < fewest { 0..0 } else { 0..times.len() };
            let residual = |i: usize, h: usize| {
                let k = window.first + 1 + i;
                let rows = &predicted[h][window.range()];
                let curvature = SVector::<f64, N>::from_fn(|j, _| {
                    let error = |r: usize| track.q[window.first + 1 + r][j] - rows[r * N + j];
                    local_cubic(times, error, i, half).ddq
                });
                arm.inertia(&hypotheses[h].theta, &track.q[k]) * curvature
            };
            let under_all = |i: usize| {
                let measured_state = measured_state(track, window.track, window.first + 1 + i);
                std::array::from_fn(|h| ResidualTorque { residual: residual(i, h), ..measured_state })
            };
            rows.step_by(2).map(under_all).collect()
        })
        .collect();
    std::array::from_fn(|h| windows.iter().flatten().map(|residuals| residuals[h]).collect())
}

/// Measured state at sample `k` of the log with number `index`, with zero residual torque.
fn measured_state<const N: usize>(track: &Track<N>, index: usize, k: usize) -> ResidualTorque<N> {
    ResidualTorque {
        track: index,
        t: track.t[k] - track.t[0],
        q: track.q[k],
        dq: SVector::from_fn(|j, _| velocity(&track.t, |s| track.q[s][j], k)),
        tau: SVector::from_fn(|j, _| track.held[k][j].start),
        reversal: std::array::from_fn(|j| reverses(&track.t, |s| track.q[s][j], k)),
        residual: SVector::zeros(),
    }
}

fn velocity(t: &[f64], q: impl Fn(usize) -> f64, k: usize) -> f64 {
    local_cubic(t, q, k, 6).dq
}

/// Whether the sign of a joint's mean velocity differs before and after sample `k`, over `REVERSAL_S` seconds on either side; `q` gives the joint's
/// position at a sample.
fn reverses(t: &[f64], q: impl Fn(usize) -> f64, k: usize) -> bool {
    let near = |x: f64| t.partition_point(|&s| s < x).min(t.len() - 1);
    let (a, b) = (near(t[k] - REVERSAL_S), near(t[k] + REVERSAL_S));
    (q(b) - q(k)) * (q(k) - q(a)) < 0.0
}

/// RMS residual torque of one joint over bins of one variable.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Regime {
    /// Joint, counted from 1.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// Variable that the bins belong to, for example `abs(dq1)`.
    pub variable: String,
    /// Unit of the binned variable.
    pub unit: String,
    /// Edges of the bins, ascending, in the variable's unit.
    pub edges: Vec<f64>,
    /// Unit of the RMS residual torques: N m or N.
    pub torque_unit: &'static str,
    /// RMS residual torque in each bin with the arm file as it is.
    pub before: Vec<f64>,
    /// RMS residual torque in each bin with the arm's parameters re-estimated.
    pub refit: Vec<f64>,
    /// RMS residual torque in each bin with the causes of the diagnosis.
    pub after: Vec<f64>,
    /// Samples in each bin.
    pub count: Vec<usize>,
}

/// Share of the gap that a joint bears, and the regime of its motion in which the residual torque stands out.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Location {
    /// Joint, counted from 1.
    #[schemars(range(min = 1))]
    pub joint: usize,
    /// Share of the whole gap that this joint bears, 0 to 1.
    #[schemars(range(min = 0, max = 1))]
    pub share: f64,
    /// Name of the regime in which the joint's residual torque stands out.
    pub regime: String,
    /// Range of the variable that defines the regime, as text with its unit.
    pub detail: String,
    /// Range of the variable that defines the regime; `None` where the gap is spread evenly.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<VariableRange>,
}

/// Range of a variable of the motion.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct VariableRange {
    /// Name of the variable of the motion, for example `abs(dq1)`.
    pub variable: String,
    /// Lower end of the range, in the variable's unit.
    pub from: f64,
    /// Upper end of the range, in the variable's unit.
    pub to: f64,
}

/// Variable of the motion over which residual torques are binned, with names of the lowest, the middle and the highest bins.
struct RegimeVariable<const N: usize> {
    name: String,
    unit: &'static str,
    low: &'static str,
    middle: &'static str,
    high: &'static str,
    value: fn(&ResidualTorque<N>, usize) -> f64,
}

fn variables<const N: usize>(joint: usize, rotary: bool) -> Vec<RegimeVariable<N>> {
    let j = joint + 1;
    let pick = |rotary_unit, linear_unit| if rotary { rotary_unit } else { linear_unit };
    let variable = |name, unit, names: [&'static str; 3], value| RegimeVariable {
        name,
        unit,
        low: names[0],
        middle: names[1],
        high: names[2],
        value,
    };
    vec![
        variable(
            format!("abs(dq{j})"),
            pick("rad/s", "m/s"),
            ["low speed", "medium speed", "high speed"],
            |x, j| x.dq[j].abs(),
        ),
        variable(format!("reversal{j}"), "1", ["away from reversals", "", "reversals"], |x, j| {
            f64::from(u8::from(x.reversal[j]))
        }),
        variable(
            format!("q{j}"),
            pick("rad", "m"),
            ["one end of the travel", "part of the travel", "one end of the travel"],
            |x, j| x.q[j],
        ),
        variable(
            format!("abs(tau{j})"),
            pick("N m", "N"),
            ["low torque", "medium torque", "high torque"],
            |x, j| x.tau[j].abs(),
        ),
        variable("t".to_owned(), "s", ["start of the log", "part of the log", "end of the log"], |x, _| x.t),
    ]
}

/// Edges of the bins of a variable's values: quantiles; 0, 0.5 and 1 for a variable with the two values 0 and 1.
fn edges(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let (first, last) = (values[0], values[values.len() - 1]);
    if values.iter().all(|v| *v == 0.0 || *v == 1.0) {
        return vec![0.0, 0.5, 1.0];
    }
    let mut edges: Vec<f64> = (0..=BINS).map(|i| values[i * (values.len() - 1) / BINS]).collect();
    (edges[0], edges[BINS]) = (first, last);
    edges.dedup();
    edges
}

fn bin(edges: &[f64], value: f64) -> usize {
    edges[1..edges.len() - 1].partition_point(|edge| *edge <= value)
}

/// Residual torques under the three models of a diagnosis, sample by sample.
pub struct ResidualTorques<const N: usize> {
    /// Residual torques with the arm file as it is.
    pub before: Vec<ResidualTorque<N>>,
    /// Residual torques with the arm's parameters re-estimated.
    pub refit: Vec<ResidualTorque<N>>,
    /// Residual torques with the causes of the diagnosis.
    pub after: Vec<ResidualTorque<N>>,
}

/// RMS residual torque of every joint over the bins of every variable.
pub fn regimes<const N: usize>(residuals: &ResidualTorques<N>, rotary: bool) -> Vec<Regime> {
    let mut all = Vec::new();
    if residuals.refit.is_empty() {
        return all;
    }
    for joint in 0..N {
        for variable in variables::<N>(joint, rotary) {
            let edges = edges(residuals.refit.iter().map(|x| (variable.value)(x, joint)).collect());
            if edges.len() < 2 {
                continue;
            }
            let (refit, count) = binned(&residuals.refit, joint, &variable, &edges);
            all.push(Regime {
                joint: joint + 1,
                variable: variable.name.clone(),
                unit: variable.unit.to_owned(),
                torque_unit: if rotary { "N m" } else { "N" },
                before: binned(&residuals.before, joint, &variable, &edges).0,
                refit,
                after: binned(&residuals.after, joint, &variable, &edges).0,
                count,
                edges,
            });
        }
    }
    all
}

fn binned<const N: usize>(
    residuals: &[ResidualTorque<N>],
    joint: usize,
    variable: &RegimeVariable<N>,
    edges: &[f64],
) -> (Vec<f64>, Vec<usize>) {
    let bins = edges.len() - 1;
    let (mut squares, mut count) = (vec![0.0; bins], vec![0; bins]);
    for x in residuals {
        let b = bin(edges, (variable.value)(x, joint)).min(bins - 1);
        squares[b] += x.residual[joint].powi(2);
        count[b] += 1;
    }
    let rms = squares.iter().zip(&count).map(|(s, n)| if *n > 0 { (s / *n as f64).sqrt() } else { 0.0 });
    (rms.collect(), count)
}

/// Location of the gap on every joint, largest of the `shares` first, with the regime that stands out.
pub fn places<const N: usize>(shares: &[f64; N], regimes: &[Regime]) -> Vec<Location> {
    let mut places: Vec<Location> = (0..N).map(|j| standing_out(j, shares[j], regimes)).collect();
    places.sort_by(|a, b| b.share.total_cmp(&a.share));
    places
}

/// Location of the gap on joint `j` (from 0), at the regime whose mean square residual torque exceeds the joint's by the largest ratio.
fn standing_out(j: usize, share: f64, regimes: &[Regime]) -> Location {
    let mut best: Option<(f64, &Regime, usize)> = None;
    for regime in regimes.iter().filter(|r| r.joint == j + 1) {
        let samples: usize = regime.count.iter().sum();
        let pairs = || regime.refit.iter().zip(&regime.count);
        let mean = pairs().map(|(r, n)| r * r * *n as f64).sum::<f64>() / samples.max(1) as f64;
        for (b, (rms, count)) in pairs().enumerate() {
            let contrast = rms * rms / mean.max(1e-300);
            if *count >= FEWEST_IN_BIN.max(samples / 20) && contrast > best.map_or(REGIME_CONTRAST, |x| x.0) {
                best = Some((contrast, regime, b));
            }
        }
    }
    let Some((_, regime, b)) = best else {
        return Location {
            joint: j + 1,
            share,
            regime: "everywhere".into(),
            detail: "no regime stands out".into(),
            range: None,
        };
    };
    let (from, to) = (regime.edges[b], regime.edges[b + 1]);
    let name = regime_name(regime, b);
    let detail = if regime.variable.starts_with("reversal") {
        format!("within {REVERSAL_S} s of a change of direction of joint {}", j + 1)
    } else {
        format!("{} from {from:.3} to {to:.3} {}", regime.variable, regime.unit)
    };
    Location {
        joint: j + 1,
        share,
        regime: name,
        detail,
        range: Some(VariableRange { variable: regime.variable.clone(), from, to }),
    }
}

fn regime_name(regime: &Regime, b: usize) -> String {
    let bins = regime.count.len();
    let all = variables::<1>(0, true);
    let kind = |name: &str| name.trim_end_matches(|c: char| c.is_ascii_digit() || c == ')').to_owned();
    let variable = all.iter().find(|a| kind(&a.name) == kind(&regime.variable));
    let position = if b == 0 {
        0
    } else if b + 1 == bins {
        2
    } else {
        1
    };
    variable.map_or_else(String::new, |a| [a.low, a.middle, a.high][position].to_owned())
}
