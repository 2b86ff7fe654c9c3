//! Monitor of an online estimator: size of its prediction errors, excitation by the motion, and an alarm when the model no longer explains
//! the arm.
//!
//! **Spread.** Mean square of each prediction error over the last `memory` samples; with the diagonal of `P` it gives standard deviations.
//!
//! **Excitation.** The leverage of a sample ([`crate::rls::Rls::leverage`]), averaged over `memory` samples, as a share of the leverage that every
//! sample would have if all samples excited the parameters equally: near 1 while every parameter keeps being excited, near 0 while the arm rests or
//! repeats known motion.
//!
//! **Alarm.** A cumulative sum test (Page 1954) on the normalised error. While learning, the variance of each error and its correlation
//! from one sample to the next are measured; afterwards `u = (e - rho e_last)/sigma` is tested for a standard deviation that has grown
//! by half against an unchanged one:
//!
//! ```text
//! S <- max(0, S + min(u^2, 25) (1 - 1/r^2)/2 - ln r),  r = 1.5;      alarm while S > ln(n between)
//! ```
//!
//! The mean number of samples between false alarms is at least `between` if the `n` errors stay Gaussian with the learned variance
//! (Lorden 1971: the increments are at most a log-likelihood ratio; the cut at 25 makes them smaller, so that single
//! outliers raise no alarm). Errors of the filtered dynamic model are torques and meet the condition best; errors of the energy and power
//! models grow with the speed and must be learned on motion as fast as the motion that is monitored.

use crate::real::{Real, lit};
use nalgebra::SVector;

/// Growth of the standard deviation of prediction errors that the alarm of the online monitor looks for.
const GROWTH: f64 = 1.5;
/// Largest squared prediction error, in units of its variance, that counts in the alarm of the online monitor: larger ones are cut to it.
const OUTLIER: f64 = 25.0;

/// Settings of the monitor of an online estimator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonitorSettings<T> {
    /// Number of samples over which mean square error and excitation are averaged.
    pub memory: T,
    /// Number of samples before learning begins, while estimate and filters settle.
    pub settling: u32,
    /// Number of samples over which variances and correlations of the prediction errors are learned; there is no alarm before.
    pub learning: u32,
    /// Mean number of samples between false alarms.
    pub between: T,
    /// Lower limit of the learned standard deviation of a prediction error, in the unit of the error; the alarm ignores errors of this size.
    pub floor: T,
}

impl<T: Real> Default for MonitorSettings<T> {
    /// Settings for a period of some milliseconds: memory and settling of 400 samples, learning of 1600, a false alarm in a million samples.
    fn default() -> Self {
        Self { memory: lit(400.0), settling: 400, learning: 1600, between: lit(1e6), floor: T::zero() }
    }
}

/// Monitor of an online estimator with `N` prediction errors per sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Monitor<T, const N: usize> {
    settings: MonitorSettings<T>,
    samples: u32,
    mean_square: SVector<T, N>,
    excitation: T,
    last: SVector<T, N>,
    square: SVector<T, N>,
    product: SVector<T, N>,
    correlation: SVector<T, N>,
    inverse_sigma: SVector<T, N>,
    sum: SVector<T, N>,
    limit: T,
}

impl<T: Real, const N: usize> Monitor<T, N> {
    /// Monitor before its first sample.
    pub fn new(settings: MonitorSettings<T>) -> Self {
        let zero = SVector::zeros();
        Self {
            settings,
            samples: 0,
            mean_square: zero,
            excitation: T::zero(),
            last: zero,
            square: zero,
            product: zero,
            correlation: zero,
            inverse_sigma: zero,
            sum: zero,
            limit: (settings.between * lit(N as f64)).ln(),
        }
    }

    /// Takes the prediction `error` of a used sample, its `leverage`, the number of estimated `parameters`, and the `age` of the estimate in samples,
    /// at most the memory of the forgetting factor.
    #[inline]
    pub fn update(&mut self, error: &SVector<T, N>, leverage: T, parameters: usize, age: T) {
        self.samples = self.samples.saturating_add(1);
        let weight = T::one() / self.settings.memory.min(lit(f64::from(self.samples))).max(T::one());
        for j in 0..N {
            let change = error[j] * error[j] - self.mean_square[j];
            self.mean_square[j] += change * weight;
        }
        let share = leverage * age / lit(parameters as f64);
        self.excitation += (share - self.excitation) * weight;
        let learned = self.settings.settling.saturating_add(self.settings.learning);
        if self.samples > learned {
            self.test(error);
        } else if self.samples > self.settings.settling {
            self.learn(error, self.samples == learned);
        }
        self.last = *error;
    }

    #[inline]
    fn learn(&mut self, error: &SVector<T, N>, finished: bool) {
        for j in 0..N {
            self.square[j] += error[j] * error[j];
            self.product[j] += error[j] * self.last[j];
        }
        if !finished {
            return;
        }
        let most: T = lit(0.999);
        for j in 0..N {
            let variance = self.square[j] / lit(f64::from(self.settings.learning.max(1)));
            let ratio = self.product[j] / self.square[j];
            let rho = if ratio.is_finite() { ratio.max(-most).min(most) } else { T::zero() };
            let floor = self.settings.floor.max(lit(1e-15));
            self.correlation[j] = rho;
            self.inverse_sigma[j] = T::one() / (variance * (T::one() - rho * rho)).sqrt().max(floor);
        }
    }

    #[inline]
    fn test(&mut self, error: &SVector<T, N>) {
        let gain: T = lit(0.5 * (1.0 - 1.0 / (GROWTH * GROWTH)));
        // ln 1.5
        let toll: T = lit(0.405_465_108_108_164_4);
        for j in 0..N {
            let u = (error[j] - self.correlation[j] * self.last[j]) * self.inverse_sigma[j];
            let step = (u * u).min(lit(OUTLIER)) * gain - toll;
            // The sum is at most twice the alarm limit, so that an alarm ends soon after its cause has ended.
            self.sum[j] = (self.sum[j] + step).max(T::zero()).min(self.limit + self.limit);
        }
    }

    /// Mean square of each prediction error over the memory, N m, J or W squared by scheme.
    pub fn mean_square(&self) -> &SVector<T, N> {
        &self.mean_square
    }

    /// Excitation by the recent motion, from 0 (none) to about 1 (every parameter).
    pub fn excitation(&self) -> T {
        self.excitation
    }

    /// Whether each prediction error is larger than its learned standard deviation explains.
    pub fn alarms(&self) -> [bool; N] {
        core::array::from_fn(|j| self.sum[j] > self.limit)
    }

    /// Largest cumulative sum of the alarm test as a share of its limit; above 1 there is an alarm.
    pub fn alarm_level(&self) -> T {
        self.sum.iter().fold(T::zero(), |most, sum| most.max(*sum)) / self.limit
    }
}
