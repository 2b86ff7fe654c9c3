//! Plants of a batch rollout side by side, one in each lane of a vector.

use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::effect::{Hooks, JointPoints};
use crate::fixed_mode::{Dynamics, Instant, Modes};
use crate::kinematics::{AngleRange, JointState, KinematicState, RigidArm};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::plant::Plant;
use crate::real::Real;
use crate::trig::{Rotation, SinCos};
use core::array::from_fn;

/// Time, position, velocity, motor torque and bias `C dq + g` of a joint at an instant, copied as arguments of the effects' laws: compilers keep data
/// in memory to which a function that is not inlined has a reference.
pub(super) struct JointInstant<V> {
    pub(super) t: V,
    pub(super) q: V,
    pub(super) dq: V,
    pub(super) tau: V,
    pub(super) bias: V,
}

impl<V: Copy> JointInstant<V> {
    #[inline(always)]
    fn of<const N: usize>(at: &Instant<'_, V, N>, j: usize) -> Self {
        let JointState { q, dq } = &at.kinematics.joints;
        Self { t: at.t, q: q[j], dq: dq[j], tau: at.tau[j], bias: at.kinematics.equation_terms.bias[j] }
    }
}

/// Plants of a batch rollout, one in each lane of a vector.
pub(super) struct PlantLanes<'a, T: Real, C, A, const W: usize, const N: usize, const P: usize> {
    pub(super) plants: [&'a Plant<T, A, N, P>; W],
    pub(super) rigid: RigidArm<Lanes<T, C, W>, A, N, P>,
    /// Whether all lanes have the same plant.
    same_plant: bool,
    /// Hooks of effects in use on each joint, in any lane.
    pub(super) hooks: [Hooks; N],
    /// 1 in each lane where a joint has dry friction, else 0.
    pub(super) dry: [Lanes<T, C, W>; N],
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const N: usize, const P: usize>
    PlantLanes<'a, T, C, A, W, N, P>
{
    /// Plants of a batch rollout of which all lanes have the plant `plant`.
    pub(super) fn new(plant: &'a Plant<T, A, N, P>) -> Self {
        let RigidArm { arm, theta, viscous, coulomb, constant_inertia, tilt } = plant.rigid();
        let rigid = RigidArm {
            arm: arm.clone(),
            theta: theta.map(Lanes::of),
            viscous: viscous.map(Lanes::of),
            coulomb: coulomb.map(|level| Lanes::of(level.max(T::zero()))),
            constant_inertia: constant_inertia.map(|row| row.map(Lanes::of)),
            tilt: Lanes::of(*tilt),
        };
        let (hooks, dry) = (from_fn(|j| plant.hooks(j)), from_fn(|j| Lanes::of(plant.dry(j))));
        Self { plants: [plant; W], rigid, same_plant: true, hooks, dry }
    }

    /// Whether any joint in any lane has effects that add torque or change its Coulomb level.
    #[inline(always)]
    pub(super) fn has_effects(&self) -> bool {
        let mut any = false;
        for j in 0..N {
            any |= self.hooks[j].force | self.hooks[j].coulomb;
        }
        any
    }

    /// Puts the plant `plant` into lane `l`.
    pub(super) fn put(&mut self, l: usize, plant: &'a Plant<T, A, N, P>) {
        if core::ptr::eq(self.plants[l], plant) {
            return;
        }
        self.plants[l] = plant;
        self.same_plant = self.plants.iter().all(|other| core::ptr::eq(*other, plant));
        let (own, rigid) = (plant.rigid(), &mut self.rigid);
        for i in 0..P {
            rigid.theta[i].0[l] = own.theta[i];
        }
        for j in 0..N {
            rigid.viscous[j].0[l] = own.viscous[j];
            rigid.coulomb[j].0[l] = own.coulomb[j].max(T::zero());
            for k in 0..N {
                rigid.constant_inertia[j][k].0[l] = own.constant_inertia[j][k];
            }
            self.dry[j].0[l] = plant.dry(j);
            self.hooks[j].force = self.plants.iter().any(|plant| plant.hooks(j).force);
            self.hooks[j].coulomb = self.plants.iter().any(|plant| plant.hooks(j).coulomb);
        }
        rigid.tilt.0[l] = own.tilt;
    }

    /// Coulomb level of joint `j` in the lanes where it slides, in `direction`, and torque of the effects on joint `j`, N m (N); `other` is the
    /// direction in which the joint after `j` slides, `memory` the hysteresis state of joint `j`, if it has one.
    #[inline(never)]
    pub(super) fn laws(
        &self,
        at: &JointInstant<Lanes<T, C, W>>,
        direction: Lanes<T, C, W>,
        other: Lanes<T, C, W>,
        memory: Option<&Lanes<T, C, W>>,
        j: usize,
    ) -> [Lanes<T, C, W>; 2] {
        let friction = self.rigid.viscous[j] * at.dq.size() + self.rigid.coulomb[j];
        let none = [T::zero(); W];
        let points = JointPoints {
            t: &at.t.0,
            q: &at.q.0,
            dq: &at.dq.0,
            tau: &at.tau.0,
            load: &at.bias.0,
            friction: &friction.0,
            other: &other.0,
            memory: memory.map_or(&none, |memory| &memory.0),
        };
        let (mut level, mut force) = (self.rigid.coulomb[j], Lanes::of(T::zero()));
        if self.hooks[j].coulomb {
            level = self.levels(&points, direction, j);
        }
        if self.hooks[j].force {
            force = self.forces(&points, j);
        }
        [level, force]
    }

    /// Coulomb levels of joint `j` in the lanes where it slides in `direction`, at the states `x` of the lanes, N m (N).
    #[inline]
    fn levels(&self, x: &JointPoints<'_, T>, direction: Lanes<T, C, W>, j: usize) -> Lanes<T, C, W> {
        let mut levels = self.rigid.coulomb[j];
        if !self.same_plant {
            for l in 0..W {
                levels.0[l] = self.plants[l].level(j, &x.at(l), direction.0[l]);
            }
            return levels;
        }
        let mut sums = [self.plants[0].rigid().coulomb[j]; W];
        for effect in self.plants[0].effects() {
            if effect.joint == j && effect.law.spec().hooks.coulomb {
                effect.law.add_coulombs(&effect.p, x, &direction.0, &mut sums);
            }
        }
        for l in 0..W {
            if direction.0[l] != T::zero() {
                levels.0[l] = sums[l].max(T::zero());
            }
        }
        levels
    }

    /// Torques of the effects on joint `j` at the states `x` of the lanes, N m (N).
    #[inline]
    fn forces(&self, x: &JointPoints<'_, T>, j: usize) -> Lanes<T, C, W> {
        let mut sums = [T::zero(); W];
        if self.same_plant {
            for effect in self.plants[0].effects() {
                if effect.joint == j && effect.law.spec().hooks.force {
                    effect.law.add_forces(&effect.p, x, &mut sums);
                }
            }
        } else {
            for l in 0..W {
                sums[l] = self.plants[l].force(j, &x.at(l));
            }
        }
        Lanes::new(sums)
    }

    /// Friction torque at rest of joint `j` less its Coulomb level, N m (N), in the lanes where the joint is stuck, else 0.
    #[inline(never)]
    pub(super) fn stiction_violations(
        &self,
        at: &JointInstant<Lanes<T, C, W>>,
        friction_at_rest: Lanes<T, C, W>,
        direction: Lanes<T, C, W>,
        j: usize,
    ) -> Lanes<T, C, W> {
        let mut stiction_violation = Lanes::of(T::zero());
        for l in 0..W {
            if direction.0[l] == T::zero() {
                stiction_violation.0[l] = self.plants[l]
                    .stiction_violation(j, at.t.0[l], at.q.0[l], at.tau.0[l], friction_at_rest.0[l])
                    .0;
            }
        }
        stiction_violation
    }
}

/// Dynamics of the plants of a batch rollout, one in each lane. Without `EFFECTS` it is known at compile time, from `ANY_STUCK`, whether any joint is
/// stuck, and a step has no branch.
pub(super) struct LaneDynamics<'b, B, const EFFECTS: bool, const ANY_STUCK: bool>(pub(super) &'b B);

impl<
    T: Real,
    C: Cpu,
    A: Arm<T, N, P>,
    const W: usize,
    const N: usize,
    const P: usize,
    const EFFECTS: bool,
    const ANY_STUCK: bool,
> Dynamics<Lanes<T, C, W>, N> for LaneDynamics<'_, PlantLanes<'_, T, C, A, W, N, P>, EFFECTS, ANY_STUCK>
{
    #[inline(always)]
    fn rotations(
        &self,
        by: &[Lanes<T, C, W>; N],
        reach: AngleRange,
    ) -> ([Rotation<Lanes<T, C, W>>; N], Lanes<T, C, W>) {
        self.0.rigid.rotations(by, reach)
    }

    #[inline(always)]
    fn rotated(
        &self,
        joints: &JointState<Lanes<T, C, W>, N>,
        sincos: [SinCos<Lanes<T, C, W>>; N],
    ) -> KinematicState<Lanes<T, C, W>, N> {
        self.0.rigid.rotated(joints, sincos)
    }

    #[inline(always)]
    fn any_stuck(&self, modes: &Modes<Lanes<T, C, W>, N>) -> bool {
        if EFFECTS { modes.any_stuck } else { ANY_STUCK }
    }

    #[inline(always)]
    fn generalized_force(
        &self,
        at: &Instant<'_, Lanes<T, C, W>, N>,
        direction: &[Lanes<T, C, W>; N],
    ) -> [Lanes<T, C, W>; N] {
        let mut generalized_force = *at.tau;
        for j in 0..N {
            let (mut level, viscous) = (self.0.rigid.coulomb[j], self.0.rigid.viscous[j]);
            if EFFECTS && (self.0.hooks[j].force || self.0.hooks[j].coulomb) {
                let [own, force] =
                    self.0.laws(&JointInstant::of(at, j), direction[j], direction[(j + 1) % N], None, j);
                (level, generalized_force[j]) = (own, generalized_force[j] + force);
            }
            // Terms are subtracted in the order in which they are computed, the bias last.
            let driven = (-viscous)
                .fused(at.kinematics.joints.dq[j], (-level).fused(direction[j], generalized_force[j]));
            generalized_force[j] = driven - at.kinematics.equation_terms.bias[j];
        }
        generalized_force
    }

    #[inline(always)]
    fn stiction_violation(
        &self,
        at: &Instant<'_, Lanes<T, C, W>, N>,
        friction_at_rest: &[Lanes<T, C, W>; N],
        direction: &[Lanes<T, C, W>; N],
    ) -> [Lanes<T, C, W>; N] {
        let mut stiction_violation = *friction_at_rest;
        for j in 0..N {
            stiction_violation[j] = if EFFECTS && self.0.hooks[j].coulomb {
                self.0.stiction_violations(&JointInstant::of(at, j), friction_at_rest[j], direction[j], j)
            } else {
                let slides = direction[j] * direction[j];
                (friction_at_rest[j].size() - self.0.rigid.coulomb[j]) * (Lanes::of(T::one()) - slides)
            };
        }
        stiction_violation
    }
}
