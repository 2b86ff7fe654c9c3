//! The first-order filters `F(s) = lambda/(s + lambda)` and `D(s) = lambda s/(s + lambda)` at sample times.
//!
//! Two discretisations of the pair `F`, `D`, with `a = exp(-h lambda)`:
//!
//! * **paper**, as printed by Reyes and Kelly (1997), section 5.1: `F(z) = (1 - a) z^-1 / (1 - a z^-1)` and
//!   `D(z) = lambda (1 - z^-1) / (1 - a z^-1)`. Their ratio is `lambda (z - 1)/(1 - a)` where a derivative has `(z - 1)/h`: an output of `D`
//!   is too large by `lambda h/(1 - a)` against one of `F`, its parameter too small by the inverse (0.940 at 50 rad/s, 2.5 ms, 0.692 at 314 rad/s).
//! * **exact**: `F` for signals that are linear between samples (first-order hold), `F` for signals that are held (zero-order hold:
//!   the torque), and `D = lambda (1 - F)`, which makes the pair consistent by construction. Energies are quadratic in the velocity:
//!   for them `D` also takes the value half-way, because a chord lies above a convex curve at every sample, which adds up to a bias.
//!
//! Configuration ([`Cutoff`], [`FilterCoefficients`]) and state (one output per channel, the caller's) are separate, so one step's coefficients drive
//! any number of channels; [`CachedCoefficients`] keeps the coefficients while the length of the interval stays the same. Starting values: with `D`
//! started in the steady state of its first input and every `F` of the same equation from zero, an equation `y = dp/dt + b` holds for the filtered
//! signals from the first sample on, whatever the motion at that time.

use crate::cpu::Cpu;
use crate::real::{Real, lit};

/// Cut-off `lambda` of the first-order filters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cutoff<T> {
    /// Cut-off, rad/s.
    pub rad_per_s: T,
}

/// Coefficients of the first-order filters for a sample interval of length `h`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterCoefficients<T> {
    /// Decay of a filter's output over the interval, `exp(-h lambda)`.
    pub decay: T,
    /// Weight of the input at the start of the interval, for an input that is linear over the interval.
    pub first: T,
    /// Weight of the input at the end of the interval, for an input that is linear over the interval.
    pub last: T,
    /// Weight of the height of the input above its chord at the middle of the interval, for an input that is quadratic over the interval.
    pub bulge: T,
    /// Length of the interval in time constants of the filter, `h lambda`.
    pub x: T,
    /// Cut-off of the filter, rad/s.
    pub lambda: T,
}

impl<T: Real> Cutoff<T> {
    /// Coefficients of the filters for an interval of `h` seconds.
    #[inline]
    pub fn step(&self, h: T) -> FilterCoefficients<T> {
        let x = self.rad_per_s * h;
        FilterCoefficients::with_decay(self.rad_per_s, x, (-x).exp())
    }
}

impl<T: Real> FilterCoefficients<T> {
    #[inline]
    fn with_decay(lambda: T, x: T, decay: T) -> Self {
        // (1 - a)/x, from its series where the difference would cancel.
        let mean = if x > lit(1e-4) {
            (T::one() - decay) / x
        } else {
            T::one() - x * lit(0.5) * (T::one() - x / lit(3.0))
        };
        Self { decay, first: mean - decay, last: T::one() - mean, bulge: bulge(x, decay), x, lambda }
    }

    /// Coefficients for an interval of slightly different length, `x = h lambda`, by the series of `exp` around the known decay.
    #[inline]
    fn near(&self, x: T) -> Self {
        let d = self.x - x;
        let change = T::one() + d * (T::one() + d * (lit::<T>(0.5) + d * lit(1.0 / 6.0)));
        Self::with_decay(self.lambda, x, self.decay * change)
    }

    /// Output of the low-pass filter `F` one interval after its output `y`, for an input held at `held`.
    #[inline(always)]
    pub fn held<C: Cpu>(&self, y: T, held: T) -> T {
        C::fused(self.decay, y, (T::one() - self.decay) * held)
    }

    /// Output of the low-pass filter `F` one interval after its output `y`, for an input that goes linearly from `from` to `to`.
    #[inline(always)]
    pub fn ramp<C: Cpu>(&self, y: T, from: T, to: T) -> T {
        C::fused(self.last, to, C::fused(self.decay, y, self.first * from))
    }

    /// Output of the low-pass filter `F` one interval after its output `y`, for an input that is a parabola from `from` to `to` and lies `height`
    /// above its chord at the middle.
    #[inline(always)]
    pub fn curve<C: Cpu>(&self, y: T, from: T, to: T, height: T) -> T {
        C::fused(self.bulge, height, self.ramp::<C>(y, from, to))
    }

    /// Output of the derivative filter `D` as Reyes and Kelly (1997) print it, one interval after its output `y`, for an input that goes from `from`
    /// to `to`.
    #[inline(always)]
    pub fn paper_derivative<C: Cpu>(&self, y: T, from: T, to: T) -> T {
        C::fused(self.lambda, to - from, self.decay * y)
    }
}

/// Filter coefficients of the last interval, reused while intervals have the same length.
///
/// Lengths that differ by rounding of the clock count as equal; for lengths that differ a little more, `exp` is taken from its series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CachedCoefficients<T> {
    h: T,
    step: FilterCoefficients<T>,
}

/// Relative change of a filter's decay over one interval below which two sample intervals count as equally long; the parameters estimated from the
/// filtered signals then change by about as little.
const SAME: f64 = 1e-12;
/// Relative change of a filter's decay up to which three terms of the series of `exp` suffice: the fourth is 4e-18.
const NEAR_DECAY: f64 = 1e-4;

impl<T: Real> CachedCoefficients<T> {
    /// Empty cache of coefficients of filters with this cut-off.
    #[inline]
    pub fn new(cutoff: &Cutoff<T>) -> Self {
        Self { h: T::zero(), step: cutoff.step(T::zero()) }
    }

    /// Coefficients of the filters for an interval of `h` seconds, computed anew if the length has changed.
    #[inline(always)]
    pub fn step(&mut self, h: T) -> FilterCoefficients<T> {
        if h != self.h {
            self.renew(h);
        }
        self.step
    }

    fn renew(&mut self, h: T) {
        let x = self.step.lambda * h;
        let change = (x - self.step.x).abs();
        if change <= lit::<T>(SAME).max(T::default_epsilon()) && self.h > T::zero() {
            return;
        }
        let near = change <= lit(NEAR_DECAY) && self.h > T::zero();
        self.step = if near { self.step.near(x) } else { Cutoff { rad_per_s: self.step.lambda }.step(h) };
        self.h = h;
    }
}

/// Output of the low-pass filter `F` at the end of an interval for the parabola `4 s (1 - s)`, `s` from 0 to 1; `x = lambda h`, `decay = exp(-x)`.
#[inline]
fn bulge<T: Real>(x: T, decay: T) -> T {
    let four: T = lit(4.0);
    if x < lit(0.02) {
        let series =
            lit::<T>(1.0 / 6.0) - x * (lit::<T>(1.0 / 12.0) - x * (lit::<T>(1.0 / 40.0) - x / lit(180.0)));
        return four * x * series;
    }
    let inverse = T::one() / x;
    let two = inverse + inverse;
    four * inverse * (T::one() - two + decay * (T::one() + two))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::Portable;

    const CUTOFF: Cutoff<f64> = Cutoff { rad_per_s: 50.0 };

    #[test]
    fn exact_pair_is_exact_on_a_ramp() {
        // F of a ramp of slope 1 is t - (1 - exp(-lambda t))/lambda, whatever the intervals.
        let (mut low, mut t) = (0.0, 0.0);
        for h in [0.0025, 0.001, 0.004, 0.0025] {
            low = CUTOFF.step(h).ramp::<Portable>(low, t, t + h);
            t += h;
            assert!((low - (t - (1.0 - (-50.0 * t).exp()) / 50.0)).abs() < 1e-13);
        }
    }

    #[test]
    fn a_parabola_passes_without_error_at_small_and_large_steps() {
        // F of t^2 from rest is t^2 - 2 t/lambda + 2 (1 - exp(-lambda t))/lambda^2.
        for lambda in [0.5, 7.9, 8.1, 50.0, 4000.0] {
            let step = Cutoff { rad_per_s: lambda }.step(0.0025);
            let mut low = 0.0_f64;
            for k in 1..=200 {
                let (before, t) = (f64::from(k - 1) * 0.0025, f64::from(k) * 0.0025);
                low = step.curve::<Portable>(low, before * before, t * t, -0.0025 * 0.0025 / 4.0);
                let exact = t * t - 2.0 * t / lambda + 2.0 * (1.0 - (-lambda * t).exp()) / (lambda * lambda);
                assert!((low - exact).abs() < 1e-14, "{lambda} rad/s");
            }
        }
    }

    #[test]
    fn papers_pair_inflates_derivatives_as_its_ratio_says() {
        let step = CUTOFF.step(0.0025);
        let (mut d, mut f) = (0.0, 0.0);
        for k in 1..4000 {
            d = step.paper_derivative::<Portable>(d, f64::from(k - 1) * 0.0025, f64::from(k) * 0.0025);
            f = step.held::<Portable>(f, 1.0);
        }
        let inflation = 50.0 * 0.0025 / (1.0 - (-50.0_f64 * 0.0025).exp());
        assert!((d / f - inflation).abs() < 1e-12);
        assert!((1.0 / inflation - 0.940).abs() < 5e-4);
    }

    #[test]
    fn a_held_input_settles_without_error_at_any_period() {
        let mut y = 0.0;
        for k in 0..400 {
            y = CUTOFF.step(0.001 + 0.001 * f64::from(k % 3)).held::<Portable>(y, 2.0);
        }
        assert!((y - 2.0).abs() < 1e-9);
    }

    #[test]
    fn kept_coefficients_are_those_of_the_interval() {
        // Equal, off by a clock's rounding, off by jitter, another period, and back.
        let mut kept = CachedCoefficients::new(&CUTOFF);
        for h in [0.0025, 0.0025, 0.0025 + 1e-15, 0.0025 + 1e-6, 0.0025 - 1e-6, 0.004, 1e-9, 0.0025] {
            let (step, fresh) = (kept.step(h), CUTOFF.step(h));
            for (a, b) in [
                (step.decay, fresh.decay),
                (step.first, fresh.first),
                (step.last, fresh.last),
                (step.bulge, fresh.bulge),
            ] {
                assert!((a - b).abs() < 4.0 * SAME, "{h}: {a} {b}");
            }
        }
    }
}
