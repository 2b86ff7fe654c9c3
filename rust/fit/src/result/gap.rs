//! Prediction errors on the holdout: windows from measured initial states, and whole logs from their first sample.

use crate::likelihood::context::{DiagnosisContext, SplitWeighting, WindowSet};
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::log::input::Options;
use crate::log::track::Track;
use crate::model::arm::ArmDescription;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::rms;
use crate::numeric::random::Random;
use crate::predict::window::{Dataset, InitialStateOffset, Window};
use crate::result::floor::floor;
use crate::result::report::{AtHorizon, FreeRun, FreeRunSeries, Gap, SecondHalves, Series};
use armgap_core::arm::Arm;
use rayon::prelude::*;

/// Largest number of points of a drawn curve of positions over time.
const DRAWN: usize = 2500;

/// Largest number of holdout logs whose curves of positions over time are drawn.
const DRAWN_LOGS: usize = 3;

/// Number of bootstrap resamples of the holdout's blocks of windows for the confidence interval of the closed share.
const CLOSED_SHARE_RESAMPLES: usize = 500;

/// Prediction horizons at which the gap is reported besides the chosen one, s.
pub(crate) const HORIZONS: [f64; 3] = [0.1, 0.5, 1.0];

/// Largest free-run error that is reported, rad or m: a larger one only says that the run diverged.
const FREE_RUN_LIMIT: f64 = 100.0;

/// The three models whose predictions a report compares.
pub struct Compared<const P: usize> {
    /// The arm file as it is, without effects.
    pub before: Hypothesis<P>,
    /// The arm with its parameters re-estimated, without effects.
    pub refit: Hypothesis<P>,
    /// The arm with its parameters re-estimated and the named causes.
    pub after: Hypothesis<P>,
}

/// Predicted positions on the holdout from measured initial states for the three compared models, and their noise floor.
pub struct Errors<const N: usize> {
    /// All windows of the holdout, those in which pushes act too.
    sample: WindowSet<N>,
    before: Vec<f64>,
    refit: Vec<f64>,
    after: Vec<f64>,
    /// Predicted positions of the model with causes, rad or m, with the encoder zeros fitted to the holdout's recordings.
    with_zeros: Vec<f64>,
    /// Noise floor by joint as a mean square, rad^2 or m^2: what errors of measured initial states and measurement noise contribute.
    floor: [f64; N],
}

impl<const N: usize> Errors<N> {
    /// Predicts the holdout with the three compared models; `zeros` are the encoder zeros of the holdout's recordings.
    pub fn new<A: Arm<f64, N, P>, const P: usize>(
        context: &DiagnosisContext<A, N, P>,
        compared: &Compared<P>,
        zeros: &EncoderZeros<N>,
        seed: u64,
    ) -> Self {
        let sample = context.all_windows(&context.holdout);
        let data = &sample.data;
        let offsets = data.zero_offsets();
        let bare = data.without_pushes();
        let after = data.predict(&context.arm, &compared.after, &offsets);
        Self {
            before: bare.predict(&context.arm, &compared.before, &offsets),
            refit: bare.predict(&context.arm, &compared.refit, &offsets),
            floor: floor(context, data, &compared.after, &after, seed),
            with_zeros: data.predict(&context.arm, &compared.after, &zeros.offsets(data)),
            after,
            sample,
        }
    }

    /// RMS error per joint, rad or m, of the model with causes and the encoder zeros fitted to the holdout's recordings, so that their scatter does
    /// not count.
    pub fn beside_zeros(&self) -> Vec<f64> {
        rms::<N>(&self.sample.measured, &self.with_zeros)
    }

    /// Measured and predicted positions of the holdout windows, for drawing.
    pub fn series(&self) -> Vec<Series> {
        window_series(&self.sample.data, &self.sample.measured, [&self.before, &self.refit, &self.after])
    }
}

/// Gap on the holdout of the arm file as it is, with parameters re-estimated, and with the named causes.
pub fn gap<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    compared: &Compared<P>,
    errors: &Errors<N>,
    free: &FreeRuns<N>,
    weights: &SplitWeighting<N>,
    description: &ArmDescription,
    options: &Options,
) -> Gap {
    let measured = &errors.sample.measured;
    let floor: Vec<f64> = errors.floor.iter().map(|v| v.sqrt()).collect();
    let before = rms::<N>(measured, &errors.before);
    let after = rms::<N>(measured, &errors.after);
    let refit = rms::<N>(measured, &errors.refit);
    Gap {
        horizon_s: options.horizon,
        unit: if description.kind.rotary() { "rad" } else { "m" },
        closed: closed(&before, &after, &floor),
        closed_ci: closed_interval(errors, &floor, options.seed),
        unexplained: (1.0 - closed(&refit, &after, &floor)).clamp(0.0, 1.0),
        refit,
        motion: rms::<N>(measured, &errors.sample.still()),
        horizons: HORIZONS
            .par_iter()
            .filter_map(|h| at_horizon(context, compared, *h, options.seed))
            .collect(),
        free_run: FreeRun {
            before: rms::<N>(&free.measured, &free.before),
            after: rms::<N>(&free.measured, &free.after),
        },
        second_halves: second_halves(context, &compared.after, weights),
        training: None,
        before,
        after,
        floor,
    }
}

/// RMS errors of a model on the second halves of the holdout logs, with positions as measured and with the encoder zeros that the first halves show;
/// none where the holdout has no encoder zeros of its own or a half has no window.
fn second_halves<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    model: &Hypothesis<P>,
    weights: &SplitWeighting<N>,
) -> Option<SecondHalves> {
    let data = &context.holdout.data;
    if weights.holdout.zeros.recordings.len() == weights.training.zeros.recordings.len() {
        return None;
    }
    let half = |second: bool| {
        let of = |(index, track): (usize, &Track<N>)| {
            let middle = 0.5 * (track.t[0] + track.t[track.len() - 1]);
            data.of_track(index, |w| (track.t[w.first] > middle) == second)
        };
        data.tracks.iter().enumerate().map(of).reduce(Dataset::and)
    };
    let [first, second] = [half(false)?, half(true)?].map(WindowSet::new);
    if first.data.windows.is_empty() || second.data.windows.is_empty() {
        return None;
    }
    let zeros = context.zeros_beside(&first, model, weights.holdout.scale, &weights.training.zeros);
    let missed = |offsets: &[InitialStateOffset<N>]| {
        rms::<N>(&second.measured, &second.data.predict(&context.arm, model, offsets))
    };
    let (after, with_zeros) = (missed(&second.data.zero_offsets()), missed(&zeros.offsets(&second.data)));
    Some(SecondHalves { after, with_zeros })
}

/// Gap on the holdout at another prediction `horizon`, s; none where the logs hold less than two windows each.
fn at_horizon<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    compared: &Compared<P>,
    horizon: f64,
    seed: u64,
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
        floor: floor(context, &data, &compared.after, &after, seed).map(f64::sqrt).to_vec(),
        after: missed(&after),
    })
}

/// Share of the gap above the noise floor that is closed: `1 - sum max(after - floor, 0) / sum max(before - floor, 0)`, summed over joints.
pub(crate) fn closed(before: &[f64], after: &[f64], floor: &[f64]) -> f64 {
    let above =
        |x: &[f64]| x.iter().zip(floor).map(|(x, f)| ((x - f) / before_scale(before)).max(0.0)).sum::<f64>();
    let (b, a) = (above(before), above(after));
    if b > 0.0 { 1.0 - a / b } else { 0.0 }
}

/// Largest of the errors `before` over the joints, positive: the common unit of the errors in the closed share.
fn before_scale(before: &[f64]) -> f64 {
    before.iter().copied().fold(f64::MIN_POSITIVE, f64::max)
}

/// 95 % interval of the closed share of the gap, from bootstrap resamples of the holdout's blocks of windows.
fn closed_interval<const N: usize>(errors: &Errors<N>, floor: &[f64], seed: u64) -> [f64; 2] {
    let WindowSet { data, measured } = &errors.sample;
    let squares = |predicted: &[f64], w: &Window<N>, j: usize| -> f64 {
        let pairs = measured[w.range()].iter().zip(&predicted[w.range()]);
        pairs.skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum()
    };
    let table = |predicted: &[f64]| -> Vec<[f64; N]> {
        data.windows.iter().map(|w| std::array::from_fn(|j| squares(predicted, w, j))).collect()
    };
    let (before, after) = (table(&errors.before), table(&errors.after));
    let mut random = Random(seed);
    let blocks = data.blocks();
    let mut shares: Vec<f64> = (0..CLOSED_SHARE_RESAMPLES)
        .map(|_| {
            let block = |_| blocks[random.below(blocks.len())].clone();
            let draw: Vec<usize> = (0..blocks.len()).flat_map(block).collect();
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
    [shares[CLOSED_SHARE_RESAMPLES / 40], shares[CLOSED_SHARE_RESAMPLES - 1 - CLOSED_SHARE_RESAMPLES / 40]]
}

/// The logs of a data set as one window per log.
pub(crate) fn whole<const N: usize>(data: &Dataset<N>) -> Dataset<N> {
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

/// Predicted positions clamped to within `FREE_RUN_LIMIT` of the measured ones, rad or m, so that a diverged run stays finite.
pub(crate) fn limited(measured: &[f64], predicted: &[f64]) -> Vec<f64> {
    let within = |p: &f64, m: &f64| m + (p - m).clamp(-FREE_RUN_LIMIT, FREE_RUN_LIMIT);
    predicted.iter().zip(measured).map(|(p, m)| within(p, m)).collect()
}

/// Free runs: simulations of whole holdout logs from their first sample, with the arm file as it is and with the causes.
pub struct FreeRuns<const N: usize> {
    data: Dataset<N>,
    measured: Vec<f64>,
    before: Vec<f64>,
    after: Vec<f64>,
}

impl<const N: usize> FreeRuns<N> {
    /// Simulates the holdout logs with the arm file as it is and with the model with causes.
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

    /// Measured and simulated positions of the free runs, for drawing.
    pub fn series(&self) -> Vec<FreeRunSeries> {
        free_run_series(&self.data, &self.measured, [&self.before, &self.after])
    }
}

/// Curves of whole logs for drawing: measured positions, and positions simulated with the arm file as it is and with the causes, rad or m.
pub(crate) fn free_run_series<const N: usize>(
    data: &Dataset<N>,
    measured: &[f64],
    [before, after]: [&[f64]; 2],
) -> Vec<FreeRunSeries> {
    let mut all = Vec::new();
    for window in data.windows.iter().take(DRAWN_LOGS) {
        let track = &data.tracks[window.track];
        let rows: Vec<usize> = (0..window.rows()).step_by(window.rows().div_ceil(DRAWN)).collect();
        for j in 0..N {
            let pick = |x: &[f64]| rows.iter().map(|i| x[(window.offset + i) * N + j]).collect();
            all.push(FreeRunSeries {
                log: track.name.clone(),
                joint: j + 1,
                t: rows.iter().map(|i| track.t[i + 1]).collect(),
                measured: pick(measured),
                before: pick(before),
                after: pick(after),
            });
        }
    }
    all
}

/// Curves of windows for drawing: measured positions, and predictions of the arm file as it is, re-estimated, and with causes, rad or m.
pub(crate) fn window_series<const N: usize>(
    data: &Dataset<N>,
    measured: &[f64],
    [before, refit, after]: [&[f64]; 3],
) -> Vec<Series> {
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
                initial_position: Vec::new(),
                initial_velocity: Vec::new(),
            };
            for window in data.windows.iter().filter(|w| w.track == index) {
                s.window_start.push(s.t.len());
                s.initial_position.push(window.initial_state.q[j]);
                s.initial_velocity.push(window.initial_state.dq[j]);
                for i in (0..window.rows()).step_by(stride) {
                    let at = (window.offset + i) * N + j;
                    s.t.push(track.t[window.first + 1 + i]);
                    s.measured.push(measured[at]);
                    s.before.push(before[at]);
                    s.refit.push(refit[at]);
                    s.after.push(after[at]);
                }
            }
            all.push(s);
        }
    }
    all
}
