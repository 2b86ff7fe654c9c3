//! How far predictions miss on the holdout: windows from measured initial states, and whole logs from their first sample.

use crate::arm::ArmDescription;
use crate::assemble::Compared;
use crate::context::DiagnosisContext;
use crate::diagnose::Options;
use crate::model::Hypothesis;
use crate::random::Random;
use crate::report::{AtHorizon, FreeRun, FreeRunSeries, Gap, Series};
use crate::window::{Dataset, InitialStateOffset, Window};
use armgap_core::arm::Arm;
use rayon::prelude::*;

/// Points of a drawn curve at most.
const DRAWN: usize = 2500;

/// Holdout logs that are drawn.
const DRAWN_LOGS: usize = 3;

/// Resamples of the holdout windows for the interval of the closed share.
const RESAMPLES: usize = 500;

/// Further prediction horizons, s.
const HORIZONS: [f64; 3] = [0.1, 0.5, 1.0];

/// Free-run errors are cut here, rad or m: beyond, only "it diverged" is meant.
const FREE_RUN_LIMIT: f64 = 100.0;

/// A window's mean square error from its measured initial state counts up to this many times the typical variance: twenty times in
/// the error itself, as far as initial states are ever corrected.
const WORST_START: f64 = 400.0;

/// Predictions on the holdout from measured initial states, and their squared errors.
pub struct Errors<const N: usize> {
    before: Vec<f64>,
    refit: Vec<f64>,
    after: Vec<f64>,
    /// Mean square that measured initial states and the measurement itself put into the errors, per joint.
    floor: [f64; N],
}

impl<const N: usize> Errors<N> {
    /// Predictions of the three hypotheses.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        context: &DiagnosisContext<A, N, P>,
        compared: &Compared<P>,
    ) -> Self {
        let data = &context.holdout.data;
        let offsets = data.zero_offsets();
        let bare = data.without_pushes();
        let after = data.predict(&context.arm, &compared.after, &offsets);
        Self {
            before: bare.predict(&context.arm, &compared.before, &offsets),
            refit: bare.predict(&context.arm, &compared.refit, &offsets),
            floor: floor(context, data, &compared.after, &after),
            after,
        }
    }

    /// Measured and predicted positions for drawing.
    pub fn series<A: Arm<f64, N, P>, const P: usize>(
        &self,
        context: &DiagnosisContext<A, N, P>,
    ) -> Vec<Series> {
        let data = &context.holdout.data;
        let mut all = Vec::new();
        for (index, track) in data.tracks.iter().enumerate().take(DRAWN_LOGS) {
            let stride = track.len().div_ceil(DRAWN);
            for j in 0..N {
                let mut s = Series {
                    log: track.name.clone(),
                    joint: j + 1,
                    t: Vec::new(),
                    measured: Vec::new(),
                    before: Vec::new(),
                    refit: Vec::new(),
                    after: Vec::new(),
                    window_start: Vec::new(),
                };
                for window in data.windows.iter().filter(|w| w.track == index) {
                    s.window_start.push(s.t.len());
                    for i in (0..window.rows()).step_by(stride) {
                        let at = (window.offset + i) * N + j;
                        s.t.push(track.t[window.first + 1 + i]);
                        s.measured.push(context.holdout.measured[at]);
                        s.before.push(self.before[at]);
                        s.refit.push(self.refit[at]);
                        s.after.push(self.after[at]);
                    }
                }
                all.push(s);
            }
        }
        all
    }
}

/// Mean square of a perfect model's errors: noise of the sample itself, and the error of the measured initial state carried along the
/// window, around what the model predicts.
fn floor<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    data: &Dataset<N>,
    model: &Hypothesis<P>,
    predicted: &[f64],
) -> [f64; N] {
    let offsets = data.zero_offsets();
    let columns =
        crate::weighting::initial_state_sensitivities(data, &context.arm, model, &offsets, predicted);
    let carried = |window: &Window<N>, errors: &[[f64; 2]; N]| -> [f64; N] {
        let mut sum = [0.0; N];
        for row in window.range().step_by(N) {
            for (j, total) in sum.iter_mut().enumerate() {
                for (k, [vq, cov, vdq]) in window.initial_state.covariance.iter().enumerate() {
                    let [a, b] = [0, 1].map(|i| columns[i * N + k][row + j] * errors[k][i].sqrt());
                    *total += a * a * vq + 2.0 * a * b * cov + b * b * vdq;
                }
            }
        }
        sum.map(|x| x / window.rows() as f64)
    };
    let by_noise: Vec<[f64; N]> = data.windows.iter().map(|w| carried(w, &[[1.0; 2]; N])).collect();
    let in_all: Vec<[f64; N]> =
        data.windows.iter().map(|w| carried(w, &w.initial_state.mean_square)).collect();
    std::array::from_fn(|j| {
        // A window whose initial state decides whether a joint sticks has no meaningful derivative; it counts as a bad one, not as infinite.
        let typical = crate::track::median(by_noise.iter().map(|w| w[j]).collect());
        let mean = in_all.iter().map(|w| w[j].min(WORST_START * typical)).sum::<f64>() / in_all.len() as f64;
        context.noise[j].powi(2) + mean
    })
}

/// RMS difference of each joint.
pub fn rms<const N: usize>(measured: &[f64], predicted: &[f64]) -> Vec<f64> {
    let rows = (measured.len() / N).max(1) as f64;
    let squares = |j: usize| -> f64 {
        measured.iter().zip(predicted).skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum()
    };
    (0..N).map(|j| (squares(j) / rows).sqrt()).collect()
}

/// The gap before, re-estimated, and with the causes.
pub fn gap<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    compared: &Compared<P>,
    errors: &Errors<N>,
    free: &FreeRuns<N>,
    description: &ArmDescription,
    options: &Options,
) -> Gap {
    let measured = &context.holdout.measured;
    let floor: Vec<f64> = errors.floor.iter().map(|v| v.sqrt()).collect();
    let before = rms::<N>(measured, &errors.before);
    let after = rms::<N>(measured, &errors.after);
    Gap {
        horizon_s: options.horizon,
        unit: if description.kind.rotary() { "rad" } else { "m" },
        closed: closed(&before, &after, &floor),
        closed_ci: closed_interval(context, errors, &floor, options.seed),
        refit: rms::<N>(measured, &errors.refit),
        motion: rms::<N>(measured, &context.holdout.still()),
        horizons: HORIZONS.par_iter().filter_map(|h| at_horizon(context, compared, *h)).collect(),
        free_run: FreeRun {
            before: rms::<N>(&free.measured, &free.before),
            after: rms::<N>(&free.measured, &free.after),
        },
        before,
        after,
        floor,
    }
}

/// The gap at another prediction horizon; none where the logs are shorter than two of it.
fn at_horizon<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    compared: &Compared<P>,
    horizon: f64,
) -> Option<AtHorizon> {
    let data = Dataset::new(context.holdout.data.tracks.clone(), horizon);
    if data.windows.len() < 2 * data.tracks.len() {
        return None;
    }
    let bare = data.without_pushes();
    let (measured, offsets) = (data.measured(), data.zero_offsets());
    let missed = |predicted: &[f64]| rms::<N>(&measured, &limited(&measured, predicted));
    let after = data.predict(&context.arm, &compared.after, &offsets);
    Some(AtHorizon {
        horizon_s: horizon,
        before: missed(&bare.predict(&context.arm, &compared.before, &offsets)),
        refit: missed(&bare.predict(&context.arm, &compared.refit, &offsets)),
        floor: floor(context, &data, &compared.after, &after).map(f64::sqrt).to_vec(),
        after: missed(&after),
    })
}

/// Share of the gap above the floor that is closed, over all joints.
fn closed(before: &[f64], after: &[f64], floor: &[f64]) -> f64 {
    let above =
        |x: &[f64]| x.iter().zip(floor).map(|(x, f)| ((x - f) / before_scale(before)).max(0.0)).sum::<f64>();
    let (b, a) = (above(before), above(after));
    if b > 0.0 { 1.0 - a / b } else { 0.0 }
}

fn before_scale(before: &[f64]) -> f64 {
    before.iter().copied().fold(f64::MIN_POSITIVE, f64::max)
}

/// 95 % interval of the closed share from resampled holdout windows.
fn closed_interval<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    errors: &Errors<N>,
    floor: &[f64],
    seed: u64,
) -> [f64; 2] {
    let data = &context.holdout.data;
    let squares = |predicted: &[f64], w: &Window<N>, j: usize| -> f64 {
        let pairs = context.holdout.measured[w.range()].iter().zip(&predicted[w.range()]);
        pairs.skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum()
    };
    let table = |predicted: &[f64]| -> Vec<[f64; N]> {
        data.windows.iter().map(|w| std::array::from_fn(|j| squares(predicted, w, j))).collect()
    };
    let (before, after) = (table(&errors.before), table(&errors.after));
    let mut random = Random(seed);
    let count = data.windows.len();
    let mut shares: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let draw: Vec<usize> = (0..count).map(|_| random.below(count)).collect();
            let rows: usize = draw.iter().map(|&w| data.windows[w].rows()).sum();
            let pooled = |table: &[[f64; N]]| -> Vec<f64> {
                (0..N)
                    .map(|j| (draw.iter().map(|&w| table[w][j]).sum::<f64>() / rows.max(1) as f64).sqrt())
                    .collect()
            };
            closed(&pooled(&before), &pooled(&after), floor)
        })
        .collect();
    shares.sort_by(f64::total_cmp);
    [shares[RESAMPLES / 40], shares[RESAMPLES - 1 - RESAMPLES / 40]]
}

/// The holdout as one window per log.
fn whole<const N: usize>(data: &Dataset<N>) -> Dataset<N> {
    let (mut windows, mut rows) = (Vec::new(), 0);
    for (index, track) in data.tracks.iter().enumerate() {
        let last = track.len() - 1;
        windows.push(Window {
            track: index,
            first: 0,
            last,
            offset: rows,
            initial_state: track.initial_state(0),
        });
        rows += last;
    }
    Dataset { tracks: data.tracks.clone(), windows, rows }
}

/// Predictions kept within reach of the measurement, so that a diverged run stays a number.
fn limited(measured: &[f64], predicted: &[f64]) -> Vec<f64> {
    let within = |p: &f64, m: &f64| m + (p - m).clamp(-FREE_RUN_LIMIT, FREE_RUN_LIMIT);
    predicted.iter().zip(measured).map(|(p, m)| within(p, m)).collect()
}

/// Whole logs of the holdout from their first sample.
pub struct FreeRuns<const N: usize> {
    data: Dataset<N>,
    measured: Vec<f64>,
    before: Vec<f64>,
    after: Vec<f64>,
}

impl<const N: usize> FreeRuns<N> {
    /// Runs of the arm file as it is, and of the model with the causes.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        context: &DiagnosisContext<A, N, P>,
        compared: &Compared<P>,
    ) -> Self {
        let data = whole(&context.holdout.data);
        let (bare, measured) = (data.without_pushes(), data.measured());
        let offsets = vec![InitialStateOffset::none(); data.windows.len()];
        let run = |data: &Dataset<N>, h| limited(&measured, &data.predict(&context.arm, h, &offsets));
        let (before, after) = rayon::join(|| run(&bare, &compared.before), || run(&data, &compared.after));
        Self { data, measured, before, after }
    }

    /// Curves for drawing.
    pub fn series(&self) -> Vec<FreeRunSeries> {
        let mut all = Vec::new();
        for window in self.data.windows.iter().take(DRAWN_LOGS) {
            let track = &self.data.tracks[window.track];
            let rows: Vec<usize> = (0..window.rows()).step_by(window.rows().div_ceil(DRAWN)).collect();
            for j in 0..N {
                let pick = |x: &[f64]| rows.iter().map(|i| x[(window.offset + i) * N + j]).collect();
                all.push(FreeRunSeries {
                    log: track.name.clone(),
                    joint: j + 1,
                    t: rows.iter().map(|i| track.t[i + 1]).collect(),
                    measured: pick(&self.measured),
                    before: pick(&self.before),
                    after: pick(&self.after),
                });
            }
        }
        all
    }
}
