//! Local cubic least squares with uneven sample times (Savitzky and Golay 1964, generalised to any sample times).

use nalgebra::{Matrix4, Vector4};

/// What a local cubic says of the sample it is centred on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Local {
    /// Position.
    pub q: f64,
    /// Velocity.
    pub dq: f64,
    /// Acceleration.
    pub ddq: f64,
    /// Variance of position, covariance, and variance of velocity, for a measurement of variance one.
    pub covariance: [f64; 3],
    /// Variance of the acceleration, for a measurement of variance one.
    pub ddq_variance: f64,
    /// Mean square residual per degree of freedom.
    pub misfit: f64,
}

/// Fits a cubic to the samples within `half` of `at` (fewer at the ends of the log) and evaluates it there.
pub fn local_cubic(t: &[f64], q: impl Fn(usize) -> f64, at: usize, half: usize) -> Local {
    let count = (2 * half + 1).min(t.len());
    let first = at.saturating_sub(half).min(t.len() - count);
    let scale = (t[first + count - 1] - t[first]).max(f64::MIN_POSITIVE) / 2.0;
    let place = |k: usize| (t[k] - t[at]) / scale;
    // The normal matrix of powers holds their sums only.
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
    let Some(inverse) = normal.try_inverse() else {
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
