//! Velocities from positions, for schemes that need them at the samples.

use crate::numeric::smooth::local_cubic;

/// How velocities are estimated from positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Velocity {
    /// The paper's: mean velocity of the period before; zero at the first sample.
    Backward,
    /// Slope of the parabola through a sample and its neighbours.
    Central,
    /// Local cubic least squares.
    LocalCubic,
}

impl Velocity {
    /// The method with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "backward" => Some(Self::Backward),
            "central" => Some(Self::Central),
            "local-cubic" => Some(Self::LocalCubic),
            _ => None,
        }
    }

    /// Velocities of one joint at all samples.
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
