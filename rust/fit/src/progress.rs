//! Progress reports and cancellation of long computations.
//!
//! Work is counted in units: a fit, or the test of a candidate. The remaining work is not known, for every cause that is found is followed by
//! a search for the next cause; so each phase takes a share of the remaining fraction, and the fraction done never falls.
//!
//! A cancelled diagnosis unwinds from the running computation (`resume_unwind`: no panic hook, no message; rayon passes it on) to
//! `guarded`, which turns it into an error. Nothing outside this file sees the unwinding.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};

/// Phase of a computation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Fitting the arm's parameters and the causes found so far.
    Refit,
    /// Score test of every candidate effect (first order).
    Screen,
    /// Rough fits of the candidate effects that passed the score test.
    Candidates,
    /// Full fits of the best candidate effects.
    Finalists,
    /// Looking for external disturbances.
    Pushes,
    /// Assembling the result of the diagnosis.
    Result,
    /// Repeating a simulation with half the step length.
    Simulate,
}

impl Phase {
    /// Name of the phase in plain words, for display.
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

    /// Share, 0 to 1, of the remaining work that a phase takes, measured on logs with one cause (two rounds of search).
    const fn share(self) -> f64 {
        match self {
            Self::Refit => 0.09,
            Self::Screen => 0.16,
            Self::Candidates => 0.30,
            Self::Finalists => 0.38,
            Self::Pushes => 0.05,
            Self::Result => 0.95,
            // Each repetition takes twice the time of all before it, and one or two repetitions suffice.
            Self::Simulate => 0.4,
        }
    }
}

/// Progress report: current phase and fraction done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Current phase of the computation.
    pub phase: Phase,
    /// Estimated fraction of the work that is done, 0 to 1; never falls.
    pub fraction: f64,
}

/// Answer of an observer to a progress report: continue or cancel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Control {
    /// Continue the computation.
    Go,
    /// Cancel the computation with an error at its next progress check.
    Stop,
}

/// Function that receives progress reports and may cancel; called often and from any thread, so it must be quick.
pub type Observer = Arc<dyn Fn(Progress) -> Control + Send + Sync>;

/// Counts units of work and reports progress to the observer.
pub struct ProgressReporter {
    observer: Observer,
    /// Index of the current phase in `ORDER`.
    phase: AtomicUsize,
    /// Units of work planned in the current phase.
    planned: AtomicUsize,
    /// Units of work done in the current phase.
    done: AtomicUsize,
    /// Fractions of the work, 0 to 1, at which the current phase begins and ends, and the largest fraction reported; as bits of doubles, whose order
    /// as integers is that of the numbers.
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

/// Payload of the unwinding that cancels a computation; recognised by its type.
struct Stopped;

impl ProgressReporter {
    /// A reporter that starts at fraction 0 and reports to `observer`.
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

    /// A reporter that counts no units: its observer sees the fraction reached by this reporter so far, and may cancel.
    pub fn aside(&self) -> Self {
        let (observer, now) = (Arc::clone(&self.observer), self.current());
        Self::new(Arc::new(move |_| observer(now)))
    }

    /// Ends the current phase and begins `phase`, of about `units` units of work.
    pub fn begin(&self, phase: Phase, units: usize) {
        let from = f64::from_bits(self.to.load(Relaxed));
        self.phase.store(ORDER.iter().position(|w| *w == phase).unwrap_or(0), Relaxed);
        self.planned.store(units.max(1), Relaxed);
        self.done.store(0, Relaxed);
        self.from.store(from.to_bits(), Relaxed);
        self.to.store((from + (1.0 - from) * phase.share()).to_bits(), Relaxed);
        self.check();
    }

    /// Counts one unit of work as done and reports to the observer.
    pub fn unit(&self) {
        self.done.fetch_add(1, Relaxed);
        self.check();
    }

    /// Reports the current progress to the observer; does not return if the observer cancels.
    pub fn check(&self) {
        if (self.observer)(self.current()) == Control::Stop {
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

/// Runs `task`; `None` if the observer cancelled it.
pub fn guarded<T>(task: impl FnOnce() -> T) -> Option<T> {
    match catch_unwind(AssertUnwindSafe(task)) {
        Ok(result) => Some(result),
        Err(cause) if is_cancellation(cause.as_ref()) => None,
        Err(cause) => resume_unwind(cause),
    }
}

fn is_cancellation(cause: &(dyn Any + Send)) -> bool {
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
        let reporter =
            ProgressReporter::new(Arc::new(|p| if p.fraction > 0.05 { Control::Stop } else { Control::Go }));
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
