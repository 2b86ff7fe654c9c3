//! The study of one arm: training and holdout windows, trusted values, and the current weights of residuals.

use crate::metric::Metric;
use crate::model::{Hypothesis, Placed};
use crate::progress::{Watch, Work};
use crate::scale::Scales;
use crate::solve::{Effort, Fit, Prior, Problem};
use crate::window::{Dataset, Shift};
use armgap_core::arm::Arm;

/// Rounds of re-weighting at most.
const MAX_ROUNDS: usize = 5;

/// A round that changes every joint's scale by less than this factor is the last.
const SETTLED: f64 = 1.1;

/// What stays the same throughout a diagnosis.
pub struct Study<A, const N: usize, const P: usize> {
    /// The arm.
    pub arm: A,
    /// Trusted values.
    pub prior: Prior<P>,
    /// Typical sizes.
    pub scales: Scales<N>,
    /// Windows the hypotheses are fitted to.
    pub training: Sample<N>,
    /// Windows they are judged on.
    pub holdout: Sample<N>,
    /// Standard deviation of the position measurement.
    pub noise: [f64; N],
    /// Effects of the user's own, at their start.
    pub own: Vec<Placed>,
    /// Who looks on.
    pub watch: Watch,
}

/// Windows with their measured positions.
pub struct Sample<const N: usize> {
    /// The windows.
    pub data: Dataset<N>,
    /// Measured positions in the order of the flat vector.
    pub measured: Vec<f64>,
}

impl<const N: usize> Sample<N> {
    /// Windows of the given dataset.
    pub fn new(data: Dataset<N>) -> Self {
        let measured = data.measured();
        Self { data, measured }
    }

    /// Cost, in these scales, of predicting that every joint stays where its window starts.
    pub fn motion(&self, scale: &[f64; N]) -> f64 {
        let moved = self.data.windows.iter().map(|window| {
            let rows = self.measured[window.range()].chunks_exact(N);
            let apart = |row: &[f64]| -> f64 {
                (0..N).map(|j| ((row[j] - window.start.q[j]) / scale[j]).powi(2)).sum()
            };
            rows.map(apart).sum::<f64>()
        });
        moved.sum()
    }
}

/// Weights for training and holdout windows, taken around one hypothesis.
#[derive(Debug, Clone)]
pub struct Weights<const N: usize> {
    /// Weights of the training windows.
    pub training: Metric<N>,
    /// Weights of the holdout windows.
    pub holdout: Metric<N>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Study<A, N, P> {
    /// The fitting problem under these weights.
    pub fn problem<'a>(&'a self, metric: &'a Metric<N>) -> Problem<'a, A, N, P> {
        self.on(&self.training, metric)
    }

    /// The judging problem under these weights.
    pub fn judge<'a>(&'a self, metric: &'a Metric<N>) -> Problem<'a, A, N, P> {
        self.on(&self.holdout, metric)
    }

    fn on<'a>(&'a self, sample: &'a Sample<N>, metric: &'a Metric<N>) -> Problem<'a, A, N, P> {
        Problem {
            arm: &self.arm,
            data: &sample.data,
            measured: &sample.measured,
            metric,
            prior: &self.prior,
            scales: &self.scales,
            watch: &self.watch,
        }
    }

    /// Weights around a hypothesis: starts are fitted to it and the scales are those given.
    pub fn weights(&self, hypothesis: &Hypothesis<P>, scale: [f64; N]) -> Weights<N> {
        let around = |sample| self.metric(sample, hypothesis, scale);
        let (training, holdout) = rayon::join(|| around(&self.training), || around(&self.holdout));
        Weights { training, holdout }
    }

    /// A metric whose starts have been fitted to the hypothesis once and relinearised there.
    pub fn metric(&self, sample: &Sample<N>, hypothesis: &Hypothesis<P>, scale: [f64; N]) -> Metric<N> {
        self.watch.check();
        let around = |starts: Vec<Shift<N>>| {
            let predicted = sample.data.predict(&self.arm, hypothesis, &starts);
            let metric = Metric::new(&sample.data, &self.arm, hypothesis, scale, starts, &predicted);
            let residual = metric.residual(&sample.measured, &predicted);
            (metric, residual)
        };
        let (rough, residual) = around(sample.data.measured_starts());
        let starts = bounded(&sample.data, rough.refit_starts(&sample.data, &residual));
        let (metric, residual) = around(starts);
        metric.robust(&sample.data, &residual)
    }

    /// Fits with scales that follow the residual, from rough scales down to the residual's own.
    pub fn settle(&self, start: &Hypothesis<P>, scale: [f64; N]) -> (Fit<P>, Weights<N>) {
        self.watch.begin(Work::Refit, MAX_ROUNDS + 1);
        let mut scale = scale;
        let mut hypothesis = start.clone();
        loop_rounds(|round| {
            let metric = self.metric(&self.training, &hypothesis, scale);
            let fit = self.problem(&metric).solve(&hypothesis, Effort::ROUGH);
            let next = self.residual_scale(&metric, &fit.hypothesis);
            hypothesis = fit.hypothesis.clone();
            let change = (0..N).map(|j| (next[j] / scale[j]).max(scale[j] / next[j])).fold(1.0, f64::max);
            scale = next;
            change < SETTLED || round == MAX_ROUNDS
        });
        let weights = self.weights(&hypothesis, scale);
        let fit = self.problem(&weights.training).solve(&hypothesis, Effort::FULL);
        (fit, weights)
    }

    /// Scale of each joint's residual under a hypothesis: its RMS once starts are fitted, widened by its correlation in time,
    /// and never under the measurement's noise.
    pub fn residual_scale(&self, metric: &Metric<N>, hypothesis: &Hypothesis<P>) -> [f64; N] {
        let problem = self.problem(metric);
        let residual = problem.residual(hypothesis);
        let left = metric.remainder(&self.training.data, &residual);
        std::array::from_fn(|j| {
            let windows = self.training.data.windows.iter().map(|w| {
                left[w.range()].iter().skip(j).step_by(N).map(|x| x * metric.scale[j]).collect::<Vec<f64>>()
            });
            correlated_rms(&windows.collect::<Vec<_>>(), &metric.trust).max(self.noise[j])
        })
    }

    /// First scales: the typical window's RMS error of the arm file as it is.
    pub fn rough_scale(&self, hypothesis: &Hypothesis<P>) -> [f64; N] {
        let data = &self.training.data;
        let predicted = data.predict(&self.arm, hypothesis, &data.measured_starts());
        std::array::from_fn(|j| {
            let window_rms = data.windows.iter().map(|w| {
                let pairs = self.training.measured[w.range()].iter().zip(&predicted[w.range()]);
                let squares: f64 = pairs.skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum();
                (squares / w.rows() as f64).sqrt()
            });
            crate::track::median(window_rms.collect()).max(self.noise[j])
        })
    }
}

/// Runs `round(1)`, `round(2)`, … until one says it is the last.
fn loop_rounds(mut round: impl FnMut(usize) -> bool) {
    let mut count = 1;
    while !round(count) {
        count += 1;
    }
}

/// Start corrections no larger than twenty times what the measured start allows; beyond, the window's model is at fault.
fn bounded<const N: usize>(data: &Dataset<N>, starts: Vec<Shift<N>>) -> Vec<Shift<N>> {
    let limit = |x: f64, variance: f64| x.clamp(-20.0 * variance.sqrt(), 20.0 * variance.sqrt());
    let mut starts = starts;
    for (shift, window) in starts.iter_mut().zip(&data.windows) {
        for j in 0..N {
            let [vq, _, vdq] = window.start.covariance[j];
            shift.q[j] = limit(shift.q[j], vq);
            shift.dq[j] = limit(shift.dq[j], vdq);
        }
    }
    starts
}

/// RMS of pooled windows by their trust, times the square root of the autocorrelation time in samples (at least one).
fn correlated_rms(windows: &[Vec<f64>], trust: &[f64]) -> f64 {
    let moment = |lag: usize| -> f64 {
        let product = |w: &Vec<f64>| w.iter().zip(w.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
        windows.iter().zip(trust).map(|(w, trust)| trust * product(w)).sum()
    };
    let count: f64 = windows.iter().zip(trust).map(|(w, trust)| trust * w.len() as f64).sum();
    let energy = moment(0);
    if energy <= 0.0 || count <= 0.0 {
        return 0.0;
    }
    let longest = windows.iter().map(Vec::len).max().unwrap_or(1);
    let mut time = 1.0;
    for lag in 1..longest / 2 {
        let correlation = moment(lag) / energy;
        if correlation < 0.05 {
            break;
        }
        time += 2.0 * correlation;
    }
    (energy / count * time).sqrt()
}
