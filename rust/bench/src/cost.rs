//! Distribution of the time that an online estimator takes for one sample, call by call as in a controller, and the noise of the machine.
//!
//! Every call is timed on its own, less the time of reading the clock; the typical time comes from whole runs, in which the clock is read once. The
//! noise is measured by fixed arithmetic: the time by which the slowest call of the arithmetic exceeds its typical call is due to the machine
//! (interrupts, other programs), and the estimator's slowest sample includes about as much noise.

use crate::run::{PERIOD, arm, samples};
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Reading, Settings};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use nalgebra::SVector;
use std::hint::black_box;
use std::time::Instant;

/// Distribution of the time of one call of a function, ns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// Time per call from whole runs, median over the runs, ns.
    pub typical: f64,
    /// Median time of single calls, ns.
    pub median: f64,
    /// Time that 99 of 100 calls do not exceed, ns.
    pub p99: f64,
    /// Time that 9999 of 10000 calls do not exceed, ns.
    pub p9999: f64,
    /// Time of the slowest call, ns.
    pub max: f64,
}

/// Online estimator of the two-link arm with nine parameters.
pub type Online<T> = Estimator<T, armgap_core::arm::TwoLink<T>, 2, 9, 9>;

/// Online estimator of the two-link arm before its first sample, at the settings of Reyes and Kelly (1997).
pub fn fresh<T: Real>(scheme: Scheme, variant: Variant, form: Form) -> Online<T> {
    let settings = Settings {
        scheme,
        variant,
        cutoff: Cutoff { rad_per_s: lit(50.0) },
        forgetting: T::one(),
        theta0: SVector::zeros(),
        p0: lit(1000.0),
    };
    Online::<T>::new(arm(), settings).with_form(form)
}

/// Positions and torques of the two-link arm's run, one sample every [`PERIOD`].
pub fn readings<T: Real>() -> Vec<Reading<T, 2>> {
    samples().into_iter().map(|s| Reading { q: s.q, dq: None, tau: s.tau }).collect()
}

/// Time of one sample of the online estimator of the two-link arm, from at least `count` samples.
pub fn online<T: Real>(scheme: Scheme, variant: Variant, form: Form, count: usize) -> Cost {
    let data = readings::<T>();
    let start = fresh::<T>(scheme, variant, form);
    let period: T = lit(PERIOD);
    measured(
        count,
        data.len(),
        || start,
        |estimator, k| {
            black_box(estimator.update_after(period, black_box(&data[k])));
        },
    )
}

/// Time of fixed arithmetic of about fifty nanoseconds, from at least `count` calls: the noise of the machine.
pub fn noise(count: usize) -> Cost {
    measured(
        count,
        4000,
        || 1.0_f64,
        |x, _| {
            for _ in 0..16 {
                *x = black_box(*x * 0.999 + 0.5);
            }
        },
    )
}

/// Distribution of the time of `call`, from at least `count` calls in runs of `length` calls, each run on a new state.
fn measured<S>(
    count: usize,
    length: usize,
    fresh: impl Fn() -> S,
    mut call: impl FnMut(&mut S, usize),
) -> Cost {
    let runs = count.div_ceil(length).max(1);
    let clock = clock();
    let mut single = Vec::with_capacity(runs * length);
    let mut whole = Vec::with_capacity(runs);
    for _ in 0..runs {
        let mut state = fresh();
        let start = Instant::now();
        for k in 0..length {
            call(&mut state, k);
        }
        whole.push(start.elapsed().as_nanos() as f64 / length as f64);
        state = fresh();
        for k in 0..length {
            let start = Instant::now();
            call(&mut state, k);
            single.push((start.elapsed().as_nanos() as f64 - clock).max(0.0));
        }
        black_box(&mut state);
    }
    single.sort_by(f64::total_cmp);
    whole.sort_by(f64::total_cmp);
    let at = |share: f64| single[((single.len() - 1) as f64 * share) as usize];
    Cost { typical: whole[runs / 2], median: at(0.5), p99: at(0.99), p9999: at(0.9999), max: at(1.0) }
}

/// Time between two immediate readings of the clock, ns.
fn clock() -> f64 {
    let mut times: Vec<f64> = (0..20_001).map(|_| Instant::now().elapsed().as_nanos() as f64).collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distributions_are_ordered_and_of_the_count_asked_for() {
        let cost = online::<f32>(Scheme::FilteredPower, Variant::Exact, Form::Factorized, 5000);
        for (low, high) in
            [(0.0, cost.median), (cost.median, cost.p99), (cost.p99, cost.p9999), (cost.p9999, cost.max)]
        {
            assert!(low <= high, "{cost:?}");
        }
        assert!(cost.typical > 0.0);
    }
}
