//! Starts from the data: with how many cycles per turn of a joint the residual repeats.
//!
//! Over a short window a torque `sin(n q)` bends the prediction by nearly its double integral over the joint's own inertia. For
//! every `n` of a grid its two phases are fitted to the residuals of all windows, each freed from an offset and a drift as an error
//! of its start would leave: least-squares spectral analysis (Lomb 1976) over position in place of time.

use crate::model::Hypothesis;
use crate::solve::Problem;
use crate::window::{Dataset, Window};
use armgap_core::arm::Arm;
use rayon::prelude::*;

/// Step of the grid, in cycles over the joint's travel: half the width of a peak.
const RESOLUTION: f64 = 0.5;

/// Fewest cycles over the travel; slower ripple is much like gravity and has fixed starts.
const FEWEST: f64 = 2.0;

/// Phase at most that a ripple turns by per sample at RMS speed, rad.
const FASTEST: f64 = 2.5;

/// Most points of the grid.
const MOST_POINTS: usize = 600;

/// Peaks reported for a joint.
const PEAKS: usize = 3;

/// A torque `amplitude sin(cycles q + phase)` that would explain part of the residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeat {
    /// Amplitude, N m or N.
    pub amplitude: f64,
    /// Cycles per radian or metre, times 2 pi.
    pub cycles: f64,
    /// Phase, rad.
    pub phase: f64,
    /// Decrease of the windows' cost.
    pub gain: f64,
}

/// The strongest repeats in the residual of a hypothesis that act on joint `j`, best first.
pub fn repeats<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &Problem<A, N, P>,
    base: &Hypothesis<P>,
    j: usize,
) -> Vec<Repeat> {
    let [from, to] = problem.scales.travel[j];
    let travel = to - from;
    if travel.is_nan() || travel <= 0.0 {
        return Vec::new();
    }
    let unit = std::f64::consts::TAU / travel;
    let highest = FASTEST / (problem.scales.speed[j] * problem.scales.period) / unit;
    let points = (((highest - FEWEST) / RESOLUTION).max(0.0) as usize).min(MOST_POINTS);
    let residual = problem.residual(base);
    let paths = paths(problem, base, &residual, j);
    let spectrum: Vec<Repeat> = (0..points)
        .into_par_iter()
        .map(|i| fitted(&paths, unit * (FEWEST + RESOLUTION * i as f64)))
        .collect();
    peaks(&spectrum)
}

/// One window's motion of one joint, with what its residual asks for.
struct Path {
    /// Positions halfway between samples, the first before the first row.
    q: Vec<f64>,
    /// Acceleration per torque in units of the residual's scale.
    gain: Vec<f64>,
    /// Lengths of the intervals.
    h: Vec<f64>,
    /// Residual without offset and drift.
    residual: Vec<f64>,
    /// Orthonormal drift; the offset is constant.
    drift: Vec<f64>,
    /// Weight of the window.
    trust: f64,
}

fn paths<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &Problem<A, N, P>,
    base: &Hypothesis<P>,
    residual: &[f64],
    j: usize,
) -> Vec<Path> {
    let one = |(window, trust): (&Window<N>, &f64)| {
        let rows = &residual[window.range()];
        path(problem, base, window, rows.iter().skip(j).step_by(N).copied().collect(), *trust, j)
    };
    problem.data.windows.iter().zip(&problem.metric.trust).filter(|(w, _)| w.rows() > 4).map(one).collect()
}

fn path<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &Problem<A, N, P>,
    base: &Hypothesis<P>,
    window: &Window<N>,
    mut residual: Vec<f64>,
    trust: f64,
    j: usize,
) -> Path {
    let data: &Dataset<N> = problem.data;
    let track = &data.tracks[window.track];
    let intervals = || window.first..window.last;
    let t = &track.t[window.first + 1..=window.last];
    let middle = t.iter().sum::<f64>() / t.len() as f64;
    let length = t.iter().map(|t| (t - middle).powi(2)).sum::<f64>().sqrt();
    let drift: Vec<f64> = t.iter().map(|t| (t - middle) / length).collect();
    let mean = residual.iter().sum::<f64>() / residual.len() as f64;
    let slope: f64 = residual.iter().zip(&drift).map(|(r, d)| r * d).sum();
    for (r, d) in residual.iter_mut().zip(&drift) {
        *r -= mean + slope * d;
    }
    let response = |k: usize| {
        let inertia = problem.arm.inertia(&base.theta, &track.q[k]);
        let own = inertia.try_inverse().map_or(0.0, |inverse| inverse[(j, j)]);
        own / problem.metric.scale[j]
    };
    Path {
        q: intervals().map(|k| 0.5 * (track.q[k][j] + track.q[k + 1][j])).collect(),
        gain: intervals().map(response).collect(),
        h: intervals().map(|k| track.t[k + 1] - track.t[k]).collect(),
        residual,
        drift,
        trust,
    }
}

/// Least squares of both phases of one frequency over all windows.
fn fitted(paths: &[Path], cycles: f64) -> Repeat {
    let mut normal = [0.0; 3];
    let mut right = [0.0; 2];
    for path in paths {
        let (n, b) = products(path, cycles);
        for (sum, x) in normal.iter_mut().zip(n).chain(right.iter_mut().zip(b)) {
            *sum += path.trust * x;
        }
    }
    let [ss, sc, cc] = normal;
    let determinant = ss * cc - sc * sc;
    if determinant.is_nan() || determinant <= 1e-9 * ss * cc {
        return Repeat { amplitude: 0.0, cycles, phase: 0.0, gain: 0.0 };
    }
    let sine = (cc * right[0] - sc * right[1]) / determinant;
    let cosine = (ss * right[1] - sc * right[0]) / determinant;
    Repeat {
        amplitude: sine.hypot(cosine),
        cycles,
        phase: cosine.atan2(sine),
        gain: sine * right[0] + cosine * right[1],
    }
}

/// Inner products of the responses to `sin(n q)` and `cos(n q)` in one window, offset and drift removed, and with the residual.
fn products(path: &Path, cycles: f64) -> ([f64; 3], [f64; 2]) {
    let (mut speed, mut bend) = ([0.0; 2], [0.0; 2]);
    let (mut squares, mut right) = ([0.0; 3], [0.0; 2]);
    let (mut offset, mut drift) = ([0.0; 2], [0.0; 2]);
    for k in 0..path.q.len() {
        let (s, c) = armgap_core::trig::sin_cos(cycles * path.q[k]);
        let (h, torque) = (path.h[k], [path.gain[k] * s, path.gain[k] * c]);
        for i in 0..2 {
            bend[i] += h * (speed[i] + 0.5 * h * torque[i]);
            speed[i] += h * torque[i];
            right[i] += bend[i] * path.residual[k];
            offset[i] += bend[i];
            drift[i] += bend[i] * path.drift[k];
        }
        squares[0] += bend[0] * bend[0];
        squares[1] += bend[0] * bend[1];
        squares[2] += bend[1] * bend[1];
    }
    let count = path.q.len() as f64;
    let free = |a: usize, b: usize| offset[a] * offset[b] / count + drift[a] * drift[b];
    ([squares[0] - free(0, 0), squares[1] - free(0, 1), squares[2] - free(1, 1)], right)
}

/// The highest local maxima.
fn peaks(spectrum: &[Repeat]) -> Vec<Repeat> {
    let gain = |i: usize| spectrum.get(i).map_or(0.0, |r| r.gain);
    let top = |i: &usize| gain(*i) > 0.0 && (*i == 0 || gain(*i) >= gain(*i - 1)) && gain(*i) > gain(*i + 1);
    let mut found: Vec<Repeat> = (0..spectrum.len()).filter(top).map(|i| spectrum[i]).collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found.truncate(PEAKS);
    found
}
