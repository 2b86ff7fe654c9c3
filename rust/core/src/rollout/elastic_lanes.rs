//! Dynamics of one plant with elastic joints, regularised friction, or both, in several runs side by side.
//!
//! The equations are those of [`Plant::acceleration`], with one run in each lane: the friction of a joint acts on its link or on its motor, is a
//! smooth function of velocity where it is regularised, and elsewhere has the direction of its friction mode throughout a step.

use super::plant_lanes::{JointInstant, PlantLanes};
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::fixed_mode::contradiction;
use crate::hyperbolic::tanh;
use crate::kinematics::{AngleRange, JointState, KinematicState, rotated};
use crate::lanes::Lanes;
use crate::linear::solve_positive_definite;
use crate::number::Number;
use crate::plant::{Plant, SLIDING};
use crate::real::{Real, lit};
use core::array::from_fn;

/// Joint states of several runs side by side, with the deflections of elastic joints.
#[derive(Debug, Clone, Copy)]
pub(super) struct ElasticState<V, const N: usize> {
    /// Positions and velocities of all joints.
    pub(super) joints: JointState<V, N>,
    /// Deflection of each joint's shaft, motor position less joint position, rad or m; zero for rigid joints.
    pub(super) deflection: [V; N],
    /// Rate of each deflection, rad/s or m/s.
    pub(super) deflection_rate: [V; N],
}

/// Friction modes of all joints during a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct ElasticModes<V, const N: usize> {
    /// Direction in which each joint, or the motor that carries its friction, slides: -1, 0 (stuck) or 1; 1 where friction is regularised.
    pub(super) direction: [V; N],
    /// Whether any joint is stuck in any lane.
    pub(super) any_stuck: bool,
}

/// Part of a sample interval in every lane, with the motor torques over it.
#[derive(Debug, Clone, Copy)]
pub(super) struct ElasticSpan<V, const N: usize> {
    /// Time at the start of the part, s.
    pub(super) t: V,
    /// Length of the part, s.
    pub(super) h: V,
    /// Motor torques at the start, the middle and the end of the part, N m (N).
    pub(super) tau: [[V; N]; 3],
}

/// State at the end of a step of all lanes, and whether the step contradicts its assumptions: fixed friction modes and a small change of angles.
pub(super) struct ElasticStep<V, const N: usize> {
    pub(super) end: ElasticState<V, N>,
    /// Positive or NaN where friction modes contradict the motion, or where the motion is not finite or turns the arm beyond the angle range of a
    /// step.
    pub(super) violation: V,
    /// Positive where a joint with regularised friction does not slide at the end of the step in the direction in which it moves at the start of the
    /// step.
    pub(super) slowing: V,
}

/// Shaft between motor and link of an elastic joint, the same in all lanes.
#[derive(Clone, Copy)]
struct Shaft<V, const N: usize> {
    stiffness: V,
    damping: V,
    /// 1 over the inertia of the rotor, 1/(kg m^2) (1/kg).
    inverse_inertia: V,
    /// Rotor velocity per velocity of each joint.
    rotor_jacobian: [V; N],
}

/// Motion at one Runge-Kutta stage.
#[derive(Clone, Copy)]
struct StageMotion<V, const N: usize> {
    /// Joint accelerations, rad/s^2 (m/s^2).
    ddq: [V; N],
    /// Accelerations of the shafts' deflections, rad/s^2 (m/s^2).
    deflection_acceleration: [V; N],
    /// Friction torque that keeps each stuck joint or motor at rest, N m (N); meaningless if none is stuck.
    friction_at_rest: [V; N],
    /// Torque that reaches each joint through its shaft, or the motor's torque where friction acts on the motor, N m (N).
    reaching: [V; N],
}

/// One plant with elastic joints or regularised friction, in `W` lanes.
pub(super) struct ElasticLanes<'a, T: Real, C, A, const W: usize, const N: usize, const P: usize> {
    lanes: PlantLanes<'a, T, C, A, W, N, P>,
    shafts: [Option<Shaft<Lanes<T, C, W>, N>>; N],
    /// Whether friction of each joint acts on its motor, which moves against its link.
    at_motor: [bool; N],
    /// 1 over the width over which friction of each joint is regularised, s/rad (s/m); `None` for exact dry friction.
    inverse_width: [Option<Lanes<T, C, W>>; N],
    /// Whether each joint has dry friction, or effects that may depend on the direction in which it slides.
    is_dry: [bool; N],
    has_effects: bool,
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const N: usize, const P: usize>
    ElasticLanes<'a, T, C, A, W, N, P>
{
    pub(super) fn new(plant: &'a Plant<T, A, N, P>) -> Self {
        let lanes = PlantLanes::new(plant);
        let shaft = |j: usize| {
            plant.drivetrain().get(j).map(|transmission| Shaft {
                stiffness: Lanes::of(transmission.stiffness),
                damping: Lanes::of(transmission.damping),
                inverse_inertia: Lanes::of(T::one() / transmission.inertia),
                rotor_jacobian: transmission.rotor_jacobian(j).map(Lanes::of),
            })
        };
        let inverse_width = |j: usize| plant.is_rounded(j).then(|| Lanes::of(T::one() / plant.rounding(j)));
        Self {
            shafts: from_fn(shaft),
            at_motor: from_fn(|j| plant.drivetrain().sides(j).friction_at_motor),
            inverse_width: from_fn(inverse_width),
            is_dry: from_fn(|j| plant.is_dry(j)),
            has_effects: lanes.has_effects(),
            lanes,
        }
    }

    /// Plant of all lanes.
    #[inline(always)]
    pub(super) fn plant(&self) -> &'a Plant<T, A, N, P> {
        self.lanes.plants[0]
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
    fn friction_velocity(&self, j: usize, state: &ElasticState<Lanes<T, C, W>, N>) -> Lanes<T, C, W> {
        if self.at_motor[j] { state.joints.dq[j] + state.deflection_rate[j] } else { state.joints.dq[j] }
    }

    /// Direction of the dry friction of joint `j` at the velocity `dq`, rad/s or m/s: that of its friction mode, or a smooth function of `dq` between
    /// -1 and 1 where friction is regularised.
    #[inline(always)]
    fn sliding(
        &self,
        j: usize,
        dq: Lanes<T, C, W>,
        modes: &ElasticModes<Lanes<T, C, W>, N>,
    ) -> Lanes<T, C, W> {
        match self.inverse_width[j] {
            Some(inverse_width) => tanh(dq * inverse_width),
            None => modes.direction[j],
        }
    }

    /// Coulomb level and torque of the effects of joint `j`, N m (N), at the direction `along` of its friction and the direction `other` of that of
    /// the joint after `j`.
    #[inline(always)]
    fn laws(
        &self,
        at: &JointInstant<Lanes<T, C, W>>,
        along: Lanes<T, C, W>,
        other: Lanes<T, C, W>,
        j: usize,
    ) -> [Lanes<T, C, W>; 2] {
        if !self.has_effects {
            return [self.lanes.rigid.coulomb[j], Lanes::of(T::zero())];
        }
        let along = if self.inverse_width[j].is_some() { sign(along) } else { along };
        self.lanes.laws(at, along, other, j)
    }

    /// Motion of all lanes at the time `t` under the motor torques `tau`.
    #[inline(always)]
    fn motion(
        &self,
        t: Lanes<T, C, W>,
        kinematics: &KinematicState<Lanes<T, C, W>, N>,
        state: &ElasticState<Lanes<T, C, W>, N>,
        tau: &[Lanes<T, C, W>; N],
        modes: &ElasticModes<Lanes<T, C, W>, N>,
    ) -> StageMotion<Lanes<T, C, W>, N> {
        let (zero, one) = (Lanes::of(T::zero()), Lanes::of(T::one()));
        let JointState { q, dq } = state.joints;
        let bias = &kinematics.equation_terms.bias;
        let viscous = &self.lanes.rigid.viscous;
        let (mut slides, mut sliding, mut transmitted) = ([one; N], [zero; N], [zero; N]);
        for j in 0..N {
            slides[j] = modes.direction[j] * modes.direction[j];
            if self.has_effects || !self.at_motor[j] {
                sliding[j] = self.sliding(j, dq[j], modes);
            }
            if let Some(shaft) = &self.shafts[j] {
                transmitted[j] =
                    shaft.stiffness.fused(state.deflection[j], shaft.damping * state.deflection_rate[j]);
            }
        }
        // Friction that acts on a motor is subtracted from the motor's torque.
        let (mut braked, mut left) = ([zero; N], *tau);
        for j in 0..N {
            if !self.at_motor[j] {
                continue;
            }
            let velocity = self.friction_velocity(j, state);
            let along = self.sliding(j, velocity, modes);
            let at =
                JointInstant { t, q: q[j] + state.deflection[j], dq: velocity, tau: tau[j], bias: bias[j] };
            let [level, _] = self.laws(&at, along, zero, j);
            let moving = viscous[j].fused(velocity, level * along);
            braked[j] = slides[j].fused(moving, (one - slides[j]) * (tau[j] - transmitted[j]));
            left[j] = tau[j] - braked[j];
        }
        let mut reaching = left;
        for j in 0..N {
            let Some(shaft) = &self.shafts[j] else { continue };
            let retained = left[j] - transmitted[j];
            for k in 0..N {
                reaching[k] = (-shaft.rotor_jacobian[k]).fused(retained, reaching[k]);
            }
        }
        let (mut force, mut held) = (reaching, [one; N]);
        for j in 0..N {
            let at = JointInstant { t, q: q[j], dq: dq[j], tau: reaching[j], bias: bias[j] };
            let [level, effects] = self.laws(&at, sliding[j], sliding[(j + 1) % N], j);
            force[j] = reaching[j] - bias[j] + effects;
            if !self.at_motor[j] {
                force[j] = force[j] - viscous[j].fused(dq[j], level * sliding[j]);
                held[j] = slides[j];
            }
        }
        let (mut inertia, mut right) = (kinematics.equation_terms.inertia, force);
        if modes.any_stuck {
            for i in 0..N {
                right[i] = right[i] * held[i];
                for j in 0..i {
                    let kept = inertia[i][j] * (held[i] * held[j]);
                    (inertia[i][j], inertia[j][i]) = (kept, kept);
                }
            }
        }
        let ddq = solve_positive_definite(inertia, right);
        let mut deflection_acceleration = [zero; N];
        for j in 0..N {
            let Some(shaft) = &self.shafts[j] else { continue };
            let mut of_rotor = shaft.inverse_inertia * (left[j] - transmitted[j]);
            for k in 0..N {
                of_rotor = (-shaft.rotor_jacobian[k]).fused(ddq[k], of_rotor);
            }
            // A motor held by its friction does not move.
            deflection_acceleration[j] = if self.at_motor[j] && modes.any_stuck {
                slides[j].fused(of_rotor, (slides[j] - one) * ddq[j])
            } else {
                of_rotor
            };
        }
        let mut friction_at_rest = force;
        if modes.any_stuck {
            for i in 0..N {
                for k in 0..N {
                    friction_at_rest[i] =
                        (-kinematics.equation_terms.inertia[i][k]).fused(ddq[k], friction_at_rest[i]);
                }
                if self.at_motor[i] {
                    (friction_at_rest[i], reaching[i]) = (braked[i], tau[i]);
                }
            }
        }
        StageMotion { ddq, deflection_acceleration, friction_at_rest, reaching }
    }

    /// State `dt` seconds after `start`, with the velocities of the state `at` and the accelerations of `motion` held constant.
    #[inline(always)]
    fn moved(
        start: &ElasticState<Lanes<T, C, W>, N>,
        dt: Lanes<T, C, W>,
        at: &ElasticState<Lanes<T, C, W>, N>,
        motion: &StageMotion<Lanes<T, C, W>, N>,
    ) -> ElasticState<Lanes<T, C, W>, N> {
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
        modes: &ElasticModes<Lanes<T, C, W>, N>,
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
        start: &ElasticState<Lanes<T, C, W>, N>,
        kinematics: &KinematicState<Lanes<T, C, W>, N>,
        span: &ElasticSpan<Lanes<T, C, W>, N>,
        modes: &ElasticModes<Lanes<T, C, W>, N>,
    ) -> ElasticStep<Lanes<T, C, W>, N> {
        let c = |x: f64| Lanes::<T, C, W>::of(lit(x));
        let zero = [c(0.0); N];
        let (mut at, mut there) = (*start, *kinematics);
        let mut sum = ElasticState {
            joints: JointState { q: zero, dq: zero },
            deflection: zero,
            deflection_rate: zero,
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
            if stage.is_multiple_of(3) && modes.any_stuck {
                let bias = &there.equation_terms.bias;
                violation = violation.larger(self.stiction_violation(t, &at.joints, bias, &motion, modes));
            }
            if stage < 3 {
                at = Self::moved(start, span.h * c(STAGE_TIME[stage + 1]), &at, &motion);
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
        }
        for j in (0..N).filter(|j| self.is_dry[*j] && self.inverse_width[*j].is_none()) {
            violation = violation.larger(-(self.friction_velocity(j, &end) * modes.direction[j]));
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
        ElasticStep { end, violation: violation.larger(far) + finite, slowing }
    }

    /// Number per lane, > 0 where a joint's velocity, or at rest its acceleration, contradicts the direction of its friction mode.
    #[inline(always)]
    fn contradictions(
        &self,
        state: &ElasticState<Lanes<T, C, W>, N>,
        motion: &StageMotion<Lanes<T, C, W>, N>,
        modes: &ElasticModes<Lanes<T, C, W>, N>,
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
            worst = worst.larger(if self.is_dry[j] { off } else { off * (one - slides) });
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
