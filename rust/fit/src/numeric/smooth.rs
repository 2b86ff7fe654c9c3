//! Local cubic least squares with uneven sample times (Savitzky and Golay 1964, generalised to any sample times).

use nalgebra::{Matrix4, Vector4};

/// Position and derivatives from a local cubic at its centre sample, with their variances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Local {
    /// Position, rad or m.
    pub q: f64,
    /// Velocity, rad/s or m/s.
    pub dq: f64,
    /// Acceleration, rad/s^2 or m/s^2.
    pub ddq: f64,
    /// Variance of position, covariance of position and velocity, and variance of velocity, for a measurement of variance one.
    pub covariance: [f64; 3],
    /// Variance of the acceleration, for a measurement of variance one.
    pub ddq_variance: f64,
    /// Mean square residual of the local cubic per degree of freedom, rad^2 or m^2.
    pub misfit: f64,
}

/// Ratio of a sample interval to the mean interval from which it is a gap in the log, over which no local cubic reaches.
pub const HOLE: f64 = 10.0;

/// Index of the first sample and number of samples of a local cubic of half width `half` around `at`: `half` on either side; at an end of the log
/// or a gap, samples missing on one side are taken on the other.
pub fn samples_near(t: &[f64], at: usize, half: usize) -> (usize, usize) {
    let longest = HOLE * (t[t.len() - 1] - t[0]) / (t.len() - 1).max(1) as f64;
    let joined = |k: usize| t[k + 1] - t[k] <= longest;
    let low = (at.saturating_sub(2 * half)..at).rev().take_while(|&k| joined(k)).last().unwrap_or(at);
    let high = (at..(at + 2 * half).min(t.len() - 1)).take_while(|&k| joined(k)).last().map_or(at, |k| k + 1);
    let count = (2 * half + 1).min(high + 1 - low);
    (at.saturating_sub(half).clamp(low, high + 1 - count), count)
}

/// Cubic fitted to the samples within `half` of `at` (fewer at the ends of the log and beside gaps), evaluated at sample `at`.
pub fn local_cubic(t: &[f64], q: impl Fn(usize) -> f64, at: usize, half: usize) -> Local {
    let (first, count) = samples_near(t, at, half);
    let scale = (t[first + count - 1] - t[first]).max(f64::MIN_POSITIVE) / 2.0;
    let place = |k: usize| (t[k] - t[at]) / scale;
    // The entries of the normal matrix are sums of powers of the times.
    let (mut powers, mut right) = ([0.0; 7], Vector4::zeros());
    let base = q(at);
    for k in first..first + count {
        let (x, y) = (place(k), q(k) - base);
        let mut power = 1.0;
        for (i, sum) in powers.iter_mut().enumerate() {
            *sum += power;
            if i < 4 {
                right[i] += power * y;
            }
            power *= x;
        }
    }
    let normal = Matrix4::from_fn(|i, j| powers[i + j]);
    let Some(inverse) = normal.try_inverse().filter(|_| count > 3) else {
        return Local {
            q: base,
            dq: 0.0,
            ddq: 0.0,
            covariance: [1.0, 0.0, f64::MAX],
            ddq_variance: f64::MAX,
            misfit: 0.0,
        };
    };
    let c = inverse * right;
    let left = |k: usize| {
        let x = place(k);
        q(k) - base - (c[0] + x * (c[1] + x * (c[2] + x * c[3])))
    };
    let squares: f64 = (first..first + count).map(|k| left(k).powi(2)).sum();
    let degrees_of_freedom = count.saturating_sub(4);
    Local {
        q: base + c[0],
        dq: c[1] / scale,
        ddq: 2.0 * c[2] / (scale * scale),
        covariance: [inverse[(0, 0)], inverse[(0, 1)] / scale, inverse[(1, 1)] / (scale * scale)],
        ddq_variance: 4.0 * inverse[(2, 2)] / scale.powi(4),
        misfit: if degrees_of_freedom > 0 { squares / degrees_of_freedom as f64 } else { 0.0 },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_cubic_reaches_over_a_hole() {
        let t: Vec<f64> = (0..200).map(|k| 0.001 * f64::from(k) + if k < 120 { 0.0 } else { 2.0 }).collect();
        let motion = |k: usize| if k < 120 { 3.0 * t[k] } else { 1.0 - 5.0 * (t[k] - 2.0) };
        for half in [3, 27] {
            for (at, rate) in [(116, 3.0), (119, 3.0), (120, -5.0), (125, -5.0)] {
                let local = local_cubic(&t, motion, at, half);
                assert!((local.dq - rate).abs() < 1e-6, "{local:?}");
                assert!(local.covariance[2] > 0.0, "{local:?}");
            }
        }
    }

    #[test]
    fn samples_missing_on_one_side_are_taken_on_the_other() {
        let t: Vec<f64> = (0..40).map(f64::from).collect();
        assert_eq!(samples_near(&t, 20, 3), (17, 7));
        assert_eq!(samples_near(&t, 1, 3), (0, 7));
        assert_eq!(samples_near(&t, 38, 3), (33, 7));
        assert_eq!(samples_near(&t, 20, 30), (0, 40));
    }
}
