//! Context of a diagnosis: arm, prior, scales, training and holdout windows, and the weighting of their residuals.

use crate::likelihood::encoder_zero::EncoderZeros;
use crate::likelihood::scale::Scales;
use crate::likelihood::solve::{Effort, Fit, FitProblem, Prior};
use crate::likelihood::weighting::{Gram, Weighting, initial_state_sensitivities};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::numeric::products::rms;
use crate::predict::log_inputs::LogInputs;
use crate::predict::window::{Dataset, InitialStateOffset, Window};
use crate::progress::ProgressReporter;
use armgap_core::arm::Arm;
use armgap_core::transmission::Sides;

/// Rounds of alternating estimation of encoder zeros and parameters, to find how much of the training cost encoder zeros explain.
const ZERO_ROUNDS: usize = 2;

/// Gauss-Newton steps in the fit of the encoder zeros of holdout recordings; the zeros of training recordings take one step in each round of
/// re-weighting.
const HOLDOUT_ROUNDS: usize = 2;

/// Context of a diagnosis: the arm, its prior, scales, and windows.
pub struct DiagnosisContext<A, const N: usize, const P: usize> {
    /// Model of the arm (dynamics without effects).
    pub arm: A,
    /// Prior of the arm's parameters.
    pub prior: Prior<P>,
    /// Parameters from which the arm without effects is fitted too, besides those of the prior, SI.
    pub start: Option<[f64; P]>,
    /// Typical sizes of torques, speeds, positions and inertias on this arm and its logs.
    pub scales: Scales<N>,
    /// Windows of the training logs, to which hypotheses are fitted.
    pub training: WindowSet<N>,
    /// Windows of the holdout, on which causes are judged.
    pub holdout: WindowSet<N>,
    /// Length of the windows, s.
    pub horizon: f64,
    /// Standard deviation of the position measurement per joint, rad or m.
    pub noise: [f64; N],
    /// Per joint, the sides of the transmission that encoder and friction may be on, those with both on one side first.
    pub sides: [Vec<Sides>; N],
    /// Custom effects at their initial guesses.
    pub custom_effects: Vec<EffectInstance>,
    /// Receiver of progress reports, with cancellation.
    pub progress: ProgressReporter,
}

/// Windows of logs with their measured positions.
pub struct WindowSet<const N: usize> {
    /// Logs cut into windows.
    pub data: Dataset<N>,
    /// Measured positions of all windows, rad or m, by window, sample and joint.
    pub measured: Vec<f64>,
}

impl<const N: usize> WindowSet<N> {
    /// A window set of the given dataset, with its measured positions.
    pub fn new(data: Dataset<N>) -> Self {
        let measured = data.measured();
        Self { data, measured }
    }

    /// RMS prediction error of a hypothesis by joint, from the measured initial states, rad or m.
    pub fn errors<A: Arm<f64, N, P>, const P: usize>(&self, arm: &A, hypothesis: &Hypothesis<P>) -> Vec<f64> {
        rms::<N>(&self.measured, &self.predict(arm, hypothesis))
    }

    /// Predictions of a hypothesis from the measured initial states, by window, sample and joint, rad or m.
    fn predict<A: Arm<f64, N, P>, const P: usize>(&self, arm: &A, hypothesis: &Hypothesis<P>) -> Vec<f64> {
        self.data.predict(arm, hypothesis, &self.data.zero_offsets())
    }

    /// Predictions of no motion: the measured initial position of each window at all its samples, by window, sample and joint.
    pub fn still(&self) -> Vec<f64> {
        let window = |w: &Window<N>| w.initial_state.q.as_slice().repeat(w.rows());
        self.data.windows.iter().flat_map(window).collect()
    }

    /// Cost, with residuals in units of `scale`, of predicting that every joint stays at the initial position of its window.
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

/// Fitted encoder zeros, and the windows' initial-state offsets that were fitted together with them.
struct FittedZeros<const N: usize> {
    zeros: EncoderZeros<N>,
    offsets: Vec<InitialStateOffset<N>>,
    /// Inputs of the logs under the hypothesis.
    inputs: Option<LogInputs<N>>,
}

/// Predictions of a hypothesis linearised around given initial states.
struct Linearised<const N: usize> {
    /// Weighting with the initial states projected out, with all robust weights one.
    weighting: Weighting<N>,
    /// Whitened residual of the predictions.
    residual: Vec<f64>,
    /// Derivatives of the predictions by initial positions and velocities.
    sensitivities: Vec<Vec<f64>>,
    /// Inputs of the logs under the hypothesis.
    inputs: Option<LogInputs<N>>,
}

/// Inverse covariances of the windows' prediction errors under one hypothesis.
#[derive(Debug, Clone)]
pub struct SplitWeighting<const N: usize> {
    /// By which errors in the training windows are weighted.
    pub training: Weighting<N>,
    /// By which errors in the holdout windows are weighted.
    pub holdout: Weighting<N>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// A copy of this context with `data` as training and as holdout windows.
    pub(crate) fn on_windows(&self, data: Dataset<N>) -> Self {
        Self {
            arm: self.arm.clone(),
            prior: self.prior,
            start: self.start,
            scales: self.scales.clone(),
            training: WindowSet::new(data.clone()),
            holdout: WindowSet::new(data),
            horizon: self.horizon,
            noise: self.noise,
            sides: self.sides.clone(),
            custom_effects: self.custom_effects.clone(),
            progress: self.progress.aside(),
        }
    }

    /// All windows of the logs of `sample`, those in which pushes act too.
    pub(crate) fn all_windows(&self, sample: &WindowSet<N>) -> WindowSet<N> {
        WindowSet::new(Dataset::new(sample.data.tracks.clone(), self.horizon))
    }

    /// Fitting problem on the training windows with the weighting `weighting`.
    pub fn problem<'a>(&'a self, weighting: &'a Weighting<N>) -> FitProblem<'a, A, N, P> {
        self.on(&self.training, weighting)
    }

    /// Fitting problem on the holdout windows with the weighting `weighting`.
    pub fn judge<'a>(&'a self, weighting: &'a Weighting<N>) -> FitProblem<'a, A, N, P> {
        self.on(&self.holdout, weighting)
    }

    pub(crate) fn on<'a>(
        &'a self,
        sample: &'a WindowSet<N>,
        weighting: &'a Weighting<N>,
    ) -> FitProblem<'a, A, N, P> {
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

    /// Encoder zeros `training` of the training recordings, and zeros of the other recordings in `sample` fitted under a hypothesis; `scale` per
    /// joint, rad or m.
    pub(crate) fn zeros_beside(
        &self,
        sample: &WindowSet<N>,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
        training: &EncoderZeros<N>,
    ) -> EncoderZeros<N> {
        let mut zeros = training.clone();
        if training.recordings.is_empty() || training.knows_all(&sample.data) {
            return zeros;
        }
        let known = training.recordings.len();
        let others = |gram: &Gram, zeros: &EncoderZeros<N>| zeros.and_of_others(&sample.data, gram, known);
        for _ in 0..HOLDOUT_ROUNDS {
            zeros = self.fitting_zeros(sample, hypothesis, scale, &zeros, others).zeros;
        }
        zeros
    }

    /// Weightings of training and holdout windows with initial states fitted under a hypothesis, the residual scales `scale` per joint, rad or m, and
    /// the encoder zeros of `given`.
    pub fn reweighted(
        &self,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
        given: &SplitWeighting<N>,
    ) -> SplitWeighting<N> {
        let around = |sample, given: &Weighting<N>| self.weighting(sample, hypothesis, scale, &given.zeros);
        let (training, holdout) =
            rayon::join(|| around(&self.training, &given.training), || around(&self.holdout, &given.holdout));
        SplitWeighting { training, holdout }
    }

    /// Weighting of the training windows with initial states and, if `with_zeros`, encoder zeros (from `zeros`) fitted to the hypothesis.
    pub(super) fn training_weighting(
        &self,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
        zeros: &EncoderZeros<N>,
        with_zeros: bool,
    ) -> Weighting<N> {
        let sample = &self.training;
        if !with_zeros {
            return self.weighting(sample, hypothesis, scale, zeros);
        }
        let of_training = |gram: &Gram, zeros: &EncoderZeros<N>| zeros.of_training(&sample.data, gram);
        let FittedZeros { zeros, offsets, inputs } =
            self.fitting_zeros(sample, hypothesis, scale, zeros, of_training);
        let Linearised { weighting, residual, .. } =
            self.linearised(sample, hypothesis, scale, offsets, inputs.as_ref());
        weighting.robust(&sample.data, &residual).with_zeros(zeros)
    }

    /// Weighting of the windows `sample` with the encoder zeros `zeros`: initial states are fitted once under the hypothesis, and predictions
    /// linearised around these initial states.
    pub fn weighting(
        &self,
        sample: &WindowSet<N>,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
        zeros: &EncoderZeros<N>,
    ) -> Weighting<N> {
        let offsets = zeros.offsets(&sample.data);
        let rough = self.linearised(sample, hypothesis, scale, offsets, None);
        let offsets =
            bounded(&sample.data, rough.weighting.refit_initial_states(&sample.data, &rough.residual));
        let Linearised { weighting, residual, .. } =
            self.linearised(sample, hypothesis, scale, offsets, rough.inputs.as_ref());
        weighting.robust(&sample.data, &residual).with_zeros(zeros.clone())
    }

    /// Encoder zeros and initial-state offsets after one Gauss-Newton step under the hypothesis from the first guess `zeros`; `fitted` estimates the
    /// zeros from the inner products of the derivatives of the predictions by the zeros.
    fn fitting_zeros(
        &self,
        sample: &WindowSet<N>,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
        zeros: &EncoderZeros<N>,
        fitted: impl Fn(&Gram, &EncoderZeros<N>) -> EncoderZeros<N>,
    ) -> FittedZeros<N> {
        let data = &sample.data;
        let Linearised { weighting: rough, mut residual, sensitivities, inputs } =
            self.linearised(sample, hypothesis, scale, zeros.offsets(data), None);
        let rough = rough.robust(data, &residual);
        let columns = rough.zero_columns(&sensitivities);
        let views: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let zeros = fitted(&rough.gram(data, &views, &residual), zeros);
        let mut offsets = zeros.offsets(data);
        for ((window, new), old) in data.windows.iter().zip(&offsets).zip(&rough.offsets) {
            for (j, column) in columns.iter().enumerate() {
                let change = new.zero[j] - old.zero[j];
                let rows = residual[window.range()].iter_mut().zip(&column[window.range()]);
                rows.for_each(|(r, c)| *r -= change * c);
            }
        }
        let refitted = bounded(data, rough.refit_initial_states(data, &residual));
        for (offset, refitted) in offsets.iter_mut().zip(refitted) {
            *offset = InitialStateOffset { zero: offset.zero, ..refitted };
        }
        FittedZeros { zeros, offsets, inputs }
    }

    /// Weighting of the windows `sample` around their measured initial states, with all robust weights one.
    pub(super) fn equal_weighting(
        &self,
        sample: &WindowSet<N>,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
    ) -> Weighting<N> {
        self.linearised(sample, hypothesis, scale, sample.data.zero_offsets(), None).weighting
    }

    /// Predictions linearised around initial states with the offsets `offsets`; `known` are the inputs of the logs under the hypothesis, if known.
    fn linearised(
        &self,
        sample: &WindowSet<N>,
        hypothesis: &Hypothesis<P>,
        scale: [f64; N],
        offsets: Vec<InitialStateOffset<N>>,
        known: Option<&LogInputs<N>>,
    ) -> Linearised<N> {
        self.progress.check();
        let (data, arm) = (&sample.data, &self.arm);
        let (predicted, inputs) = data.predict_beside(arm, hypothesis, &offsets, known);
        let sensitivities =
            initial_state_sensitivities(data, arm, hypothesis, &offsets, &predicted, inputs.as_ref());
        let weighting = Weighting::from_sensitivities(&sample.data, &sensitivities, scale, offsets);
        let residual = weighting.residual(&sample.measured, &predicted);
        Linearised { weighting, residual, sensitivities, inputs }
    }

    /// Student-t cost of the training windows after parameters and encoder zeros of the recordings are estimated together, with the scales and the
    /// median window cost of `weighting`, which contains no encoder zeros.
    pub(crate) fn cost_with_zeros(&self, fit: &Fit<P>, weighting: &Weighting<N>) -> f64 {
        let mut beside = weighting.clone();
        let mut hypothesis = fit.hypothesis.clone();
        for _ in 0..ZERO_ROUNDS {
            beside = self.training_weighting(&hypothesis, weighting.scale, &beside.zeros, true);
            hypothesis = self.problem(&beside).solve(&hypothesis, Effort::ROUGH).hypothesis;
        }
        let costs = self.problem(&beside).raw_costs(&hypothesis);
        costs.into_iter().map(|cost| weighting.student_t_cost(cost)).sum()
    }

    /// Scale of each joint's residual under a hypothesis, rad or m: RMS residual after the fit of initial states, times the square root of its
    /// autocorrelation time in samples, and at least the noise of the position measurement.
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

    /// Initial scale of each joint's residual, rad or m: median over windows of the RMS prediction error of `hypothesis`, before any fit, and at
    /// least the measurement noise.
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

/// Offsets of initial states limited to twenty standard deviations of the measured state; a larger offset would mean that the model is wrong in the
/// window.
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

/// RMS residual over all windows, weighted by their robust weights, times the square root of the residual's autocorrelation time in samples (at least
/// one).
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
