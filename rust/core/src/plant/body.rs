//! The plant as a step without mode changes sees it: on one run, or on several side by side.

use super::Plant;
use crate::arm::Arm;
use crate::glide::{Body, Instant};
use crate::number::Number;
use crate::pose::{Place, Pose, Reach};
use crate::real::Real;
use crate::trig::{Rotation, Turn};

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Body<T, N> for Plant<T, A, N, P> {
    #[inline(always)]
    fn rotations(&self, by: &[T; N], reach: Reach) -> ([Rotation<T>; N], T) {
        self.rigid.rotations(by, reach)
    }

    #[inline(always)]
    fn turned(&self, place: &Place<T, N>, turns: [Turn<T>; N]) -> Pose<T, N> {
        self.rigid.turned(place, turns)
    }

    #[inline(always)]
    fn pull(&self, at: &Instant<'_, T, N>, direction: &[T; N]) -> [T; N] {
        let Pose { place: Place { q, dq }, balance, .. } = at.pose;
        let mut pull = *at.tau;
        for j in 0..N {
            // What is known first is subtracted first: the bias is not.
            pull[j] -= self.rigid.viscous[j] * dq[j];
            let hooks = self.hooks[j];
            if !(hooks.coulomb || hooks.force) {
                pull[j] = pull[j] - self.rigid.coulomb[j].larger(T::zero()) * direction[j] - balance.bias[j];
                continue;
            }
            pull[j] -= balance.bias[j];
            let mut x = self.point(j, at.t, q[j], dq[j], at.tau[j], balance.bias[j]);
            if direction[j] != T::zero() {
                pull[j] -= self.level(j, &x, direction[j]) * direction[j];
            }
            x.other = direction[(j + 1) % N];
            pull[j] += self.force(j, &x);
        }
        pull
    }

    #[inline(always)]
    fn excess(&self, at: &Instant<'_, T, N>, holding: &[T; N], direction: &[T; N]) -> [T; N] {
        let mut excess = [T::zero(); N];
        for j in 0..N {
            if direction[j] == T::zero() {
                excess[j] = self.excess(j, at.t, at.pose.place.q[j], at.tau[j], holding[j]).0;
            }
        }
        excess
    }
}
