//! The context of a diagnosis: arm, prior, scales, training and holdout windows; and the weighting of their residuals.

use crate::likelihood::scale::Scales;
use crate::likelihood::solve::{Effort, Fit, FitProblem, Prior};
use crate::likelihood::weighting::Weighting;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::window::{Dataset, InitialStateOffset, Window};
use crate::progress::{Phase, ProgressReporter};
use armgap_core::arm::Arm;
use armgap_core::transmission::Sides;

/// Rounds of re-weighting at most.
const MAX_ROUNDS: usize = 5;

/// A round that changes every joint's scale by less than this factor is the last.
const SETTLED: f64 = 1.1;

/// What a diagnosis works with: the arm, its prior, scales, and windows.
pub struct DiagnosisContext<A, const N: usize, const P: usize> {
    /// The arm.
    pub arm: A,
    /// Prior of the arm's parameters.
    pub prior: Prior<P>,
    /// Typical sizes.
    pub scales: Scales<N>,
    /// Windows the hypotheses are fitted to.
    pub training: WindowSet<N>,
    /// Windows of the holdout, on which causes are judged.
    pub holdout: WindowSet<N>,
    /// Standard deviation of the position measurement.
    pub noise: [f64; N],
    /// Sides that encoder and friction of every joint may be on, both on one side first.
    pub sides: [Vec<Sides>; N],
    /// Custom effects at their initial guess.
    pub custom_effects: Vec<EffectInstance>,
    /// Progress report and cancellation.
    pub progress: ProgressReporter,
}

/// Windows with their measured positions.
pub struct WindowSet<const N: usize> {
    /// The windows.
    pub data: Dataset<N>,
    /// Measured positions in the order of the flat vector.
    pub measured: Vec<f64>,
}

impl<const N: usize> WindowSet<N> {
    /// Windows of the given dataset.
    pub fn new(data: Dataset<N>) -> Self {
        let measured = data.measured();
        Self { data, measured }
    }

    /// Positions of an arm that stays at the initial position of each window, in the order of the flat vector.
    pub fn still(&self) -> Vec<f64> {
        let window = |w: &Window<N>| w.initial_state.q.as_slice().repeat(w.rows());
        self.data.windows.iter().flat_map(window).collect()
    }

    /// Cost, in these scales, of predicting that every joint stays at the initial position of its window.
    pub fn motion(&self, scale: &[f64; N]) -> f64 {
        let moved = self.data.windows.iter().map(|window| {
            let rows = self.measured[window.range()].chunks_exact(N);
            let apart = |row: &[f64]| -> f64 {
                (0..N).map(|j| ((row[j] - window.initial_state.q[j]) / scale[j]).powi(2)).sum()
            };
            rows.map(apart).sum::<f64>()
        });
        moved.sum()
    }
}

/// Weightings of training and holdout windows around one hypothesis.
#[derive(Debug, Clone)]
pub struct SplitWeighting<const N: usize> {
    /// Weighting of the training windows.
    pub training: Weighting<N>,
    /// Weighting of the holdout windows.
    pub holdout: Weighting<N>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// This context with other windows, to learn from and to judge on.
    pub(crate) fn on_windows(&self, data: Dataset<N>) -> Self {
        Self {
            arm: self.arm.clone(),
            prior: self.prior,
            scales: self.scales.clone(),
            training: WindowSet::new(data.clone()),
            holdout: WindowSet::new(data),
            noise: self.noise,
            sides: self.sides.clone(),
            custom_effects: self.custom_effects.clone(),
            progress: self.progress.aside(),
        }
    }

    /// The fitting problem on the training windows under this weighting.
    pub fn problem<'a>(&'a self, weighting: &'a Weighting<N>) -> FitProblem<'a, A, N, P> {
        self.on(&self.training, weighting)
    }

    /// The problem on the holdout windows under this weighting.
    pub fn judge<'a>(&'a self, weighting: &'a Weighting<N>) -> FitProblem<'a, A, N, P> {
        self.on(&self.holdout, weighting)
    }

    fn on<'a>(&'a self, sample: &'a WindowSet<N>, weighting: &'a Weighting<N>) -> FitProblem<'a, A, N, P> {
        FitProblem {
            arm: &self.arm,
            data: &sample.data,
            measured: &sample.measured,
            weighting,
            prior: &self.prior,
            scales: &self.scales,
            progress: &self.progress,
        }
    }

    /// Weightings around a hypothesis: initial states are fitted to it and the scales are those given.
    pub fn weights(&self, hypothesis: &Hypothesis<P>, scale: [f64; N]) -> SplitWeighting<N> {
        let around = |sample| self.weighting(sample, hypothesis, scale);
        let (training, holdout) = rayon::join(|| around(&self.training), || around(&self.holdout));
        SplitWeighting { training, holdout }
    }

    /// The weighting whose initial states have been fitted to the hypothesis once and relinearised there.
    pub fn weighting(
        &self,
        sample: &WindowSet<N>,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
    ) -> Weighting<N> {
        self.progress.check();
        let around = |offsets: Vec<InitialStateOffset<N>>| {
            let predicted = sample.data.predict(&self.arm, hypothesis, &offsets);
            let weighting = Weighting::new(&sample.data, &self.arm, hypothesis, scale, offsets, &predicted);
            let residual = weighting.residual(&sample.measured, &predicted);
            (weighting, residual)
        };
        let (rough, residual) = around(sample.data.zero_offsets());
        let offsets = bounded(&sample.data, rough.refit_initial_states(&sample.data, &residual));
        let (weighting, residual) = around(offsets);
        weighting.robust(&sample.data, &residual)
    }

    /// Fits with scales that follow the residual, from rough scales down to the residual's own.
    pub fn settle(&self, start: &Hypothesis<P>, scale: [f64; N]) -> (Fit<P>, SplitWeighting<N>) {
        self.progress.begin(Phase::Refit, MAX_ROUNDS + 1);
        let mut scale = scale;
        let mut hypothesis = start.clone();
        loop_rounds(|round| {
            let weighting = self.weighting(&self.training, &hypothesis, scale);
            let fit = self.problem(&weighting).solve(&hypothesis, Effort::ROUGH);
            let next = self.residual_scale(&weighting, &fit.hypothesis);
            hypothesis = fit.hypothesis.clone();
            let change = (0..N).map(|j| (next[j] / scale[j]).max(scale[j] / next[j])).fold(1.0, f64::max);
            scale = next;
            change < SETTLED || round == MAX_ROUNDS
        });
        let weights = self.weights(&hypothesis, scale);
        let fit = self.problem(&weights.training).solve(&hypothesis, Effort::FULL);
        (fit, weights)
    }

    /// Scale of each joint's residual under a hypothesis: its RMS once initial states are fitted, widened by its correlation in time,
    /// and never under the measurement's noise.
    pub fn residual_scale(&self, weighting: &Weighting<N>, hypothesis: &Hypothesis<P>) -> [f64; N] {
        let problem = self.problem(weighting);
        let residual = problem.residual(hypothesis);
        let left = weighting.remainder(&self.training.data, &residual);
        std::array::from_fn(|j| {
            let windows = self.training.data.windows.iter().map(|w| {
                left[w.range()]
                    .iter()
                    .skip(j)
                    .step_by(N)
                    .map(|x| x * weighting.scale[j])
                    .collect::<Vec<f64>>()
            });
            correlated_rms(&windows.collect::<Vec<_>>(), &weighting.robust_weight).max(self.noise[j])
        })
    }

    /// First scales: the typical window's RMS error of the arm file as it is.
    pub fn rough_scale(&self, hypothesis: &Hypothesis<P>) -> [f64; N] {
        let data = &self.training.data;
        let predicted = data.predict(&self.arm, hypothesis, &data.zero_offsets());
        std::array::from_fn(|j| {
            let window_rms = data.windows.iter().map(|w| {
                let pairs = self.training.measured[w.range()].iter().zip(&predicted[w.range()]);
                let squares: f64 = pairs.skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum();
                (squares / w.rows() as f64).sqrt()
            });
            crate::log::track::median(window_rms.collect()).max(self.noise[j])
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

/// Corrections of initial states, at most twenty standard deviations of the measured one; beyond, the model of the window is at fault.
fn bounded<const N: usize>(
    data: &Dataset<N>,
    offsets: Vec<InitialStateOffset<N>>,
) -> Vec<InitialStateOffset<N>> {
    let limit = |x: f64, variance: f64| x.clamp(-20.0 * variance.sqrt(), 20.0 * variance.sqrt());
    let mut offsets = offsets;
    for (shift, window) in offsets.iter_mut().zip(&data.windows) {
        for j in 0..N {
            let [vq, _, vdq] = window.initial_state.covariance[j];
            shift.q[j] = limit(shift.q[j], vq);
            shift.dq[j] = limit(shift.dq[j], vdq);
        }
    }
    offsets
}

/// RMS of pooled windows by their robust weights, times the square root of the autocorrelation time in samples (at least one).
fn correlated_rms(windows: &[Vec<f64>], robust_weight: &[f64]) -> f64 {
    let moment = |lag: usize| -> f64 {
        let product = |w: &Vec<f64>| w.iter().zip(w.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
        windows.iter().zip(robust_weight).map(|(w, robust_weight)| robust_weight * product(w)).sum()
    };
    let count: f64 =
        windows.iter().zip(robust_weight).map(|(w, robust_weight)| robust_weight * w.len() as f64).sum();
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
