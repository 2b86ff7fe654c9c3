//! The lanes on their way.

use super::bundle::Bundle;
use super::change::{Outcome, Taken};
use super::clock::Clock;
use super::{Run, WIDTH, Wide};
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::effect::Pulse;
use crate::glide::{Glided, Held, Modes, Place, Pose, Span, glide};
use crate::integrate::{Interval, State, exact};
use crate::number::Number;
use crate::plant::Mode;
use crate::real::{Real, lit};
use crate::trig::NEAR;
use nalgebra::SVector;

/// Steps after which sines and cosines that were turned on step by step are computed afresh.
const AFRESH: usize = 64;

/// Taken from what is wrong in lanes that have ended.
const IDLE: f64 = 1e30;

/// The lanes' states on their way.
pub(super) struct Abreast<'a, T: Real, C, A, const N: usize, const P: usize> {
    bundle: Bundle<'a, T, C, A, N, P>,
    pose: Pose<Wide<T, C>, N>,
    modes: Modes<Wide<T, C>, N>,
    clocks: [Clock<T, N>; WIDTH],
    /// Nothing in lanes that move, so much that nothing is wrong in those that have ended.
    idle: Wide<T, C>,
    /// Lanes that move.
    moving: usize,
    /// Whether all lanes that move go from sample to sample.
    even: bool,
    steps: usize,
    limit: T,
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const N: usize, const P: usize> Abreast<'a, T, C, A, N, P> {
    #[inline(always)]
    pub(super) fn new(runs: &[Run<'a, T, A, N, P>], limit: T) -> Option<Self> {
        let first = runs.first()?;
        let of = |l: usize| runs.get(l).unwrap_or(first);
        let bundle = Bundle::new(core::array::from_fn(|l| of(l).plant));
        let zero = Wide::of(T::zero());
        let mut place = Place { q: [zero; N], dq: [zero; N] };
        let mut direction = [zero; N];
        let mut clocks = [Clock::new(0); WIDTH];
        for l in 0..WIDTH {
            let state = &of(l).state;
            put(&mut place, l, &Place { q: state.q.into(), dq: state.dq.into() });
            for j in 0..N {
                direction[j].0[l] = state.modes[j].direction();
            }
            let rows = |run: &Run<'a, T, A, N, P>| run.torque.len().min(run.positions.len() / N);
            clocks[l] = Clock::new(runs.get(l).map_or(0, rows));
        }
        let pose = bundle.rigid.pose(&place);
        let (modes, moving) = (Modes::new(direction), WIDTH);
        let mut lanes = Self { bundle, pose, modes, clocks, idle: zero, moving, even: false, steps: 0, limit };
        for l in 0..WIDTH {
            if lanes.clocks[l].is_over() {
                lanes.rest(l);
            }
        }
        Some(lanes)
    }

    /// Whether any lane has not ended.
    #[inline(always)]
    pub(super) fn are_moving(&self) -> bool {
        self.moving > 0
    }

    /// One step of every lane.
    #[inline(always)]
    pub(super) fn step(&mut self, runs: &mut [Run<'a, T, A, N, P>]) {
        let span = if self.even { self.intervals(runs) } else { self.parts(runs) };
        let start = self.pose.place;
        let glided = glide(&self.bundle, &self.pose, &self.modes, &span);
        self.pose = glided.pose;
        self.steps += 1;
        let mut wrong = glided.wrong - self.idle;
        for j in 0..N {
            wrong = wrong.larger(self.pose.place.q[j].size() - Wide::of(self.limit));
        }
        if self.even && wrong.none_positive() {
            for (l, run) in runs.iter_mut().enumerate().take(WIDTH) {
                let Clock { k, rows, .. } = self.clocks[l];
                if k < rows {
                    write(run, k, &numbers(&self.pose.place.q, l));
                    self.clocks[l].k = k + 1;
                    if k + 1 == rows {
                        self.end(run, l);
                    }
                }
            }
        } else {
            self.sort_out(runs, &start, &glided);
        }
        if self.steps >= AFRESH {
            self.pose = self.bundle.rigid.pose(&self.pose.place);
            self.steps = 0;
        }
    }

    /// Goes on from a step after which lanes go different ways.
    #[inline(always)]
    fn sort_out(
        &mut self,
        runs: &mut [Run<'a, T, A, N, P>],
        start: &Place<Wide<T, C>, N>,
        glided: &Glided<Wide<T, C>, N>,
    ) {
        let (place, arrived) = self.judge(runs, start, glided);
        self.modes = Modes::new(self.modes.direction);
        let mut by = place.q;
        for j in 0..N {
            by[j] = place.q[j] - self.pose.place.q[j];
        }
        let (pose, far) = self.bundle.rigid.near(&self.pose, &place, &by);
        self.pose = pose;
        if !(far - Wide::of(lit(NEAR))).none_positive() {
            self.steps = AFRESH;
        }
        for (l, run) in runs.iter_mut().enumerate().take(WIDTH).filter(|(l, _)| arrived[*l]) {
            self.arrive(run, l);
        }
    }

    /// Writes lane `l`'s positions after its interval, or ends it where they are beyond the limit.
    #[inline]
    fn arrive(&mut self, run: &mut Run<'a, T, A, N, P>, l: usize) {
        let q = numbers(&self.pose.place.q, l);
        let within = q.iter().all(|q| q.abs() <= self.limit);
        if within {
            write(run, self.clocks[l].k, &q);
            self.clocks[l].next();
        }
        if !within || self.clocks[l].is_over() {
            self.end(run, l);
        }
    }

    /// Ends lane `l`.
    #[inline]
    fn end(&mut self, run: &mut Run<'a, T, A, N, P>, l: usize) {
        run.state = state_of(&lane_of(&self.pose.place, l), &numbers(&self.modes.direction, l));
        self.rest(l);
    }

    /// Puts a lane that has ended to rest.
    #[inline]
    fn rest(&mut self, l: usize) {
        for j in 0..N {
            self.pose.place.q[j].0[l] = T::zero();
            self.pose.place.dq[j].0[l] = T::zero();
            self.modes.direction[j].0[l] = T::one();
        }
        self.clocks[l] = Clock::new(0);
        self.idle.0[l] = lit(IDLE);
        self.moving -= 1;
        self.steps = AFRESH;
    }

    /// Times and torques of the lanes' intervals.
    #[inline(always)]
    fn intervals(&self, runs: &[Run<'a, T, A, N, P>]) -> Span<Wide<T, C>, N> {
        let zero = Wide::of(T::zero());
        let mut span = Span { t: zero, h: zero, tau: [[zero; N]; 3] };
        for (l, run) in runs.iter().enumerate().take(WIDTH) {
            let Clock { k, rows, .. } = self.clocks[l];
            if k >= rows {
                continue;
            }
            let (t, end) = (run.t[k], run.t[k + 1]);
            (span.t.0[l], span.h.0[l]) = (t, end - t);
            for j in 0..N {
                let Pulse { start, middle, end } = run.torque[k][j];
                span.tau[0][j].0[l] = start;
                span.tau[1][j].0[l] = middle;
                span.tau[2][j].0[l] = end;
            }
        }
        span
    }

    /// Times and torques of the steps before the lanes, be they intervals or parts of them; of no length for lanes that have ended.
    #[inline(never)]
    fn parts(&mut self, runs: &[Run<'a, T, A, N, P>]) -> Span<Wide<T, C>, N> {
        let zero = Wide::of(T::zero());
        let mut span = Span { t: zero, h: zero, tau: [[zero; N]; 3] };
        self.even = true;
        for (l, run) in runs.iter().enumerate().take(WIDTH) {
            let clock = &mut self.clocks[l];
            if clock.is_over() {
                continue;
            }
            let interval = interval(run, clock.k);
            let whole = clock.is_whole();
            if whole {
                clock.left = interval.h;
            }
            self.even &= whole;
            let h = clock.length();
            (span.t.0[l], span.h.0[l]) = (interval.t + clock.done, h);
            for (i, part) in [T::zero(), lit(0.5), T::one()].into_iter().enumerate() {
                let tau = interval.torque_at(clock.done + h * part);
                for j in 0..N {
                    span.tau[i][j].0[l] = tau[j];
                }
            }
        }
        span
    }

    /// Lane by lane, what comes of a step: where the lanes go on from, and which have got to the end of an interval.
    #[inline(never)]
    fn judge(
        &mut self,
        runs: &[Run<'a, T, A, N, P>],
        start: &Place<Wide<T, C>, N>,
        glided: &Glided<Wide<T, C>, N>,
    ) -> (Place<Wide<T, C>, N>, [bool; WIDTH]) {
        let (mut place, mut arrived) = (glided.pose.place, [false; WIDTH]);
        self.even = false;
        for (l, run) in runs.iter().enumerate().take(WIDTH) {
            let clock = &mut self.clocks[l];
            if clock.is_over() {
                continue;
            }
            if glided.wrong.0[l] <= T::zero() && clock.goal.is_none() {
                arrived[l] = true;
                continue;
            }
            if clock.is_whole() {
                clock.left = interval(run, clock.k).h;
            }
            let taken = Taken {
                places: [lane_of(start, l), lane_of(&place, l)],
                ddq: [numbers(&glided.ddq[0], l), numbers(&glided.ddq[1], l)],
                held: [held_in(&glided.held[0], l), held_in(&glided.held[1], l)],
                far: glided.far.0[l],
                dry: core::array::from_fn(|j| self.bundle.dry[j].0[l] != T::zero()),
            };
            let mut direction = numbers(&self.modes.direction, l);
            match taken.judge(clock, &mut direction) {
                Outcome::Right => arrived[l] = true,
                Outcome::Again => put(&mut place, l, &taken.places[0]),
                Outcome::Reversed(reached) => {
                    put(&mut place, l, &reached);
                    arrived[l] = clock.left <= T::zero();
                }
                Outcome::Alone => {
                    let mut state = state_of(&taken.places[0], &direction);
                    exact(run.plant, &mut state, &interval(run, clock.k), clock.done);
                    direction = state.modes.map(Mode::direction);
                    put(&mut place, l, &Place { q: state.q.into(), dq: state.dq.into() });
                    (arrived[l], self.steps) = (true, AFRESH);
                }
            }
            for j in 0..N {
                self.modes.direction[j].0[l] = direction[j];
            }
        }
        (place, arrived)
    }
}

/// Writes the positions after interval `k`.
#[inline(always)]
fn write<T: Real, A, const N: usize, const P: usize>(run: &mut Run<'_, T, A, N, P>, k: usize, q: &[T; N]) {
    for j in 0..N {
        run.positions[k * N + j] = q[j];
    }
}

/// Interval `k` of a run.
#[inline]
fn interval<'r, T: Real, A, const N: usize, const P: usize>(
    run: &Run<'r, T, A, N, P>,
    k: usize,
) -> Interval<'r, T, N> {
    Interval { t: run.t[k], h: run.t[k + 1] - run.t[k], torque: &run.torque[k] }
}

/// The numbers of lane `l`.
#[inline]
fn numbers<T: Real, C, const N: usize>(x: &[Wide<T, C>; N], l: usize) -> [T; N] {
    core::array::from_fn(|j| x[j].0[l])
}

/// Lane `l`'s place.
#[inline]
fn lane_of<T: Real, C, const N: usize>(place: &Place<Wide<T, C>, N>, l: usize) -> Place<T, N> {
    Place { q: numbers(&place.q, l), dq: numbers(&place.dq, l) }
}

/// Puts a place into lane `l`.
#[inline]
fn put<T: Real, C, const N: usize>(place: &mut Place<Wide<T, C>, N>, l: usize, of: &Place<T, N>) {
    for j in 0..N {
        place.q[j].0[l] = of.q[j];
        place.dq[j].0[l] = of.dq[j];
    }
}

/// What holds lane `l`.
#[inline]
fn held_in<T: Real, C, const N: usize>(held: &Held<Wide<T, C>, N>, l: usize) -> Held<T, N> {
    Held { holding: numbers(&held.holding, l), excess: numbers(&held.excess, l) }
}

/// A state of its own.
#[inline]
fn state_of<T: Real, const N: usize>(place: &Place<T, N>, direction: &[T; N]) -> State<T, N> {
    let mut state = State::new(SVector::from(place.q), SVector::from(place.dq));
    state.modes = direction.map(Mode::of);
    state
}
