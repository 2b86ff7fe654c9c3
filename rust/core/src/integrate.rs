//! Classical Runge-Kutta over one sample interval, with changes of the friction modes located inside it.
//!
//! While no joint reverses, sticks or breaks away the right-hand side is smooth and the step is of order four. A joint whose
//! velocity would change sign is stopped at the instant it reaches zero; there it either sticks, if friction can hold it, or
//! goes on in the direction of the torque. A stuck joint breaks away at the instant the torque it needs exceeds its Coulomb
//! level. So the arm left under a torque below that level does not creep, and a step across a reversal keeps its accuracy.

use crate::arm::Arm;
use crate::effect::Pulse;
use crate::glide::{Glided, Modes, Place, Pose, Span, glide};
use crate::plant::{Mode, Motion, Plant};
use crate::real::{Real, lit};
use crate::transmission::Hidden;
use crate::trig::NEAR;
use nalgebra::SVector;

/// Mode changes located within one sub-step before the rest of it is taken with all crossing joints held.
const MAX_EVENTS: usize = 16;

/// Corrections of the located instant; each squares the error of the last.
const MAX_REFINEMENTS: usize = 4;

/// A correction of this part of a step is as good on a straight line: what is left out is of the order of its square.
const STRAIGHT: f64 = 1e-6;

/// The same on a curve of constant rate of acceleration, whose error is of the order of its cube.
const CURVED: f64 = 1e-3;

/// Attempts at the instant of a release.
const MAX_FALSE_POSITIONS: usize = 12;

/// A release is found where holding takes more than friction gives, but by less than this part of what the step changes.
const RELEASED: f64 = 1e-8;

/// Attempts are made this part of a step beyond where the root is expected, so that they end on its far side.
const BEYOND: f64 = 1e-9;

/// Position, velocity and friction mode of every joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T, const N: usize> {
    /// Positions.
    pub q: SVector<T, N>,
    /// Velocities.
    pub dq: SVector<T, N>,
    /// Friction modes.
    pub modes: [Mode; N],
    /// States that no encoder shows.
    pub hidden: Hidden<T, N>,
}

impl<T: Real, const N: usize> State<T, N> {
    /// A state whose modes follow from its velocities: a joint at rest starts stuck and is released if its torque demands it.
    pub fn new(q: SVector<T, N>, dq: SVector<T, N>) -> Self {
        Self { q, dq, modes: core::array::from_fn(|j| Mode::of(dq[j])), hidden: Hidden::none(q) }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.q.iter().chain(self.dq.iter()).all(nalgebra::ComplexField::is_finite)
    }
}

/// A sample interval: where it starts, how long it is, and the torque over it.
#[derive(Debug, Clone, Copy)]
pub struct Interval<'a, T, const N: usize> {
    /// Time of the sample, s.
    pub t: T,
    /// Length, s.
    pub h: T,
    /// Torque of each joint over the interval.
    pub torque: &'a [Pulse<T>; N],
}

impl<T: Real, const N: usize> Interval<'_, T, N> {
    /// Torque at `x` seconds after the sample.
    #[inline]
    fn torque_at(&self, x: T) -> SVector<T, N> {
        let s = x / self.h;
        SVector::from_fn(|j, _| {
            let pulse = &self.torque[j];
            if pulse.start == pulse.end && pulse.start == pulse.middle { pulse.start } else { pulse.at(s) }
        })
    }
}

/// Advances `state` over one sample interval in `substeps` equal steps.
#[inline]
pub fn advance<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize>(
    plant: &Plant<T, A, N, P>,
    state: &mut State<T, N>,
    interval: &Interval<T, N>,
    substeps: usize,
) {
    if interval.h <= T::zero() {
        return;
    }
    let count = substeps.max(1);
    if count == 1 && plant.glides() && glided(plant, state, interval) {
        return;
    }
    let dt = interval.h / lit(count as f64);
    for i in 0..count {
        let from = dt * lit(i as f64);
        if plant.smoothing() > T::zero() {
            *state = Step::new(plant, interval, state).smooth(state, from, dt);
        } else {
            Step::new(plant, interval, state).exact(state, from, dt);
        }
    }
}

/// One sample interval in one step, if no friction mode changes within it.
#[inline(always)]
fn glided<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize>(
    plant: &Plant<T, A, N, P>,
    state: &mut State<T, N>,
    interval: &Interval<T, N>,
) -> bool {
    let mut span = Span { t: interval.t, h: interval.h, tau: [[T::zero(); N]; 3] };
    let mut direction = [T::zero(); N];
    for j in 0..N {
        let Pulse { start, middle, end } = interval.torque[j];
        (span.tau[0][j], span.tau[1][j], span.tau[2][j]) = (start, middle, end);
        direction[j] = state.modes[j].direction();
    }
    let start = plant.rigid().pose(&Place { q: state.q.into(), dq: state.dq.into() });
    let Glided { pose, wrong } = glide(plant, &start, &Modes::new(direction), &span);
    let right = wrong <= T::zero();
    if right {
        (state.q, state.dq) = (pose.place.q.into(), pose.place.dq.into());
    }
    right
}

/// One sample interval with exact friction in one step, from mode change to mode change.
#[inline(never)]
pub(crate) fn exact<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize>(
    plant: &Plant<T, A, N, P>,
    state: &mut State<T, N>,
    interval: &Interval<T, N>,
) {
    Step::new(plant, interval, state).exact(state, T::zero(), interval.h);
}

/// One sub-step's surroundings.
struct Step<'a, T: Real, A, const N: usize, const P: usize> {
    plant: &'a Plant<T, A, N, P>,
    interval: &'a Interval<'a, T, N>,
    /// Where the sub-step starts; sines and cosines within it are turned on from here.
    origin: Pose<T, N>,
}

impl<'a, T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Step<'a, T, A, N, P> {
    #[inline]
    fn new(plant: &'a Plant<T, A, N, P>, interval: &'a Interval<'a, T, N>, state: &State<T, N>) -> Self {
        let origin = plant.rigid().pose(&Place { q: state.q.into(), dq: state.dq.into() });
        Self { plant, interval, origin }
    }

    #[inline]
    fn motion(&self, x: T, state: &State<T, N>) -> Motion<T, N> {
        let place = Place { q: state.q.into(), dq: state.dq.into() };
        let (mut pose, far) = self.plant.rigid().near(&self.origin, &place);
        if far > lit(NEAR) {
            pose = self.plant.rigid().pose(&place);
        }
        let tau = self.interval.torque_at(x);
        self.plant.acceleration(self.interval.t + x, &pose, &tau, &state.modes, &state.hidden)
    }

    /// `state` moved on by `dt` with the rates `(dq, motion)` of some stage.
    #[inline]
    fn moved(&self, state: &State<T, N>, dt: T, at: &State<T, N>, slope: &Motion<T, N>) -> State<T, N> {
        let mut next = *state;
        next.q = state.q + at.dq * dt;
        next.dq = state.dq + slope.ddq * dt;
        if self.plant.is_driven() {
            next.hidden.twist = state.hidden.twist + at.hidden.dtwist * dt;
            next.hidden.dtwist = state.hidden.dtwist + slope.ddtwist * dt;
        }
        next
    }

    /// One Runge-Kutta step whose first stage is known.
    #[inline]
    fn runge_kutta(&self, state: &State<T, N>, x: T, dt: T, k1: &Motion<T, N>) -> State<T, N> {
        let (half, sixth, two) = (dt * lit(0.5), dt / lit(6.0), lit::<T>(2.0));
        let s2 = self.moved(state, half, state, k1);
        let k2 = self.motion(x + half, &s2);
        let s3 = self.moved(state, half, &s2, &k2);
        let k3 = self.motion(x + half, &s3);
        let s4 = self.moved(state, dt, &s3, &k3);
        let k4 = self.motion(x + dt, &s4);
        let mut next = *state;
        next.q = state.q + (state.dq + (s2.dq + s3.dq) * two + s4.dq) * sixth;
        next.dq = state.dq + (k1.ddq + (k2.ddq + k3.ddq) * two + k4.ddq) * sixth;
        if self.plant.is_driven() {
            let rates = [&state.hidden.dtwist, &s2.hidden.dtwist, &s3.hidden.dtwist, &s4.hidden.dtwist];
            next.hidden.twist += (rates[0] + (rates[1] + rates[2]) * two + rates[3]) * sixth;
            next.hidden.dtwist += (k1.ddtwist + (k2.ddtwist + k3.ddtwist) * two + k4.ddtwist) * sixth;
        }
        if self.plant.remembers() {
            next.hidden.memory = self.plant.memory(&next.q, &state.hidden);
            next.hidden.anchor = next.q;
        }
        next
    }

    /// A step with smoothed friction: no events.
    fn smooth(&self, state: &State<T, N>, x: T, dt: T) -> State<T, N> {
        let k1 = self.motion(x, state);
        self.runge_kutta(state, x, dt, &k1)
    }

    /// A step with exact friction: from mode change to mode change.
    #[inline]
    fn exact(&self, state: &mut State<T, N>, from: T, dt: T) {
        let (mut x, mut left) = (from, dt);
        for _ in 0..MAX_EVENTS {
            let k1 = self.settle(state, x);
            let trial = self.runge_kutta(state, x, left, &k1);
            let Some(event) = self.first_event(state, &trial, x, left, &k1) else {
                *state = trial;
                return;
            };
            let Located { length, reached } = self.locate(state, &event, x, left, &k1);
            *state = event.apply(reached);
            x += length;
            left -= length;
            if left <= T::zero() {
                return;
            }
        }
        let k1 = self.settle(state, x);
        let mut last = self.runge_kutta(state, x, left, &k1);
        self.hold_reversed(&mut last);
        *state = last;
    }

    /// Holds every joint with dry friction whose velocity contradicts its mode.
    fn hold_reversed(&self, state: &mut State<T, N>) {
        for j in (0..N).filter(|j| self.plant.is_dry(*j)) {
            if state.dq[j] * state.modes[j].direction() < T::zero() {
                (state.dq[j], state.modes[j]) = (T::zero(), Mode::Stuck);
            }
        }
    }

    /// Releases stuck joints that friction cannot hold, and sticks joints that were released to no avail; returns the motion.
    #[inline]
    fn settle(&self, state: &mut State<T, N>, x: T) -> Motion<T, N> {
        let mut motion = self.motion(x, state);
        let mut tried = [false; N];
        for _ in 0..2 * N {
            let Some((j, mode)) = self.unsettled(state, &motion, x, &tried) else {
                break;
            };
            tried[j] = mode == Mode::Stuck;
            state.modes[j] = mode;
            motion = self.motion(x, state);
        }
        motion
    }

    /// Torque that reaches the joints.
    #[inline]
    fn joint_torque(&self, x: T, state: &State<T, N>) -> SVector<T, N> {
        self.plant.transmitted(&self.interval.torque_at(x), &state.hidden)
    }

    /// The joint whose mode contradicts the motion most, and the mode it should have.
    #[inline]
    fn unsettled(
        &self,
        state: &State<T, N>,
        motion: &Motion<T, N>,
        x: T,
        tried: &[bool; N],
    ) -> Option<(usize, Mode)> {
        let (mut found, mut worst) = (None, T::zero());
        for j in 0..N {
            if state.dq[j] != T::zero() {
                let contradicts = self.plant.is_dry(j) || state.modes[j] == Mode::Stuck;
                if contradicts && state.modes[j] != Mode::of(state.dq[j]) {
                    return Some((j, Mode::of(state.dq[j])));
                }
            } else if state.modes[j] == Mode::Stuck {
                let tau = self.joint_torque(x, state);
                let (excess, direction) =
                    self.plant.excess(j, self.interval.t + x, state.q[j], tau[j], motion.holding[j]);
                if excess > worst && !tried[j] {
                    (found, worst) = (Some((j, Mode::of(direction))), excess);
                }
            } else if self.plant.is_dry(j) && motion.ddq[j] * state.modes[j].direction() < T::zero() {
                return Some((j, Mode::Stuck));
            }
        }
        found
    }

    /// The mode change that a trial step runs into first, if any.
    #[inline]
    fn first_event(
        &self,
        state: &State<T, N>,
        trial: &State<T, N>,
        x: T,
        dt: T,
        k1: &Motion<T, N>,
    ) -> Option<Event<T>> {
        let reverses =
            |j: usize| self.plant.is_dry(j) && trial.dq[j] * state.modes[j].direction() < T::zero();
        let any_stuck = state.modes.contains(&Mode::Stuck);
        if !any_stuck && !(0..N).any(reverses) {
            return None;
        }
        let end = self.motion(x + dt, trial);
        let mut first: Option<Event<T>> = None;
        for j in 0..N {
            let event = if reverses(j) {
                let s = hermite_root(state.dq[j], k1.ddq[j] * dt, trial.dq[j], end.ddq[j] * dt);
                Some(Event { joint: j, s, change: Change::Stop })
            } else if state.modes[j] == Mode::Stuck {
                self.release(j, state, trial, x, dt, &end)
            } else {
                None
            };
            if let Some(event) = event
                && first.as_ref().is_none_or(|earliest| event.s < earliest.s)
            {
                first = Some(event);
            }
        }
        first
    }

    /// When a stuck joint breaks away within the step, by linear interpolation of the torque that it lacks.
    fn release(
        &self,
        j: usize,
        state: &State<T, N>,
        trial: &State<T, N>,
        x: T,
        dt: T,
        end: &Motion<T, N>,
    ) -> Option<Event<T>> {
        let t = self.interval.t;
        let tau_end = self.joint_torque(x + dt, trial);
        let (after, direction) = self.plant.excess(j, t + x + dt, trial.q[j], tau_end[j], end.holding[j]);
        if after <= T::zero() {
            return None;
        }
        let start = self.motion(x, state);
        let tau = self.joint_torque(x, state);
        let (before, _) = self.plant.excess(j, t + x, state.q[j], tau[j], start.holding[j]);
        let s = if before < T::zero() { before / (before - after) } else { T::zero() };
        let change = Change::Release { mode: Mode::of(direction), excess: [before, after] };
        Some(Event { joint: j, s, change })
    }

    /// Integrates up to the event.
    #[inline(never)]
    fn locate(&self, state: &State<T, N>, event: &Event<T>, x: T, dt: T, k1: &Motion<T, N>) -> Located<T, N> {
        if event.joint >= N {
            // No event has such a joint; said here so that no index below needs a panic.
            return Located { length: dt, reached: *state };
        }
        match event.change {
            Change::Stop => self.locate_stop(state, event, x, dt, k1),
            Change::Release { excess: [before, after], .. } if before < T::zero() => {
                self.locate_release(state, event.joint, [before, after], x, dt, k1)
            }
            Change::Release { .. } => Located { length: T::zero(), reached: *state },
        }
    }

    /// Integrates to where a velocity vanishes: Newton's method, its last correction so small that a straight line is exact.
    fn locate_stop(
        &self,
        state: &State<T, N>,
        event: &Event<T>,
        x: T,
        dt: T,
        k1: &Motion<T, N>,
    ) -> Located<T, N> {
        let mut s = event.s;
        let mut reached = self.runge_kutta(state, x, s * dt, k1);
        for _ in 0..MAX_REFINEMENTS {
            let slope = self.motion(x + s * dt, &reached);
            let correction = -reached.dq[event.joint] / (slope.ddq[event.joint] * dt);
            let next = s + correction;
            if !(next > T::zero() && next <= T::one()) {
                break;
            }
            s = next;
            if correction.abs() < lit(STRAIGHT) {
                reached = self.moved(&reached, correction * dt, &reached, &slope);
                break;
            }
            if correction.abs() < lit(CURVED) && !self.plant.is_driven() && s > lit(0.01) {
                let rate = (slope.ddq - k1.ddq) / ((s - correction) * dt);
                let (part, reached) = curved(&reached, event.joint, &slope.ddq, &rate);
                return Located { length: (s - correction) * dt + part, reached };
            }
            reached = self.runge_kutta(state, x, s * dt, k1);
        }
        Located { length: s * dt, reached }
    }

    /// Integrates to just beyond where friction no longer holds joint `j`: false position in Illinois' way (Dowell and Jarratt 1971)
    /// between the start of the step, where `excess[0] < 0`, and its end, where `excess[1] > 0`.
    fn locate_release(
        &self,
        state: &State<T, N>,
        j: usize,
        excess: [T; 2],
        x: T,
        dt: T,
        k1: &Motion<T, N>,
    ) -> Located<T, N> {
        let ([mut low, mut high], [mut before, mut after]) = ([T::zero(), T::one()], excess);
        let enough = (after - before) * lit(RELEASED);
        let mut last_high = None;
        let mut reached = None;
        for _ in 0..MAX_FALSE_POSITIONS {
            let s = (high - after * (high - low) / (after - before) + lit(BEYOND)).min(high);
            let there = self.runge_kutta(state, x, s * dt, k1);
            let motion = self.motion(x + s * dt, &there);
            let tau = self.joint_torque(x + s * dt, &there);
            let (lacks, _) =
                self.plant.excess(j, self.interval.t + x + s * dt, there.q[j], tau[j], motion.holding[j]);
            let beyond = lacks > T::zero();
            let again = last_high == Some(beyond);
            last_high = Some(beyond);
            if beyond {
                (high, after, reached) = (s, lacks, Some(there));
                before *= if again { lit(0.5) } else { T::one() };
            } else {
                (low, before) = (s, lacks);
                after *= if again { lit(0.5) } else { T::one() };
            }
            if beyond && lacks < enough {
                break;
            }
        }
        let reached = reached.unwrap_or_else(|| self.runge_kutta(state, x, high * dt, k1));
        Located { length: high * dt, reached }
    }
}

/// The state where joint `j`'s velocity vanishes, close to `state` with these accelerations and their rates, and the time to there.
fn curved<T: Real, const N: usize>(
    state: &State<T, N>,
    j: usize,
    ddq: &SVector<T, N>,
    rate: &SVector<T, N>,
) -> (T, State<T, N>) {
    let half: T = lit(0.5);
    let first = -state.dq[j] / ddq[j];
    let d = -(state.dq[j] + half * rate[j] * first * first) / ddq[j];
    let mut next = *state;
    next.q += (state.dq + (ddq + rate * (d / lit(3.0))) * (half * d)) * d;
    next.dq += (ddq + rate * (half * d)) * d;
    (d, next)
}

/// A change of one joint's mode at the fraction `s` of a step.
struct Event<T> {
    joint: usize,
    s: T,
    change: Change<T>,
}

/// What happens at an event.
enum Change<T> {
    /// The velocity reaches zero.
    Stop,
    /// Friction no longer holds; by how much it lacks at the start and at the end of the step.
    Release {
        /// The mode it changes to.
        mode: Mode,
        /// What holding takes beyond friction's level at both ends of the step.
        excess: [T; 2],
    },
}

/// A state at a located event and the time it took to get there.
struct Located<T, const N: usize> {
    length: T,
    reached: State<T, N>,
}

impl<T: Real> Event<T> {
    /// The state just after the event.
    fn apply<const N: usize>(&self, mut state: State<T, N>) -> State<T, N> {
        let j = self.joint;
        match self.change {
            Change::Stop => (state.dq[j], state.modes[j]) = (T::zero(), Mode::Stuck),
            Change::Release { mode, .. } => state.modes[j] = mode,
        }
        state
    }
}

/// First root in `(0, 1)` of the cubic with values `v0, v1` and slopes `d0, d1` at the ends, where `v0 v1 <= 0` or the curve
/// leaves zero first; found by bisection and Newton on the polynomial alone.
fn hermite_root<T: Real>(v0: T, d0: T, v1: T, d1: T) -> T {
    let (two, three) = (lit::<T>(2.0), lit::<T>(3.0));
    let (c3, c2) = (two * (v0 - v1) + d0 + d1, three * (v1 - v0) - two * d0 - d1);
    let value = |s: T| v0 + s * (d0 + s * (c2 + s * c3));
    let slope = |s: T| d0 + s * (two * c2 + s * three * c3);
    let (mut low, mut high) = (T::zero(), T::one());
    let mut s = if v0 == T::zero() { lit(0.5) } else { v0 / (v0 - v1) };
    for _ in 0..40 {
        let f = value(s);
        if f * v1 > T::zero() {
            high = s;
        } else {
            low = s;
        }
        let newton = s - f / slope(s);
        let next = if newton > low && newton < high { newton } else { (low + high) / two };
        if (next - s).abs() < lit(1e-13) {
            return next;
        }
        s = next;
    }
    s
}
