//! Classical Runge-Kutta over one sample interval, with changes of the friction modes located inside it.
//!
//! While no joint reverses, sticks or breaks away the right-hand side is smooth and the step is of order four. A joint whose
//! velocity would change sign is stopped at the instant of zero velocity; it then either sticks, if friction can hold it, or
//! goes on in the direction of the torque. A stuck joint breaks away at the instant the torque it needs exceeds its Coulomb
//! level. So an arm under torques below the Coulomb levels does not creep, and a step across a reversal keeps its accuracy. Impacts of
//! a rotor on the flank of its backlash, and its separation from the flank, are located by the same methods.

mod backlash;
mod crossing;
mod division;
pub(crate) mod root;
mod settle;

use crate::arm::Arm;
use crate::effect::InputSegment;
use crate::fixed_mode::{FixedModeStep, ModeCheck, Modes, Span, rk4_fixed_mode};
use crate::kinematics::{AngleRange, JointState, KinematicState};
use crate::plant::{Accelerations, Mode, Plant};
use crate::real::{Real, lit};
use crate::transmission::LatentState;
use crossing::{Located, TrialStep};
pub(crate) use division::{Division, keep_sliding};
pub use division::{StepLimits, advance_in_stable_steps, largest_stable_rate};
use nalgebra::SVector;

/// Largest number of events located within one sample interval, or within each of its steps where their number is prescribed; after these events, steps
/// are taken whole, and joints that change the sign of their velocity are stopped at their ends. 8 per joint, at least 16.
pub(crate) const fn max_events(joints: usize) -> usize {
    if joints < 2 { 16 } else { 8 * joints }
}

/// Position, velocity and friction mode of every joint, and latent states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<T, const N: usize> {
    /// Joint positions, rad or m.
    pub q: SVector<T, N>,
    /// Joint velocities, rad/s or m/s.
    pub dq: SVector<T, N>,
    /// Friction mode of each joint: stuck, forward or backward.
    pub modes: [Mode; N],
    /// Latent states of transmissions and of hysteresis.
    pub latent: LatentState<T, N>,
}

impl<T: Real, const N: usize> State<T, N> {
    /// State whose friction modes follow from its velocities: a joint at rest starts stuck and is released if its torque demands it.
    pub fn new(q: SVector<T, N>, dq: SVector<T, N>) -> Self {
        Self { q, dq, modes: core::array::from_fn(|j| Mode::of(dq[j])), latent: LatentState::none(q) }
    }

    /// Whether all joint positions and velocities are finite.
    pub fn is_finite(&self) -> bool {
        self.q.iter().chain(self.dq.iter()).all(nalgebra::ComplexField::is_finite)
    }
}

/// Sample interval: time of the sample, length, and joint torques over it.
#[derive(Debug, Clone, Copy)]
pub struct Interval<'a, T, const N: usize> {
    /// Time of the sample that begins the interval, s.
    pub t: T,
    /// Length of the interval, s.
    pub h: T,
    /// Torque of each joint over the interval, N m (N).
    pub torque: &'a [InputSegment<T>; N],
}

impl<T: Real, const N: usize> Interval<'_, T, N> {
    /// Joint torques at `x` seconds after the sample, N m (N).
    #[inline]
    pub(crate) fn torque_at(&self, x: T) -> SVector<T, N> {
        let s = x / self.h;
        SVector::from_fn(|j, _| {
            let segment = &self.torque[j];
            if segment.start == segment.end && segment.start == segment.middle {
                segment.start
            } else {
                segment.at(s)
            }
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
    if count == 1 && plant.is_plain() && fixed_mode_step(plant, state, interval) {
        return;
    }
    let mut division = Division::equal(interval.h, count);
    loop {
        division.events = max_events(N);
        substep(plant, state, interval, &mut division);
        if !division.next() {
            return;
        }
    }
}

/// Advances `state` over the next step of a divided sample interval.
#[inline]
pub(crate) fn substep<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize>(
    plant: &Plant<T, A, N, P>,
    state: &mut State<T, N>,
    interval: &Interval<T, N>,
    division: &mut Division<T>,
) {
    let (from, dt) = (division.from(), division.h);
    if (0..N).all(|j| plant.is_rounded(j)) && !plant.drivetrain().has_backlash() {
        *state = SubStep::new(plant, interval, state).smooth(state, from, dt);
    } else {
        SubStep::new(plant, interval, state).exact(state, from, dt, &mut division.events);
    }
}

/// Takes one sample interval in one step; false, with `state` unchanged, if a friction mode changes within the interval.
#[inline(always)]
fn fixed_mode_step<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize>(
    plant: &Plant<T, A, N, P>,
    state: &mut State<T, N>,
    interval: &Interval<T, N>,
) -> bool {
    let mut span = Span { t: interval.t, h: interval.h, tau: [[T::zero(); N]; 3] };
    let (mut direction, mut dry) = ([T::zero(); N], [T::zero(); N]);
    for j in 0..N {
        let InputSegment { start, middle, end } = interval.torque[j];
        (span.tau[0][j], span.tau[1][j], span.tau[2][j]) = (start, middle, end);
        (direction[j], dry[j]) = (state.modes[j].direction(), plant.dry(j));
    }
    let start = plant.rigid().kinematics(&JointState { q: state.q.into(), dq: state.dq.into() });
    let modes = Modes::new(direction, dry);
    let mut mode_check = ModeCheck::none();
    let kinematics = rk4_fixed_mode(
        &FixedModeStep { dynamics: plant, start: &start, modes: &modes, span: &span },
        &mut mode_check,
    );
    let crosses = |j: usize| plant.edge_between(j, state.q[j], kinematics.joints.q[j]).is_some();
    let right = mode_check.mode_violation <= T::zero() && !(plant.jumps() && (0..N).any(crosses));
    if right {
        (state.q, state.dq) = (kinematics.joints.q.into(), kinematics.joints.dq.into());
    }
    right
}

/// Integrates the rest of a sample interval, of which `done` seconds are over, with exact dry friction, from event to event.
#[inline(never)]
pub(crate) fn exact<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize>(
    plant: &Plant<T, A, N, P>,
    state: &mut State<T, N>,
    interval: &Interval<T, N>,
    done: T,
) {
    let mut events = max_events(N);
    SubStep::new(plant, interval, state).exact(state, done, interval.h - done, &mut events);
}

/// Plant, sample interval and initial kinematic state of one integration step.
struct SubStep<'a, T: Real, A, const N: usize, const P: usize> {
    plant: &'a Plant<T, A, N, P>,
    interval: &'a Interval<'a, T, N>,
    /// Kinematic state at the start of the step; sines and cosines within the step are rotated from it.
    origin: KinematicState<T, N>,
}

impl<'a, T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> SubStep<'a, T, A, N, P> {
    #[inline]
    fn new(plant: &'a Plant<T, A, N, P>, interval: &'a Interval<'a, T, N>, state: &State<T, N>) -> Self {
        let origin = plant.rigid().kinematics(&JointState { q: state.q.into(), dq: state.dq.into() });
        Self { plant, interval, origin }
    }

    #[inline]
    fn motion(&self, x: T, state: &State<T, N>) -> Accelerations<T, N> {
        let joints = JointState { q: state.q.into(), dq: state.dq.into() };
        let origin = &self.origin;
        let kinematics = self.plant.rigid().near(&joints, &origin.joints.q, &origin.sincos, AngleRange::Near);
        let tau = self.interval.torque_at(x);
        self.plant.acceleration(self.interval.t + x, &kinematics, &tau, &state.modes, &state.latent)
    }

    /// State `dt` seconds after `state`, with the velocities of the state `at` and the accelerations `slope` held constant.
    #[inline]
    fn moved(
        &self,
        state: &State<T, N>,
        dt: T,
        at: &State<T, N>,
        slope: &Accelerations<T, N>,
    ) -> State<T, N> {
        let mut next = *state;
        next.q = state.q + at.dq * dt;
        next.dq = state.dq + slope.ddq * dt;
        if self.plant.drivetrain().any() {
            next.latent.deflection = state.latent.deflection + at.latent.deflection_rate * dt;
            next.latent.deflection_rate = state.latent.deflection_rate + slope.deflection_acceleration * dt;
        }
        next
    }

    /// State after one classical Runge-Kutta step of `dt` seconds, whose accelerations at the start, `k1`, are known.
    #[inline]
    fn runge_kutta(&self, state: &State<T, N>, x: T, dt: T, k1: &Accelerations<T, N>) -> State<T, N> {
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
        if self.plant.drivetrain().any() {
            let rates = [
                &state.latent.deflection_rate,
                &s2.latent.deflection_rate,
                &s3.latent.deflection_rate,
                &s4.latent.deflection_rate,
            ];
            next.latent.deflection += (rates[0] + (rates[1] + rates[2]) * two + rates[3]) * sixth;
            next.latent.deflection_rate += (k1.deflection_acceleration
                + (k2.deflection_acceleration + k3.deflection_acceleration) * two
                + k4.deflection_acceleration)
                * sixth;
        }
        if self.plant.has_hysteresis() {
            next.latent.memory = self.plant.memory(&next.q, &state.latent);
            next.latent.anchor = next.q;
        }
        next
    }

    /// State after a step of `dt` seconds in which the friction of all joints is regularised, so that there are no events.
    fn smooth(&self, state: &State<T, N>, x: T, dt: T) -> State<T, N> {
        let k1 = self.motion(x, state);
        self.runge_kutta(state, x, dt, &k1)
    }

    /// Integrates a step of `dt` seconds with exact dry friction, from event to event; `events` is the number of events that the sample interval may
    /// still have, beyond which the step ends in one piece.
    #[inline]
    fn exact(&self, state: &mut State<T, N>, from: T, dt: T, events: &mut usize) {
        let (mut x, mut left) = (from, dt);
        while *events > 0 {
            let k1 = self.settle(state, x);
            let trial = self.runge_kutta(state, x, left, &k1);
            let trial_step = TrialStep { state, x, dt: left, k1: &k1 };
            let Some(event) = self.first_event(&trial_step, &trial) else {
                *state = trial;
                return;
            };
            *events -= 1;
            let Located { length, reached } = self.locate(&trial_step, &event);
            *state = self.applied(&event, reached);
            x += length;
            left -= length;
            if left <= T::zero() {
                return;
            }
        }
        let k1 = self.settle(state, x);
        let mut last = self.runge_kutta(state, x, left, &k1);
        self.hold_reversed(&mut last);
        self.close_crossed(&mut last);
        *state = last;
    }

    /// Stops every joint with exact dry friction whose velocity contradicts its friction mode.
    fn hold_reversed(&self, state: &mut State<T, N>) {
        for j in (0..N).filter(|j| !self.plant.is_rounded(*j) && self.plant.is_dry(*j)) {
            let velocity = self.plant.friction_velocity(j, &state.dq, &state.latent);
            if velocity * state.modes[j].direction() < T::zero() {
                self.stop(j, state);
            }
        }
    }
}
