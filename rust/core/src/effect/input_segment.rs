//! Torque of an actuator between two samples.

use crate::real::{Real, lit};

/// Torque over one sample interval, quadratic in time: values at the start, the middle and the end, N m (N).
///
/// Its mean is given by Simpson's rule. Laws that smear or shift a step of torque choose the three values such that the mean and the first moment,
/// and with them the speed and the distance a mass gains, are exact however fast the law is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputSegment<T> {
    /// Torque at the sample that begins the interval, N m (N).
    pub start: T,
    /// Torque half-way to the next sample, N m (N).
    pub middle: T,
    /// Torque just before the next sample, N m (N).
    pub end: T,
}

impl<T: Real> InputSegment<T> {
    /// Torque `tau`, N m (N), held constant over the interval.
    #[inline]
    pub fn held(tau: T) -> Self {
        Self { start: tau, middle: tau, end: tau }
    }

    /// Torque on a straight line with this mean, N m (N), and this first moment about the middle of an interval of `h` seconds: it gives a mass the
    /// speed and the distance of any torque of equal mean and moment.
    pub fn with_moment(mean: T, moment: T, h: T) -> Self {
        let rise = if h > T::zero() { lit::<T>(6.0) * moment / (h * h) } else { T::zero() };
        Self { start: mean - rise, middle: mean, end: mean + rise }
    }

    /// Mean torque over the interval, N m (N), by Simpson's rule, which is exact for a quadratic.
    #[inline]
    pub fn mean(&self) -> T {
        let (four, six) = (lit::<T>(4.0), lit::<T>(6.0));
        (self.start + four * self.middle + self.end) / six
    }

    /// Torque at the fraction `s` of the interval, from 0 to 1, N m (N).
    #[inline]
    pub fn at(&self, s: T) -> T {
        let two = lit::<T>(2.0);
        let one = T::one();
        let (l0, l1, l2) = ((two * s - one) * (s - one), two * two * s * (one - s), s * (two * s - one));
        l0 * self.start + l1 * self.middle + l2 * self.end
    }

    /// Sum of two torques over one interval.
    #[inline]
    pub fn plus(self, other: Self) -> Self {
        Self {
            start: self.start + other.start,
            middle: self.middle + other.middle,
            end: self.end + other.end,
        }
    }

    /// Applies `f` to the torques at the start, the middle and the end.
    pub fn map(self, f: impl Fn(T) -> T) -> Self {
        Self { start: f(self.start), middle: f(self.middle), end: f(self.end) }
    }
}

/// Length of the interval after sample `k` of the times `t`, s; the last sample's interval is as long as the one before it.
#[inline]
pub fn interval<T: Real>(t: &[T], k: usize) -> T {
    match (t.get(k), t.get(k + 1)) {
        (Some(&a), Some(&b)) => b - a,
        (Some(&b), None) if k > 0 => t.get(k - 1).map_or_else(T::zero, |&a| b - a),
        _ => T::zero(),
    }
}
