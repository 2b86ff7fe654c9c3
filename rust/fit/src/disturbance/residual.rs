//! Low-passed residual torque of a whole log under a model, and columns of torques by which the model could be wrong.
//!
//! The residual torque is the torque that the measured motion needs minus the logged one. Residual torque and columns go through the same low-pass,
//! so that neither a lag nor noise of the acceleration enters only one of them. A push is a part of the residual torque that no combination of the
//! columns explains: it does not recur with the state.

use crate::likelihood::solve::Prior;
use crate::log::track::Track;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::low_pass::{LowPass, slope};
use crate::predict::residual_torque::{
    InverseDynamicsResidual, SLOW, half_width, inverse_dynamics_residuals, rms, rms_speeds, slow_speeds,
};
use armgap_core::arm::Arm;
use nalgebra::{SMatrix, SVector};

/// Standard deviation of the Gaussian low-pass of residual torques, s: elastic vibrations and delays are faster, a push by hand slower.
pub const LOW_PASS: f64 = 0.045;

/// Spacing of the grid of times of the residual torque, s.
const GRID: f64 = 0.01;

/// Least spacing of the grid of times of the residual torque, in sample periods.
const GRID_SAMPLES: f64 = 2.0;

/// Ratio of the largest friction of a joint at rest to its Coulomb friction: static friction exceeds sliding friction.
const STATIC: f64 = 1.1;

/// Prior standard deviation of torques of unknown effects, relative to the joint's typical torque.
const UNKNOWN: f64 = 0.05;

/// Prior standard deviation of a missing rotor's inertia, relative to the joint's own inertia.
const ROTOR: f64 = 0.1;

/// Prior standard deviation of a missing rotor's inertial coupling to another joint, relative to the smaller of both joints' inertias.
const COUPLING: f64 = 0.05;

/// Prior standard deviation of an encoder's zero error, rad.
const ZERO: f64 = 0.05;

/// Displacement of a position in the finite difference of the torque by an encoder's zero, rad.
const TURN: f64 = 1e-3;

/// Prior standard deviation of a lag of the torque, s.
const LAG: f64 = 0.01;

/// Speed below which low-speed friction effects act, relative to the joint's RMS speed.
const LOW_SPEED: f64 = 0.4;

/// Least number of samples of a log in which pushes are looked for.
const FEWEST_LOG_SAMPLES: usize = 100;

/// Length of the moving mean of the motion's activity (squared torques, rates of torque, accelerations and speeds), s.
const ACTIVE: f64 = 0.1;

/// Residual torque of one joint over the grid of a log.
pub struct Joint {
    /// Torque that the measured motion needs beyond the logged torque, without friction at rest, N m (N), by grid point.
    pub lack: Vec<f64>,
    /// Torque of the joint per unit of every possible model error, by grid point.
    pub columns: Vec<Vec<f64>>,
    /// Share of the time, 0 to 1, around each grid point at which the joint may be at rest.
    pub rest: Vec<f64>,
    /// Largest friction torque of the joint at rest, N m (N).
    pub holding: f64,
    /// RMS torque that the measured motion needs, N m (N).
    pub typical: f64,
}

/// Residual torque of a log and all that is needed to explain it by model errors.
pub struct Residual<const N: usize> {
    /// Times of the regular grid onto which the residual torque is low-passed, s.
    pub t: Vec<f64>,
    /// Spacing of the regular grid of times, s.
    pub step: f64,
    /// Residual torque of each joint.
    pub joints: [Joint; N],
    /// Prior mean and standard deviation of the coefficient of every column of model errors.
    pub prior: Vec<(f64, f64)>,
    /// Activity of the motion: for each joint the moving mean squares of torque, rate of torque, acceleration and speed, each relative to its mean
    /// over the log. One series over the grid of times for each; those that are zero throughout are left out.
    pub activity: Vec<Vec<f64>>,
}

/// Residual torque at one sample, with the columns of possible model errors.
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
    /// Residual torque of a log under a model; `None` for too few samples or a model that cannot be simulated.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        arm: &A,
        track: &Track<N>,
        model: &Hypothesis<P>,
        prior: &Prior<P>,
    ) -> Option<Self> {
        let speed = rms_speeds(track);
        let rows = rows(arm, track, model, &slow_speeds(track, &speed))?;
        let t: Vec<f64> = rows.iter().map(|r| r.t).collect();
        if t.len() < FEWEST_LOG_SAMPLES {
            return None;
        }
        let step = GRID.max(GRID_SAMPLES * track.period());
        let low = LowPass::new(&t, step, LOW_PASS);
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

/// Prior mean and standard deviation of the coefficient of every column of model errors, in the order of [`columns`], lags last.
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

/// Torques by which a model could be wrong at one instant: columns of its regressor, then per joint a rotor, an offset, drag, friction at low
/// speed, two springs or tilts, and load-dependent friction; last the coupling of a rotor and the encoders' zeros.
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

/// Residual torque at every sample of a log except at its ends, where accelerations are uncertain; `None` if the model cannot be simulated.
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

/// Squared torques, rates of torque, accelerations and speeds of all joints around every grid point, each relative to its mean.
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

/// Mean of the values within `half` indices of each value.
fn moving_mean(x: &[f64], half: usize) -> Vec<f64> {
    let mean = |i: usize| {
        let part = &x[i.saturating_sub(half)..(i + half + 1).min(x.len())];
        part.iter().sum::<f64>() / part.len() as f64
    };
    (0..x.len()).map(mean).collect()
}
