//! Friction and effect torques at one joint and instant.

use super::{Mode, Plant};
use crate::arm::Arm;
use crate::effect::JointPoint;
use crate::hyperbolic::TANH_SATURATION;
use crate::real::{Real, lit};

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Plant<T, A, N, P> {
    /// State, torque `tau` and load `load`, N m (N), of joint `j` at an instant, as arguments of the effects' laws.
    #[inline]
    pub(crate) fn point(&self, j: usize, t: T, q: T, dq: T, tau: T, load: T) -> JointPoint<T> {
        let friction = self.rigid.viscous[j] * dq.abs() + self.rigid.coulomb[j];
        JointPoint { t, q, dq, tau, load, friction, other: T::zero(), memory: T::zero() }
    }

    /// Direction in which joint `j` slides: -1, 0 or 1; a number between -1 and 1 where friction is regularised.
    #[inline]
    pub(super) fn sliding(&self, j: usize, dq: &[T; N], modes: &[Mode; N]) -> T {
        if self.is_rounded(j) { self.soft_sign(j, dq[j]) } else { modes[j].direction() }
    }

    /// Smooth sign of the velocity `dq`, rad/s (m/s), of joint `j` with regularised friction.
    #[inline]
    fn soft_sign(&self, j: usize, dq: T) -> T {
        let ratio = dq / self.rounding[j];
        if ratio.abs() < lit(TANH_SATURATION) { ratio.tanh() } else { ratio.signum() }
    }

    /// Coulomb level of joint `j` for sliding in `direction`, N m (N), never negative.
    #[inline]
    pub(crate) fn level(&self, j: usize, x: &JointPoint<T>, direction: T) -> T {
        let mut level = self.rigid.coulomb[j];
        if self.hooks[j].coulomb {
            for effect in self.effects() {
                if effect.joint == j && effect.law.spec().hooks.coulomb {
                    level += effect.law.coulomb(&effect.p, x, direction);
                }
            }
        }
        level.max(T::zero())
    }

    /// Torque of the effects with [`crate::effect::Effect::force`] on joint `j`, N m (N).
    #[inline]
    pub(crate) fn force(&self, j: usize, x: &JointPoint<T>) -> T {
        let mut sum = T::zero();
        if self.hooks[j].force {
            for effect in self.effects() {
                if effect.joint == j && effect.law.spec().hooks.force {
                    sum += effect.law.force(&effect.p, x);
                }
            }
        }
        sum
    }

    /// Dry friction torque of joint `j`, N m (N), positive against motion forward; 0 for a stuck joint.
    #[inline]
    pub(super) fn dry_friction(&self, j: usize, x: &JointPoint<T>, mode: Mode) -> T {
        if self.is_rounded(j) {
            let soft = self.soft_sign(j, x.dq);
            return self.level(j, x, if soft < T::zero() { -T::one() } else { T::one() }) * soft;
        }
        match mode {
            Mode::Stuck => T::zero(),
            slides => self.level(j, x, slides.direction()) * slides.direction(),
        }
    }
}
