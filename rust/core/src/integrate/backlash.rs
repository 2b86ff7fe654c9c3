//! Backlash that closes and opens inside a step.

use super::crossing::{Change, Located, ModeEvent, TrialStep};
use super::root::hermite_root;
use super::{State, SubStep};
use crate::arm::Arm;
use crate::kinematics::JointState;
use crate::plant::Accelerations;
use crate::real::Real;

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> SubStep<'_, T, A, N, P> {
    /// Opens every backlash whose flank would have to pull at `x` seconds after the sample; returns whether any was opened.
    pub(super) fn open(&self, x: T, state: &mut State<T, N>, motion: &Accelerations<T, N>) -> bool {
        let tau = self.interval.torque_at(x) - motion.motor_friction;
        let mut opened = false;
        for j in 0..N {
            let flank_tension = self.plant.drivetrain().flank_tension(j, tau[j], &motion.ddq, &state.latent);
            if flank_tension.is_some_and(|flank_tension| flank_tension > T::zero()) {
                state.latent.side[j] = T::zero();
                opened = true;
            }
        }
        opened
    }

    /// Event at which joint `j`'s backlash closes or opens within the trial step, if it does.
    pub(super) fn flank(
        &self,
        j: usize,
        &TrialStep { state, x, dt, k1 }: &TrialStep<'_, T, N>,
        trial: &State<T, N>,
        end: &Accelerations<T, N>,
    ) -> Option<ModeEvent<T>> {
        let drivetrain = self.plant.drivetrain();
        if let Some(depth) = drivetrain.depth(j, &trial.latent) {
            let side = if trial.latent.deflection[j] < T::zero() { -T::one() } else { T::one() };
            let before = side * state.latent.deflection[j] - drivetrain.get(j)?.half_backlash();
            let (rate, later) =
                (side * state.latent.deflection_rate[j] * dt, side * trial.latent.deflection_rate[j] * dt);
            let s = hermite_root(before.min(T::zero()), rate, depth, later);
            return (depth > T::zero()).then_some(ModeEvent { joint: j, s, change: Change::Impact });
        }
        let flank_tension = |x: T, at: &State<T, N>, motion: &Accelerations<T, N>| {
            let tau = self.interval.torque_at(x)[j] - motion.motor_friction[j];
            drivetrain.flank_tension(j, tau, &motion.ddq, &at.latent)
        };
        let (before, after) = (flank_tension(x, state, k1)?, flank_tension(x + dt, trial, end)?);
        let s = if before < T::zero() { before / (before - after) } else { T::zero() };
        (after > T::zero()).then_some(ModeEvent {
            joint: j,
            s,
            change: Change::Open { flank_tension: [before, after] },
        })
    }

    /// Integrates to the impact of joint `j`'s rotor on a flank of its backlash, from a first guess `s`, a fraction of the step.
    pub(super) fn locate_impact(&self, trial_step: &TrialStep<'_, T, N>, j: usize, s: T) -> Located<T, N> {
        let beyond = |there: &State<T, N>| {
            let depth = self.plant.drivetrain().depth(j, &there.latent)?;
            let side = if there.latent.deflection[j] < T::zero() { -T::one() } else { T::one() };
            Some((depth, side * there.latent.deflection_rate[j])).filter(|(_, rate)| *rate > T::zero())
        };
        self.locate_crossing(trial_step, s, beyond)
    }

    /// State just after the impact of joint `j`'s rotor on a flank of its backlash.
    pub(super) fn after_impact(&self, j: usize, mut state: State<T, N>) -> State<T, N> {
        let joints = JointState { q: state.q.into(), dq: state.dq.into() };
        let inertia = self.plant.rigid().kinematics(&joints).equation_terms.inertia;
        self.plant.drivetrain().impact(j, &inertia, &mut state.dq, &mut state.latent);
        state
    }

    /// Closes every backlash whose rotor has passed a flank in a step in which events were no longer located.
    pub(super) fn close_crossed(&self, state: &mut State<T, N>) {
        for j in 0..N {
            if self.plant.drivetrain().depth(j, &state.latent).is_some_and(|depth| depth > T::zero()) {
                *state = self.after_impact(j, *state);
            }
        }
    }
}
