//! Plants side by side, one in each lane.

use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::effect::{Hooks, JointPoint};
use crate::glide::{Body, Instant};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::plant::Plant;
use crate::pose::{Place, Pose, Reach, Rigid};
use crate::real::Real;
use core::array::from_fn;

/// A joint at an instant. What an effect gets is a copy, made where there is one: whatever a function outside can see has to be kept in
/// memory throughout.
struct Here<V> {
    t: V,
    q: V,
    dq: V,
    tau: V,
    bias: V,
}

impl<V: Copy> Here<V> {
    #[inline(always)]
    fn of<const N: usize>(at: &Instant<'_, V, N>, j: usize) -> Self {
        let Place { q, dq } = &at.pose.place;
        Self { t: at.t, q: q[j], dq: dq[j], tau: at.tau[j], bias: at.pose.balance.bias[j] }
    }
}

/// Plants side by side.
pub(super) struct Bundle<'a, T: Real, C, A, const W: usize, const N: usize, const P: usize> {
    pub(super) plants: [&'a Plant<T, A, N, P>; W],
    pub(super) rigid: Rigid<Lanes<T, C, W>, A, N, P>,
    /// One plant in all lanes.
    alike: bool,
    /// Hooks in use on each joint, in any lane.
    hooks: [Hooks; N],
    /// 1 where a joint has dry friction.
    pub(super) dry: [Lanes<T, C, W>; N],
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const N: usize, const P: usize>
    Bundle<'a, T, C, A, W, N, P>
{
    /// The same plant in all lanes.
    pub(super) fn new(plant: &'a Plant<T, A, N, P>) -> Self {
        let Rigid { arm, theta, viscous, coulomb, steady, tilt } = plant.rigid();
        let rigid = Rigid {
            arm: arm.clone(),
            theta: theta.map(Lanes::of),
            viscous: viscous.map(Lanes::of),
            coulomb: coulomb.map(|level| Lanes::of(level.max(T::zero()))),
            steady: steady.map(|row| row.map(Lanes::of)),
            tilt: Lanes::of(*tilt),
        };
        let (hooks, dry) = (from_fn(|j| plant.hooks(j)), from_fn(|j| Lanes::of(plant.dry(j))));
        Self { plants: [plant; W], rigid, alike: true, hooks, dry }
    }

    /// Puts a plant into lane `l`.
    pub(super) fn put(&mut self, l: usize, plant: &'a Plant<T, A, N, P>) {
        if core::ptr::eq(self.plants[l], plant) {
            return;
        }
        self.plants[l] = plant;
        self.alike = self.plants.iter().all(|other| core::ptr::eq(*other, plant));
        let (own, rigid) = (plant.rigid(), &mut self.rigid);
        for i in 0..P {
            rigid.theta[i].0[l] = own.theta[i];
        }
        for j in 0..N {
            rigid.viscous[j].0[l] = own.viscous[j];
            rigid.coulomb[j].0[l] = own.coulomb[j].max(T::zero());
            for k in 0..N {
                rigid.steady[j][k].0[l] = own.steady[j][k];
            }
            self.dry[j].0[l] = plant.dry(j);
            self.hooks[j].force = self.plants.iter().any(|plant| plant.hooks(j).force);
            self.hooks[j].coulomb = self.plants.iter().any(|plant| plant.hooks(j).coulomb);
        }
        rigid.tilt.0[l] = own.tilt;
    }

    /// Coulomb levels of sliding joints, and torques of the effects.
    #[inline(never)]
    fn laws(
        &self,
        at: &Here<Lanes<T, C, W>>,
        direction: &[Lanes<T, C, W>; N],
        j: usize,
    ) -> [Lanes<T, C, W>; 2] {
        let mut x = [self.point(at, j, 0); W];
        for l in 1..W {
            x[l] = self.point(at, j, l);
        }
        let (mut level, mut force) = (self.rigid.coulomb[j], Lanes::of(T::zero()));
        if self.hooks[j].coulomb {
            level = self.levels(&x, direction[j], j);
        }
        if self.hooks[j].force {
            for l in 0..W {
                x[l].other = direction[(j + 1) % N].0[l];
            }
            force = self.forces(&x, j);
        }
        [level, force]
    }

    #[inline]
    fn point(&self, at: &Here<Lanes<T, C, W>>, j: usize, l: usize) -> JointPoint<T> {
        self.plants[l].point(j, at.t.0[l], at.q.0[l], at.dq.0[l], at.tau.0[l], at.bias.0[l])
    }

    /// Coulomb levels of joint `j` in the lanes where it slides.
    #[inline]
    fn levels(&self, x: &[JointPoint<T>; W], direction: Lanes<T, C, W>, j: usize) -> Lanes<T, C, W> {
        let mut levels = self.rigid.coulomb[j];
        if !self.alike {
            for l in 0..W {
                levels.0[l] = self.plants[l].level(j, &x[l], direction.0[l]);
            }
            return levels;
        }
        let (mut sliding, mut count) = ([0; W], 0);
        let (mut points, mut along, mut sums) = (*x, direction.0, [T::zero(); W]);
        for l in 0..W {
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
    fn forces(&self, x: &[JointPoint<T>; W], j: usize) -> Lanes<T, C, W> {
        let mut sums = [T::zero(); W];
        if self.alike {
            for effect in self.plants[0].effects() {
                if effect.joint == j && effect.law.spec().hooks.force {
                    effect.law.add_forces(&effect.p, x, &mut sums);
                }
            }
        } else {
            for l in 0..W {
                sums[l] = self.plants[l].force(j, &x[l]);
            }
        }
        Lanes::new(sums)
    }

    /// By how much holding joint `j` takes more than friction gives, in the lanes where it is stuck.
    #[inline(never)]
    fn excesses(
        &self,
        at: &Here<Lanes<T, C, W>>,
        holding: Lanes<T, C, W>,
        direction: Lanes<T, C, W>,
        j: usize,
    ) -> Lanes<T, C, W> {
        let mut excess = Lanes::of(T::zero());
        for l in 0..W {
            if direction.0[l] == T::zero() {
                excess.0[l] = self.plants[l].excess(j, at.t.0[l], at.q.0[l], at.tau.0[l], holding.0[l]).0;
            }
        }
        excess
    }
}

impl<T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const N: usize, const P: usize> Body<Lanes<T, C, W>, N>
    for Bundle<'_, T, C, A, W, N, P>
{
    #[inline(always)]
    fn near(
        &self,
        known: &Pose<Lanes<T, C, W>, N>,
        place: &Place<Lanes<T, C, W>, N>,
        by: &[Lanes<T, C, W>; N],
        reach: Reach,
    ) -> (Pose<Lanes<T, C, W>, N>, Lanes<T, C, W>) {
        self.rigid.near(known, place, by, reach)
    }

    #[inline(always)]
    fn dry(&self, j: usize) -> Lanes<T, C, W> {
        self.dry[j]
    }

    #[inline(always)]
    fn pull(
        &self,
        at: &Instant<'_, Lanes<T, C, W>, N>,
        direction: &[Lanes<T, C, W>; N],
    ) -> [Lanes<T, C, W>; N] {
        let mut pull = *at.tau;
        for j in 0..N {
            let (mut level, viscous) = (self.rigid.coulomb[j], self.rigid.viscous[j]);
            if self.hooks[j].force || self.hooks[j].coulomb {
                let [own, force] = self.laws(&Here::of(at, j), direction, j);
                (level, pull[j]) = (own, pull[j] + force);
            }
            // What is known first is subtracted first: the bias is not.
            let driven = (-viscous).fused(at.pose.place.dq[j], pull[j] - level * direction[j]);
            pull[j] = driven - at.pose.balance.bias[j];
        }
        pull
    }

    #[inline(always)]
    fn excess(
        &self,
        at: &Instant<'_, Lanes<T, C, W>, N>,
        holding: &[Lanes<T, C, W>; N],
        direction: &[Lanes<T, C, W>; N],
    ) -> [Lanes<T, C, W>; N] {
        let mut excess = *holding;
        for j in 0..N {
            excess[j] = if self.hooks[j].coulomb {
                self.excesses(&Here::of(at, j), holding[j], direction[j], j)
            } else {
                let slides = direction[j] * direction[j];
                (holding[j].size() - self.rigid.coulomb[j]) * (Lanes::of(T::one()) - slides)
            };
        }
        excess
    }
}
