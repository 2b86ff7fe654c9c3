//! Batch rollouts of plants with latent states or regularised friction: one run in each lane of a vector unit.
//!
//! Every lane divides its sample intervals into as many steps as keep Runge-Kutta stable, as [`crate::integrate::advance_in_stable_steps`] does. A
//! step in which the friction mode of a joint changes, or in which backlash closes or opens, is left to the scalar integrator
//! ([`crate::integrate`]), in its lane alone.

use super::cursor::{RunCursor, lane_values};
use super::latent_lanes::{LatentLaneState, LatentLanes, LatentModes, LatentSpan};
use super::{Run, WIDTH};
use crate::arm::Arm;
use crate::cpu::{Cpu, Kernel, Level};
use crate::integrate::{Division, State, StepLimits, keep_sliding, max_events, substep};
use crate::kinematics::JointState;
use crate::lanes::Lanes;
use crate::linear::free_inertia;
use crate::number::Number;
use crate::plant::Mode;
use crate::real::{Real, lit};
use core::array::from_fn;
use nalgebra::SVector;

/// Correction of the states that runs reach at their samples, such as by what was measured there.
pub trait Correction<T: Real, const N: usize> {
    /// Corrects the state that the run with the index `run` has reached at its next sample; the run goes on from there.
    fn correct(&mut self, run: usize, state: &mut State<T, N>);
}

/// Batch of runs of plants ([`crate::plant::Plant::is_latent_or_regularised`]), simulated [`WIDTH`] at a time; without a
/// correction a run ends where a joint position exceeds `limit`, rad or m, or is NaN. The positions of the runs are those that the encoders show,
/// before a correction.
pub struct LatentRollout<'r, 'a, T: Real, A, const N: usize, const P: usize> {
    /// Runs of the batch, whose plants differ in values alone: all have the same transmissions, effects and joints with regularised friction.
    pub runs: &'r mut [Run<'a, T, A, N, P>],
    /// Largest size of a joint position, rad or m, beyond which a run ends.
    pub limit: T,
    /// Largest numbers of steps in one sample interval.
    pub step_limits: StepLimits,
    /// Correction of the states at the samples, if any.
    pub correction: Option<&'r mut dyn Correction<T, N>>,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> LatentRollout<'_, '_, T, A, N, P> {
    /// Simulates all runs with the instruction set `level`.
    pub fn run_all(self, level: Level) {
        level.run_wide(self);
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Kernel for LatentRollout<'_, '_, T, A, N, P> {
    type Output = ();

    #[inline(always)]
    fn run<C: Cpu>(self) {
        let Some(mut batch) = LatentBatch::<T, C, A, WIDTH, N, P>::new(self) else { return };
        while batch.moving > 0 {
            batch.step();
        }
    }
}

/// State of all lanes of a batch.
struct LatentBatch<'r, 'a, T: Real, C, A, const W: usize, const N: usize, const P: usize> {
    rollout: LatentRollout<'r, 'a, T, A, N, P>,
    lanes: LatentLanes<'a, T, C, A, W, N, P>,
    state: LatentLaneState<Lanes<T, C, W>, N>,
    modes: LatentModes<Lanes<T, C, W>, N>,
    span: LatentSpan<Lanes<T, C, W>, N>,
    /// Division of each lane's sample interval.
    divisions: [Division<T>; W],
    /// Whether each lane starts a sample interval.
    at_sample: [bool; W],
    /// Index of the run in each lane; `cursors` has each lane's position in its run, `None` if the lane has ended.
    runs: [usize; W],
    cursors: [Option<RunCursor<'a, T, N>>; W],
    /// Number of lanes that have not ended.
    moving: usize,
    /// Index of the run that enters the next free lane.
    waiting: usize,
}

impl<'r, 'a, T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const N: usize, const P: usize>
    LatentBatch<'r, 'a, T, C, A, W, N, P>
{
    #[inline(always)]
    fn new(rollout: LatentRollout<'r, 'a, T, A, N, P>) -> Option<Self> {
        let plant = rollout.runs.first()?.plant;
        let (zero, one) = (Lanes::of(T::zero()), Lanes::of(T::one()));
        let joints = JointState { q: [zero; N], dq: [zero; N] };
        let mut batch = Self {
            rollout,
            lanes: LatentLanes::new(plant),
            state: LatentLaneState {
                joints,
                deflection: [zero; N],
                deflection_rate: [zero; N],
                memory: [zero; N],
            },
            modes: LatentModes { direction: [one; N], side: [zero; N], any_stuck: false },
            span: LatentSpan { t: zero, h: zero, tau: [[zero; N]; 3] },
            divisions: [Division::empty(); W],
            at_sample: [false; W],
            runs: [0; W],
            cursors: from_fn(|_| None),
            moving: W,
            waiting: 0,
        };
        for l in 0..W {
            batch.enter(l);
        }
        Some(batch)
    }

    /// Takes one step of every lane.
    #[inline(always)]
    fn step(&mut self) {
        let kinematics = self.lanes.kinematics(&self.state.joints);
        if self.at_sample.contains(&true) {
            let inertia = &kinematics.equation_terms.inertia;
            let mut free = [self.span.h; N];
            for j in 0..N {
                free[j] = free_inertia(inertia, j);
            }
            self.start_intervals(&free);
        }
        let start = self.state;
        let step = self.lanes.step(&start, &kinematics, &self.span, &self.modes);
        self.state = step.end;
        for l in 0..W {
            if self.cursors[l].is_none() {
                continue;
            }
            let holds = step.violation.0[l] <= T::zero() && !self.crosses_edge(l, &start);
            if !holds {
                self.put(l, &start);
                self.take_alone(l);
            } else if self.divisions[l].needs_sliding() && step.slowing.0[l] > T::zero() {
                self.put(l, &start);
                self.refine(l);
            } else {
                self.arrive(l);
            }
        }
    }

    /// Whether a joint of lane `l` crosses a position at which its torque jumps, on the way from the state `start`.
    #[inline(always)]
    fn crosses_edge(&self, l: usize, start: &LatentLaneState<Lanes<T, C, W>, N>) -> bool {
        let plant = self.lanes.plant(l);
        let crosses = |j: usize| {
            let [from, to] = [start, &self.state].map(|state| state.joints.q[j].0[l]);
            plant.edge_between(j, from, to).is_some()
        };
        plant.jumps() && (0..N).any(crosses)
    }

    /// Divides the intervals that lanes start into steps; `free` is each joint's inertia with all other joints free to move.
    #[inline(never)]
    fn start_intervals(&mut self, free: &[Lanes<T, C, W>; N]) {
        for l in 0..W {
            let plant = self.lanes.plant(l);
            let Some(RunCursor { interval: Some(interval), .. }) = &self.cursors[l] else { continue };
            if !self.at_sample[l] {
                continue;
            }
            self.at_sample[l] = false;
            let state = self.state_of(l);
            let rates = plant.step_rates_with(&state.q, &lane_values(free, l));
            let all_slide = plant.all_slide(&state.dq, &state.latent);
            self.divisions[l] =
                Division::new(interval.h, &rates, self.rollout.step_limits, all_slide, max_events(N));
            self.set_span(l);
        }
    }

    /// Sets times and torques of the next step of lane `l`.
    #[inline]
    fn set_span(&mut self, l: usize) {
        let Some(RunCursor { interval: Some(interval), .. }) = &self.cursors[l] else { return };
        let (from, h) = (self.divisions[l].from(), self.divisions[l].h);
        (self.span.t.0[l], self.span.h.0[l]) = (interval.t + from, h);
        for (i, part) in [T::zero(), lit(0.5), T::one()].into_iter().enumerate() {
            let tau = interval.torque_at(from + h * part);
            for j in 0..N {
                self.span.tau[i][j].0[l] = tau[j];
            }
        }
    }

    /// Divides the rest of the interval of lane `l` into steps for a joint near standstill.
    #[inline(never)]
    fn refine(&mut self, l: usize) {
        self.divisions[l].refine();
        self.set_span(l);
    }

    /// Takes the step of lane `l` with the scalar integrator.
    #[inline(never)]
    fn take_alone(&mut self, l: usize) {
        let Some(RunCursor { interval: Some(interval), .. }) = &self.cursors[l] else { return };
        let plant = self.lanes.plant(l);
        let (start, events) = (self.state_of(l), self.divisions[l].events);
        let mut state = start;
        substep(plant, &mut state, interval, &mut self.divisions[l]);
        if self.divisions[l].needs_sliding() && !keep_sliding(plant, &start, &state) {
            self.divisions[l].events = events;
            return self.refine(l);
        }
        self.set(l, &state);
        self.arrive(l);
    }

    /// Ends the step of lane `l`: the next step of its interval, the next interval or the next run follows.
    #[inline]
    fn arrive(&mut self, l: usize) {
        if self.divisions[l].next() {
            return self.set_span(l);
        }
        let mut state = self.state_of(l);
        let within = state.is_finite() && state.q.iter().all(|q| q.abs() <= self.rollout.limit);
        if (within || self.rollout.correction.is_some())
            && let Some(cursor) = &mut self.cursors[l]
        {
            cursor.arrive(self.lanes.plant(l).drivetrain().shown(&state.q, &state.latent).into());
            let goes_on = cursor.interval.is_some();
            if let Some(correction) = &mut self.rollout.correction {
                correction.correct(self.runs[l], &mut state);
                self.set(l, &state);
            }
            if goes_on {
                self.at_sample[l] = true;
                return;
            }
        }
        self.rollout.runs[self.runs[l]].state = self.state_of(l);
        self.enter(l);
    }

    /// Puts the next run into lane `l`, or ends the lane if there is none.
    #[inline(never)]
    fn enter(&mut self, l: usize) {
        self.cursors[l] = None;
        while self.waiting < self.rollout.runs.len() {
            let run = &mut self.rollout.runs[self.waiting];
            self.runs[l] = self.waiting;
            self.waiting += 1;
            let state = run.state;
            self.cursors[l] = RunCursor::of(run);
            if self.cursors[l].is_some() {
                self.at_sample[l] = true;
                self.lanes.put(l, self.rollout.runs[self.runs[l]].plant);
                return self.set(l, &state);
            }
        }
        // A lane without a run takes steps of zero length with an arm at rest.
        self.moving -= 1;
        self.span.h.0[l] = T::zero();
        self.set(l, &State { modes: [Mode::Forward; N], ..State::new(SVector::zeros(), SVector::zeros()) });
    }

    /// State of lane `l`.
    #[inline]
    fn state_of(&self, l: usize) -> State<T, N> {
        let LatentLaneState { joints, deflection, deflection_rate, memory } = &self.state;
        let mut state =
            State::new(SVector::from(lane_values(&joints.q, l)), SVector::from(lane_values(&joints.dq, l)));
        state.modes = lane_values(&self.modes.direction, l).map(Mode::of);
        state.latent.deflection = lane_values(deflection, l).into();
        state.latent.deflection_rate = lane_values(deflection_rate, l).into();
        state.latent.memory = lane_values(memory, l).into();
        state.latent.side = lane_values(&self.modes.side, l).into();
        state
    }

    /// Sets the state of lane `l` to that of the same lane in `other`.
    #[inline]
    fn put(&mut self, l: usize, other: &LatentLaneState<Lanes<T, C, W>, N>) {
        for j in 0..N {
            self.state.joints.q[j].0[l] = other.joints.q[j].0[l];
            self.state.joints.dq[j].0[l] = other.joints.dq[j].0[l];
            self.state.deflection[j].0[l] = other.deflection[j].0[l];
            self.state.deflection_rate[j].0[l] = other.deflection_rate[j].0[l];
            self.state.memory[j].0[l] = other.memory[j].0[l];
        }
    }

    /// Sets the state of lane `l`.
    #[inline]
    fn set(&mut self, l: usize, state: &State<T, N>) {
        let plant = self.lanes.plant(l);
        let memory = plant.memory(&state.q, &state.latent);
        self.modes.any_stuck = false;
        for j in 0..N {
            self.state.joints.q[j].0[l] = state.q[j];
            self.state.joints.dq[j].0[l] = state.dq[j];
            self.state.deflection[j].0[l] = state.latent.deflection[j];
            self.state.deflection_rate[j].0[l] = state.latent.deflection_rate[j];
            self.state.memory[j].0[l] = memory[j];
            self.modes.side[j].0[l] = state.latent.side[j];
            self.modes.direction[j].0[l] =
                if plant.is_rounded(j) { T::one() } else { state.modes[j].direction() };
            self.modes.any_stuck |= self.modes.direction[j].any_zero();
        }
    }
}
