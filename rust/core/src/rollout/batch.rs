//! State of all lanes of a batch rollout, and one step of all lanes.

use super::clock::Clock;
use super::cursor::{
    RunCursor, lane_of, lane_values, sincos_of, start_interval, state_of, static_friction_of,
};
use super::lane_step::{LaneStep, StepOutcome};
use super::plant_lanes::{LaneDynamics, PlantLanes};
use super::{Run, WIDTH};
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::fixed_mode::{FixedModeStep, ModeCheck, Modes, Span, rk4_fixed_mode};
use crate::integrate::{State, exact};
use crate::kinematics::{AngleRange, JointState, KinematicState};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::plant::Mode;
use crate::real::{Real, lit};
use crate::trig::SinCos;
use core::array::from_fn;
use nalgebra::SVector;

/// Number of steps of a batch rollout after which sines and cosines that were rotated step by step are computed anew.
const STEPS_TO_RECOMPUTE: usize = 64;

/// Number subtracted from the mode violation of lanes that have ended, so that these lanes never count as violating a mode.
const IDLE: f64 = 1e30;

/// Time by which the lanes of a batch rollout advance in one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum StepExtent {
    /// All lanes advance over a whole sample interval.
    Full,
    /// Some lanes advance over the rest of an interval only.
    Partial,
    /// Some lanes advance to a reversal only.
    ToReversal,
}

/// State of all lanes of a batch rollout, in `H` vectors of `W` lanes.
pub(super) struct LaneBatch<'a, T: Real, C, A, const W: usize, const H: usize, const N: usize, const P: usize>
{
    plant_lanes: [PlantLanes<'a, T, C, A, W, N, P>; H],
    kinematics: [KinematicState<Lanes<T, C, W>, N>; H],
    modes: [Modes<Lanes<T, C, W>, N>; H],
    spans: [Span<Lanes<T, C, W>, N>; H],
    /// Joint states at the start of the last step; `sincos` are sines and cosines at the start, `mode_check` the check of the step's friction modes.
    step_start: [JointState<Lanes<T, C, W>, N>; H],
    sincos: [[SinCos<Lanes<T, C, W>>; N]; H],
    mode_check: [ModeCheck<Lanes<T, C, W>, N>; H],
    clocks: [Clock<T, N>; WIDTH],
    /// 0 for lanes that move, [`IDLE`] for lanes that have ended, so that ended lanes never show a mode violation.
    idle: [Lanes<T, C, W>; H],
    /// Index of the run in each lane; `cursors` has each lane's position in its run, `None` if the lane has ended.
    runs: [usize; WIDTH],
    cursors: [Option<RunCursor<'a, T, N>>; WIDTH],
    /// Number of lanes that have not ended.
    moving: usize,
    /// Index of the run that enters the next free lane.
    waiting: usize,
    extent: StepExtent,
    /// Whether the sliding direction of a lane has changed since its friction modes were computed.
    modes_stale: bool,
    steps: usize,
    limit: T,
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const H: usize, const N: usize, const P: usize>
    LaneBatch<'a, T, C, A, W, H, N, P>
{
    /// Number of lanes in all vectors.
    const LANES: usize = W * H;

    #[inline(always)]
    pub(super) fn new(runs: &mut [Run<'a, T, A, N, P>], limit: T) -> Option<Self> {
        let plant = runs.first()?.plant;
        let zero = Lanes::of(T::zero());
        let mut lanes = Self {
            plant_lanes: from_fn(|_| PlantLanes::new(plant)),
            kinematics: [KinematicState::none(); H],
            modes: [Modes::new([zero; N], [zero; N]); H],
            spans: [Span { t: zero, h: zero, tau: [[zero; N]; 3] }; H],
            step_start: [KinematicState::none().joints; H],
            sincos: [KinematicState::none().sincos; H],
            mode_check: [ModeCheck::none(); H],
            clocks: [Clock::new(); WIDTH],
            runs: [0; WIDTH],
            cursors: from_fn(|_| None),
            idle: [zero; H],
            moving: Self::LANES,
            waiting: 0,
            extent: StepExtent::Full,
            modes_stale: true,
            steps: 0,
            limit,
        };
        for l in 0..Self::LANES {
            lanes.enter(runs, l);
        }
        lanes.renew_modes();
        Some(lanes)
    }

    /// Whether the run in any lane has not ended.
    #[inline(always)]
    pub(super) fn are_moving(&self) -> bool {
        self.moving > 0
    }

    /// Takes one step of every lane of the batch rollout.
    #[inline(always)]
    pub(super) fn step(&mut self, runs: &mut [Run<'a, T, A, N, P>]) {
        if self.extent != StepExtent::Full {
            self.set_partial_steps();
        }
        let right = if self.plant_lanes.iter().any(PlantLanes::has_effects) {
            self.step_lanes::<true, true>()
        } else if self.modes.iter().any(|modes| modes.any_stuck) {
            self.step_lanes::<false, true>()
        } else {
            self.step_lanes::<false, false>()
        };
        if right {
            self.arrive_all(runs);
        } else {
            self.resolve_lanes(runs);
        }
        self.steps += 1;
        if self.steps >= STEPS_TO_RECOMPUTE {
            for i in 0..H {
                self.kinematics[i] = self.plant_lanes[i].rigid.kinematics(&self.kinematics[i].joints);
            }
            self.steps = 0;
        }
    }

    /// Takes one step of every lane with its friction modes; returns whether the modes agree with the motion in all lanes.
    #[inline(always)]
    fn step_lanes<const EFFECTS: bool, const ANY_STUCK: bool>(&mut self) -> bool {
        let mut right = self.extent != StepExtent::ToReversal;
        for i in 0..H {
            (self.step_start[i], self.sincos[i]) = (self.kinematics[i].joints, self.kinematics[i].sincos);
            let step = FixedModeStep {
                dynamics: &LaneDynamics::<_, EFFECTS, ANY_STUCK>(&self.plant_lanes[i]),
                start: &self.kinematics[i],
                modes: &self.modes[i],
                span: &self.spans[i],
            };
            self.kinematics[i] = rk4_fixed_mode(&step, &mut self.mode_check[i]);
            let mut mode_violation = self.mode_check[i].mode_violation - self.idle[i];
            for j in 0..N {
                mode_violation =
                    mode_violation.larger(self.kinematics[i].joints.q[j].size() - Lanes::of(self.limit));
            }
            right &= mode_violation.none_positive();
        }
        right
    }

    /// Accepts a step in which the friction modes hold in all lanes, and starts the next interval of every lane.
    #[inline(always)]
    fn arrive_all(&mut self, runs: &mut [Run<'a, T, A, N, P>]) {
        if self.extent != StepExtent::Full {
            self.clocks = [Clock::new(); WIDTH];
        }
        let mut ended = false;
        for l in 0..Self::LANES {
            if let Some(cursor) = &mut self.cursors[l] {
                cursor.arrive(lane_of(&self.kinematics[l / W].joints, l % W).q);
                match &cursor.interval {
                    Some(interval) => start_interval(&mut self.spans[l / W], l % W, interval),
                    None => ended = true,
                }
            }
        }
        self.extent = StepExtent::Full;
        if ended {
            for l in 0..Self::LANES {
                if self.cursors[l].as_ref().is_some_and(|cursor| cursor.interval.is_none()) {
                    self.end(runs, l);
                }
            }
        }
        self.renew_modes();
    }

    /// Decides lane by lane whether a step is accepted, repeated, or handed to the scalar integrator.
    #[inline(always)]
    fn resolve_lanes(&mut self, runs: &mut [Run<'a, T, A, N, P>]) {
        self.extent = StepExtent::Partial;
        for l in 0..Self::LANES {
            if self.cursors[l].is_none() {
                continue;
            }
            let right =
                self.clocks[l].goal.is_none() && self.mode_check[l / W].mode_violation.0[l % W] <= T::zero();
            if right || self.judge(l) {
                self.arrive(runs, l);
            }
        }
        self.renew_modes();
    }

    /// Recomputes the friction modes of all lanes from their sliding directions.
    #[inline(always)]
    fn renew_modes(&mut self) {
        for i in 0..H {
            if self.modes_stale {
                self.modes[i] = Modes::new(self.modes[i].direction, self.plant_lanes[i].dry);
            } else {
                self.modes[i].fresh = false;
            }
        }
        self.modes_stale = false;
    }

    /// Joint state of lane `l`.
    #[inline(always)]
    fn joints(&self, l: usize) -> JointState<T, N> {
        lane_of(&self.kinematics[l / W].joints, l % W)
    }

    /// Writes the positions of lane `l` at the end of its interval, and ends its run if a position is beyond the limit.
    #[inline]
    fn arrive(&mut self, runs: &mut [Run<'a, T, A, N, P>], l: usize) {
        let q = self.joints(l).q;
        let within = q.iter().all(|q| q.abs() <= self.limit);
        self.clocks[l] = Clock::new();
        if let Some(cursor) = &mut self.cursors[l]
            && within
        {
            cursor.arrive(q);
            if let Some(interval) = &cursor.interval {
                return start_interval(&mut self.spans[l / W], l % W, interval);
            }
        }
        self.end(runs, l);
    }

    /// Ends the run in lane `l`; the next run enters, if there is one.
    #[inline(never)]
    fn end(&mut self, runs: &mut [Run<'a, T, A, N, P>], l: usize) {
        runs[self.runs[l]].state =
            state_of(&self.joints(l), &lane_values(&self.modes[l / W].direction, l % W));
        self.enter(runs, l);
    }

    /// Puts the next run into lane `l`, or ends the lane if there is none.
    #[inline(never)]
    fn enter(&mut self, runs: &mut [Run<'a, T, A, N, P>], l: usize) {
        let mut state = State::new(SVector::zeros(), SVector::zeros());
        (self.clocks[l], self.cursors[l]) = (Clock::new(), None);
        while self.cursors[l].is_none() && self.waiting < runs.len() {
            let run = &mut runs[self.waiting];
            (self.runs[l], self.cursors[l]) = (self.waiting, RunCursor::of(run));
            state = run.state;
            self.plant_lanes[l / W].put(l % W, run.plant);
            self.waiting += 1;
        }
        if let Some(RunCursor { interval: Some(interval), .. }) = &self.cursors[l] {
            start_interval(&mut self.spans[l / W], l % W, interval);
        } else {
            // A step of zero length, which violates no mode.
            self.spans[l / W].h.0[l % W] = T::zero();
            self.idle[l / W].0[l % W] = lit(IDLE);
            self.moving -= 1;
            state = State { modes: [Mode::Forward; N], ..State::new(SVector::zeros(), SVector::zeros()) };
        }
        self.set_direction(l, &state.modes.map(Mode::direction));
        let rigid = self.plant_lanes[l / W].plants[l % W].rigid();
        self.put(l, &rigid.kinematics(&JointState { q: state.q.into(), dq: state.dq.into() }));
    }

    /// Sets the sliding directions of lane `l`.
    #[inline]
    fn set_direction(&mut self, l: usize, direction: &[T; N]) {
        for j in 0..N {
            self.modes[l / W].direction[j].0[l % W] = direction[j];
        }
        self.modes_stale = true;
    }

    /// Sets the kinematic state of lane `l`.
    #[inline]
    fn put(&mut self, l: usize, own: &KinematicState<T, N>) {
        let (l, i) = (l % W, l / W);
        let KinematicState { joints, sincos, equation_terms } = &mut self.kinematics[i];
        for j in 0..N {
            (joints.q[j].0[l], joints.dq[j].0[l]) = (own.joints.q[j], own.joints.dq[j]);
            (sincos[j].sine.0[l], sincos[j].cosine.0[l]) = (own.sincos[j].sine, own.sincos[j].cosine);
            equation_terms.bias[j].0[l] = own.equation_terms.bias[j];
            for k in 0..N {
                equation_terms.inertia[j][k].0[l] = own.equation_terms.inertia[j][k];
            }
        }
    }

    /// Sets the spans of lanes that step over a part of their interval only.
    #[inline(never)]
    fn set_partial_steps(&mut self) {
        self.extent = StepExtent::Full;
        for l in 0..Self::LANES {
            let (clock, cursor) = (&self.clocks[l], &self.cursors[l]);
            let Some(RunCursor { interval: Some(interval), .. }) = cursor else { continue };
            if clock.is_whole() {
                continue;
            }
            self.extent = self.extent.max(if clock.goal.is_some() {
                StepExtent::ToReversal
            } else {
                StepExtent::Partial
            });
            let h = clock.length();
            let (span, l) = (&mut self.spans[l / W], l % W);
            (span.t.0[l], span.h.0[l]) = (interval.t + clock.done, h);
            for (i, part) in [T::zero(), lit(0.5), T::one()].into_iter().enumerate() {
                let tau = interval.torque_at(clock.done + h * part);
                for j in 0..N {
                    span.tau[i][j].0[l] = tau[j];
                }
            }
        }
    }

    /// Accepts the step that lane `l` has tried, or cuts it at an event; returns whether the lane is at the end of its interval.
    #[inline(never)]
    fn judge(&mut self, l: usize) -> bool {
        let (i, lane) = (l / W, l % W);
        let Some(RunCursor { interval: Some(interval), .. }) = &self.cursors[l] else { return false };
        if self.clocks[l].is_whole() {
            self.clocks[l].left = interval.h;
        }
        let (mode_check, start, end) = (&self.mode_check[i], &self.step_start[i], &self.kinematics[i]);
        let PlantLanes { rigid, dry, plants, .. } = &self.plant_lanes[i];
        let lane_step = LaneStep {
            ends: [lane_of(start, lane), lane_of(&end.joints, lane)],
            ddq: [lane_values(&mode_check.ddq[0], lane), lane_values(&mode_check.ddq[1], lane)],
            static_friction: self.modes[i]
                .any_stuck
                .then(|| mode_check.static_friction.each_ref().map(|held| static_friction_of(held, lane))),
            range_violation: mode_check.range_violation.0[lane],
            dry: lane_values(dry, lane).map(|dry| dry != T::zero()),
            coulomb: lane_values(&rigid.coulomb, lane),
            inertia: end.equation_terms.inertia.each_ref().map(|row| lane_values(row, lane)),
        };
        let clock = &mut self.clocks[l];
        let before = lane_values(&self.modes[i].direction, lane);
        let mut direction = before;
        let own = plants[lane].rigid();
        let (kinematics, arrived) = match lane_step.judge(clock, &mut direction) {
            StepOutcome::Accepted => return true,
            StepOutcome::Repeat => (own.rotated(&lane_step.ends[0], sincos_of(&self.sincos[i], lane)), false),
            StepOutcome::Reversed(joints) => {
                let sincos = sincos_of(&end.sincos, lane);
                (
                    own.near(&joints, &lane_step.ends[1].q, &sincos, AngleRange::Slight),
                    clock.left <= T::zero(),
                )
            }
            StepOutcome::Scalar => {
                let mut state = state_of(&lane_step.ends[0], &direction);
                exact(plants[lane], &mut state, interval, clock.done);
                direction = state.modes.map(Mode::direction);
                (own.kinematics(&JointState { q: state.q.into(), dq: state.dq.into() }), true)
            }
        };
        if direction != before {
            self.set_direction(l, &direction);
        }
        self.put(l, &kinematics);
        arrived
    }
}
