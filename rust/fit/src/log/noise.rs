//! Standard deviation of a position measurement, for any motion of the arm and for samples held over several rows.
//!
//! The part of seven samples that no quintic explains is `e = sum_i w_i q_i / |w|` with the weights of the sixth divided difference, `w_i = 1 /
//! prod_{k != i} (t_i - t_k)`. For white noise the standard deviation of `e` is that of the noise (variance estimation by differences: Hall, Kay and
//! Titterington, Biometrika 77, 1990); the median size of `e` over a log is insensitive to outliers.
//!
//! White noise gives the same estimate from successive samples and from every second or fifth sample. Motion raises the estimate at wide strides;
//! positions held over `h` rows raise the estimate at every stride except multiples of `h`, but not that from the rows at which the position changes.
//! So errors only raise estimates: where one of these series of samples gives a clearly smaller estimate than successive samples, the smallest
//! estimate is the noise.

use crate::log::track::median;

/// Number of samples in one divided difference: a quintic fitted to so many leaves one degree of freedom.
const TAKEN: usize = 7;

/// Strides, in rows, between the samples of a divided difference: logs hold positions over up to 6 rows.
const STRIDES: [usize; 6] = [1, 2, 3, 4, 5, 6];

/// Ratio of the noise estimate from another series of samples to that from successive samples, below which the former is clearly smaller: six
/// estimates of one noise, each from a few hundred places in a log, differ by less.
const CLEARLY: f64 = 0.75;

/// Largest number of samples of a log around which its noise is estimated: the estimate is then good to three percent.
const PLACES: usize = 4000;

/// Least number of rows at which the position changes for these rows to be a series of samples of their own.
const FRESH: usize = 50;

/// Median of a chi-squared variable with one degree of freedom, whose mean is one.
const CHI_SQUARED_MEDIAN: f64 = 0.454_936;

/// Lower bound of the estimated standard deviation of a position measurement, rad or m, so that weights of residuals stay finite.
const MIN_POSITION_NOISE: f64 = 1e-9;

/// Noise of a position measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation of the position measurement, rad or m.
    pub sigma: f64,
    /// Whether the positions seem to be held over several rows: samples further apart, or the rows at which the position changes, give a clearly
    /// smaller estimate of the noise than successive rows.
    pub is_held: bool,
}

/// Noise of the measurement `q` at the times `t`, at least that of uniform rounding to `step` (zero where no step is known).
pub fn noise(t: &[f64], q: &[f64], step: f64) -> Noise {
    let adjacent = scatter(t, q, 1).unwrap_or(0.0);
    let (fresh_t, fresh_q) = fresh(t, q);
    let strided = STRIDES[1..].iter().filter_map(|stride| scatter(t, q, *stride));
    let held = (fresh_t.len() > FRESH).then(|| scatter(&fresh_t, &fresh_q, 1)).flatten();
    let least = strided.chain(held).fold(adjacent, f64::min);
    let white = if least < CLEARLY * adjacent { least } else { adjacent };
    let sigma = white.max(step / 12.0_f64.sqrt()).max(MIN_POSITION_NOISE);
    Noise { sigma, is_held: sigma < CLEARLY * adjacent }
}

/// Times and values of the samples at which the value changes.
fn fresh(t: &[f64], q: &[f64]) -> (Vec<f64>, Vec<f64>) {
    (1..t.len().min(q.len())).filter(|&k| q[k] != q[k - 1]).map(|k| (t[k], q[k])).unzip()
}

/// Noise estimate from divided differences of samples `stride` rows apart; `None` for a log that is too short.
fn scatter(t: &[f64], q: &[f64], stride: usize) -> Option<f64> {
    let last = t.len().checked_sub((TAKEN - 1) * stride)?;
    let squares: Vec<f64> =
        (0..last).step_by(last / PLACES + 1).map(|first| difference(t, q, first, stride).powi(2)).collect();
    (!squares.is_empty()).then(|| (median(squares) / CHI_SQUARED_MEDIAN).sqrt())
}

/// Normalised sixth divided difference of the samples `first`, `first + stride`, ...
fn difference(t: &[f64], q: &[f64], first: usize, stride: usize) -> f64 {
    let at = |i: usize| first + i * stride;
    let span = t[at(TAKEN - 1)] - t[first];
    let place = |i: usize| (t[at(i)] - t[first]) / span;
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 0..TAKEN {
        let apart: f64 = (0..TAKEN).filter(|k| *k != i).map(|k| place(i) - place(k)).product();
        let weight = apart.recip();
        sum += weight * (q[at(i)] - q[first]);
        squares += weight * weight;
    }
    sum / squares.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    const NOISE: f64 = 2e-4;

    fn noise_level(t: &[f64], q: &[f64], step: f64) -> f64 {
        noise(t, q, step).sigma
    }
    const PERIOD: f64 = 4e-3;

    /// Ten seconds of a motion of 1.2 rad at up to `hertz`, measured with Gaussian noise of standard deviation `noise`.
    fn log(hertz: f64, noise: f64) -> (Vec<f64>, Vec<f64>) {
        let mut random = Random(1);
        let t: Vec<f64> = (0..2500).map(|k| f64::from(k) * PERIOD).collect();
        let turn = std::f64::consts::TAU * hertz;
        let q = |t: &f64| 0.8 * (turn * t).sin() + 0.4 * (0.37 * turn * t).cos();
        let measured = t.iter().map(|t| q(t) + noise * random.normal()).collect();
        (t, measured)
    }

    fn on_grid(q: &[f64], step: f64) -> Vec<f64> {
        q.iter().map(|q| (q / step).round() * step).collect()
    }

    fn assert_near(found: f64, wanted: f64, what: &str) {
        assert!((0.85..1.2).contains(&(found / wanted)), "{what}: {found} against {wanted}");
    }

    #[test]
    fn white_noise_is_found_under_any_motion() {
        for hertz in [0.0, 0.3, 1.0, 3.0] {
            let (t, q) = log(hertz, NOISE);
            assert_near(noise_level(&t, &q, 0.0), NOISE, &format!("{hertz} Hz"));
        }
    }

    #[test]
    fn uneven_times_are_no_noise() {
        let (mut t, _) = log(0.0, 0.0);
        let mut random = Random(2);
        for t in &mut t {
            *t += 0.3 * PERIOD * random.below(1000) as f64 / 1000.0;
        }
        let mut measured = |t: &f64| (6.0 * t).sin() + NOISE * random.normal();
        let q: Vec<f64> = t.iter().map(&mut measured).collect();
        assert_near(noise_level(&t, &q, 0.0), NOISE, "uneven times");
    }

    #[test]
    fn rounding_to_an_encoder_step_is_its_noise() {
        let step = 3e-4;
        for hertz in [0.0, 0.02, 0.3, 1.0] {
            let (t, q) = log(hertz, 0.0);
            assert_near(
                noise_level(&t, &on_grid(&q, step), step),
                step / 12.0_f64.sqrt(),
                &format!("{hertz}"),
            );
        }
    }

    #[test]
    fn held_positions_are_no_noise() {
        let (t, q) = log(0.5, NOISE);
        for rows in [2, 3, 5] {
            let held: Vec<f64> = (0..q.len()).map(|k| q[k / rows * rows]).collect();
            assert_near(noise_level(&t, &held, 0.0), NOISE, &format!("held over {rows} rows"));
            assert!(noise(&t, &held, 0.0).is_held && !noise(&t, &q, 0.0).is_held);
        }
        let mut random = Random(3);
        let mut irregular = q.clone();
        for k in 1..q.len() {
            if random.below(3) > 0 {
                irregular[k] = irregular[k - 1];
            }
        }
        assert_near(noise_level(&t, &irregular, 0.0), NOISE, "held irregularly");
    }

    #[test]
    fn filtered_positions_are_not_better_than_their_encoder() {
        let step = 1e-3;
        let (t, q) = log(0.3, step);
        let smooth: Vec<f64> =
            (20..q.len() - 20).map(|k| q[k - 20..=k + 20].iter().sum::<f64>() / 41.0).collect();
        assert!(noise_level(&t[20..q.len() - 20], &smooth, 0.0) < 0.1 * step, "nothing is known of its step");
        assert!(noise_level(&t[20..q.len() - 20], &smooth, step) > 0.28 * step);
    }

    #[test]
    fn a_log_too_short_to_say_has_the_least_noise() {
        assert_eq!(noise_level(&[0.0, 1.0], &[0.0, 1.0], 0.0), MIN_POSITION_NOISE);
    }
}
