//! Batch rollouts: many runs at once, one in each lane of a vector unit.
//!
//! Each run has its own plant, initial state, times and torques. A step is taken by all lanes at once, each with its present friction modes
//! ([`crate::fixed_mode`]), and every lane has its own clock: a lane in which a joint reverses within a step goes back to the start of the step, and
//! takes a shorter step to the reversal and another to the sample while other lanes go on. Rarer events (a joint that breaks away within a step, a
//! step beyond the angle range) are left to the scalar integrator ([`crate::integrate`]). Plants in which more than friction modes can change cannot
//! run in a batch.

mod batch;
mod clock;
mod cursor;
mod lane_step;
mod latent_batch;
mod latent_lanes;
mod latent_motion;
mod plant_lanes;

use crate::arm::Arm;
use crate::cpu::{Cpu, Kernel, Level};
use crate::effect::InputSegment;
use crate::integrate::State;
use crate::plant::Plant;
use crate::real::Real;
use batch::LaneBatch;
pub use latent_batch::{Correction, LatentRollout};

/// Number of runs that a batch rollout simulates at a time.
pub const WIDTH: usize = 8;

/// Simulation of one plant from the first of its sample times to the last.
pub struct Run<'a, T: Real, A, const N: usize, const P: usize> {
    /// Plant to simulate, of which only friction modes may change ([`Plant::only_modes_change`]).
    pub plant: &'a Plant<T, A, N, P>,
    /// Sample times of the run, s.
    pub t: &'a [T],
    /// Joint torques from each sample to the next, N m (N).
    pub torque: &'a [[InputSegment<T>; N]],
    /// State at the first sample; after the rollout, the state at the end of the run.
    pub state: State<T, N>,
    /// Joint positions, rad or m, at all samples after the first, `N` for each; unchanged after the sample at which a position exceeds the limit. The
    /// rollout takes the slice out of the run.
    pub positions: &'a mut [T],
}

/// Batch of runs, simulated [`WIDTH`] at a time; a run ends where a joint position exceeds `limit`, rad or m, or is NaN.
pub struct BatchRollout<'r, 'a, T: Real, A, const N: usize, const P: usize> {
    /// Runs of the batch.
    pub runs: &'r mut [Run<'a, T, A, N, P>],
    /// Largest size of a joint position, rad or m, beyond which a run ends.
    pub limit: T,
}

impl<'a, T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> BatchRollout<'_, 'a, T, A, N, P> {
    /// Simulates all runs with the instruction set `level`.
    pub fn run_all(self, level: Level) {
        level.run_wide(self);
    }

    /// Simulates all runs in `H` vectors of `W` lanes.
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
        // A remainder of at most half the lanes is simulated in vectors of half the length, which takes half the time.
        let over = runs.len() % WIDTH;
        let (most, few) = runs.split_at_mut(if over <= WIDTH / 2 { runs.len() - over } else { runs.len() });
        Self::run_batch::<C, 8, 1>(most, limit);
        Self::run_batch::<C, 4, 1>(few, limit);
    }
}
