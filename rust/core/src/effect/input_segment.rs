//! Torque of an actuator between two samples.

use crate::real::{Real, lit};

/// Torque over one sample interval: its values at the start, the middle and the end.
///
/// Between them it is quadratic, so Simpson's rule gives its mean. Laws that smear or shift a step choose the three values such that the
/// mean and the first moment, and with them the speed and the distance a mass gains, are exact however fast they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InputSegment<T> {
    /// At the sample.
    pub start: T,
    /// Half-way to the next sample.
    pub middle: T,
    /// Value just before the next sample.
    pub end: T,
}

impl<T: Real> InputSegment<T> {
    /// A torque held constant over the interval.
    #[inline]
    pub fn held(tau: T) -> Self {
        Self { start: tau, middle: tau, end: tau }
    }

    /// The straight line with the given mean and first moment about the middle of an interval of length `h`: what moves a mass by the
    /// same speed and the same distance as the torque that has them.
    pub fn with_moment(mean: T, moment: T, h: T) -> Self {
        let rise = if h > T::zero() { lit::<T>(6.0) * moment / (h * h) } else { T::zero() };
        Self { start: mean - rise, middle: mean, end: mean + rise }
    }

    /// Mean over the interval (Simpson's rule, exact here).
    #[inline]
    pub fn mean(&self) -> T {
        let (four, six) = (lit::<T>(4.0), lit::<T>(6.0));
        (self.start + four * self.middle + self.end) / six
    }

    /// Value at the fraction `s` of the interval, from 0 to 1.
    #[inline]
    pub fn at(&self, s: T) -> T {
        let two = lit::<T>(2.0);
        let one = T::one();
        let (l0, l1, l2) = ((two * s - one) * (s - one), two * two * s * (one - s), s * (two * s - one));
        l0 * self.start + l1 * self.middle + l2 * self.end
    }

    /// Sum of both torques.
    #[inline]
    pub fn plus(self, other: Self) -> Self {
        Self {
            start: self.start + other.start,
            middle: self.middle + other.middle,
            end: self.end + other.end,
        }
    }

    /// Applies `f` to each of the three values.
    pub fn map(self, f: impl Fn(T) -> T) -> Self {
        Self { start: f(self.start), middle: f(self.middle), end: f(self.end) }
    }
}

/// Length of the interval after sample `k`; the last one is as long as the one before it.
#[inline]
pub fn interval<T: Real>(t: &[T], k: usize) -> T {
    match (t.get(k), t.get(k + 1)) {
        (Some(&a), Some(&b)) => b - a,
        (Some(&b), None) if k > 0 => t.get(k - 1).map_or_else(T::zero, |&a| b - a),
        _ => T::zero(),
    }
}
