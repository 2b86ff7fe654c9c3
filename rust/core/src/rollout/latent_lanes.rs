//! Dynamics of plants with latent states, regularised friction, or both, in several runs side by side.
//!
//! The equations are those of [`Plant::acceleration`], with one run in each lane: the friction of a joint acts on its link or on its motor, is a
//! smooth function of velocity where it is regularised, and elsewhere has the direction of its friction mode throughout a step. The backlash of a
//! joint is open or closed throughout a step.

use super::latent_motion::StageMotion;
use super::plant_lanes::{JointInstant, PlantLanes};
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::fixed_mode::contradiction;
use crate::hyperbolic::tanh;
use crate::kinematics::{AngleRange, JointState, KinematicState, rotated};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::plant::{Plant, SLIDING};
use crate::real::{Real, lit};
use crate::transmission::Transmission;
use core::array::from_fn;

/// Joint states of several runs side by side, with their latent states.
#[derive(Debug, Clone, Copy)]
pub(super) struct LatentLaneState<V, const N: usize> {
    /// Positions and velocities of all joints.
    pub(super) joints: JointState<V, N>,
    /// Deflection of each joint's transmission, motor position less joint position, rad or m; zero for rigid joints.
    pub(super) deflection: [V; N],
    /// Rate of each deflection, rad/s or m/s.
    pub(super) deflection_rate: [V; N],
    /// Hysteresis state of each joint at its position, N m (N).
    pub(super) memory: [V; N],
}

/// Friction modes of all joints, and whether their backlash is closed, during a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct LatentModes<V, const N: usize> {
    /// Direction in which each joint, or the motor that carries its friction, slides: -1, 0 (stuck) or 1; 1 where friction is regularised.
    pub(super) direction: [V; N],
    /// Flank in contact where the backlash of a joint is closed, -1 or 1; zero where it is open, and for joints without backlash.
    pub(super) side: [V; N],
    /// Whether any joint is stuck in any lane.
    pub(super) any_stuck: bool,
}

/// Part of a sample interval in every lane, with the motor torques over it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LatentSpan<V, const N: usize> {
    /// Time at the start of the part, s.
    pub(super) t: V,
    /// Length of the part, s.
    pub(super) h: V,
    /// Motor torques at the start, the middle and the end of the part, N m (N).
    pub(super) tau: [[V; N]; 3],
}

/// State at the end of a step of all lanes, and whether the step contradicts its assumptions: fixed friction modes and a small change of angles.
pub(super) struct LatentStep<V, const N: usize> {
    pub(super) end: LatentLaneState<V, N>,
    /// Positive or NaN where friction modes contradict the motion, where backlash closes or opens, or where the motion is not finite or turns the arm
    /// beyond the angle range of a step.
    pub(super) violation: V,
    /// Positive where a joint with regularised friction does not slide at the end of the step in the direction in which it moves at the start of the
    /// step.
    pub(super) slowing: V,
}

/// Shaft between motor and link of an elastic joint, or backlash, the same in all lanes.
#[derive(Clone, Copy)]
pub(super) struct Shaft<V, const N: usize> {
    /// Stiffness and damping of the shaft; zero for backlash, which passes no torque where it is open.
    pub(super) stiffness: V,
    pub(super) damping: V,
    /// Inertia of the rotor, kg m^2 (kg), and 1 over it.
    pub(super) inertia: V,
    pub(super) inverse_inertia: V,
    /// Rotor velocity per velocity of each joint.
    pub(super) rotor_jacobian: [V; N],
    /// Half of the width of the backlash, rad or m; `None` for an elastic shaft.
    pub(super) half_backlash: Option<V>,
}

impl<V, const N: usize> Shaft<V, N> {
    /// Shaft of the transmission of joint `j`, with the numbers that `of` makes of the transmission's values.
    fn of<T: Real>(transmission: &Transmission<T>, j: usize, of: impl Fn(T) -> V) -> Self {
        let has_backlash = transmission.backlash > T::zero();
        let passes = if has_backlash { T::zero() } else { T::one() };
        Self {
            stiffness: of(transmission.stiffness * passes),
            damping: of(transmission.damping * passes),
            inertia: of(transmission.inertia),
            inverse_inertia: of(T::one() / transmission.inertia),
            rotor_jacobian: transmission.rotor_jacobian(j).map(&of),
            half_backlash: has_backlash.then(|| of(transmission.half_backlash())),
        }
    }
}

/// Plants with latent states or regularised friction, one in each of `W` lanes, which differ in values alone.
pub(super) struct LatentLanes<'a, T: Real, C, A, const W: usize, const N: usize, const P: usize> {
    pub(super) lanes: PlantLanes<'a, T, C, A, W, N, P>,
    pub(super) shafts: [Option<Shaft<Lanes<T, C, W>, N>>; N],
    /// Whether friction of each joint acts on its motor, which moves against its link.
    pub(super) at_motor: [bool; N],
    /// 1 over the width over which friction of each joint is regularised, s/rad (s/m); `None` for exact dry friction.
    pub(super) inverse_width: [Option<Lanes<T, C, W>>; N],
    pub(super) has_effects: bool,
    pub(super) has_backlash: bool,
    pub(super) has_hysteresis: bool,
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const N: usize, const P: usize>
    LatentLanes<'a, T, C, A, W, N, P>
{
    pub(super) fn new(plant: &'a Plant<T, A, N, P>) -> Self {
        let lanes = PlantLanes::new(plant);
        let shaft =
            |j: usize| plant.drivetrain().get(j).map(|transmission| Shaft::of(transmission, j, Lanes::of));
        let inverse_width = |j: usize| plant.is_rounded(j).then(|| Lanes::of(T::one() / plant.rounding(j)));
        Self {
            shafts: from_fn(shaft),
            at_motor: from_fn(|j| plant.drivetrain().sides(j).friction_at_motor),
            inverse_width: from_fn(inverse_width),
            has_effects: lanes.has_effects(),
            has_backlash: plant.drivetrain().has_backlash(),
            has_hysteresis: plant.has_hysteresis(),
            lanes,
        }
    }

    /// Plant of lane `l`.
    #[inline(always)]
    pub(super) fn plant(&self, l: usize) -> &'a Plant<T, A, N, P> {
        self.lanes.plants[l]
    }

    /// Puts the plant `plant`, which differs from those of the other lanes in values alone, into lane `l`.
    pub(super) fn put(&mut self, l: usize, plant: &'a Plant<T, A, N, P>) {
        if core::ptr::eq(self.plant(l), plant) {
            return;
        }
        self.lanes.put(l, plant);
        for j in 0..N {
            if let Some(inverse_width) = &mut self.inverse_width[j] {
                inverse_width.0[l] = T::one() / plant.rounding(j);
            }
            if let (Some(shaft), Some(transmission)) = (&mut self.shafts[j], plant.drivetrain().get(j)) {
                let own: Shaft<T, N> = Shaft::of(transmission, j, |x| x);
                shaft.stiffness.0[l] = own.stiffness;
                shaft.damping.0[l] = own.damping;
                shaft.inertia.0[l] = own.inertia;
                shaft.inverse_inertia.0[l] = own.inverse_inertia;
                for k in 0..N {
                    shaft.rotor_jacobian[k].0[l] = own.rotor_jacobian[k];
                }
                if let (Some(half), Some(own)) = (&mut shaft.half_backlash, own.half_backlash) {
                    half.0[l] = own;
                }
            }
        }
    }

    /// Kinematic state at the joint state `joints`.
    #[inline(always)]
    pub(super) fn kinematics(
        &self,
        joints: &JointState<Lanes<T, C, W>, N>,
    ) -> KinematicState<Lanes<T, C, W>, N> {
        self.lanes.rigid.kinematics(joints)
    }

    /// Velocity on which the friction of joint `j` acts, rad/s or m/s.
    #[inline(always)]
    pub(super) fn friction_velocity(
        &self,
        j: usize,
        state: &LatentLaneState<Lanes<T, C, W>, N>,
    ) -> Lanes<T, C, W> {
        if self.at_motor[j] { state.joints.dq[j] + state.deflection_rate[j] } else { state.joints.dq[j] }
    }

    /// Direction of the dry friction of joint `j` at the velocity `dq`, rad/s or m/s: that of its friction mode, or a smooth function of `dq` between
    /// -1 and 1 where friction is regularised.
    #[inline(always)]
    pub(super) fn sliding(
        &self,
        j: usize,
        dq: Lanes<T, C, W>,
        modes: &LatentModes<Lanes<T, C, W>, N>,
    ) -> Lanes<T, C, W> {
        match self.inverse_width[j] {
            Some(inverse_width) => tanh(dq * inverse_width),
            None => modes.direction[j],
        }
    }

    /// Coulomb level and torque of the effects of joint `j`, N m (N), at the direction `along` of its friction and the direction `other` of that of
    /// the joint after `j`; `memory` are the hysteresis states of the joint.
    #[inline(always)]
    pub(super) fn laws(
        &self,
        at: &JointInstant<Lanes<T, C, W>>,
        along: Lanes<T, C, W>,
        other: Lanes<T, C, W>,
        memory: Option<&Lanes<T, C, W>>,
        j: usize,
    ) -> [Lanes<T, C, W>; 2] {
        if !self.has_effects {
            return [self.lanes.rigid.coulomb[j], Lanes::of(T::zero())];
        }
        let along = if self.inverse_width[j].is_some() { sign(along) } else { along };
        self.lanes.laws(at, along, other, memory, j)
    }

    /// Hysteresis states of all joints after they have moved from the state `start` to the positions `q`, as [`Plant::memory`] has them.
    #[inline(never)]
    pub(super) fn memory_after(
        &self,
        start: &LatentLaneState<Lanes<T, C, W>, N>,
        q: &[Lanes<T, C, W>; N],
    ) -> [Lanes<T, C, W>; N] {
        let mut memory = start.memory;
        for l in 0..W {
            for effect in self.plant(l).effects().filter(|effect| effect.law.spec().hooks.memory) {
                let j = effect.joint;
                let distance = q[j].0[l] - start.joints.q[j].0[l];
                memory[j].0[l] = effect.law.hysteresis_after(&effect.p, memory[j].0[l], distance);
            }
        }
        memory
    }

    /// State `dt` seconds after `start`, with the velocities of the state `at` and the accelerations of `motion` held constant.
    #[inline(always)]
    fn moved(
        start: &LatentLaneState<Lanes<T, C, W>, N>,
        dt: Lanes<T, C, W>,
        at: &LatentLaneState<Lanes<T, C, W>, N>,
        motion: &StageMotion<Lanes<T, C, W>, N>,
    ) -> LatentLaneState<Lanes<T, C, W>, N> {
        let mut next = *start;
        for j in 0..N {
            next.joints.q[j] = dt.fused(at.joints.dq[j], start.joints.q[j]);
            next.joints.dq[j] = dt.fused(motion.ddq[j], start.joints.dq[j]);
            next.deflection[j] = dt.fused(at.deflection_rate[j], start.deflection[j]);
            next.deflection_rate[j] = dt.fused(motion.deflection_acceleration[j], start.deflection_rate[j]);
        }
        next
    }

    /// Largest stiction violation of the stuck joints at the time `t`, N m (N): > 0 in lanes where a joint breaks away.
    #[inline(always)]
    fn stiction_violation(
        &self,
        t: Lanes<T, C, W>,
        joints: &JointState<Lanes<T, C, W>, N>,
        bias: &[Lanes<T, C, W>; N],
        motion: &StageMotion<Lanes<T, C, W>, N>,
        modes: &LatentModes<Lanes<T, C, W>, N>,
    ) -> Lanes<T, C, W> {
        let (one, mut worst) = (Lanes::of(T::one()), -Lanes::of(T::one()));
        for j in (0..N).filter(|j| self.inverse_width[*j].is_none()) {
            let (rests, direction) = (motion.friction_at_rest[j], modes.direction[j]);
            worst = worst.larger(if self.lanes.hooks[j].coulomb {
                let (q, dq, tau) = (joints.q[j], joints.dq[j], motion.reaching[j]);
                let at = JointInstant { t, q, dq, tau, bias: bias[j] };
                self.lanes.stiction_violations(&at, rests, direction, j)
            } else {
                (rests.size() - self.lanes.rigid.coulomb[j]) * (one - direction * direction)
            });
        }
        worst
    }

    /// One classical Runge-Kutta step of all lanes from `start`.
    ///
    /// The stages are a loop, so that their motion is compiled once.
    #[inline(always)]
    pub(super) fn step(
        &self,
        start: &LatentLaneState<Lanes<T, C, W>, N>,
        kinematics: &KinematicState<Lanes<T, C, W>, N>,
        span: &LatentSpan<Lanes<T, C, W>, N>,
        modes: &LatentModes<Lanes<T, C, W>, N>,
    ) -> LatentStep<Lanes<T, C, W>, N> {
        let c = |x: f64| Lanes::<T, C, W>::of(lit(x));
        let zero = [c(0.0); N];
        let (mut at, mut there) = (*start, *kinematics);
        let mut sum = LatentLaneState {
            joints: JointState { q: zero, dq: zero },
            deflection: zero,
            deflection_rate: zero,
            memory: start.memory,
        };
        let (mut violation, mut far) = (-c(1.0), c(0.0));
        for stage in 0..4 {
            let t = span.t + span.h * c(STAGE_TIME[stage]);
            let motion = self.motion(t, &there, &at, &span.tau[stage.div_ceil(2)], modes);
            let weight = c(STAGE_WEIGHT[stage]);
            for j in 0..N {
                sum.joints.q[j] = weight.fused(at.joints.dq[j], sum.joints.q[j]);
                sum.joints.dq[j] = weight.fused(motion.ddq[j], sum.joints.dq[j]);
                sum.deflection[j] = weight.fused(at.deflection_rate[j], sum.deflection[j]);
                sum.deflection_rate[j] =
                    weight.fused(motion.deflection_acceleration[j], sum.deflection_rate[j]);
            }
            if stage == 0 {
                violation = violation.larger(self.contradictions(start, &motion, modes));
            }
            if stage.is_multiple_of(3) && self.has_backlash {
                violation = violation.larger(motion.flank_tension);
            }
            if stage.is_multiple_of(3) && modes.any_stuck {
                let bias = &there.equation_terms.bias;
                violation = violation.larger(self.stiction_violation(t, &at.joints, bias, &motion, modes));
            }
            if stage < 3 {
                at = Self::moved(start, span.h * c(STAGE_TIME[stage + 1]), &at, &motion);
                if self.has_hysteresis {
                    at.memory = self.memory_after(start, &at.joints.q);
                }
                let mut by = at.joints.q;
                for j in 0..N {
                    by[j] = by[j] - start.joints.q[j];
                }
                let (rotations, angle) = self.lanes.rigid.rotations(&by, AngleRange::Near);
                far = angle.larger(far);
                there = self.lanes.rigid.rotated(&at.joints, rotated(&kinematics.sincos, &rotations));
            }
        }
        let (mut end, mut total) = (*start, c(-0.0));
        for j in 0..N {
            end.joints.q[j] = span.h.fused(sum.joints.q[j], start.joints.q[j]);
            end.joints.dq[j] = span.h.fused(sum.joints.dq[j], start.joints.dq[j]);
            if self.shafts[j].is_some() {
                end.deflection[j] = span.h.fused(sum.deflection[j], start.deflection[j]);
                end.deflection_rate[j] = span.h.fused(sum.deflection_rate[j], start.deflection_rate[j]);
            }
            total = total + end.joints.dq[j] + end.deflection_rate[j];
            if let Some(half_backlash) = self.shafts[j].as_ref().and_then(|shaft| shaft.half_backlash) {
                violation = violation.larger(end.deflection[j].size() - half_backlash);
            }
        }
        if self.has_hysteresis {
            end.memory = self.memory_after(start, &end.joints.q);
        }
        for j in (0..N).filter(|j| self.inverse_width[*j].is_none()) {
            let along = self.friction_velocity(j, &end) * modes.direction[j];
            violation = violation.larger(-(along * self.lanes.dry[j]));
        }
        let mut slowing = -c(1.0);
        for j in 0..N {
            if let Some(inverse_width) = self.inverse_width[j] {
                let ahead = self.friction_velocity(j, &end) * sign(self.friction_velocity(j, start));
                slowing = slowing.larger(c(SLIDING) - ahead * inverse_width);
            }
        }
        // NaN where the motion is not finite, else 0.
        let finite = total * c(0.0);
        let far = AngleRange::Near.part(far) - c(1.0);
        LatentStep { end, violation: violation.larger(far) + finite, slowing }
    }

    /// Number per lane, > 0 where a joint's velocity, or at rest its acceleration, contradicts the direction of its friction mode.
    #[inline(always)]
    fn contradictions(
        &self,
        state: &LatentLaneState<Lanes<T, C, W>, N>,
        motion: &StageMotion<Lanes<T, C, W>, N>,
        modes: &LatentModes<Lanes<T, C, W>, N>,
    ) -> Lanes<T, C, W> {
        let (one, mut worst) = (Lanes::of(T::one()), -Lanes::of(T::one()));
        for j in (0..N).filter(|j| self.inverse_width[*j].is_none()) {
            let direction = modes.direction[j];
            let slides = direction * direction;
            let mut acceleration = motion.ddq[j];
            if self.at_motor[j] {
                acceleration = acceleration + motion.deflection_acceleration[j];
            }
            let off = contradiction(self.friction_velocity(j, state), acceleration, direction, slides);
            // A wrong sliding direction has no effect on a joint without dry friction.
            worst = worst.larger(off * (one - slides * (one - self.lanes.dry[j])));
        }
        worst
    }
}

/// Times of the Runge-Kutta stages after the start of a step, as parts of its length.
const STAGE_TIME: [f64; 4] = [0.0, 0.5, 0.5, 1.0];

/// Weights of the Runge-Kutta stages.
const STAGE_WEIGHT: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// -1 in lanes with a negative number, else 1.
#[inline(always)]
fn sign<T: Real, C: Cpu, const W: usize>(x: Lanes<T, C, W>) -> Lanes<T, C, W> {
    let mut sign = x;
    for l in 0..W {
        sign.0[l] = if x.0[l] < T::zero() { -T::one() } else { T::one() };
    }
    sign
}
