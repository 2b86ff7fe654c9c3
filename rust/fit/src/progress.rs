//! Progress reports and cancellation of long computations.
//!
//! Work is counted in units: a fit, a candidate's test. What is still to come is not known, for every cause that is found is followed by
//! a search for the next; so a part of the work takes a share of what is left, and the fraction done never falls.
//!
//! A cancelled diagnosis unwinds from wherever it is (`resume_unwind`: no panic hook, no message; rayon hands it on) to
//! `guarded`, which makes an error of it. Nothing outside this file sees the unwinding.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};

/// Phase of a computation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Fitting the model as far as it is known.
    Refit,
    /// Testing every candidate to first order.
    Screen,
    /// Fitting the candidates that passed.
    Candidates,
    /// Fitting the best of them to the end.
    Finalists,
    /// Looking for external disturbances.
    Pushes,
    /// Assembling the result.
    Result,
    /// Simulating once more with half the steps.
    Simulate,
}

impl Phase {
    /// In words.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Refit => "re-estimating the arm",
            Self::Screen => "testing every effect",
            Self::Candidates => "fitting candidates",
            Self::Finalists => "comparing the best",
            Self::Pushes => "looking for pushes",
            Self::Result => "putting the result together",
            Self::Simulate => "simulating",
        }
    }

    /// Share of what is left that this phase takes, measured on logs with one cause: their search has two rounds.
    const fn share(self) -> f64 {
        match self {
            Self::Refit => 0.09,
            Self::Screen => 0.16,
            Self::Candidates => 0.30,
            Self::Finalists => 0.38,
            Self::Pushes => 0.05,
            Self::Result => 0.95,
            // Twice as dear as all before it, and once or twice is enough.
            Self::Simulate => 0.4,
        }
    }
}

/// A progress report.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Current phase.
    pub phase: Phase,
    /// Estimated fraction of the work that is done, from 0 to 1; never falls.
    pub fraction: f64,
}

/// Answer of an observer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Continue.
    Go,
    /// Cancel with an error, soon.
    ContactGuess,
}

/// Called often and from any thread; must be quick.
pub type Observer = Arc<dyn Fn(Progress) -> Control + Send + Sync>;

/// Counts units of work and reports progress to the observer.
pub struct ProgressReporter {
    observer: Observer,
    /// Index of the phase in `ORDER`.
    phase: AtomicUsize,
    /// Units planned and done in the current phase.
    planned: AtomicUsize,
    done: AtomicUsize,
    /// Fractions where the current phase begins and ends, and the largest reported, as bits: positive numbers sort alike.
    from: AtomicU64,
    to: AtomicU64,
    reported: AtomicU64,
}

const ORDER: [Phase; 7] = [
    Phase::Refit,
    Phase::Screen,
    Phase::Candidates,
    Phase::Finalists,
    Phase::Pushes,
    Phase::Result,
    Phase::Simulate,
];

/// What unwinds; found by its type.
struct Stopped;

impl ProgressReporter {
    /// A count from nothing.
    pub fn new(observer: Observer) -> Self {
        let zero = || AtomicU64::new(0.0_f64.to_bits());
        let count = || AtomicUsize::new(0);
        Self {
            observer,
            phase: count(),
            planned: count(),
            done: count(),
            from: zero(),
            to: zero(),
            reported: zero(),
        }
    }

    /// A reporter whose units do not count: the observer sees the progress of this one as it was, and may cancel.
    pub fn aside(&self) -> Self {
        let (observer, now) = (Arc::clone(&self.observer), self.current());
        Self::new(Arc::new(move |_| observer(now)))
    }

    /// Begins a phase of about so many units; the phase before is over.
    pub fn begin(&self, phase: Phase, units: usize) {
        let from = f64::from_bits(self.to.load(Relaxed));
        self.phase.store(ORDER.iter().position(|w| *w == phase).unwrap_or(0), Relaxed);
        self.planned.store(units.max(1), Relaxed);
        self.done.store(0, Relaxed);
        self.from.store(from.to_bits(), Relaxed);
        self.to.store((from + (1.0 - from) * phase.share()).to_bits(), Relaxed);
        self.check();
    }

    /// One unit is done.
    pub fn unit(&self) {
        self.done.fetch_add(1, Relaxed);
        self.check();
    }

    /// Reports to the observer; does not return if it cancels.
    pub fn check(&self) {
        if (self.observer)(self.current()) == Control::ContactGuess {
            resume_unwind(Box::new(Stopped));
        }
    }

    fn current(&self) -> Progress {
        let load = |x: &AtomicU64| f64::from_bits(x.load(Relaxed));
        let (from, to) = (load(&self.from), load(&self.to));
        let part = (self.done.load(Relaxed) as f64 / self.planned.load(Relaxed).max(1) as f64).min(1.0);
        let fraction = from + (to - from) * part;
        let before = f64::from_bits(self.reported.fetch_max(fraction.to_bits(), Relaxed));
        Progress { phase: ORDER[self.phase.load(Relaxed)], fraction: fraction.max(before) }
    }
}

/// Runs `task`; none if it was cancelled.
pub fn guarded<T>(task: impl FnOnce() -> T) -> Option<T> {
    match catch_unwind(AssertUnwindSafe(task)) {
        Ok(result) => Some(result),
        Err(cause) if is_contact(cause.as_ref()) => None,
        Err(cause) => resume_unwind(cause),
    }
}

fn is_contact(cause: &(dyn Any + Send)) -> bool {
    cause.is::<Stopped>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::sync::Mutex;

    fn recording() -> (Observer, Arc<Mutex<Vec<f64>>>) {
        let reported = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&reported);
        (
            Arc::new(move |p: Progress| {
                seen.lock().unwrap().push(p.fraction);
                Control::Go
            }),
            reported,
        )
    }

    #[test]
    fn the_fraction_never_falls_and_stays_below_one() {
        let (observer, reported) = recording();
        let reporter = ProgressReporter::new(observer);
        for _ in 0..5 {
            for phase in [Phase::Refit, Phase::Candidates, Phase::Finalists] {
                reporter.begin(phase, 3);
                (0..7).for_each(|_| reporter.unit());
            }
        }
        reporter.begin(Phase::Result, 1);
        let reported = reported.lock().unwrap();
        assert!(reported.windows(2).all(|w| w[1] >= w[0]));
        assert!(reported.iter().all(|x| (0.0..1.0).contains(x)));
    }

    #[test]
    fn stopping_unwinds_through_threads_to_the_guard() {
        let reporter = ProgressReporter::new(Arc::new(|p| {
            if p.fraction > 0.05 { Control::ContactGuess } else { Control::Go }
        }));
        reporter.begin(Phase::Candidates, 100);
        let result = guarded(|| (0..100).into_par_iter().map(|_| reporter.unit()).count());
        assert_eq!(result, None);
    }

    #[test]
    fn another_panic_is_not_taken_for_a_stop() {
        let result = catch_unwind(|| guarded(|| resume_unwind(Box::new("something else"))));
        assert!(result.is_err());
    }
}
