//! One lane's step in which friction modes may have changed, and what to do about it.

use super::clock::{Clock, Reversal, max_changes};
use crate::fixed_mode::StaticFriction;
use crate::integrate::root::{VelocityZero, hermite_root};
use crate::kinematics::JointState;
use crate::linear::free_inertia;
use crate::real::Real;

/// One lane's part of a step.
pub(super) struct LaneStep<T, const N: usize> {
    /// Joint states at its start and its end.
    pub(super) ends: [JointState<T, N>; 2],
    /// Accelerations there.
    pub(super) ddq: [[T; N]; 2],
    /// Static friction there, if any joint is stuck.
    pub(super) static_friction: Option<[StaticFriction<T, N>; 2]>,
    /// > 0 or NaN if the step exceeds the angle range.
    pub(super) range_violation: T,
    /// Joints with dry friction.
    pub(super) dry: [bool; N],
    /// Coulomb coefficients.
    pub(super) coulomb: [T; N],
    /// Inertia at the end.
    pub(super) inertia: [[T; N]; N],
}

/// What to do after the step.
pub(super) enum StepOutcome<T, const N: usize> {
    /// The modes hold: the lane goes on from its end.
    Accepted,
    /// It ended at a reversal, with this joint state.
    Reversed(JointState<T, N>),
    /// It is repeated from its start with other modes or another length.
    Repeat,
    /// The scalar integrator takes the rest of the interval.
    Scalar,
}

impl<T: Real, const N: usize> LaneStep<T, N> {
    /// Decides, and sets the lane's clock and its joints' directions accordingly.
    pub(super) fn judge(&self, clock: &mut Clock<T, N>, direction: &mut [T; N]) -> StepOutcome<T, N> {
        let near = self.range_violation <= T::zero();
        if !near || clock.changes >= max_changes(N) {
            return StepOutcome::Scalar;
        }
        if let Some(goal) = clock.goal {
            return self.approach(goal, clock, direction);
        }
        let outcome = self.settle(clock, direction).unwrap_or_else(|| self.first_change(clock, direction));
        if matches!(outcome, StepOutcome::Repeat) {
            clock.changes += 1;
        }
        outcome
    }

    /// Releases the joint with the largest stiction violation, and sticks one that was released but is pulled back.
    fn settle(&self, clock: &mut Clock<T, N>, direction: &mut [T; N]) -> Option<StepOutcome<T, N>> {
        let (mut released, mut worst) = (None, T::zero());
        for j in 0..N {
            let (dq, along) = (self.ends[0].dq[j], direction[j]);
            if dq != T::zero() {
                if (self.dry[j] || along == T::zero()) && dq * along <= T::zero() {
                    direction[j] = dq.signum();
                    return Some(StepOutcome::Repeat);
                }
            } else if along == T::zero() {
                if let Some([static_friction, _]) = &self.static_friction
                    && static_friction.stiction_violation[j] > worst
                {
                    (released, worst) = (
                        Some((j, static_friction.friction_at_rest[j].signum())),
                        static_friction.stiction_violation[j],
                    );
                }
            } else if self.dry[j] && self.ddq[0][j] * along < T::zero() {
                (direction[j], clock.tried[j]) = (T::zero(), true);
                return Some(StepOutcome::Repeat);
            }
        }
        let (j, along) = released?;
        if clock.tried[j] {
            return Some(StepOutcome::Scalar);
        }
        direction[j] = along;
        Some(StepOutcome::Repeat)
    }

    /// The reversal that comes first, if any.
    fn first_change(&self, clock: &mut Clock<T, N>, direction: &[T; N]) -> StepOutcome<T, N> {
        let [start, end] = &self.ends;
        let mut first = None;
        for j in 0..N {
            if direction[j] == T::zero()
                && self
                    .static_friction
                    .as_ref()
                    .is_some_and(|static_friction| static_friction[1].stiction_violation[j] > T::zero())
            {
                return StepOutcome::Scalar;
            }
            if self.dry[j] && end.dq[j] * direction[j] < T::zero() {
                let h = clock.left;
                let s = hermite_root(start.dq[j], self.ddq[0][j] * h, end.dq[j], self.ddq[1][j] * h);
                if first.is_none_or(|(earliest, _)| s < earliest) {
                    first = Some((s, j));
                }
            }
        }
        let Some((s, joint)) = first else { return StepOutcome::Accepted };
        clock.goal = Some(Reversal { joint, length: s * clock.left });
        StepOutcome::Repeat
    }

    /// Ends at a reversal, or comes closer to it in another step.
    fn approach(
        &self,
        goal: Reversal<T>,
        clock: &mut Clock<T, N>,
        direction: &mut [T; N],
    ) -> StepOutcome<T, N> {
        let Reversal { joint: j, length } = goal;
        let end = &self.ends[1];
        let zero = VelocityZero { joints: end, j, length, ddq: [&self.ddq[0], &self.ddq[1]] };
        let next = length + zero.correction();
        let within = next > T::zero() && next <= clock.left;
        let (more, mut joints) = match zero.reached(clock.left) {
            Some(reached) if within => reached,
            None if within => {
                clock.goal = Some(Reversal { joint: j, length: next });
                clock.changes += 1;
                return StepOutcome::Repeat;
            }
            _ => (T::zero(), *end),
        };
        joints.dq[j] = T::zero();
        // As it seems; `settle` puts right what is not so.
        let goes_on = -(self.ddq[1][j] * direction[j]) > self.acceleration_step(j);
        direction[j] = if goes_on { -direction[j] } else { T::zero() };
        clock.pass(length + more);
        StepOutcome::Reversed(joints)
    }

    /// Change of joint `j`'s acceleration when its dry friction reverses, all other joints free to move.
    fn acceleration_step(&self, j: usize) -> T {
        (self.coulomb[j] + self.coulomb[j]) / free_inertia(&self.inertia, j)
    }
}
