//! Events inside a step and their instants: changes of friction modes, backlash that closes or opens, torques that jump.

use super::root::{STRAIGHT, VelocityZero, hermite_root};
use super::{State, SubStep};
use crate::arm::Arm;
use crate::kinematics::JointState;
use crate::plant::{Accelerations, Mode};
use crate::real::{Real, lit};

/// Largest number of Newton corrections of the instant of an event; each squares the error.
const MAX_REFINEMENTS: usize = 4;

/// Largest number of false-position steps to the instant at which a stuck joint breaks away or a backlash opens.
const MAX_FALSE_POSITIONS: usize = 12;

/// Positive stiction violation, or flank tension, as a part of its change over a step, below which the instant of breakaway, or of opening, is
/// located well enough.
const RELEASED: f64 = 1e-8;

/// Distance by which a joint that has crossed a position at which its torque jumps is put beyond the position, rad or m.
const BESIDE: f64 = 1e-13;

/// Part of a step by which false-position steps go beyond the expected root, so that they end where the violation is positive.
const BEYOND: f64 = 1e-9;

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> SubStep<'_, T, A, N, P> {
    /// First event within a trial step from `trial_step.state` to `trial`, if any.
    #[inline]
    pub(super) fn first_event(
        &self,
        trial_step: &TrialStep<'_, T, N>,
        trial: &State<T, N>,
    ) -> Option<ModeEvent<T>> {
        let &TrialStep { state, x, dt, k1 } = trial_step;
        let exact = |j: usize| !self.plant.is_rounded(j);
        let velocity = |j: usize, at: &State<T, N>| self.plant.friction_velocity(j, &at.dq, &at.latent);
        let reverses = |j: usize| {
            exact(j) && self.plant.is_dry(j) && velocity(j, trial) * state.modes[j].direction() < T::zero()
        };
        let sticks = |j: usize| exact(j) && state.modes[j] == Mode::Stuck;
        let has_backlash = self.plant.drivetrain().has_backlash();
        let edge = |j: usize| self.plant.edge_between(j, state.q[j], trial.q[j]);
        if !has_backlash && !(0..N).any(|j| edge(j).is_some()) && !(0..N).any(|j| sticks(j) || reverses(j)) {
            return None;
        }
        let end = self.motion(x + dt, trial);
        let mut first: Option<ModeEvent<T>> = None;
        for j in 0..N {
            let event = if reverses(j) {
                let before = self.plant.friction_acceleration(j, k1, &state.latent);
                let after = self.plant.friction_acceleration(j, &end, &trial.latent);
                let s = hermite_root(velocity(j, state), before * dt, velocity(j, trial), after * dt);
                Some(ModeEvent { joint: j, s, change: Change::Standstill })
            } else if sticks(j) {
                self.release(j, trial_step, trial, &end)
            } else {
                None
            };
            let flank = if has_backlash { self.flank(j, trial_step, trial, &end) } else { None };
            let crossing = edge(j).map(|at| {
                let (from, to) = (state.q[j] - at, trial.q[j] - at);
                let s = hermite_root(from, state.dq[j] * dt, to, trial.dq[j] * dt);
                ModeEvent { joint: j, s, change: Change::Cross { at } }
            });
            for event in [event, flank, crossing].into_iter().flatten() {
                if first.as_ref().is_none_or(|earliest| event.s < earliest.s) {
                    first = Some(event);
                }
            }
        }
        first
    }

    /// Event at which stuck joint `j` breaks away within the trial step, by linear interpolation of its friction torque at rest less the Coulomb
    /// level.
    fn release(
        &self,
        j: usize,
        &TrialStep { state, x, dt, .. }: &TrialStep<'_, T, N>,
        trial: &State<T, N>,
        end: &Accelerations<T, N>,
    ) -> Option<ModeEvent<T>> {
        let (after, direction) = self.stiction_violation(j, x + dt, trial, end);
        if after <= T::zero() {
            return None;
        }
        let (before, _) = self.stiction_violation(j, x, state, &self.motion(x, state));
        let s = if before < T::zero() { before / (before - after) } else { T::zero() };
        let change = Change::Release { mode: Mode::of(direction), stiction_violation: [before, after] };
        Some(ModeEvent { joint: j, s, change })
    }

    /// Integrates from the start of a trial step up to an event.
    #[inline(never)]
    pub(super) fn locate(&self, trial_step: &TrialStep<'_, T, N>, event: &ModeEvent<T>) -> Located<T, N> {
        if event.joint >= N {
            // Never true; the test lets the compiler omit bounds checks, and panics, for the indices below.
            return Located { length: trial_step.dt, reached: *trial_step.state };
        }
        match event.change {
            Change::Standstill => self.locate_standstill(trial_step, event),
            Change::Release { stiction_violation, .. } if stiction_violation[0] < T::zero() => {
                let violation = |x: T, there: &State<T, N>, motion: &Accelerations<T, N>| {
                    self.stiction_violation(event.joint, x, there, motion).0
                };
                self.locate_beyond(trial_step, stiction_violation, violation)
            }
            Change::Open { flank_tension } if flank_tension[0] < T::zero() => {
                let violation = |x: T, there: &State<T, N>, motion: &Accelerations<T, N>| {
                    let tau = self.interval.torque_at(x)[event.joint] - motion.motor_friction[event.joint];
                    self.plant
                        .drivetrain()
                        .flank_tension(event.joint, tau, &motion.ddq, &there.latent)
                        .unwrap_or_else(T::zero)
                };
                self.locate_beyond(trial_step, flank_tension, violation)
            }
            Change::Impact => self.locate_impact(trial_step, event.joint, event.s),
            Change::Cross { at } => {
                let beyond = |there: &State<T, N>| Some((there.q[event.joint] - at, there.dq[event.joint]));
                self.locate_crossing(trial_step, event.s, beyond)
            }
            Change::Release { .. } | Change::Open { .. } => {
                Located { length: T::zero(), reached: *trial_step.state }
            }
        }
    }

    /// State just after an event, from the state at its instant.
    pub(super) fn applied(&self, event: &ModeEvent<T>, mut state: State<T, N>) -> State<T, N> {
        let j = event.joint;
        if j >= N {
            return state;
        }
        match event.change {
            Change::Standstill => self.stop(j, &mut state),
            Change::Release { mode, .. } => state.modes[j] = mode,
            Change::Open { .. } => state.latent.side[j] = T::zero(),
            Change::Impact => return self.after_impact(j, state),
            Change::Cross { at } => {
                let ahead = if state.dq[j] < T::zero() { -T::one() } else { T::one() };
                state.q[j] = at + ahead * lit(BESIDE);
            }
        }
        state
    }

    /// Stops joint `j`, or the motor that the joint's friction acts on, and makes the joint stuck.
    pub(super) fn stop(&self, j: usize, state: &mut State<T, N>) {
        if self.plant.drivetrain().brakes_motor(j, &state.latent) {
            state.latent.deflection_rate[j] = -state.dq[j];
        } else {
            state.dq[j] = T::zero();
        }
        state.modes[j] = Mode::Stuck;
    }

    /// Integrates to where the velocity of an event's joint, or of the motor that carries its friction, vanishes, by Newton's method until the last
    /// correction is so small that linear interpolation suffices.
    fn locate_standstill(&self, trial_step: &TrialStep<'_, T, N>, event: &ModeEvent<T>) -> Located<T, N> {
        let &TrialStep { state, x, dt, k1 } = trial_step;
        let mut s = event.s;
        let mut reached = self.runge_kutta(state, x, s * dt, k1);
        for _ in 0..MAX_REFINEMENTS {
            let slope = self.motion(x + s * dt, &reached);
            let joints = JointState { q: reached.q.into(), dq: reached.dq.into() };
            let ddq = [&k1.ddq.into(), &slope.ddq.into()];
            let zero = VelocityZero { joints: &joints, j: event.joint, length: s * dt, ddq };
            let correction = if self.plant.drivetrain().any() {
                -self.plant.friction_velocity(event.joint, &reached.dq, &reached.latent)
                    / self.plant.friction_acceleration(event.joint, &slope, &reached.latent)
            } else {
                zero.correction()
            };
            let next = s + correction / dt;
            if !(next > T::zero() && next <= T::one()) {
                break;
            }
            if !self.plant.drivetrain().any()
                && let Some((more, joints)) = zero.reached(dt)
            {
                (reached.q, reached.dq) = (joints.q.into(), joints.dq.into());
                return Located { length: s * dt + more, reached };
            }
            s = next;
            if correction.abs() < lit::<T>(STRAIGHT) * dt {
                reached = self.moved(&reached, correction, &reached, &slope);
                break;
            }
            reached = self.runge_kutta(state, x, s * dt, k1);
        }
        Located { length: s * dt, reached }
    }

    /// Integrates to where a joint position, or a deflection within its backlash, reaches a limit, by Newton's method; `beyond` gives its distance
    /// beyond the limit, rad or m, and the rate of the distance.
    pub(super) fn locate_crossing(
        &self,
        &TrialStep { state, x, dt, k1 }: &TrialStep<'_, T, N>,
        mut s: T,
        beyond: impl Fn(&State<T, N>) -> Option<(T, T)>,
    ) -> Located<T, N> {
        let mut reached = self.runge_kutta(state, x, s * dt, k1);
        for _ in 0..MAX_REFINEMENTS {
            let Some((distance, rate)) = beyond(&reached) else { break };
            let correction = -distance / rate;
            let next = s + correction / dt;
            if !(next > T::zero() && next <= T::one()) || correction.abs() < lit::<T>(STRAIGHT) * dt {
                break;
            }
            s = next;
            reached = self.runge_kutta(state, x, s * dt, k1);
        }
        Located { length: s * dt, reached }
    }

    /// Integrates to just beyond where static friction, or a closed flank, no longer holds: the Illinois variant of false position (Dowell and
    /// Jarratt 1971) between the start of the step with the violation `ends[0] < 0` and its end with `ends[1] > 0`.
    fn locate_beyond(
        &self,
        trial_step: &TrialStep<'_, T, N>,
        ends: [T; 2],
        violation: impl Fn(T, &State<T, N>, &Accelerations<T, N>) -> T,
    ) -> Located<T, N> {
        let &TrialStep { state, x, dt, k1 } = trial_step;
        let ([mut low, mut high], [mut before, mut after]) = ([T::zero(), T::one()], ends);
        let enough = (after - before) * lit(RELEASED);
        let mut last_high = None;
        let mut reached = None;
        for _ in 0..MAX_FALSE_POSITIONS {
            let s = (high - after * (high - low) / (after - before) + lit(BEYOND)).min(high);
            let there = self.runge_kutta(state, x, s * dt, k1);
            let motion = self.motion(x + s * dt, &there);
            let violation = violation(x + s * dt, &there, &motion);
            let beyond = violation > T::zero();
            let again = last_high == Some(beyond);
            last_high = Some(beyond);
            if beyond {
                (high, after, reached) = (s, violation, Some(there));
                before *= if again { lit(0.5) } else { T::one() };
            } else {
                (low, before) = (s, violation);
                after *= if again { lit(0.5) } else { T::one() };
            }
            if beyond && violation < enough {
                break;
            }
        }
        let reached = reached.unwrap_or_else(|| self.runge_kutta(state, x, high * dt, k1));
        Located { length: high * dt, reached }
    }
}

/// Step that an event may cut short: start `state`, start time `x` after the sample, s, length `dt`, s, and accelerations `k1` at the start.
pub(super) struct TrialStep<'a, T, const N: usize> {
    pub(super) state: &'a State<T, N>,
    pub(super) x: T,
    pub(super) dt: T,
    pub(super) k1: &'a Accelerations<T, N>,
}

/// Change of one joint's friction mode or backlash at the fraction `s` of a step.
pub(super) struct ModeEvent<T> {
    pub(super) joint: usize,
    pub(super) s: T,
    pub(super) change: Change<T>,
}

/// What changes at an event inside a step.
pub(super) enum Change<T> {
    /// The velocity of the joint reaches zero.
    Standstill,
    /// A stuck joint breaks away: static friction no longer holds it.
    Release {
        /// Friction mode that the joint changes to.
        mode: Mode,
        /// Friction torque at rest less the Coulomb level of the joint, N m (N), at the start and the end of the step.
        stiction_violation: [T; 2],
    },
    /// The rotor hits a flank of its backlash.
    Impact,
    /// The joint crosses a position at which its torque jumps.
    Cross {
        /// Joint position at which the torque jumps, rad or m.
        at: T,
    },
    /// A flank no longer pushes and the backlash opens.
    Open {
        /// Force by which the flank would have to pull at the start and the end of the step, N m (N); a flank can only push.
        flank_tension: [T; 2],
    },
}

/// State at a located event and time from the start of the step.
pub(super) struct Located<T, const N: usize> {
    /// Time from the start of the step to the event, s.
    pub(super) length: T,
    /// State at the event.
    pub(super) reached: State<T, N>,
}
