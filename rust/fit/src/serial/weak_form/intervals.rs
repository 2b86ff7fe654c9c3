//! A log as a sequence of sample intervals: state in the middle of each interval, mean torque over it, and the test functions of the weak form.
//!
//! With a smooth test function `phi` of compact support, the weak form of the equation of motion
//!
//! ```text
//! - int phi' M(q) dq dt + int phi (g - dK/dq + f) dt = int phi tau dt
//! ```
//!
//! needs no acceleration: this is the filtered dynamic regression of Reyes and Kelly (1997) with a symmetric filter of finite length in place of the
//! first-order one. Velocities in the momentum are differences of positions, which are exact means over a sample interval; friction and everything
//! else that depends on the sign of a velocity take the velocity from local cubics.

use crate::log::track::Track;
use std::f64::consts::PI;

/// Half width of a test function, s: its transfer function falls to one half at `0.5 / HALF_WIDTH_S`, here 10 Hz. Friction torques at a reversal are
/// smeared over the test function; the position noise in a row grows with the inverse square of the half width.
pub const HALF_WIDTH_S: f64 = 0.05;

/// Smallest half width of a test function, in sample periods.
const FEWEST_PERIODS: f64 = 5.0;

/// Distance between neighbouring test functions, in half widths.
const SPACING: f64 = 0.5;

/// Time from which residual torques count as independent, s, or twice the half width of the test functions if that is longer, as these overlap:
/// disturbances are correlated over 0.05 to 0.3 s, and a longer correlation comes from torques that are missing in the model.
const INDEPENDENT_S: f64 = 0.25;

/// Speed, in standard deviations of the measured velocity, below which a joint counts as at rest: the measured torque then only bounds the dry
/// friction.
const AT_REST_DEVIATIONS: f64 = 3.0;

/// Speed, relative to a joint's RMS speed, below which the joint counts as at rest: before it slides, it may creep under a torque below its Coulomb
/// level. At a reversal with a tenth of the largest acceleration a joint is this slow for only some milliseconds.
const AT_REST_SPEED: f64 = 0.01;

/// Time between two samples, in sample periods, beyond which the log counts as interrupted: no test function extends over the interruption.
const GAP: f64 = 3.5;

/// State in the middle of a sample interval and mean torque over it, by joint.
#[derive(Debug, Clone, Copy)]
pub struct Middle<const N: usize> {
    /// Time in the middle of the interval since the start of the log, s.
    pub t: f64,
    /// Length of the interval, s.
    pub h: f64,
    /// Positions in the middle of the interval, rad or m.
    pub q: [f64; N],
    /// Velocities in the middle of the interval from local cubics, rad/s or m/s.
    pub dq: [f64; N],
    /// Accelerations in the middle of the interval from local cubics, rad/s^2 or m/s^2.
    pub ddq: [f64; N],
    /// Mean velocities over the interval from differences of positions, rad/s or m/s.
    pub mean_dq: [f64; N],
    /// Mean torques over the interval, N m or N.
    pub tau: [f64; N],
    /// Whether each joint is at rest in the interval, so that its dry friction is unknown.
    pub rest: [bool; N],
}

/// A log as a sequence of sample intervals.
#[derive(Debug, Clone)]
pub struct Intervals<const N: usize> {
    /// States and torques in the middle of the sample intervals, in order of time.
    pub middles: Vec<Middle<N>>,
    /// Standard deviation of the position noise by joint, rad or m.
    pub noise: [f64; N],
    /// Speeds below which the joints count as at rest whatever their noise, rad/s or m/s.
    pub slow: [f64; N],
}

impl<const N: usize> Intervals<N> {
    /// The sample intervals of a log.
    pub fn new(track: &Track<N>) -> Self {
        let smoothed = track.smoothed();
        let begin = track.t.first().copied().unwrap_or(0.0);
        let slow: [f64; N] = std::array::from_fn(|j| {
            let square: f64 = smoothed.iter().map(|s| s[j].local.dq.powi(2)).sum();
            (AT_REST_SPEED * (square / smoothed.len().max(1) as f64).sqrt()).max(1e-9)
        });
        let middle = |k: usize| -> Middle<N> {
            let h = track.t[k + 1] - track.t[k];
            let (a, b) = (&smoothed[k], &smoothed[k + 1]);
            let dq: [f64; N] = std::array::from_fn(|j| 0.5 * (a[j].local.dq + b[j].local.dq));
            Middle {
                t: 0.5 * (track.t[k] + track.t[k + 1]) - begin,
                h,
                q: std::array::from_fn(|j| 0.5 * (track.q[k][j] + track.q[k + 1][j])),
                dq,
                ddq: std::array::from_fn(|j| 0.5 * (a[j].local.ddq + b[j].local.ddq)),
                mean_dq: std::array::from_fn(|j| (track.q[k + 1][j] - track.q[k][j]) / h),
                tau: std::array::from_fn(|j| track.held[k][j].mean()),
                rest: std::array::from_fn(|j| {
                    let deviation = track.noise[j] * a[j].local.covariance[2].sqrt();
                    dq[j].abs() < slow[j].max(AT_REST_DEVIATIONS * deviation)
                }),
            }
        };
        Self { middles: (0..track.len().saturating_sub(1)).map(middle).collect(), noise: track.noise, slow }
    }

    /// Test functions over the log, each of `half_width`, s, or wider where the log has few samples; `log` is the index of the log.
    pub fn test_functions(&self, log: usize, half_width: f64) -> Vec<TestFunction> {
        let period = crate::log::track::median(self.middles.iter().map(|m| m.h).collect());
        let half = half_width.max(FEWEST_PERIODS * period);
        let mut found = Vec::new();
        let mut first = 0;
        for k in 0..=self.middles.len() {
            if k < self.middles.len() && self.middles[k].h <= GAP * period {
                continue;
            }
            found.extend(self.over(log, first..k, half));
            first = k + 1;
        }
        found
    }

    fn over(&self, log: usize, stretch: std::ops::Range<usize>, half: f64) -> Vec<TestFunction> {
        let Some((a, b)) = self.middles.get(stretch.clone()).and_then(|m| Some((m.first()?, m.last()?)))
        else {
            return Vec::new();
        };
        let (begin, end) = (a.t - 0.5 * a.h, b.t + 0.5 * b.h);
        let count = ((end - begin - 2.0 * half) / (SPACING * half)).floor();
        let at = |i: usize| {
            let centre = begin + half * (1.0 + SPACING * i as f64);
            let inside = &self.middles[stretch.clone()];
            let first = stretch.start + inside.partition_point(|m| m.t + 0.5 * m.h <= centre - half);
            let last = stretch.start + inside.partition_point(|m| m.t - 0.5 * m.h < centre + half);
            TestFunction { log, first, last, centre, half }
        };
        if count < 0.0 { Vec::new() } else { (0..=count as usize).map(at).collect() }
    }
}

/// A test function of the weak form: a raised cosine of unit area over part of a log.
#[derive(Debug, Clone, Copy)]
pub struct TestFunction {
    /// Index of the log that the test function lies in.
    pub log: usize,
    /// Index of the first sample interval inside the test function.
    pub first: usize,
    /// Index behind the last sample interval inside the test function.
    pub last: usize,
    /// Time of the test function's maximum since the start of the log, s.
    pub centre: f64,
    half: f64,
}

impl TestFunction {
    /// Lag, in test functions, from which residual torques count as independent.
    pub fn independent(&self) -> usize {
        (INDEPENDENT_S.max(2.0 * self.half) / (SPACING * self.half)).round() as usize
    }

    /// Half width of the test function, s.
    pub fn half_width(&self) -> f64 {
        self.half
    }

    /// Integral of the test function over the sample interval `m`, dimensionless; the sum over all intervals is 1.
    pub fn weight<const N: usize>(&self, m: &Middle<N>) -> f64 {
        let area = |t: f64| {
            let x = ((t - self.centre) / self.half).clamp(-1.0, 1.0);
            0.5 * (x + (PI * x).sin() / PI)
        };
        area(m.t + 0.5 * m.h) - area(m.t - 0.5 * m.h)
    }

    /// Difference of the test function between end and start of the sample interval `m`, 1/s: the integral of its derivative.
    pub fn rise<const N: usize>(&self, m: &Middle<N>) -> f64 {
        self.value(m.t + 0.5 * m.h) - self.value(m.t - 0.5 * m.h)
    }

    /// Derivatives of a row of the weak form by the measured positions, N m/rad (N/m), sample by sample from the start of the test function's first
    /// interval on.
    ///
    /// The momentum in the row is `momentum`, an inertia, kg m^2 (kg), times the mean velocity, and the torque in the row is `stiffness`, N m/rad
    /// (N/m), times the position plus `damping`, N m s/rad (N s/m), times the velocity.
    pub fn on_positions<const N: usize>(
        &self,
        middles: &[Middle<N>],
        [momentum, stiffness, damping]: [f64; 3],
    ) -> Vec<f64> {
        let mut factors = vec![0.0; self.last - self.first + 1];
        for k in self.reach() {
            let (m, at) = (&middles[k], k - self.first);
            let (weight, rise) = (self.weight(m), self.rise(m));
            let slope = (damping * weight - momentum * rise) / m.h;
            factors[at] += 0.5 * stiffness * weight - slope;
            factors[at + 1] += 0.5 * stiffness * weight + slope;
        }
        factors
    }

    fn value(&self, t: f64) -> f64 {
        let x = ((t - self.centre) / self.half).clamp(-1.0, 1.0);
        0.5 * (1.0 + (PI * x).cos()) / self.half
    }

    /// Range of the sample intervals inside the test function.
    pub fn reach(&self) -> std::ops::Range<usize> {
        self.first..self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn falling(count: usize, h: f64) -> Track<1> {
        let t: Vec<f64> = (0..count).map(|k| h * k as f64 + 1e-4 * (k as f64).sin()).collect();
        let q: Vec<f64> = t.iter().map(|t| 0.5 * 3.0 * t * t).collect();
        Track::new("", &t, &q, &vec![1.0; count], Some([1e-9]))
    }

    #[test]
    fn residuals_are_independent_after_a_quarter_of_a_second_or_where_test_functions_end() {
        let lag = |half| TestFunction { log: 0, first: 0, last: 1, centre: 0.0, half }.independent();
        assert_eq!((lag(0.05), lag(0.4)), (10, 4));
    }

    #[test]
    fn test_functions_have_unit_area_and_no_net_rise() {
        let log = Intervals::new(&falling(400, 0.0025));
        let functions = log.test_functions(0, HALF_WIDTH_S);
        assert!(functions.len() > 30);
        for phi in functions {
            let area: f64 = phi.reach().map(|k| phi.weight(&log.middles[k])).sum();
            let rise: f64 = phi.reach().map(|k| phi.rise(&log.middles[k])).sum();
            assert!((area - 1.0).abs() < 1e-12 && rise.abs() < 1e-9, "{area} {rise}");
        }
    }

    #[test]
    fn the_weak_form_of_an_acceleration_is_the_acceleration() {
        let log = Intervals::new(&falling(400, 0.0025));
        for phi in log.test_functions(0, HALF_WIDTH_S) {
            let weak: f64 = phi.reach().map(|k| -phi.rise(&log.middles[k]) * log.middles[k].mean_dq[0]).sum();
            assert!((weak - 3.0).abs() < 1e-3, "{weak}");
        }
    }

    #[test]
    fn nothing_reaches_across_a_gap() {
        let mut track = falling(400, 0.0025);
        track.t.iter_mut().skip(200).for_each(|t| *t += 0.1);
        let log = Intervals::new(&track);
        assert!(log.test_functions(0, HALF_WIDTH_S).iter().all(|phi| !phi.reach().contains(&199)));
    }
}
