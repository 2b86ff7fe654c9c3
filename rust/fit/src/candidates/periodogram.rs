//! Periodogram of the residual over position: initial guesses of ripple, with its cycles per turn of a joint.
//!
//! Over a short window a torque `sin(n q)` changes the predicted position by nearly its double integral over time, divided by the joint's own
//! inertia. For every `n` of a grid, sine and cosine are fitted to the residuals of all windows after removal of an offset and a drift, such as an
//! error of the initial state causes: least-squares spectral analysis (Lomb 1976) over position in place of time.

use crate::likelihood::solve::FitProblem;
use crate::model::hypothesis::Hypothesis;
use crate::predict::window::{Dataset, Window};
use armgap_core::arm::Arm;
use armgap_core::cpu::{Cpu, Kernel, Level};
use armgap_core::trig::sin_cos;
use rayon::prelude::*;

/// Step of the periodogram's grid, in cycles over the joint's travel: half the width of a peak.
const RESOLUTION: f64 = 0.5;

/// Fewest cycles of ripple over a joint's travel in the periodogram; ripple with fewer cycles resembles gravity and has fixed initial guesses.
const FEWEST_CYCLES: f64 = 2.0;

/// Largest phase advance of ripple per sample at the joint's RMS speed, rad.
const FASTEST: f64 = 2.5;

/// Largest number of frequencies in a periodogram.
const MOST_POINTS: usize = 600;

/// Frequencies of the periodogram that are computed together as one vector.
const BATCH: usize = 8;

/// Largest number of peaks reported for a joint's periodogram.
const PEAKS: usize = 3;

/// A torque `amplitude sin(cycles q + phase)` that would explain part of the residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpectralPeak {
    /// Amplitude of the torque, N m or N.
    pub amplitude: f64,
    /// Angular frequency over position, rad per rad or per m: 2 pi times the cycles per radian or metre.
    pub cycles: f64,
    /// Phase of the torque, rad.
    pub phase: f64,
    /// Decrease of the windows' cost by the fitted sine.
    pub gain: f64,
}

/// Highest peaks of the periodogram of the residual of hypothesis `base` on joint `j`, largest decrease of the cost first.
pub fn periodogram_peaks<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &FitProblem<A, N, P>,
    base: &Hypothesis<P>,
    j: usize,
) -> Vec<SpectralPeak> {
    let [from, to] = problem.scales.travel[j];
    let travel = to - from;
    if travel.is_nan() || travel <= 0.0 {
        return Vec::new();
    }
    let unit = std::f64::consts::TAU / travel;
    let highest = FASTEST / (problem.scales.speed[j] * problem.scales.period) / unit;
    let points = (((highest - FEWEST_CYCLES) / RESOLUTION).max(0.0) as usize).min(MOST_POINTS);
    let residual = problem.residual(base);
    let paths = paths(problem, base, &residual, j);
    let level = Level::detect();
    let batch = |group: usize| {
        let first = unit * (FEWEST_CYCLES + RESOLUTION * (group * BATCH) as f64);
        level.run(Spectrum { paths: &paths, first, step: unit * RESOLUTION })
    };
    let groups: Vec<[SpectralPeak; BATCH]> = (0..points.div_ceil(BATCH)).into_par_iter().map(batch).collect();
    peaks(&groups.as_flattened()[..points])
}

/// Motion of one joint in one window, with the residual of its predicted position.
struct Path {
    /// Positions of the joint halfway between samples, rad or m, from the interval that ends at the window's first predicted sample.
    q: Vec<f64>,
    /// Acceleration of the joint per unit of its torque, divided by the standard deviation of the joint's position residual, per sample interval.
    gain: Vec<f64>,
    /// Lengths of the sample intervals, s.
    h: Vec<f64>,
    /// Whitened position residual of the joint after removal of offset and drift.
    residual: Vec<f64>,
    /// Linear function of time with zero mean and unit norm: the drift that is removed from the residual.
    drift: Vec<f64>,
    /// Robust weight of the window in the fit whose residual is examined.
    weight: f64,
}

fn paths<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &FitProblem<A, N, P>,
    base: &Hypothesis<P>,
    residual: &[f64],
    j: usize,
) -> Vec<Path> {
    let one = |(window, weight): (&Window<N>, &f64)| {
        let rows = &residual[window.range()];
        path(problem, base, window, rows.iter().skip(j).step_by(N).copied().collect(), *weight, j)
    };
    problem
        .data
        .windows
        .iter()
        .zip(&problem.weighting.robust_weight)
        .filter(|(w, _)| w.rows() > 4)
        .map(one)
        .collect()
}

fn path<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &FitProblem<A, N, P>,
    base: &Hypothesis<P>,
    window: &Window<N>,
    mut residual: Vec<f64>,
    weight: f64,
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
        own / problem.weighting.scale[j]
    };
    Path {
        q: intervals().map(|k| 0.5 * (track.q[k][j] + track.q[k + 1][j])).collect(),
        gain: intervals().map(response).collect(),
        h: intervals().map(|k| track.t[k + 1] - track.t[k]).collect(),
        residual,
        drift,
        weight,
    }
}

/// Periodogram of a residual over position: least squares of a sine and a cosine at evenly spaced frequencies.
struct Spectrum<'a> {
    paths: &'a [Path],
    /// First angular frequency over position and the spacing of frequencies, 2 pi times cycles per radian or metre.
    first: f64,
    step: f64,
}

/// Values of one quantity at all frequencies of a batch of the periodogram.
type Each = [f64; BATCH];

impl Kernel for Spectrum<'_> {
    type Output = [SpectralPeak; BATCH];

    #[inline(always)]
    fn run<C: Cpu>(self) -> Self::Output {
        let (mut normal, mut right) = ([[0.0; BATCH]; 3], [[0.0; BATCH]; 2]);
        for path in self.paths {
            let (n, b) = self.products::<C>(path);
            for (sum, x) in normal.iter_mut().zip(n).chain(right.iter_mut().zip(b)) {
                for l in 0..BATCH {
                    sum[l] += path.weight * x[l];
                }
            }
        }
        std::array::from_fn(|l| {
            let cycles = self.first + self.step * l as f64;
            fitted(cycles, normal.map(|x| x[l]), right.map(|x| x[l]))
        })
    }
}

impl Spectrum<'_> {
    /// Inner products, in one window, of the position responses to `sin(n q)` and `cos(n q)` without offset and drift, with each other and with the
    /// residual.
    #[inline(always)]
    fn products<C: Cpu>(&self, path: &Path) -> ([Each; 3], [Each; 2]) {
        let zero = [0.0; BATCH];
        let (mut speed, mut bend) = ([zero; 2], [zero; 2]);
        let (mut squares, mut right) = ([zero; 3], [zero; 2]);
        let (mut offset, mut drift) = ([zero; 2], [zero; 2]);
        for k in 0..path.q.len() {
            let (h, gain) = (path.h[k], path.gain[k]);
            let torque = self.phases::<C>(path.q[k]);
            for i in 0..2 {
                for l in 0..BATCH {
                    let kick = h * gain * torque[i][l];
                    bend[i][l] = C::fused(h, C::fused(0.5, kick, speed[i][l]), bend[i][l]);
                    speed[i][l] += kick;
                    right[i][l] = C::fused(bend[i][l], path.residual[k], right[i][l]);
                    offset[i][l] += bend[i][l];
                    drift[i][l] = C::fused(bend[i][l], path.drift[k], drift[i][l]);
                }
            }
            for l in 0..BATCH {
                squares[0][l] = C::fused(bend[0][l], bend[0][l], squares[0][l]);
                squares[1][l] = C::fused(bend[0][l], bend[1][l], squares[1][l]);
                squares[2][l] = C::fused(bend[1][l], bend[1][l], squares[2][l]);
            }
        }
        let count = path.q.len() as f64;
        for (square, (a, b)) in squares.iter_mut().zip([(0, 0), (0, 1), (1, 1)]) {
            for l in 0..BATCH {
                square[l] -= offset[a][l] * offset[b][l] / count + drift[a][l] * drift[b][l];
            }
        }
        (squares, right)
    }

    /// Sines and cosines of `n q` at all frequencies `n` of a batch, each from the previous frequency by rotation.
    #[inline(always)]
    fn phases<C: Cpu>(&self, q: f64) -> [Each; 2] {
        let (mut s, mut c) = sin_cos(self.first * q);
        let (by_s, by_c) = sin_cos(self.step * q);
        let mut phases = [[0.0; BATCH]; 2];
        for l in 0..BATCH {
            (phases[0][l], phases[1][l]) = (s, c);
            (s, c) = (C::fused(s, by_c, c * by_s), C::fused(c, by_c, -s * by_s));
        }
        phases
    }
}

/// Amplitude, phase and decrease of the cost at frequency `cycles`, from the normal equations of sine and cosine.
fn fitted(cycles: f64, [ss, sc, cc]: [f64; 3], right: [f64; 2]) -> SpectralPeak {
    let determinant = ss * cc - sc * sc;
    if determinant.is_nan() || determinant <= 1e-9 * ss * cc {
        return SpectralPeak { amplitude: 0.0, cycles, phase: 0.0, gain: 0.0 };
    }
    let sine = (cc * right[0] - sc * right[1]) / determinant;
    let cosine = (ss * right[1] - sc * right[0]) / determinant;
    SpectralPeak {
        amplitude: sine.hypot(cosine),
        cycles,
        phase: cosine.atan2(sine),
        gain: sine * right[0] + cosine * right[1],
    }
}

/// Highest local maxima of a spectrum, largest decrease of the cost first.
fn peaks(spectrum: &[SpectralPeak]) -> Vec<SpectralPeak> {
    let gain = |i: usize| spectrum.get(i).map_or(0.0, |r| r.gain);
    let top = |i: &usize| gain(*i) > 0.0 && (*i == 0 || gain(*i) >= gain(*i - 1)) && gain(*i) > gain(*i + 1);
    let mut found: Vec<SpectralPeak> = (0..spectrum.len()).filter(top).map(|i| spectrum[i]).collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found.truncate(PEAKS);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::cpu::Portable;

    #[test]
    fn sines_turned_on_from_frequency_to_frequency_are_those_of_each() {
        let spectrum = Spectrum { paths: &[], first: 7.3, step: 0.41 };
        for q in [-2.9, 0.0, 0.3, 11.0] {
            let [sines, cosines] = spectrum.phases::<Portable>(q);
            for l in 0..BATCH {
                let (s, c) = ((7.3 + 0.41 * l as f64) * q).sin_cos();
                assert!((sines[l] - s).abs() < 1e-13 && (cosines[l] - c).abs() < 1e-13, "{q} {l}");
            }
        }
    }

    #[test]
    fn a_ripple_is_found_with_its_size_and_phase() {
        let (cycles, amplitude, phase) = (9.0, 0.4, 0.7);
        let count = 100;
        let q: Vec<f64> = (0..count).map(|k| 0.02 * k as f64).collect();
        let middle = (count - 1) as f64 / 2.0;
        let length = (0..count).map(|k| (k as f64 - middle).powi(2)).sum::<f64>().sqrt();
        let drift: Vec<f64> = (0..count).map(|k| (k as f64 - middle) / length).collect();
        let (mut speed, mut bend) = (0.0, 0.0);
        let mut residual: Vec<f64> = Vec::new();
        for q in &q {
            let kick = 0.01 * amplitude * (cycles * q + phase).sin();
            bend += 0.01 * (speed + 0.5 * kick);
            speed += kick;
            residual.push(bend);
        }
        let mean = residual.iter().sum::<f64>() / count as f64;
        let slope: f64 = residual.iter().zip(&drift).map(|(r, d)| r * d).sum();
        residual.iter_mut().zip(&drift).for_each(|(r, d)| *r -= mean + slope * d);
        let path = Path { q, gain: vec![1.0; count], h: vec![0.01; count], residual, drift, weight: 1.0 };
        let found = Level::detect().run(Spectrum { paths: &[path], first: 8.0, step: 0.5 });
        let at = found[2];
        assert_eq!(at.cycles, cycles);
        assert!((at.amplitude - amplitude).abs() < 1e-6 && (at.phase - phase).abs() < 1e-6, "{at:?}");
        assert!(found.iter().all(|other| other.gain <= at.gain));
    }
}
