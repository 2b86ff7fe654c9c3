//! Batch rollouts: many runs at once, one in each lane of a vector unit.
//!
//! Each run has its own plant, start, times and torques. A step is taken by all lanes at once with the friction modes they have
//! ([`crate::fixed_mode`]), and every lane has its own clock: where a joint reverses within a step, that lane goes back to where the step
//! started, and takes a shorter one to the reversal and another to the sample while the others go on. What is rarer (a joint that
//! breaks away within a step, a step beyond the angle range) is integrated by the scalar integrator ([`crate::integrate`]). Runs of plants
//! in which more than friction modes can change are not for a batch.

mod batch;
mod clock;
mod cursor;
mod lane_step;
mod plant_lanes;

use crate::arm::Arm;
use crate::cpu::{Cpu, Kernel, Level};
use crate::effect::InputSegment;
use crate::integrate::State;
use crate::plant::Plant;
use crate::real::Real;
use batch::LaneBatch;

/// Number of runs in a batch.
pub const WIDTH: usize = 8;

/// One run: from `state` at the first of the times to the last.
pub struct Run<'a, T: Real, A, const N: usize, const P: usize> {
    /// The plant; see [`Plant::only_modes_change`].
    pub plant: &'a Plant<T, A, N, P>,
    /// Sample times, s.
    pub t: &'a [T],
    /// Torques from each sample to the next.
    pub torque: &'a [[InputSegment<T>; N]],
    /// State at the first sample; after the rollout, the state at its end.
    pub state: State<T, N>,
    /// Positions at all further samples, `N` for each; those after a run has left the limit stay as they are. The rollout takes them.
    pub positions: &'a mut [T],
}

/// A batch of runs, simulated [`WIDTH`] at a time; each ends where a position exceeds `limit` or is NaN.
pub struct BatchRollout<'r, 'a, T: Real, A, const N: usize, const P: usize> {
    /// The runs.
    pub runs: &'r mut [Run<'a, T, A, N, P>],
    /// Largest position.
    pub limit: T,
}

impl<'a, T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> BatchRollout<'_, 'a, T, A, N, P> {
    /// Simulates all runs with these instructions.
    pub fn run_all(self, level: Level) {
        level.run_wide(self);
    }

    /// Simulates runs in `H` vectors of `W` lanes.
    #[inline(always)]
    fn run_batch<C: Cpu, const W: usize, const H: usize>(runs: &mut [Run<'a, T, A, N, P>], limit: T) {
        let Some(mut lanes) = LaneBatch::<T, C, A, W, H, N, P>::new(runs, limit) else { return };
        while lanes.are_moving() {
            lanes.step(runs);
        }
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Kernel for BatchRollout<'_, '_, T, A, N, P> {
    type Output = ();

    #[inline(always)]
    fn run<C: Cpu>(self) {
        let Self { runs, limit } = self;
        if C::DOUBLES == 2 {
            return Self::run_batch::<C, 2, 4>(runs, limit);
        }
        if C::DOUBLES == WIDTH {
            return Self::run_batch::<C, 8, 1>(runs, limit);
        }
        // Half the lanes take half the time.
        let over = runs.len() % WIDTH;
        let (most, few) = runs.split_at_mut(if over <= WIDTH / 2 { runs.len() - over } else { runs.len() });
        Self::run_batch::<C, 8, 1>(most, limit);
        Self::run_batch::<C, 4, 1>(few, limit);
    }
}
