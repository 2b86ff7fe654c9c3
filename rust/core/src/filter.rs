//! The first-order filters `F(s) = lambda/(s + lambda)` and `D(s) = lambda s/(s + lambda)` at sample times.
//!
//! Two pairs, with `a = exp(-h lambda)`:
//!
//! * **paper**, as printed in section 5.1: `F(z) = (1 - a) z^-1 / (1 - a z^-1)` and `D(z) = lambda (1 - z^-1) / (1 - a z^-1)`. Their
//!   ratio is `lambda (z - 1)/(1 - a)` where a derivative has `(z - 1)/h`: whatever passes `D` is too large by `lambda h/(1 - a)`
//!   relative to what passes `F`, and its parameter too small by the inverse (0.940 at 50 rad/s and 2.5 ms, 0.692 at 314 rad/s).
//! * **exact**: `F` for signals that are linear between samples (first-order hold), `F` for signals that are held (zero-order hold:
//!   the torque), and `D = lambda (1 - F)`, which makes the pair consistent by construction. Energies are quadratic in the velocity:
//!   for them `D` also takes the value half-way, because a chord lies above a convex curve at every sample, which adds up to a bias.
//!
//! Configuration ([`Cutoff`], [`Step`]) and state ([`State`]) are separate, so one step's coefficients drive any number of channels.
//! Starting values: with `D` started in the steady state of its first input and every `F` of the same equation from zero, an equation
//! `y = dp/dt + b` holds for the filtered signals from the first sample on, whatever the motion at that time.

use crate::real::{Real, lit};

/// Cut-off `lambda`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cutoff<T> {
    /// rad/s.
    pub rad_per_s: T,
}

/// Coefficients for a sample interval of one length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step<T> {
    /// `exp(-h lambda)`.
    pub decay: T,
    /// Weight of the input at the start of the interval, input linear over it.
    pub first: T,
    /// Weight of the input at its end.
    pub last: T,
    /// Weight of the height by which the input's middle lies above the chord, input quadratic over the interval.
    pub bulge: T,
    /// Cut-off, rad/s.
    pub lambda: T,
}

impl<T: Real> Cutoff<T> {
    /// Coefficients for an interval of `h` seconds.
    #[inline]
    pub fn step(&self, h: T) -> Step<T> {
        let lambda = self.rad_per_s;
        let x = lambda * h;
        let decay = (-x).exp();
        // (1 - a)/x, from its series where the difference would cancel.
        let mean = if x > lit(1e-4) {
            (T::one() - decay) / x
        } else {
            T::one() - x * lit(0.5) * (T::one() - x / lit(3.0))
        };
        Step { decay, first: mean - decay, last: T::one() - mean, bulge: bulge(x, decay), lambda }
    }
}

impl<T: Real> Step<T> {
    /// Coefficients of a `share` of this step's interval of `h` seconds.
    #[inline]
    pub(crate) fn part(&self, cutoff: &Cutoff<T>, h: T, share: T) -> Self {
        if share >= T::one() { *self } else { cutoff.step(h * share) }
    }
}

/// `F`, at the end of an interval, of the parabola `4 s (1 - s)`; `x = lambda h`, `decay = exp(-x)`.
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

/// State of one channel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State<T> {
    /// Output of `F`.
    pub y: T,
    /// Last input, for the filters that look back one sample.
    pub input: T,
}

impl<T: Real> State<T> {
    /// A channel at rest at zero, seeing `input` first.
    #[inline]
    pub fn from_zero(input: T) -> Self {
        Self { y: T::zero(), input }
    }

    /// A channel in the steady state of its first input.
    #[inline]
    pub fn steady(input: T) -> Self {
        Self { y: input, input }
    }

    /// `F` of an input held at `held` over the interval.
    #[inline]
    pub fn low_held(&mut self, step: &Step<T>, held: T) -> T {
        self.y = step.decay * self.y + (T::one() - step.decay) * held;
        self.y
    }

    /// `F` of an input that goes linearly from `from` to `to` over the interval.
    #[inline]
    pub fn low_ramp(&mut self, step: &Step<T>, from: T, to: T) -> T {
        self.y = step.decay * self.y + step.first * from + step.last * to;
        self.y
    }

    /// `F` of an input linear between samples.
    #[inline]
    pub fn low(&mut self, step: &Step<T>, input: T) -> T {
        let from = self.input;
        self.input = input;
        self.low_ramp(step, from, input)
    }

    /// `D` of an input linear between samples.
    #[inline]
    pub fn derivative(&mut self, step: &Step<T>, input: T) -> T {
        (input - self.low(step, input)) * step.lambda
    }

    /// `D` of an input that is quadratic between samples and half-way lies `height` above the chord.
    #[inline]
    pub fn derivative_curved(&mut self, step: &Step<T>, input: T, height: T) -> T {
        self.low(step, input);
        self.y += step.bulge * height;
        (input - self.y) * step.lambda
    }

    /// The paper's `F`.
    #[inline]
    pub fn paper_low(&mut self, step: &Step<T>, input: T) -> T {
        let last = self.input;
        self.input = input;
        self.low_held(step, last)
    }

    /// The paper's `D`; here `y` holds the output of `D`.
    #[inline]
    pub fn paper_derivative(&mut self, step: &Step<T>, input: T) -> T {
        self.y = step.decay * self.y + step.lambda * (input - self.input);
        self.input = input;
        self.y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUTOFF: Cutoff<f64> = Cutoff { rad_per_s: 50.0 };

    #[test]
    fn exact_pair_is_exact_on_a_ramp() {
        // D of a ramp of slope 1 is 1 - exp(-lambda t), F of it t - D/lambda.
        let (mut low, mut high) = (State::from_zero(0.0), State::steady(0.0));
        let mut t = 0.0;
        for h in [0.0025, 0.001, 0.004, 0.0025] {
            t += h;
            let step = CUTOFF.step(h);
            let rise = 1.0 - (-50.0 * t).exp();
            assert!((high.derivative(&step, t) - rise).abs() < 1e-13);
            assert!((low.low(&step, t) - (t - rise / 50.0)).abs() < 1e-13);
        }
    }

    #[test]
    fn a_parabola_passes_without_error_at_small_and_large_steps() {
        // F of t^2 from rest is t^2 - 2 t/lambda + 2 (1 - exp(-lambda t))/lambda^2.
        for lambda in [0.5, 7.9, 8.1, 50.0, 4000.0] {
            let cutoff = Cutoff { rad_per_s: lambda };
            let mut state = State::steady(0.0_f64);
            for k in 1..=200 {
                let t = f64::from(k) * 0.0025;
                let d = state.derivative_curved(&cutoff.step(0.0025), t * t, -0.0025 * 0.0025 / 4.0);
                let low = t * t - 2.0 * t / lambda + 2.0 * (1.0 - (-lambda * t).exp()) / (lambda * lambda);
                assert!((d / lambda - (t * t - low)).abs() < 1e-14, "{lambda} rad/s");
            }
        }
    }

    #[test]
    fn papers_pair_inflates_derivatives_as_its_ratio_says() {
        let step = CUTOFF.step(0.0025);
        let (mut low, mut high) = (State::from_zero(0.0), State::from_zero(0.0));
        let (mut d, mut f) = (0.0, 0.0);
        for k in 1..4000 {
            d = high.paper_derivative(&step, f64::from(k) * 0.0025);
            f = low.paper_low(&step, 1.0);
        }
        let inflation = 50.0 * 0.0025 / (1.0 - (-50.0_f64 * 0.0025).exp());
        assert!((d / f - inflation).abs() < 1e-12);
        assert!((1.0 / inflation - 0.940).abs() < 5e-4);
    }

    #[test]
    fn a_held_input_settles_without_error_at_any_period() {
        let mut state = State::from_zero(0.0);
        for k in 0..400 {
            state.low_held(&CUTOFF.step(0.001 + 0.001 * f64::from(k % 3)), 2.0);
        }
        assert!((state.y - 2.0).abs() < 1e-9);
    }
}
