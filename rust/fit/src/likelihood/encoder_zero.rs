//! Encoder zeros of recordings: nuisance parameters of the fit.
//!
//! An incremental encoder finds its zero anew at every start of a robot, with a random error. The error shared by all recordings is a question about
//! the arm (an encoder offset, a tilted base) and is left to the candidates. Differences between recordings are random effects with mean zero and one
//! standard deviation per joint, estimated from the training recordings by expectation maximisation with the uncertainty of the shared part
//! (restricted maximum likelihood; Laird and Ware 1982, Biometrics 38, section 4); a recording's zero is its posterior mean. Where recordings do not
//! differ, the standard deviation and the zeros go to zero.

use crate::likelihood::solve::inverse_of_seen;
use crate::likelihood::weighting::Gram;
use crate::predict::window::{Dataset, InitialStateOffset};
use nalgebra::{DMatrix, DVector, SMatrix, SVector};

/// Upper bound and initial value of the standard deviation of encoder zeros between recordings, rad or m: six degrees, as of an arm that is set to
/// its zero by hand against friction (docs/real-arm.md). Larger differences are not scatter but a different zero, which the checks of the input look
/// for.
const LARGEST_SPREAD: f64 = 0.1;

/// Number of iterations of expectation maximisation: a non-zero standard deviation of the encoder zeros converges in tens of them, one that vanishes
/// approaches zero in hundreds.
const EM_ITERATIONS: usize = 300;

/// Prior odds that a joint whose encoder zeros differ between recordings also has an encoder offset shared by all of them. With odds of 1, the mean
/// zero of three or four recordings is named as an offset with probability 0.67 and 0.75 on arms without an offset; with 0.01, an offset of four
/// times the scatter of three recordings is doubtful.
const SHARED: f64 = 0.1;

/// Encoder zeros of recordings, and the normal distribution that they were drawn from.
#[derive(Debug, Clone)]
pub struct EncoderZeros<const N: usize> {
    /// Name of each recording, and its encoder zeros with their standard deviations: what an encoder shows where the model's position is zero, rad or
    /// m.
    pub recordings: Vec<RecordingZero<N>>,
    /// Standard deviation of each joint's zero between recordings, rad or m.
    pub spread: [f64; N],
    /// Mean of each joint's zeros over the training recordings where it stands out of their scatter, else 0, rad or m; predictions do not contain it.
    common: SVector<f64, N>,
}

/// Encoder zeros of one recording, with their standard deviations.
#[derive(Debug, Clone)]
pub struct RecordingZero<const N: usize> {
    /// Name of the recording.
    pub source: String,
    /// Encoder zero of each joint, rad or m: what the encoder shows where the model's position is zero.
    pub zero: SVector<f64, N>,
    /// Standard deviation of the encoder zero of each joint, rad or m.
    pub sigma: SVector<f64, N>,
}

/// Likelihood of one recording's encoder zeros: curvature of the negative log-likelihood, and slope of the log-likelihood at zeros of 0.
#[derive(Debug, Clone)]
struct Evidence<const N: usize> {
    source: String,
    precision: SMatrix<f64, N, N>,
    score: SVector<f64, N>,
}

impl<const N: usize> EncoderZeros<N> {
    /// Encoder zeros of 0 in all recordings.
    pub fn none() -> Self {
        Self { recordings: Vec::new(), spread: [0.0; N], common: SVector::zeros() }
    }

    /// Encoder zero of a recording per joint, rad or m; zero for an unknown recording.
    pub fn of(&self, source: &str) -> SVector<f64, N> {
        self.recordings.iter().find(|r| r.source == source).map_or_else(SVector::zeros, |r| r.zero)
    }

    /// Initial-state offset of every window of a dataset: the encoder zeros of the window's recording, and initial positions and velocities as
    /// measured.
    pub fn offsets(&self, data: &Dataset<N>) -> Vec<InitialStateOffset<N>> {
        let of_track: Vec<SVector<f64, N>> = data.tracks.iter().map(|track| self.of(&track.source)).collect();
        let offset =
            |track: usize| InitialStateOffset { zero: of_track[track], ..InitialStateOffset::none() };
        data.windows.iter().map(|window| offset(window.track)).collect()
    }

    /// Whether a dataset has logs of more than one recording, so that encoder zeros that differ can be distinguished from an offset that all share.
    pub fn can_be_told_from(data: &Dataset<N>) -> bool {
        data.tracks.iter().any(|track| track.source != data.tracks[0].source)
    }

    /// Whether an encoder zero has been estimated for every recording of a dataset.
    pub fn knows_all(&self, data: &Dataset<N>) -> bool {
        data.tracks.iter().all(|track| self.recordings.iter().any(|r| r.source == track.source))
    }

    /// Encoder zeros of the training recordings, and their distribution over recordings, from the inner products `gram` of the derivatives of the
    /// predictions by the zeros, taken at the zeros of `self`.
    ///
    /// A mean of the zeros that does not stand out of their scatter counts as part of the scatter; a larger mean is left for the candidates to
    /// explain.
    pub(crate) fn of_training(&self, data: &Dataset<N>, gram: &Gram) -> Self {
        let evidence = self.evidence(data, gram);
        let around_mean = Self::distribution(&evidence, [true; N]);
        let stands_out =
            |j: usize| around_mean.odds_of_shared(j, around_mean.common[j]).is_none_or(|odds| odds > 1.0);
        let has_mean: [bool; N] = std::array::from_fn(stands_out);
        if has_mean == [true; N] { around_mean } else { Self::distribution(&evidence, has_mean) }
    }

    /// Distribution of encoder zeros over recordings, and each recording's zero, by expectation maximisation. The mean of the distribution is
    /// estimated at the joints marked in `has_mean` and zero at the others.
    fn distribution(evidence: &[Evidence<N>], has_mean: [bool; N]) -> Self {
        let mut found = Self { spread: [LARGEST_SPREAD; N], ..Self::none() };
        for _ in 0..EM_ITERATIONS {
            let (common, of_common) = found.shared(evidence, has_mean);
            found.common = common;
            let expected = |e: &Evidence<N>| {
                let (zero, covariance) = found.posterior(e);
                let carried = covariance * e.precision;
                zero.map(|z| z * z) + (covariance + carried * of_common * carried.transpose()).diagonal()
            };
            let squares: SVector<f64, N> = evidence.iter().map(expected).sum();
            found.spread = std::array::from_fn(|j| {
                (squares[j].max(0.0) / evidence.len() as f64).sqrt().min(LARGEST_SPREAD)
            });
        }
        found.recordings = evidence.iter().map(|e| found.recording(e)).collect();
        found
    }

    /// The first `known` encoder zeros, and estimates of the zeros of the dataset's other recordings, with the distribution of the known zeros as
    /// prior.
    pub(crate) fn and_of_others(&self, data: &Dataset<N>, gram: &Gram, known: usize) -> Self {
        let mut found = self.clone();
        found.recordings.truncate(known);
        let others: Vec<RecordingZero<N>> = self
            .evidence(data, gram)
            .iter()
            .filter(|e| found.recordings.iter().all(|r| r.source != e.source))
            .map(|e| self.recording(e))
            .collect();
        found.recordings.extend(others);
        found
    }

    /// Odds that the encoder zeros of joint `j`, with `shared`, rad or m, added to each, have a non-zero mean rather than mean zero: `SHARED` times
    /// the likelihood ratio by the Bayesian information criterion of a normal sample (Schwarz 1978; Student's t test). `None` where recordings do not
    /// differ.
    pub fn odds_of_shared(&self, j: usize, shared: f64) -> Option<f64> {
        let n = self.recordings.len() as f64;
        if n < 2.0 || self.spread[j] <= 0.0 {
            return None;
        }
        let seen = || self.recordings.iter().map(|r| shared + r.zero[j]);
        let mean = seen().sum::<f64>() / n;
        let own: f64 = self.recordings.iter().map(|r| r.sigma[j].powi(2)).sum();
        let variance = (seen().map(|x| (x - mean).powi(2)).sum::<f64>() + own) / n;
        Some(SHARED * (1.0 + mean * mean / variance).powf(0.5 * n) / n.sqrt())
    }

    /// Likelihood of each recording's encoder zeros, from the inner products `gram` of the derivatives of the predictions by the zeros, summed over
    /// the recording's windows.
    fn evidence(&self, data: &Dataset<N>, gram: &Gram) -> Vec<Evidence<N>> {
        let mut found: Vec<Evidence<N>> = Vec::new();
        let joints: Vec<usize> = (0..N).collect();
        for (index, window) in data.windows.iter().enumerate() {
            let source = &data.tracks[window.track].source;
            let within = gram.within(index, &joints, &[1.0; N]);
            let precision = SMatrix::<f64, N, N>::from_fn(|a, b| within[(a, b)]);
            let slope = SVector::<f64, N>::from_fn(|j, _| gram.scores[index][j]);
            let score = slope + precision * self.of(source);
            match found.iter_mut().find(|e| e.source == *source) {
                Some(of_recording) => {
                    of_recording.precision += precision;
                    of_recording.score += score;
                }
                None => found.push(Evidence { source: source.clone(), precision, score }),
            }
        }
        found
    }

    /// Covariance of encoder zeros between recordings (diagonal).
    fn between(&self) -> SMatrix<f64, N, N> {
        SMatrix::from_diagonal(&SVector::from(self.spread.map(|s| s * s)))
    }

    /// Posterior mean and covariance of one recording's encoder zero; in a form without division by a vanishing spread.
    fn posterior(&self, evidence: &Evidence<N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        let between = self.between();
        let covariance = (SMatrix::identity() + between * evidence.precision)
            .try_inverse()
            .map_or_else(SMatrix::zeros, |inverse| inverse * between);
        (covariance * (evidence.score - evidence.precision * self.common), covariance)
    }

    fn recording(&self, evidence: &Evidence<N>) -> RecordingZero<N> {
        let (zero, covariance) = self.posterior(evidence);
        let sigma = SVector::from_fn(|j, _| covariance[(j, j)].max(0.0).sqrt());
        RecordingZero { source: evidence.source.clone(), zero, sigma }
    }

    /// Mean of the encoder zeros over all recordings and its covariance, by generalised least squares: weights are inverse to the scatter between
    /// recordings plus each recording's own covariance.
    fn shared(&self, evidence: &[Evidence<N>], has_mean: [bool; N]) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        let mut normal = DMatrix::<f64>::zeros(N, N);
        let mut right = DVector::<f64>::zeros(N);
        for e in evidence {
            let beside = SMatrix::<f64, N, N>::identity() + e.precision * self.between();
            let Some(inverse) = beside.try_inverse() else { continue };
            let (precision, score) = (inverse * e.precision, inverse * e.score);
            for a in (0..N).filter(|a| has_mean[*a]) {
                right[a] += score[a];
                (0..N).filter(|b| has_mean[*b]).for_each(|b| normal[(a, b)] += precision[(a, b)]);
            }
        }
        let Some(inverse) = inverse_of_seen(&normal) else { return (SVector::zeros(), SMatrix::zeros()) };
        let shared = &inverse * right;
        (SVector::from_fn(|j, _| shared[j]), SMatrix::from_fn(|a, b| inverse[(a, b)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Encoder zeros estimated from recordings with the likelihoods of the given zeros, each with standard deviation `sigma`.
    fn seen(zeros: &[f64], sigma: f64) -> EncoderZeros<1> {
        let track = |index: usize| {
            Track::new(&index.to_string(), &TIMES, &[0.0; TIMES.len()], &[0.0; TIMES.len()], Some([1e-3]))
        };
        let tracks: Vec<Track<1>> = (0..zeros.len()).map(track).collect();
        let window = |(track, _): (usize, &f64)| Window {
            track,
            first: 0,
            last: 1,
            offset: track,
            initial_state: tracks[track].initial_state(0),
        };
        let windows = zeros.iter().enumerate().map(window).collect();
        let data = Dataset { windows, rows: zeros.len(), tracks: tracks.clone() };
        let precision = 1.0 / (sigma * sigma);
        let products =
            |zero: &f64| vec![precision, precision * zero, precision * zero, precision * zero * zero];
        EncoderZeros::none().of_training(&data, &Gram::of(zeros.iter().map(products).collect(), 1))
    }

    use crate::log::track::Track;
    use crate::predict::window::Window;

    const TIMES: [f64; 40] = {
        let mut t = [0.0; 40];
        let mut k = 0;
        while k < t.len() {
            t[k] = k as f64 * 1e-3;
            k += 1;
        }
        t
    };

    #[test]
    fn differences_are_zeros_and_what_is_shared_beyond_them_is_not() {
        let found = seen(&[0.103, 0.100, 0.097], 1e-4);
        for (recording, wanted) in found.recordings.iter().zip([0.003, 0.0, -0.003]) {
            assert!((recording.zero[0] - wanted).abs() < 1e-4, "{recording:?}");
            assert!(recording.sigma[0] < 2e-4);
        }
        assert!((found.spread[0] - 0.003).abs() < 1e-4 && (found.common[0] - 0.1).abs() < 1e-4);
    }

    #[test]
    fn a_mean_within_the_scatter_is_a_part_of_it() {
        let seen_at = [0.03, -0.01, 0.02];
        let found = seen(&seen_at, 1e-4);
        assert_eq!(found.common[0], 0.0);
        assert_eq!(found.recordings.len(), 3);
        for (recording, wanted) in found.recordings.iter().zip(seen_at) {
            assert!((recording.zero[0] - wanted).abs() < 1e-4, "{recording:?}");
        }
    }

    #[test]
    fn scatter_within_the_errors_is_shrunk_away() {
        let found = seen(&[0.101, 0.100, 0.0995, 0.0995], 2e-3);
        assert!((found.common[0] - 0.1).abs() < 1e-3);
        assert!(found.recordings.iter().all(|r| r.zero[0].abs() < 2e-4), "{:?}", found.recordings);
    }

    #[test]
    fn what_is_shared_is_believed_as_far_as_it_stands_out_of_the_differences() {
        let found = seen(&[0.13, 0.10, 0.07], 1e-4);
        let odds = |shared: f64| found.odds_of_shared(0, shared).unwrap();
        assert!((odds(0.0) - SHARED / 3.0_f64.sqrt()).abs() < 1e-6, "no mean at all");
        assert!(odds(0.01) < SHARED && odds(-0.01) < SHARED, "less than the scatter");
        assert!(odds(0.1) > 3.0, "four times the scatter, of three recordings");
        assert!(EncoderZeros::<1>::none().odds_of_shared(0, 0.1).is_none());
    }

    #[test]
    fn what_is_far_off_counts_as_no_scatter() {
        let found = seen(&[3.0, 0.0, 0.0], 1e-2);
        assert!(found.spread[0] <= LARGEST_SPREAD);
    }
}
