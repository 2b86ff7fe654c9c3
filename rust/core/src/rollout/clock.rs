//! A lane's progress within its sample interval, and the reversal it aims at.

use crate::real::Real;

/// Mode changes within one interval before the scalar integrator takes the rest of it: six of each joint, at least those of two.
pub(super) const fn max_changes(joints: usize) -> usize {
    if joints < 2 { 12 } else { 6 * joints }
}

/// One lane's time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock<T, const N: usize> {
    /// Part of the interval that is done, s.
    pub(super) done: T,
    /// Part of the interval that is left, s.
    pub(super) left: T,
    /// The reversal that the step shall end at.
    pub(super) goal: Option<Reversal<T>>,
    /// Joints that could not be released at this instant.
    pub(super) tried: [bool; N],
    /// Steps that ended short of the interval's end.
    pub(super) changes: usize,
}

impl<T: Real, const N: usize> Clock<T, N> {
    /// At the start of an interval.
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self { done: T::zero(), left: T::zero(), goal: None, tried: [false; N], changes: 0 }
    }

    /// Whether the next step is the whole interval.
    #[inline(always)]
    pub(super) fn is_whole(&self) -> bool {
        self.done == T::zero() && self.goal.is_none()
    }

    /// Advances by `time` within the interval and forgets what was tried at the last instant.
    #[inline]
    pub(super) fn pass(&mut self, time: T) {
        (self.done, self.left) = (self.done + time, self.left - time);
        (self.goal, self.tried) = (None, [false; N]);
        self.changes += 1;
    }

    /// Length of the next step.
    #[inline(always)]
    pub(super) fn length(&self) -> T {
        self.goal.map_or(self.left, |goal| goal.length)
    }
}

/// A joint's reversal within a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reversal<T> {
    /// The joint.
    pub(super) joint: usize,
    /// When, s after the step's start.
    pub(super) length: T,
}
