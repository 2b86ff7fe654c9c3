//! Velocities from positions, for estimation schemes that need velocities at the samples.

use crate::numeric::smooth::local_cubic;

/// Method of estimating velocities from positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Velocity {
    /// Mean velocity over the sample interval before (Reyes and Kelly 1997); zero at the first sample.
    Backward,
    /// Slope of the parabola through a sample and its two neighbours.
    Central,
    /// Slope of a cubic fitted to neighbouring samples by least squares.
    LocalCubic,
}

impl Velocity {
    /// Method with the name `name`; `None` for an unknown name.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "backward" => Some(Self::Backward),
            "central" => Some(Self::Central),
            "local-cubic" => Some(Self::LocalCubic),
            _ => None,
        }
    }

    /// Velocities of one joint at all samples, rad/s or m/s; `half_width` in samples is that of a local cubic.
    pub fn of(self, t: &[f64], q: &[f64], half_width: usize) -> Vec<f64> {
        let slope = |a: usize, b: usize| (q[b] - q[a]) / (t[b] - t[a]);
        let last = t.len().saturating_sub(1);
        let one = |k: usize| match self {
            _ if last == 0 => 0.0,
            Self::Backward if k == 0 => 0.0,
            Self::Backward => slope(k - 1, k),
            Self::Central if k == 0 => slope(0, 1),
            Self::Central if k == last => slope(last - 1, last),
            Self::Central => {
                let (a, b) = (t[k] - t[k - 1], t[k + 1] - t[k]);
                (slope(k - 1, k) * b + slope(k, k + 1) * a) / (a + b)
            }
            Self::LocalCubic => local_cubic(t, |i| q[i], k, half_width).dq,
        };
        (0..t.len()).map(one).collect()
    }
}
