//! Progress of a lane of a batch rollout within its sample interval, and the reversal at which its next step shall end.

use crate::real::Real;

/// Largest number of changes between sliding and sticking that the vectorised integrator follows in one run (a lane of the batch) within one sample
/// interval: 6 per joint, at least 12. The scalar integrator takes the rest of the interval.
pub(super) const fn max_changes(joints: usize) -> usize {
    if joints < 2 { 12 } else { 6 * joints }
}

/// Progress of one lane of a batch rollout within its sample interval.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock<T, const N: usize> {
    /// Part of the sample interval that has been integrated, s.
    pub(super) done: T,
    /// Part of the sample interval that is left, s.
    pub(super) left: T,
    /// Reversal at which the next step shall end, if any.
    pub(super) goal: Option<Reversal<T>>,
    /// Whether each joint was released at the present instant and stuck again because its acceleration opposed the release.
    pub(super) tried: [bool; N],
    /// Number of steps within the present interval that ended short of its end, or were repeated.
    pub(super) changes: usize,
}

impl<T: Real, const N: usize> Clock<T, N> {
    /// Clock at the start of a sample interval.
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { done: T::zero(), left: T::zero(), goal: None, tried: [false; N], changes: 0 }
    }

    /// Whether the next step is the whole sample interval.
    #[inline(always)]
    pub(super) fn is_whole(&self) -> bool {
        self.done == T::zero() && self.goal.is_none()
    }

    /// Advances by `time`, s, within the interval, and clears `goal` and `tried`, which held at the instant before.
    #[inline]
    pub(super) fn pass(&mut self, time: T) {
        (self.done, self.left) = (self.done + time, self.left - time);
        (self.goal, self.tried) = (None, [false; N]);
        self.changes += 1;
    }

    /// Length of the next step, s.
    #[inline(always)]
    pub(super) fn length(&self) -> T {
        self.goal.map_or(self.left, |goal| goal.length)
    }
}

/// Reversal of a joint within a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reversal<T> {
    /// Joint that reverses, from 0.
    pub(super) joint: usize,
    /// Time of the reversal after the start of the step, s.
    pub(super) length: T,
}
