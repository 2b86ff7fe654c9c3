//! Plants side by side, one in each lane.

use super::{WIDTH, Wide};
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::effect::{Hooks, JointPoint};
use crate::glide::{Body, Instant, Place, Pose, Rigid};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::plant::Plant;
use crate::real::Real;

/// Plants side by side.
pub(super) struct Bundle<'a, T: Real, C, A, const N: usize, const P: usize> {
    pub(super) plants: [&'a Plant<T, A, N, P>; WIDTH],
    pub(super) rigid: Rigid<Wide<T, C>, A, N, P>,
    /// One plant in all lanes.
    alike: bool,
    /// Hooks in use on each joint, in any lane.
    hooks: [Hooks; N],
    /// 1 where a joint has dry friction.
    pub(super) dry: [Wide<T, C>; N],
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const N: usize, const P: usize> Bundle<'a, T, C, A, N, P> {
    pub(super) fn new(plants: [&'a Plant<T, A, N, P>; WIDTH]) -> Self {
        let gather = |of: &dyn Fn(&Rigid<T, A, N, P>) -> T| Lanes::new(plants.map(|plant| of(plant.rigid())));
        let rigid = Rigid {
            arm: plants[0].rigid().arm.clone(),
            theta: core::array::from_fn(|i| gather(&|r| r.theta[i])),
            viscous: core::array::from_fn(|j| gather(&|r| r.viscous[j])),
            coulomb: core::array::from_fn(|j| gather(&|r| r.coulomb[j].max(T::zero()))),
            added: core::array::from_fn(|i| core::array::from_fn(|j| gather(&|r| r.added[i][j]))),
            tilt: gather(&|r| r.tilt),
        };
        let alike = plants.iter().all(|plant| core::ptr::eq(*plant, plants[0]));
        let hooks = core::array::from_fn(|j| Hooks {
            force: plants.iter().any(|plant| plant.hooks(j).force),
            coulomb: plants.iter().any(|plant| plant.hooks(j).coulomb),
            ..Hooks::NONE
        });
        let dry = core::array::from_fn(|j| Lanes::new(plants.map(|plant| plant.dry(j))));
        Self { plants, rigid, alike, hooks, dry }
    }

    /// Coulomb levels of sliding joints, and torques of the effects.
    #[inline(never)]
    fn laws(
        &self,
        at: &Instant<'_, Wide<T, C>, N>,
        direction: &[Wide<T, C>; N],
        j: usize,
    ) -> [Wide<T, C>; 2] {
        let mut x = [self.point(at, j, 0); WIDTH];
        for l in 1..WIDTH {
            x[l] = self.point(at, j, l);
        }
        let (mut level, mut force) = (self.rigid.coulomb[j], Wide::of(T::zero()));
        if self.hooks[j].coulomb {
            level = self.levels(&x, direction[j], j);
        }
        if self.hooks[j].force {
            for l in 0..WIDTH {
                x[l].other = direction[(j + 1) % N].0[l];
            }
            force = self.forces(&x, j);
        }
        [level, force]
    }

    #[inline]
    fn point(&self, at: &Instant<'_, Wide<T, C>, N>, j: usize, l: usize) -> JointPoint<T> {
        let Place { q, dq } = &at.pose.place;
        self.plants[l].point(
            j,
            at.t.0[l],
            q[j].0[l],
            dq[j].0[l],
            at.tau[j].0[l],
            at.pose.balance.bias[j].0[l],
        )
    }

    /// Coulomb levels of joint `j` in the lanes where it slides.
    #[inline]
    fn levels(&self, x: &[JointPoint<T>; WIDTH], direction: Wide<T, C>, j: usize) -> Wide<T, C> {
        let mut levels = self.rigid.coulomb[j];
        if !self.alike {
            for l in 0..WIDTH {
                levels.0[l] = self.plants[l].level(j, &x[l], direction.0[l]);
            }
            return levels;
        }
        let (mut sliding, mut count) = ([0; WIDTH], 0);
        let (mut points, mut along, mut sums) = (*x, direction.0, [T::zero(); WIDTH]);
        for l in 0..WIDTH {
            if direction.0[l] != T::zero() {
                (sliding[count], points[count], along[count]) = (l, x[l], direction.0[l]);
                sums[count] = self.plants[0].rigid().coulomb[j];
                count += 1;
            }
        }
        for effect in self.plants[0].effects() {
            if effect.joint == j && effect.law.spec().hooks.coulomb {
                effect.law.add_coulombs(&effect.p, &points[..count], &along[..count], &mut sums[..count]);
            }
        }
        for i in 0..count {
            levels.0[sliding[i]] = sums[i].max(T::zero());
        }
        levels
    }

    /// Torques of the effects on joint `j`.
    #[inline]
    fn forces(&self, x: &[JointPoint<T>; WIDTH], j: usize) -> Wide<T, C> {
        let mut sums = [T::zero(); WIDTH];
        if self.alike {
            for effect in self.plants[0].effects() {
                if effect.joint == j && effect.law.spec().hooks.force {
                    effect.law.add_forces(&effect.p, x, &mut sums);
                }
            }
        } else {
            for l in 0..WIDTH {
                sums[l] = self.plants[l].force(j, &x[l]);
            }
        }
        Lanes::new(sums)
    }

    /// By how much holding joint `j` takes more than friction gives, in the lanes where it is stuck.
    #[inline(never)]
    fn excesses(
        &self,
        at: &Instant<'_, Wide<T, C>, N>,
        holding: Wide<T, C>,
        direction: Wide<T, C>,
        j: usize,
    ) -> Wide<T, C> {
        let mut excess = Wide::of(T::zero());
        for l in 0..WIDTH {
            if direction.0[l] == T::zero() {
                let (t, q, tau) = (at.t.0[l], at.pose.place.q[j].0[l], at.tau[j].0[l]);
                excess.0[l] = self.plants[l].excess(j, t, q, tau, holding.0[l]).0;
            }
        }
        excess
    }
}

impl<T: Real, C: Cpu, A: Arm<T, N, P>, const N: usize, const P: usize> Body<Wide<T, C>, N>
    for Bundle<'_, T, C, A, N, P>
{
    #[inline(always)]
    fn near(
        &self,
        known: &Pose<Wide<T, C>, N>,
        place: &Place<Wide<T, C>, N>,
        by: &[Wide<T, C>; N],
    ) -> (Pose<Wide<T, C>, N>, Wide<T, C>) {
        self.rigid.near(known, place, by)
    }

    #[inline(always)]
    fn dry(&self, j: usize) -> Wide<T, C> {
        self.dry[j]
    }

    #[inline(always)]
    fn pull(&self, at: &Instant<'_, Wide<T, C>, N>, direction: &[Wide<T, C>; N]) -> [Wide<T, C>; N] {
        let mut pull = *at.tau;
        for j in 0..N {
            let (mut level, viscous) = (self.rigid.coulomb[j], self.rigid.viscous[j]);
            if self.hooks[j].force || self.hooks[j].coulomb {
                let [own, force] = self.laws(at, direction, j);
                (level, pull[j]) = (own, pull[j] + force);
            }
            // What is known first is subtracted first: the bias is not.
            let driven = (-level).fused(direction[j], (-viscous).fused(at.pose.place.dq[j], pull[j]));
            pull[j] = driven - at.pose.balance.bias[j];
        }
        pull
    }

    #[inline(always)]
    fn excess(
        &self,
        at: &Instant<'_, Wide<T, C>, N>,
        holding: &[Wide<T, C>; N],
        direction: &[Wide<T, C>; N],
    ) -> [Wide<T, C>; N] {
        let mut excess = *holding;
        for j in 0..N {
            excess[j] = if self.hooks[j].coulomb {
                self.excesses(at, holding[j], direction[j], j)
            } else {
                let slides = direction[j] * direction[j];
                (holding[j].size() - self.rigid.coulomb[j]) * (Wide::of(T::one()) - slides)
            };
        }
        excess
    }
}
