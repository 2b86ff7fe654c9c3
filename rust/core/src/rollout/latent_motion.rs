//! Accelerations of plants with latent states or regularised friction, side by side.
//!
//! The equations are those of [`Plant::acceleration`](crate::plant::Plant::acceleration), with one plant in each lane. Factors of zero take the rotor of
//! an open backlash out of the arm's inertia, and the motor torque of a closed one out of the rotor's motion.

use super::latent_lanes::{LatentLaneState, LatentLanes, LatentModes};
use super::plant_lanes::JointInstant;
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::kinematics::{JointState, KinematicState};
use crate::lanes::Lanes;
use crate::linear::solve_positive_definite;
use crate::number::Number;
use crate::real::Real;

/// Motion at one Runge-Kutta stage.
#[derive(Clone, Copy)]
pub(super) struct StageMotion<V, const N: usize> {
    /// Joint accelerations, rad/s^2 (m/s^2).
    pub(super) ddq: [V; N],
    /// Accelerations of the shafts' deflections, rad/s^2 (m/s^2).
    pub(super) deflection_acceleration: [V; N],
    /// Friction torque that keeps each stuck joint or motor at rest, N m (N); meaningless if none is stuck.
    pub(super) friction_at_rest: [V; N],
    /// Torque that reaches each joint through its shaft, or the motor's torque where friction acts on the motor, N m (N).
    pub(super) reaching: [V; N],
    /// Largest force by which the flank of a closed backlash would have to pull, N m (N); positive where a backlash opens.
    pub(super) flank_tension: V,
}

/// Torques of the motors, less the friction that acts on them.
#[derive(Clone, Copy)]
struct MotorTorques<V, const N: usize> {
    /// Torque that each shaft passes on to its link, N m (N).
    transmitted: [V; N],
    /// Friction torque on each motor that moves against its link, N m (N).
    braked: [V; N],
    /// Motor torque less the friction on the motor, N m (N).
    left: [V; N],
}

/// Where the friction of each joint acts, and how, in every lane.
#[derive(Clone, Copy)]
struct Sliding<V, const N: usize> {
    /// 1 where the joint, or the motor that carries its friction, slides, 0 where it is stuck.
    slides: [V; N],
    /// Direction of the joint's dry friction at the velocity of the joint.
    along: [V; N],
    /// 1 where the joint's backlash is closed, 0 elsewhere.
    closed: [V; N],
}

impl<T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const N: usize, const P: usize>
    LatentLanes<'_, T, C, A, W, N, P>
{
    /// Motor torques less the friction that acts on motors, at the time `t` under the torques `tau`; behind closed backlash friction acts on the joint.
    #[inline(always)]
    fn motor_torques(
        &self,
        t: Lanes<T, C, W>,
        bias: &[Lanes<T, C, W>; N],
        state: &LatentLaneState<Lanes<T, C, W>, N>,
        tau: &[Lanes<T, C, W>; N],
        modes: &LatentModes<Lanes<T, C, W>, N>,
        sliding: &Sliding<Lanes<T, C, W>, N>,
    ) -> MotorTorques<Lanes<T, C, W>, N> {
        let (zero, one) = (Lanes::of(T::zero()), Lanes::of(T::one()));
        let JointState { q, .. } = &state.joints;
        let mut torques = MotorTorques { transmitted: [zero; N], braked: [zero; N], left: *tau };
        for j in 0..N {
            if let Some(shaft) = &self.shafts[j] {
                torques.transmitted[j] =
                    shaft.stiffness.fused(state.deflection[j], shaft.damping * state.deflection_rate[j]);
            }
            if !self.at_motor[j] {
                continue;
            }
            let velocity = self.friction_velocity(j, state);
            let along = self.sliding(j, velocity, modes);
            let at =
                JointInstant { t, q: q[j] + state.deflection[j], dq: velocity, tau: tau[j], bias: bias[j] };
            let [level, _] = self.laws(&at, along, zero, None, j);
            let moving = self.lanes.rigid.viscous[j].fused(velocity, level * along);
            let slides = sliding.slides[j];
            torques.braked[j] = slides.fused(moving, (one - slides) * (tau[j] - torques.transmitted[j]));
            if self.has_backlash {
                torques.braked[j] = torques.braked[j] * (one - sliding.closed[j]);
            }
            torques.left[j] = tau[j] - torques.braked[j];
        }
        torques
    }

    /// Motor torque less friction that does not reach the link of joint `j` but accelerates its rotor, N m (N).
    #[inline(always)]
    fn retained(
        &self,
        j: usize,
        torques: &MotorTorques<Lanes<T, C, W>, N>,
        sliding: &Sliding<Lanes<T, C, W>, N>,
    ) -> Lanes<T, C, W> {
        let retained = torques.left[j] - torques.transmitted[j];
        if self.has_backlash { retained * (Lanes::of(T::one()) - sliding.closed[j]) } else { retained }
    }

    /// Inertia matrix with the rotors that move with their links because their backlash is closed.
    #[inline(always)]
    fn with_closed_rotors(
        &self,
        inertia: &[[Lanes<T, C, W>; N]; N],
        sliding: &Sliding<Lanes<T, C, W>, N>,
    ) -> [[Lanes<T, C, W>; N]; N] {
        let mut inertia = *inertia;
        for j in 0..N {
            let Some(shaft) = self.shafts[j].as_ref().filter(|shaft| shaft.half_backlash.is_some()) else {
                continue;
            };
            let rotor = shaft.inertia * sliding.closed[j];
            for a in 0..N {
                for b in 0..N {
                    let part = rotor * shaft.rotor_jacobian[a];
                    inertia[a][b] = part.fused(shaft.rotor_jacobian[b], inertia[a][b]);
                }
            }
        }
        inertia
    }

    /// Sliding of all joints in the state `state`.
    #[inline(always)]
    fn slidings(
        &self,
        state: &LatentLaneState<Lanes<T, C, W>, N>,
        modes: &LatentModes<Lanes<T, C, W>, N>,
    ) -> Sliding<Lanes<T, C, W>, N> {
        let (zero, one) = (Lanes::of(T::zero()), Lanes::of(T::one()));
        let mut sliding = Sliding { slides: [one; N], along: [zero; N], closed: [zero; N] };
        for j in 0..N {
            sliding.slides[j] = modes.direction[j] * modes.direction[j];
            if self.has_backlash {
                sliding.closed[j] = modes.side[j] * modes.side[j];
            }
            if self.has_effects || self.has_backlash || !self.at_motor[j] {
                sliding.along[j] = self.sliding(j, state.joints.dq[j], modes);
            }
        }
        sliding
    }

    /// Motion of all lanes at the time `t` under the motor torques `tau`.
    #[inline(always)]
    pub(super) fn motion(
        &self,
        t: Lanes<T, C, W>,
        kinematics: &KinematicState<Lanes<T, C, W>, N>,
        state: &LatentLaneState<Lanes<T, C, W>, N>,
        tau: &[Lanes<T, C, W>; N],
        modes: &LatentModes<Lanes<T, C, W>, N>,
    ) -> StageMotion<Lanes<T, C, W>, N> {
        let (zero, one) = (Lanes::of(T::zero()), Lanes::of(T::one()));
        let JointState { q, dq } = state.joints;
        let bias = &kinematics.equation_terms.bias;
        let sliding = self.slidings(state, modes);
        let torques = self.motor_torques(t, bias, state, tau, modes, &sliding);
        let mut reaching = torques.left;
        for j in 0..N {
            let Some(shaft) = &self.shafts[j] else { continue };
            let retained = self.retained(j, &torques, &sliding);
            for k in 0..N {
                reaching[k] = (-shaft.rotor_jacobian[k]).fused(retained, reaching[k]);
            }
        }
        // Friction on links: that of motors too where their backlash is closed.
        let (mut force, mut held, mut friction) = (reaching, [one; N], [zero; N]);
        for j in 0..N {
            let at = JointInstant { t, q: q[j], dq: dq[j], tau: reaching[j], bias: bias[j] };
            let memory = self.has_hysteresis.then_some(&state.memory[j]);
            let [level, effects] = self.laws(&at, sliding.along[j], sliding.along[(j + 1) % N], memory, j);
            force[j] = reaching[j] - bias[j] + effects;
            if !self.at_motor[j] {
                force[j] = force[j] - self.lanes.rigid.viscous[j].fused(dq[j], level * sliding.along[j]);
                held[j] = sliding.slides[j];
            } else if self.has_backlash {
                let closed = sliding.closed[j];
                friction[j] = closed * self.lanes.rigid.viscous[j].fused(dq[j], level * sliding.along[j]);
                force[j] = force[j] - friction[j];
                held[j] = one - closed * (one - sliding.slides[j]);
            }
        }
        let whole = if self.has_backlash {
            self.with_closed_rotors(&kinematics.equation_terms.inertia, &sliding)
        } else {
            kinematics.equation_terms.inertia
        };
        let (mut inertia, mut right) = (whole, force);
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
        let mut motion = StageMotion {
            ddq,
            deflection_acceleration: self.deflection_accelerations(&ddq, &torques, modes, &sliding),
            friction_at_rest: force,
            reaching,
            flank_tension: -one,
        };
        if modes.any_stuck {
            for i in 0..N {
                for k in 0..N {
                    motion.friction_at_rest[i] = (-whole[i][k]).fused(ddq[k], motion.friction_at_rest[i]);
                }
                if !self.at_motor[i] {
                    continue;
                }
                let closed = sliding.closed[i];
                friction[i] =
                    (closed * (one - sliding.slides[i])).fused(motion.friction_at_rest[i], friction[i]);
                motion.friction_at_rest[i] = closed.fused(motion.friction_at_rest[i], torques.braked[i]);
                motion.reaching[i] = closed.fused(reaching[i] - tau[i], tau[i]);
            }
        }
        if self.has_backlash {
            motion.flank_tension = self.flank_tension(&ddq, tau, &friction, modes);
        }
        motion
    }

    /// Accelerations of the deflections, rad/s^2 (m/s^2), at the joint accelerations `ddq`.
    #[inline(always)]
    fn deflection_accelerations(
        &self,
        ddq: &[Lanes<T, C, W>; N],
        torques: &MotorTorques<Lanes<T, C, W>, N>,
        modes: &LatentModes<Lanes<T, C, W>, N>,
        sliding: &Sliding<Lanes<T, C, W>, N>,
    ) -> [Lanes<T, C, W>; N] {
        let one = Lanes::of(T::one());
        let mut accelerations = [Lanes::of(T::zero()); N];
        for j in 0..N {
            let Some(shaft) = &self.shafts[j] else { continue };
            let mut of_rotor = shaft.inverse_inertia * (torques.left[j] - torques.transmitted[j]);
            for k in 0..N {
                of_rotor = (-shaft.rotor_jacobian[k]).fused(ddq[k], of_rotor);
            }
            // A motor held by its friction does not move.
            accelerations[j] = if self.at_motor[j] && modes.any_stuck {
                sliding.slides[j].fused(of_rotor, (sliding.slides[j] - one) * ddq[j])
            } else {
                of_rotor
            };
            if self.has_backlash {
                accelerations[j] = accelerations[j] * (one - sliding.closed[j]);
            }
        }
        accelerations
    }

    /// Largest force by which the flank of a closed backlash would have to pull, N m (N), at the joint accelerations `ddq`, with the friction torques
    /// `friction` on motors behind closed backlash; -1 where no backlash is closed.
    #[inline(always)]
    fn flank_tension(
        &self,
        ddq: &[Lanes<T, C, W>; N],
        tau: &[Lanes<T, C, W>; N],
        friction: &[Lanes<T, C, W>; N],
        modes: &LatentModes<Lanes<T, C, W>, N>,
    ) -> Lanes<T, C, W> {
        let mut worst = -Lanes::of(T::one());
        for j in 0..N {
            let Some(shaft) = self.shafts[j].as_ref().filter(|shaft| shaft.half_backlash.is_some()) else {
                continue;
            };
            let mut pull = friction[j] - tau[j];
            for k in 0..N {
                pull = (shaft.inertia * shaft.rotor_jacobian[k]).fused(ddq[k], pull);
            }
            worst = worst.larger(pull * modes.side[j]);
        }
        worst
    }
}
