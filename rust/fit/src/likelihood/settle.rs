//! Alternate fits of a model and re-estimates of the scales of its residuals, until both agree.

use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::likelihood::solve::{Effort, Fit};
use crate::likelihood::weighting::Weighting;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::rms;
use crate::predict::window::Window;
use crate::progress::Phase;
use armgap_core::arm::Arm;
use rayon::prelude::*;

/// Largest number of rounds in which, alternately, a model is fitted and the weights of its residuals are computed.
const MAX_ROUNDS: usize = 5;

/// Ratio of successive residual scales of every joint below which re-weighting ends.
const SETTLED_SCALE_RATIO: f64 = 1.1;

/// Largest ratio of the prediction errors from measured initial states after re-weighting from the noise to those after re-weighting from larger scales.
/// Errors of the initial states make most of either, so they are alike where the second model is right; where errors of the model passed for errors of
/// initial states, predictions of the second missed by 0.25 rad.
const MAX_MISSED_RATIO: f64 = 1.5;

/// State of alternate fits and re-estimates.
#[derive(Clone)]
struct Rounds<const N: usize, const P: usize> {
    hypothesis: Hypothesis<P>,
    /// Scale of each joint's residual, rad or m.
    scale: [f64; N],
    zeros: EncoderZeros<N>,
}

impl<const N: usize, const P: usize> Rounds<N, P> {
    /// First round from a model and scales, without encoder zeros.
    fn new(start: &Hypothesis<P>, scale: [f64; N]) -> Self {
        Self { hypothesis: start.clone(), scale, zeros: EncoderZeros::none() }
    }
}

/// A model whose fit and residual scales agree.
struct Settled<const N: usize, const P: usize> {
    hypothesis: Hypothesis<P>,
    /// Scale of each joint's residual, rad or m.
    scale: [f64; N],
    /// Weighting of the training windows with these scales.
    weighting: Weighting<N>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Fits the model and re-estimates the residual scales alternately, from the first scales `scale` per joint, rad or m, until both agree, with
    /// encoder zeros that may differ between recordings.
    pub fn settle(&self, start: &Hypothesis<P>, scale: [f64; N]) -> (Fit<P>, SplitWeighting<N>) {
        self.settled(start, scale, EncoderZeros::can_be_told_from(&self.training.data))
    }

    /// Fits the model and re-estimates the residual scales, rad or m, alternately until both agree, with the same encoder zeros in all recordings.
    pub(crate) fn settle_without_zeros(
        &self,
        start: &Hypothesis<P>,
        scale: [f64; N],
    ) -> (Fit<P>, SplitWeighting<N>) {
        self.settled(start, scale, false)
    }

    /// Fits the arm without effects from several starting points; returns the starting point and the fit with the smallest prediction errors on the
    /// training logs, by the geometric mean over their windows: an unmodelled effect, such as a drive that saturates, may make most of the RMS error in
    /// a few windows.
    ///
    /// Scales and weights of the residual are estimated with the parameters, so the cost has several minima. Where the arm file's parameters predict
    /// the logs badly, the scale is large, the prior outweighs the residual, and the parameters hardly move. Where they predict large motions badly and
    /// small ones well, robust weights take the large motions for outliers. So fits start from the arm file's parameters, from others that are given,
    /// and with `from_least_squares` from those of a fit without robust weights.
    pub(crate) fn settle_rigid(&self, from_least_squares: bool) -> (Hypothesis<P>, Fit<P>) {
        let with_zeros = EncoderZeros::can_be_told_from(&self.training.data);
        let fitted = |from: Hypothesis<P>| {
            // Fits are compared below, and by checks of the input: with scales from the noise, a wrong unit of noisy torques was not found.
            let first = Rounds::new(&from, self.rough_scale(&from));
            let settled = self.weighted(self.reweighted_until_settled(first, with_zeros).0, with_zeros);
            let fit = self.problem(&settled.weighting).solve(&settled.hypothesis, Effort::FULL);
            let missed = self.missed(&fit.hypothesis, &settled.weighting.zeros);
            (from, fit, missed)
        };
        let nominal = Hypothesis::rigid(self.prior.theta);
        let given = self.start.filter(|start| *start != self.prior.theta).map(Hypothesis::rigid);
        let from_nominal = || fitted(nominal.clone());
        let others = || {
            let initial = [from_least_squares.then(|| self.least_squares(&nominal)), given];
            initial.into_par_iter().flatten().map(fitted).collect::<Vec<_>>()
        };
        let (first, others) = rayon::join(from_nominal, others);
        let (from, fit, _) =
            others.into_iter().fold(first, |best, other| if other.2 < best.2 { other } else { best });
        (from, fit)
    }

    /// Least-squares fit to the training windows, all with the same weight, from the model `start`.
    fn least_squares(&self, start: &Hypothesis<P>) -> Hypothesis<P> {
        let weighting = self.equal_weighting(&self.training, start, self.rough_scale(start));
        self.problem(&weighting).solve(start, Effort::FULL).hypothesis
    }

    /// The fit to the training windows with residual scales that agree with it, next to the model `start` and its weighting `around`, and with encoder
    /// zeros if that has some.
    pub(crate) fn settled_next_to(&self, start: &Hypothesis<P>, around: &Weighting<N>) -> Fit<P> {
        let with_zeros = !around.zeros.recordings.is_empty();
        let first = Rounds { zeros: around.zeros.clone(), ..Rounds::new(start, around.scale) };
        let Settled { hypothesis, weighting, .. } =
            self.weighted(self.reweighted_until_settled(first, with_zeros).0, with_zeros);
        self.problem(&weighting).solve(&hypothesis, Effort::FULL)
    }

    fn settled(
        &self,
        start: &Hypothesis<P>,
        scale: [f64; N],
        with_zeros: bool,
    ) -> (Fit<P>, SplitWeighting<N>) {
        let Settled { hypothesis, scale, weighting: training } =
            self.settled_weighting(start, scale, with_zeros);
        let holdout = || {
            let zeros = self.zeros_beside(&self.holdout, &hypothesis, scale, &training.zeros);
            self.weighting(&self.holdout, &hypothesis, scale, &zeros)
        };
        let fit = || self.problem(&training).solve(&hypothesis, Effort::FULL);
        let (holdout, fit) = rayon::join(holdout, fit);
        (fit, SplitWeighting { training, holdout })
    }

    /// Model, residual scales and weighting of the training windows after alternate fits and re-estimates of the scales.
    ///
    /// Re-weighting has several fixed points: at large scales the windows that the model misses most weigh as much as the others and keep the scales
    /// large. So it starts from `scale` and then from the noise, and the smaller scales hold, as in S-estimation (Rousseeuw and Yohai 1984), if the
    /// predictions from measured initial states do not miss much more: at the noise, errors of the model may pass for errors of initial states.
    fn settled_weighting(&self, start: &Hypothesis<P>, scale: [f64; N], with_zeros: bool) -> Settled<N, P> {
        let (mut last, _) = self.reweighted_until_settled(Rounds::new(start, scale), with_zeros);
        if (0..N).any(|j| last.scale[j] > SETTLED_SCALE_RATIO * self.noise[j]) {
            let from_noise = Rounds { scale: self.noise, ..last.clone() };
            let (other, agrees) = self.reweighted_until_settled(from_noise, with_zeros);
            let ratio: f64 = (0..N).map(|j| last.scale[j] / other.scale[j]).product();
            let missed = |rounds: &Rounds<N, P>| self.missed(&rounds.hypothesis, &rounds.zeros);
            if agrees && ratio > SETTLED_SCALE_RATIO && missed(&other) < MAX_MISSED_RATIO * missed(&last) {
                last = other;
            }
        }
        self.weighted(last, with_zeros)
    }

    /// The model and scales of the last round with the weighting of the training windows around them.
    fn weighted(&self, last: Rounds<N, P>, with_zeros: bool) -> Settled<N, P> {
        let Rounds { hypothesis, scale, zeros } = last;
        let weighting = self.training_weighting(&hypothesis, scale, &zeros, with_zeros);
        Settled { hypothesis, scale, weighting }
    }

    /// Alternate fits to the training windows and re-estimates of the scales from `first`, and whether both agree after at most `MAX_ROUNDS`.
    fn reweighted_until_settled(&self, first: Rounds<N, P>, with_zeros: bool) -> (Rounds<N, P>, bool) {
        self.progress.begin(Phase::Refit, MAX_ROUNDS + 1);
        let (Rounds { mut hypothesis, mut scale, mut zeros }, mut agree) = (first, false);
        loop_rounds(|round| {
            let weighting = self.training_weighting(&hypothesis, scale, &zeros, with_zeros);
            zeros.clone_from(&weighting.zeros);
            let fit = self.problem(&weighting).solve(&hypothesis, Effort::ROUGH);
            let next = self.residual_scale(&weighting, &fit.hypothesis);
            hypothesis = fit.hypothesis.clone();
            agree = (0..N).all(|j| (next[j] / scale[j]).max(scale[j] / next[j]) < SETTLED_SCALE_RATIO);
            scale = next;
            agree || round == MAX_ROUNDS
        });
        (Rounds { hypothesis, scale, zeros }, agree)
    }

    /// Geometric mean over training windows and joints of the RMS prediction error from measured initial states, relative to the noise and counted as
    /// no less than that.
    fn missed(&self, hypothesis: &Hypothesis<P>, zeros: &EncoderZeros<N>) -> f64 {
        let data = &self.training.data;
        let predicted = data.predict(&self.arm, hypothesis, &zeros.offsets(data));
        let of_window = |w: &Window<N>| rms::<N>(&self.training.measured[w.range()], &predicted[w.range()]);
        let errors = data.windows.iter().flat_map(of_window).zip(self.noise.iter().cycle());
        let logarithms: f64 = errors.map(|(error, noise)| (error / noise).max(1.0).ln()).sum();
        (logarithms / (N * data.windows.len()) as f64).exp()
    }
}

/// Calls `round(1)`, `round(2)`, … until a call returns true.
fn loop_rounds(mut round: impl FnMut(usize) -> bool) {
    let mut count = 1;
    while !round(count) {
        count += 1;
    }
}
