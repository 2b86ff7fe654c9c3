//! Dynamics of a plant with fixed friction modes, as [`crate::fixed_mode`] integrates them.

use super::Plant;
use crate::arm::Arm;
use crate::fixed_mode::{Dynamics, Instant};
use crate::kinematics::{AngleRange, JointState, KinematicState};
use crate::number::Number;
use crate::real::Real;
use crate::trig::{Rotation, SinCos};

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Dynamics<T, N> for Plant<T, A, N, P> {
    #[inline(always)]
    fn rotations(&self, by: &[T; N], reach: AngleRange) -> ([Rotation<T>; N], T) {
        self.rigid.rotations(by, reach)
    }

    #[inline(always)]
    fn rotated(&self, joints: &JointState<T, N>, sincos: [SinCos<T>; N]) -> KinematicState<T, N> {
        self.rigid.rotated(joints, sincos)
    }

    #[inline(always)]
    fn generalized_force(&self, at: &Instant<'_, T, N>, direction: &[T; N]) -> [T; N] {
        let KinematicState { joints: JointState { q, dq }, equation_terms, .. } = at.kinematics;
        let mut generalized_force = *at.tau;
        for j in 0..N {
            // Terms are subtracted in the order in which they are computed, the bias last.
            generalized_force[j] -= self.rigid.viscous[j] * dq[j];
            let hooks = self.hooks[j];
            if !(hooks.coulomb || hooks.force) {
                generalized_force[j] = generalized_force[j]
                    - self.rigid.coulomb[j].larger(T::zero()) * direction[j]
                    - equation_terms.bias[j];
                continue;
            }
            generalized_force[j] -= equation_terms.bias[j];
            let mut x = self.point(j, at.t, q[j], dq[j], at.tau[j], equation_terms.bias[j]);
            if direction[j] != T::zero() {
                generalized_force[j] -= self.level(j, &x, direction[j]) * direction[j];
            }
            x.other = direction[(j + 1) % N];
            generalized_force[j] += self.force(j, &x);
        }
        generalized_force
    }

    #[inline(always)]
    fn stiction_violation(
        &self,
        at: &Instant<'_, T, N>,
        friction_at_rest: &[T; N],
        direction: &[T; N],
    ) -> [T; N] {
        let mut stiction_violation = [T::zero(); N];
        for j in 0..N {
            if direction[j] == T::zero() {
                stiction_violation[j] = self
                    .stiction_violation(j, at.t, at.kinematics.joints.q[j], at.tau[j], friction_at_rest[j])
                    .0;
            }
        }
        stiction_violation
    }
}
