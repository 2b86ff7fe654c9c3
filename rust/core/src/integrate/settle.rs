//! Friction modes of joints at rest: which joints break away at an instant, and in which direction.
//!
//! The accelerations `a` of joints at rest, with `r` the torques on them but for dry friction, minimise `a' M a / 2 - a' r + sum level_j |a_j|`,
//! which is strictly convex (Gauss's principle of least constraint with dry friction; Moreau 1988), so one set of modes is right. It is found by an
//! active-set method, as for quadratic programs: the joint with the largest stiction violation is released; on the way to the accelerations of the
//! new modes, the first joint whose acceleration would change its sign sticks again. Each round lowers the sum, so no set of modes occurs twice.

use super::{State, SubStep};
use crate::arm::Arm;
use crate::plant::{Accelerations, Mode};
use crate::real::Real;
use nalgebra::SVector;

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> SubStep<'_, T, A, N, P> {
    /// Sets the friction modes of joints at rest, at `x` seconds after the sample, and returns the accelerations.
    #[inline]
    pub(super) fn settle(&self, state: &mut State<T, N>, x: T) -> Accelerations<T, N> {
        let mut motion = self.motion(x, state);
        if self.plant.drivetrain().has_backlash() && self.open(x, state, &motion) {
            motion = self.motion(x, state);
        }
        for _ in 0..2 * N {
            let Some((j, mode)) = self.contradicted(state, &motion) else { break };
            state.modes[j] = mode;
            motion = self.motion(x, state);
        }
        let mut in_vain = [false; N];
        for _ in 0..4 * N {
            let Some((j, mode)) = self.breaking_away(state, &motion, x, &in_vain) else { break };
            motion = self.released(state, &motion, x, (j, mode), &mut in_vain);
        }
        motion
    }

    /// Releases joint `j` into the friction mode `mode`, sticks joints that are then pulled back, and returns the accelerations; `in_vain` marks
    /// joints that are pulled back as they are released.
    #[inline(never)]
    fn released(
        &self,
        state: &mut State<T, N>,
        motion: &Accelerations<T, N>,
        x: T,
        (j, mode): (usize, Mode),
        in_vain: &mut [bool; N],
    ) -> Accelerations<T, N> {
        let mut from = self.friction_accelerations(state, motion);
        if j >= N {
            // Never true; the test lets the compiler omit bounds checks, and panics, for the indices below.
            return *motion;
        }
        state.modes[j] = mode;
        for _ in 0..N {
            let motion = self.motion(x, state);
            let to = self.friction_accelerations(state, &motion);
            let Some((k, part)) = self.first_pulled_back(state, &from, &to) else { return motion };
            // Where the Coulomb level of a sliding joint exceeds that at rest, a joint may be pulled back as it is released.
            in_vain[j] |= k == j;
            from += (to - from) * part;
            if let (Some(acceleration), Some(mode)) = (from.get_mut(k), state.modes.get_mut(k)) {
                (*acceleration, *mode) = (T::zero(), Mode::Stuck);
            }
        }
        self.motion(x, state)
    }

    /// Accelerations of joints, or of the motors that carry their friction, rad/s^2 (m/s^2).
    #[inline]
    fn friction_accelerations(&self, state: &State<T, N>, motion: &Accelerations<T, N>) -> SVector<T, N> {
        SVector::from_fn(|j, _| self.plant.friction_acceleration(j, motion, &state.latent))
    }

    /// Whether joint `j`, or the motor that carries its friction, is at rest.
    #[inline]
    fn rests(&self, j: usize, state: &State<T, N>) -> bool {
        self.plant.friction_velocity(j, &state.dq, &state.latent) == T::zero()
    }

    /// Released joint at rest whose acceleration is the first to change sign on a straight line between the accelerations `from` and `to`, with the
    /// fraction of the line.
    #[inline]
    fn first_pulled_back(
        &self,
        state: &State<T, N>,
        from: &SVector<T, N>,
        to: &SVector<T, N>,
    ) -> Option<(usize, T)> {
        let mut first = None;
        for k in 0..N {
            let along = state.modes[k].direction::<T>();
            let (before, after) = (from[k] * along, to[k] * along);
            if after < T::zero() && self.plant.is_dry(k) && self.rests(k, state) {
                let part = before.max(T::zero()) / (before.max(T::zero()) - after);
                if first.is_none_or(|(_, least)| part < least) {
                    first = Some((k, part));
                }
            }
        }
        first
    }

    /// Joint whose friction mode contradicts its velocity, or at rest its acceleration, and the mode that agrees with them.
    #[inline]
    fn contradicted(&self, state: &State<T, N>, motion: &Accelerations<T, N>) -> Option<(usize, Mode)> {
        for j in 0..N {
            let velocity = self.plant.friction_velocity(j, &state.dq, &state.latent);
            if velocity != T::zero() {
                let contradicts = self.plant.is_dry(j) || state.modes[j] == Mode::Stuck;
                if contradicts && state.modes[j] != Mode::of(velocity) {
                    return Some((j, Mode::of(velocity)));
                }
            } else if state.modes[j] != Mode::Stuck
                && self.plant.is_dry(j)
                && self.plant.friction_acceleration(j, motion, &state.latent) * state.modes[j].direction()
                    < T::zero()
            {
                return Some((j, Mode::Stuck));
            }
        }
        None
    }

    /// Stuck joint, not marked `in_vain`, whose friction torque at rest exceeds its Coulomb level by most, and the friction mode that it breaks away
    /// to.
    #[inline]
    fn breaking_away(
        &self,
        state: &State<T, N>,
        motion: &Accelerations<T, N>,
        x: T,
        in_vain: &[bool; N],
    ) -> Option<(usize, Mode)> {
        let (mut found, mut worst) = (None, T::zero());
        for j in 0..N {
            if state.modes[j] == Mode::Stuck && !in_vain[j] {
                let (stiction_violation, direction) = self.stiction_violation(j, x, state, motion);
                if stiction_violation > worst {
                    (found, worst) = (Some((j, Mode::of(direction))), stiction_violation);
                }
            }
        }
        found
    }

    /// Stiction violation of joint `j` at `x` seconds after the sample, N m (N) (friction torque at rest less the Coulomb level), and the direction,
    /// -1 or 1, in which the joint would slide.
    #[inline]
    pub(super) fn stiction_violation(
        &self,
        j: usize,
        x: T,
        state: &State<T, N>,
        motion: &Accelerations<T, N>,
    ) -> (T, T) {
        let torque = self.interval.torque_at(x);
        let mut tau = self.plant.drivetrain().torque_at_joints(&torque, &state.latent);
        if self.plant.drivetrain().brakes_motor(j, &state.latent) {
            tau[j] = torque[j];
        }
        self.plant.stiction_violation(j, self.interval.t + x, state.q[j], tau[j], motion.friction_at_rest[j])
    }
}
