//! Batch rollouts of one plant with elastic joints or regularised friction: one run in each lane of a vector unit.
//!
//! Every lane divides its sample intervals into as many steps as keep Runge-Kutta stable, as [`crate::integrate::advance_in_stable_steps`] does. A
//! step in which the friction mode of a joint changes is left to the scalar integrator ([`crate::integrate`]), in its lane alone.

use super::cursor::{RunCursor, lane_values};
use super::elastic_lanes::{ElasticLanes, ElasticModes, ElasticSpan, ElasticState};
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

/// Batch of runs of one plant ([`crate::plant::Plant::is_elastic_or_regularised`]), simulated [`WIDTH`] at a time; a run ends where a joint position
/// exceeds `limit`, rad or m, or is NaN. The positions of the runs are those that the encoders show.
pub struct ElasticRollout<'r, 'a, T: Real, A, const N: usize, const P: usize> {
    /// Runs of the batch, all of the same plant.
    pub runs: &'r mut [Run<'a, T, A, N, P>],
    /// Largest size of a joint position, rad or m, beyond which a run ends.
    pub limit: T,
    /// Largest numbers of steps in one sample interval.
    pub step_limits: StepLimits,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> ElasticRollout<'_, '_, T, A, N, P> {
    /// Simulates all runs with the instruction set `level`.
    pub fn run_all(self, level: Level) {
        level.run_wide(self);
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Kernel for ElasticRollout<'_, '_, T, A, N, P> {
    type Output = ();

    #[inline(always)]
    fn run<C: Cpu>(self) {
        let Some(mut batch) = ElasticBatch::<T, C, A, WIDTH, N, P>::new(self) else { return };
        while batch.moving > 0 {
            batch.step();
        }
    }
}

/// State of all lanes of a batch.
struct ElasticBatch<'r, 'a, T: Real, C, A, const W: usize, const N: usize, const P: usize> {
    rollout: ElasticRollout<'r, 'a, T, A, N, P>,
    lanes: ElasticLanes<'a, T, C, A, W, N, P>,
    state: ElasticState<Lanes<T, C, W>, N>,
    modes: ElasticModes<Lanes<T, C, W>, N>,
    span: ElasticSpan<Lanes<T, C, W>, N>,
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
    ElasticBatch<'r, 'a, T, C, A, W, N, P>
{
    #[inline(always)]
    fn new(rollout: ElasticRollout<'r, 'a, T, A, N, P>) -> Option<Self> {
        let plant = rollout.runs.first()?.plant;
        let (zero, one) = (Lanes::of(T::zero()), Lanes::of(T::one()));
        let joints = JointState { q: [zero; N], dq: [zero; N] };
        let mut batch = Self {
            rollout,
            lanes: ElasticLanes::new(plant),
            state: ElasticState { joints, deflection: [zero; N], deflection_rate: [zero; N] },
            modes: ElasticModes { direction: [one; N], any_stuck: false },
            span: ElasticSpan { t: zero, h: zero, tau: [[zero; N]; 3] },
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
            let holds = step.violation.0[l] <= T::zero();
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

    /// Divides the intervals that lanes start into steps; `free` is each joint's inertia with all other joints free to move.
    #[inline(never)]
    fn start_intervals(&mut self, free: &[Lanes<T, C, W>; N]) {
        let plant = self.lanes.plant();
        for l in 0..W {
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
        let plant = self.lanes.plant();
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
        let JointState { q, dq } = &self.state.joints;
        let (q, dq): ([T; N], [T; N]) = (lane_values(q, l), lane_values(dq, l));
        let within = q.iter().all(|q| q.abs() <= self.rollout.limit)
            && dq.iter().all(nalgebra::ComplexField::is_finite);
        if within && let Some(cursor) = &mut self.cursors[l] {
            let drivetrain = self.lanes.plant().drivetrain();
            let deflection: [T; N] = lane_values(&self.state.deflection, l);
            cursor.arrive(from_fn(|j| {
                if drivetrain.sides(j).encoder_at_motor { q[j] + deflection[j] } else { q[j] }
            }));
            if cursor.interval.is_some() {
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
        let ElasticState { joints, deflection, deflection_rate } = &self.state;
        let mut state =
            State::new(SVector::from(lane_values(&joints.q, l)), SVector::from(lane_values(&joints.dq, l)));
        state.modes = lane_values(&self.modes.direction, l).map(Mode::of);
        state.latent.deflection = lane_values(deflection, l).into();
        state.latent.deflection_rate = lane_values(deflection_rate, l).into();
        state
    }

    /// Sets the state of lane `l` to that of the same lane in `other`.
    #[inline]
    fn put(&mut self, l: usize, other: &ElasticState<Lanes<T, C, W>, N>) {
        for j in 0..N {
            self.state.joints.q[j].0[l] = other.joints.q[j].0[l];
            self.state.joints.dq[j].0[l] = other.joints.dq[j].0[l];
            self.state.deflection[j].0[l] = other.deflection[j].0[l];
            self.state.deflection_rate[j].0[l] = other.deflection_rate[j].0[l];
        }
    }

    /// Sets the state of lane `l`.
    #[inline]
    fn set(&mut self, l: usize, state: &State<T, N>) {
        let plant = self.lanes.plant();
        self.modes.any_stuck = false;
        for j in 0..N {
            self.state.joints.q[j].0[l] = state.q[j];
            self.state.joints.dq[j].0[l] = state.dq[j];
            self.state.deflection[j].0[l] = state.latent.deflection[j];
            self.state.deflection_rate[j].0[l] = state.latent.deflection_rate[j];
            self.modes.direction[j].0[l] =
                if plant.is_rounded(j) { T::one() } else { state.modes[j].direction() };
            self.modes.any_stuck |= self.modes.direction[j].any_zero();
        }
    }
}
