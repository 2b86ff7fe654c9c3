//! The torque that a whole log lacks under a model, low-passed, and the torques that the model could still be wrong by.
//!
//! At every sample the measured motion needs a torque and the log gives one; their difference, and every column of the model beside
//! it, goes through the same low-pass, so that neither a lag nor the noise of the acceleration enters one of them alone. A push is
//! what no combination of the columns explains: it does not come back with the state.

use crate::model::Hypothesis;
use crate::products::product;
use crate::residual_torque::{InverseDynamicsResidual, inverse_dynamics_residuals};
use crate::smooth::local_cubic;
use crate::solve::Prior;
use crate::track::Track;
use armgap_core::arm::Arm;
use nalgebra::{SMatrix, SVector};

/// Standard deviation of the low-pass, s: what elastic parts and delays do is faster, a push by hand slower.
pub const LOW_PASS: f64 = 0.045;

/// Distance of grid points, s, and in sample periods at least.
const GRID: f64 = 0.01;
const GRID_SAMPLES: f64 = 2.0;

/// Half width of the local cubic that accelerations are taken from, s, and in samples at least.
const CUBIC: f64 = 0.014;
const CUBIC_SAMPLES: usize = 3;

/// A joint slower than this part of its RMS speed, or than the noise of its velocity times the other, may be at rest.
const SLOW: f64 = 0.05;
const SLOW_NOISE: f64 = 4.0;

/// How much of the dry friction the friction of a joint at rest may reach: static friction exceeds that of sliding.
const STATIC: f64 = 1.1;

/// Torques of unknown laws, as a part of the torque that a joint needs.
const UNKNOWN: f64 = 0.05;

/// Inertia of a rotor as a part of the joint's own, and of its coupling.
const ROTOR: f64 = 0.1;
const COUPLING: f64 = 0.05;

/// Zero of an encoder that is taken for possible, rad, and the turn over which its torque is taken.
const ZERO: f64 = 0.05;
const TURN: f64 = 1e-3;

/// Lag of the torque that is taken for possible, s.
const LAG: f64 = 0.01;

/// Laws of friction at low speed act below this part of the RMS speed.
const LOW_SPEED: f64 = 0.4;

/// Samples without which a log is not judged.
const FEWEST: usize = 100;

/// Time over which the activity around a sample counts, s.
const ACTIVE: f64 = 0.1;

/// What one joint lacks.
pub struct Joint {
    /// Lacking torque, friction at rest not counted, N m.
    pub lack: Vec<f64>,
    /// Torque per unit of every column.
    pub columns: Vec<Vec<f64>>,
    /// Share of the time around each grid point at which the joint may be at rest.
    pub rest: Vec<f64>,
    /// Largest friction torque of the joint at rest, N m.
    pub holding: f64,
    /// Typical torque that the motion needs, N m.
    pub typical: f64,
}

/// What a log lacks.
pub struct Residual<const N: usize> {
    /// Times on a regular grid, s.
    pub t: Vec<f64>,
    /// Distance of grid points, s.
    pub step: f64,
    /// Joint by joint.
    pub joints: [Joint; N],
    /// Expected value and standard deviation of every column's coefficient.
    pub prior: Vec<(f64, f64)>,
    /// How violent the motion is around each point, by squared accelerations, speeds, torques and rates of torque; mean about one.
    pub activity: Vec<Vec<f64>>,
}

/// One sample with everything that is linear in the unknowns.
struct Row<const N: usize> {
    t: f64,
    lack: SVector<f64, N>,
    needed: SVector<f64, N>,
    columns: Vec<SVector<f64, N>>,
    rest: SVector<f64, N>,
    motion: [SVector<f64, N>; 3],
    tau: SVector<f64, N>,
}

impl<const N: usize> Residual<N> {
    /// The residual of a log under a model.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        arm: &A,
        track: &Track<N>,
        model: &Hypothesis<P>,
        prior: &Prior<P>,
    ) -> Option<Self> {
        let speed = rms_speeds(track);
        let rows = rows(arm, track, model, &slow_speeds(track, &speed))?;
        let t: Vec<f64> = rows.iter().map(|r| r.t).collect();
        if t.len() < FEWEST {
            return None;
        }
        let step = GRID.max(GRID_SAMPLES * track.period());
        let low = LowPass::new(&t, step);
        let columns = rows.first()?.columns.len();
        let joint = |j: usize| {
            let typical = rms(rows.iter().map(|r| r.needed[j]));
            let series = |f: &dyn Fn(&Row<N>) -> f64| low.apply(&rows.iter().map(f).collect::<Vec<f64>>());
            let mut all: Vec<Vec<f64>> = (0..columns).map(|c| series(&|r| r.columns[c][j])).collect();
            let tau = series(&|r| r.tau[j]);
            all.extend((0..N).map(|i| if i == j { slope(&tau, step) } else { vec![0.0; tau.len()] }));
            let level = arm.coulomb(&model.theta)[j].max(arm.coulomb(&prior.theta)[j]);
            let rest = series(&|r| r.rest[j]);
            Joint { lack: series(&|r| r.lack[j]), columns: all, rest, holding: STATIC * level, typical }
        };
        let joints: [Joint; N] = std::array::from_fn(joint);
        let needed = std::array::from_fn(|j| joints[j].typical);
        let activity = activity(&rows, &low);
        let prior = expected(arm, prior, &needed, &speed);
        Some(Self { t: low.grid, step, joints, prior, activity })
    }
}

/// What is expected of every column's coefficient, in the order of [`columns`], lags last.
fn expected<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: &A,
    prior: &Prior<P>,
    needed: &[f64; N],
    speed: &[f64; N],
) -> Vec<(f64, f64)> {
    let own = arm.inertia(&prior.theta, &SVector::zeros());
    let mut all: Vec<(f64, f64)> = (0..P).map(|i| (0.0, prior.sigma[i])).collect();
    for j in 0..N {
        let torque = UNKNOWN * needed[j];
        all.push((0.0, ROTOR * own[(j, j)]));
        all.push((0.0, torque));
        all.push((0.0, torque / speed[j].powi(2).max(1e-12)));
        all.extend([(0.0, torque); 3]);
        all.push((0.0, UNKNOWN));
    }
    if N > 1 {
        all.push((0.0, COUPLING * own[(0, 0)].min(own[(1, 1)])));
    }
    all.extend([(0.0, ZERO); N]);
    all.extend([(0.0, LAG); N]);
    all
}

/// Torques that a model could be wrong by at one instant: its own parameters, then per joint a rotor, an offset, drag, friction at low
/// speed, two springs or tilts, and friction under load; last the coupling of a rotor and the encoders' zeros.
fn columns<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: &A,
    [q, dq, ddq]: [&SVector<f64, N>; 3],
    tau: &SVector<f64, N>,
    slow: &[f64; N],
    low: &[f64; N],
    theta: &[f64; P],
) -> Vec<SVector<f64, N>> {
    let sign = SVector::<f64, N>::from_fn(|j, _| (dq[j] / slow[j]).tanh());
    let rigid: SMatrix<f64, N, P> = arm.regressor(q, dq, ddq);
    let mut y = rigid;
    for j in 0..N {
        y[(j, A::INERTIAL + N + j)] = sign[j];
    }
    let mut all: Vec<SVector<f64, N>> = y.column_iter().map(nalgebra::Matrix::into_owned).collect();
    for j in 0..N {
        let mut push = |value: f64| {
            let mut column = SVector::zeros();
            column[j] = value;
            all.push(column);
        };
        push(ddq[j]);
        push(1.0);
        push(dq[j] * dq[j].abs());
        push(sign[j] * (-(dq[j] / low[j]).powi(2)).exp());
        push(q[j].cos());
        push(q.sum().cos());
        push(tau[j].abs() * sign[j]);
    }
    if N > 1 {
        let mut column = SVector::zeros();
        (column[0], column[1]) = (ddq[1], ddq[0]);
        all.push(column);
    }
    for j in 0..N {
        let mut turned = *q;
        turned[j] += TURN;
        let change: SMatrix<f64, N, P> = arm.regressor(&turned, dq, ddq) - rigid;
        all.push(change * SVector::from(*theta) / TURN);
    }
    all
}

/// Every sample of one piece but those at its ends, whose acceleration is hardly known; none if the model cannot be simulated.
fn rows<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: &A,
    track: &Track<N>,
    model: &Hypothesis<P>,
    slow: &[f64; N],
) -> Option<Vec<Row<N>>> {
    let slowest = slow.iter().copied().fold(f64::INFINITY, f64::min);
    let low: [f64; N] = std::array::from_fn(|j| LOW_SPEED / SLOW * slow[j]);
    let row = |InverseDynamicsResidual { t, motion, tau, residual: lack }: InverseDynamicsResidual<N>| {
        let [q, dq, ddq] = &motion;
        let columns = columns(arm, [q, dq, ddq], &tau, slow, &low, &model.theta);
        let rest = SVector::from_fn(|j, _| f64::from(u8::from(dq[j].abs() < slow[j])));
        Row { t, lack, needed: lack + tau, columns, rest, motion, tau }
    };
    let samples = inverse_dynamics_residuals(arm, track, model, &[], half_width(track), slowest)?;
    Some(samples.into_iter().map(row).collect())
}

/// Squared torques, rates of torque, accelerations and speeds of all joints around every grid point, relative to their means.
fn activity<const N: usize>(rows: &[Row<N>], low: &LowPass) -> Vec<Vec<f64>> {
    let mut all = Vec::new();
    for j in 0..N {
        let of = |f: &dyn Fn(&Row<N>) -> f64| low.apply(&rows.iter().map(f).collect::<Vec<f64>>());
        let tau = of(&|r| r.tau[j]);
        let rate = slope(&tau, low.step);
        for series in [tau, rate, of(&|r| r.motion[2][j]), of(&|r| r.motion[1][j])] {
            let squares: Vec<f64> = series.iter().map(|x| x * x).collect();
            let smooth = moving_mean(&squares, (0.5 * ACTIVE / low.step).round() as usize);
            let mean = smooth.iter().sum::<f64>() / smooth.len().max(1) as f64;
            if mean > 0.0 {
                all.push(smooth.iter().map(|x| x / mean).collect());
            }
        }
    }
    all
}

/// A Gaussian low-pass from uneven samples onto a regular grid.
struct LowPass {
    grid: Vec<f64>,
    step: f64,
    /// For every grid point, the first sample that counts and the weights from there on.
    kernels: Vec<(usize, Vec<f64>)>,
}

impl LowPass {
    fn new(t: &[f64], step: f64) -> Self {
        let (first, last) = (t[0], t[t.len() - 1]);
        let count = ((last - first) / step).floor() as usize;
        let grid: Vec<f64> = (0..=count).map(|i| first + i as f64 * step).collect();
        let kernels = grid.iter().map(|at| kernel(t, *at, step)).collect();
        Self { grid, step, kernels }
    }

    /// Means around every grid point.
    fn apply(&self, x: &[f64]) -> Vec<f64> {
        self.kernels.iter().map(|(first, weights)| product(weights, &x[*first..])).collect()
    }
}

/// Weights of the samples around one instant, from the first that counts; they count by the time they stand for.
fn kernel(t: &[f64], at: f64, step: f64) -> (usize, Vec<f64>) {
    let reach = 4.0 * LOW_PASS;
    let (a, b) = (t.partition_point(|&t| t < at - reach), t.partition_point(|&t| t <= at + reach));
    let weight = |k: usize| {
        let before = if k > 0 { t[k] - t[k - 1] } else { step };
        before.min(LOW_PASS) * (-0.5 * ((t[k] - at) / LOW_PASS).powi(2)).exp()
    };
    let mut weights: Vec<f64> = (a..b).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    if sum > 0.0 {
        for weight in &mut weights {
            *weight /= sum;
        }
    }
    (a, weights)
}

/// Central differences.
fn slope(x: &[f64], step: f64) -> Vec<f64> {
    let at = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(x.len() - 1));
        (x[b] - x[a]) / ((b - a).max(1) as f64 * step)
    };
    (0..x.len()).map(at).collect()
}

fn moving_mean(x: &[f64], half: usize) -> Vec<f64> {
    let mean = |i: usize| {
        let part = &x[i.saturating_sub(half)..(i + half + 1).min(x.len())];
        part.iter().sum::<f64>() / part.len() as f64
    };
    (0..x.len()).map(mean).collect()
}

fn half_width<const N: usize>(track: &Track<N>) -> usize {
    ((CUBIC / track.period().max(1e-9)).round() as usize).max(CUBIC_SAMPLES)
}

fn rms_speeds<const N: usize>(track: &Track<N>) -> [f64; N] {
    let half = half_width(track);
    let places = || (0..track.len()).step_by((track.len() / 1000).max(1));
    std::array::from_fn(|j| rms(places().map(|k| local_cubic(&track.t, |i| track.q[i][j], k, half).dq)))
}

/// Speeds below which a joint may be at rest for all that its encoder says.
fn slow_speeds<const N: usize>(track: &Track<N>, speed: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|j| {
        let middle = local_cubic(&track.t, |i| track.q[i][j], track.len() / 2, half_width(track));
        let noise = track.noise[j] * middle.covariance[2].sqrt();
        (SLOW * speed[j]).max(SLOW_NOISE * noise).max(1e-9)
    })
}

fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = x.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}
