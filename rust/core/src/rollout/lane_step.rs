//! Step of one lane in which friction modes may have changed, and the decision how the lane goes on.

use super::clock::{Clock, Reversal, max_changes};
use crate::fixed_mode::StaticFriction;
use crate::integrate::root::{VelocityZero, hermite_root};
use crate::kinematics::JointState;
use crate::linear::free_inertia;
use crate::real::Real;

/// One lane's part of a step of a batch rollout.
pub(super) struct LaneStep<T, const N: usize> {
    /// Joint states at the start and the end of the step.
    pub(super) ends: [JointState<T, N>; 2],
    /// Joint accelerations at the start and the end of the step, rad/s^2 (m/s^2).
    pub(super) ddq: [[T; N]; 2],
    /// Static friction at the start and the end of the step, if any joint is stuck.
    pub(super) static_friction: Option<[StaticFriction<T, N>; 2]>,
    /// Positive or NaN if the step turns the arm beyond the angle range of one step.
    pub(super) range_violation: T,
    /// Whether each joint has dry friction.
    pub(super) dry: [bool; N],
    /// Coulomb coefficient of each joint, N m (N).
    pub(super) coulomb: [T; N],
    /// Inertia matrix at the end of the step, by rows.
    pub(super) inertia: [[T; N]; N],
}

/// How a lane of a batch rollout goes on after a step.
pub(super) enum StepOutcome<T, const N: usize> {
    /// The friction modes hold: the lane goes on from the end of the step.
    Accepted,
    /// The step ended at a reversal, with this joint state.
    Reversed(JointState<T, N>),
    /// The step is repeated from its start with changed friction modes or another length.
    Repeat,
    /// The scalar integrator takes the rest of the sample interval.
    Scalar,
}

impl<T: Real, const N: usize> LaneStep<T, N> {
    /// Decides how the lane goes on, and sets its clock and the directions of its joints accordingly.
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

    /// Releases the stuck joint whose friction torque at rest exceeds its Coulomb level by most, and sticks a released joint that is pulled back;
    /// `None` if no friction mode at the start of the step has to change.
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

    /// Repeats the step up to the earliest reversal within it; accepts the step if there is no reversal, and leaves it to the scalar integrator if a
    /// stuck joint breaks away within it.
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

    /// Ends the step at the reversal `goal`, or repeats it with a length closer to the reversal.
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
        // A first estimate of the sliding direction; `settle` corrects it if it contradicts the motion.
        let goes_on = -(self.ddq[1][j] * direction[j]) > self.acceleration_step(j);
        direction[j] = if goes_on { -direction[j] } else { T::zero() };
        clock.pass(length + more);
        StepOutcome::Reversed(joints)
    }

    /// Change of joint `j`'s acceleration when its dry friction reverses, with all other joints free to move, rad/s^2 (m/s^2).
    fn acceleration_step(&self, j: usize) -> T {
        (self.coulomb[j] + self.coulomb[j]) / free_inertia(&self.inertia, j)
    }
}
