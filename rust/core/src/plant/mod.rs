//! Arm with its effects and friction, solved for the accelerations, given the friction mode of each joint.
//!
//! Dry friction is a set of modes: a joint slides in one direction, with its Coulomb torque constant in sign, or it sticks, with
//! exactly zero velocity and the friction torque that keeps it at rest. [`Plant::acceleration`] is smooth while no mode changes;
//! [`crate::integrate`] decides when a mode changes.

mod acceleration;
mod dynamics;
mod laws;
mod rates;

pub(crate) use rates::SLIDING;
pub use rates::StepRates;

use crate::arm::Arm;
use crate::drivetrain::Drivetrain;
use crate::effect::{Active, Hooks};
use crate::kinematics::{JointState, KinematicState, RigidArm};
use crate::real::Real;
use crate::transmission::{LatentState, Sides};
use nalgebra::SVector;

/// Largest number of effects of one plant.
pub const MAX_EFFECTS: usize = 48;

/// Friction mode of a joint: what its dry friction does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The joint is at rest, held by friction.
    Stuck,
    /// The joint slides towards larger `q`.
    Forward,
    /// The joint slides towards smaller `q`.
    Backward,
}

impl Mode {
    /// Direction in which the joint slides, as a number: -1, 0 (stuck) or 1.
    #[inline]
    pub fn direction<T: Real>(self) -> T {
        match self {
            Self::Stuck => T::zero(),
            Self::Forward => T::one(),
            Self::Backward => -T::one(),
        }
    }

    /// Friction mode of a joint whose velocity has the sign of `direction`; stuck for zero.
    #[inline]
    pub fn of<T: Real>(direction: T) -> Self {
        if direction > T::zero() {
            Self::Forward
        } else if direction < T::zero() {
            Self::Backward
        } else {
            Self::Stuck
        }
    }
}

/// Joint accelerations, and the friction torque that each stuck joint needs to stay at rest.
#[derive(Debug, Clone, Copy)]
pub struct Accelerations<T, const N: usize> {
    /// Joint accelerations `ddq`, rad/s^2 (m/s^2); exactly zero for stuck joints.
    pub ddq: SVector<T, N>,
    /// Friction torque that keeps a stuck joint at rest, N m (N); zero for sliding joints.
    pub friction_at_rest: SVector<T, N>,
    /// Accelerations of the transmissions' deflections, rad/s^2 (m/s^2); zero for rigid joints.
    pub deflection_acceleration: SVector<T, N>,
    /// Friction torque of joints whose friction acts on the motor, N m (N); zero for others.
    pub motor_friction: SVector<T, N>,
}

/// Arm with parameter values, effects and a friction model.
#[derive(Clone)]
pub struct Plant<T: Real, A, const N: usize, const P: usize> {
    rigid: RigidArm<T, A, N, P>,
    drivetrain: Drivetrain<T, N>,
    rounding: [T; N],
    effects: [Option<Active<T>>; MAX_EFFECTS],
    n_effects: usize,
    hooks: [Hooks; N],
    has_hysteresis: bool,
    /// Whether friction depends on accelerations through the load that transmissions pass on.
    passes_load: bool,
    jumps: bool,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Plant<T, A, N, P> {
    /// Plant without effects and with exact Coulomb friction.
    pub fn new(arm: A, theta: [T; P]) -> Self {
        let (viscous, coulomb) = (arm.viscous(&theta).into(), arm.coulomb(&theta).into());
        let (constant_inertia, tilt) = (arm.constant_inertia(&theta), T::zero());
        Self {
            rigid: RigidArm { arm, theta, viscous, coulomb, constant_inertia, tilt },
            drivetrain: Drivetrain::none(),
            rounding: [T::zero(); N],
            effects: [None; MAX_EFFECTS],
            n_effects: 0,
            hooks: [Hooks::NONE; N],
            has_hysteresis: false,
            passes_load: false,
            jumps: false,
        }
    }

    /// Replaces `sgn(dq)` by `tanh(dq / width)` on every joint, width in rad/s (m/s); a width of zero keeps exact dry friction.
    pub fn with_smoothing(self, width: T) -> Self {
        self.with_rounding([width; N])
    }

    /// Replaces `sgn(dq)` of joint `j` by `tanh(dq / widths[j])`, widths in rad/s (m/s); a width of zero keeps exact dry friction on its joint.
    pub fn with_rounding(mut self, widths: [T; N]) -> Self {
        self.rounding = widths.map(|width| if width > T::zero() { width } else { T::zero() });
        self
    }

    /// Adds an effect; `None` beyond [`MAX_EFFECTS`], for a joint the arm does not have, or for a tilted base of an arm that does not move in one
    /// plane.
    pub fn with_effect(mut self, effect: Active<T>) -> Option<Self> {
        let tilt = effect.law.tilt(&effect.p);
        if tilt != T::zero() && !A::PLANAR {
            return None;
        }
        *self.effects.get_mut(self.n_effects)? = Some(effect);
        self.n_effects += 1;
        let hooks = effect.law.spec().hooks;
        let joint = effect.joint;
        let on_joint = self.hooks.get_mut(joint)?;
        on_joint.force |= hooks.force;
        on_joint.coulomb |= hooks.coulomb;
        self.has_hysteresis |= hooks.memory;
        self.passes_load |= hooks.load && A::ROTORS_APART;
        self.jumps |= effect.law.edge(&effect.p).is_some();
        let rigid = &mut self.rigid;
        let own = *rigid.arm.inertia(&rigid.theta, &SVector::zeros()).get((joint, joint))?;
        *rigid.constant_inertia.get_mut(joint)?.get_mut(joint)? += effect.law.inertia(&effect.p);
        if let Some(transmission) = effect.law.transmission(&effect.p, own) {
            self.drivetrain.add(joint, transmission, &mut rigid.constant_inertia)?;
        }
        rigid.tilt += tilt;
        self.add_coupling(effect.law.coupling(&effect.p));
        let rigid = &mut self.rigid;
        if let Some((mass, distance)) = effect.law.payload(&effect.p) {
            let delta = rigid.arm.payload(&rigid.theta, mass, distance);
            for (value, change) in rigid.theta.iter_mut().zip(delta) {
                *value += change;
            }
            let more = rigid.arm.constant_inertia(&delta);
            for (value, change) in rigid.constant_inertia.iter_mut().flatten().zip(more.iter().flatten()) {
                *value += *change;
            }
        }
        Some(self)
    }

    /// Sets whether encoder and friction of joint `j` sit on the link's or the motor's side; `None` for a joint that the arm does not have.
    pub fn with_sides(mut self, j: usize, sides: Sides) -> Option<Self> {
        self.drivetrain.set_sides(j, sides)?;
        Some(self)
    }

    /// Adds `inertia`, kg m^2, to `M_12` and `M_21`, between the first two joints.
    fn add_coupling(&mut self, inertia: T) {
        for (row, column) in [(0, 1), (1, 0)] {
            if let Some(entry) = self.rigid.constant_inertia.get_mut(row).and_then(|row| row.get_mut(column))
            {
                *entry += inertia;
            }
        }
    }

    /// Transmissions between motors and links.
    #[inline]
    pub fn drivetrain(&self) -> &Drivetrain<T, N> {
        &self.drivetrain
    }

    /// Whether any joint has a hysteresis state.
    #[inline]
    pub fn has_hysteresis(&self) -> bool {
        self.has_hysteresis
    }

    /// Whether the plant has states that no encoder measures: those of transmissions, or of hysteresis.
    #[inline]
    pub fn has_latent_states(&self) -> bool {
        self.drivetrain.any() || self.has_hysteresis
    }

    /// Hysteresis states of the joints, N m (N), after they have moved to the positions `q` from the positions `latent.anchor`.
    #[inline]
    pub fn memory(&self, q: &SVector<T, N>, latent: &LatentState<T, N>) -> SVector<T, N> {
        let mut memory = latent.memory;
        if self.has_hysteresis {
            for effect in self.effects().filter(|e| e.law.spec().hooks.memory) {
                let j = effect.joint;
                if let (Some(z), Some(to), Some(from)) = (memory.get_mut(j), q.get(j), latent.anchor.get(j)) {
                    *z = effect.law.hysteresis_after(&effect.p, *z, *to - *from);
                }
            }
        }
        memory
    }

    /// Rigid arm of the plant, payloads and other inertial effects included.
    pub fn rigid(&self) -> &RigidArm<T, A, N, P> {
        &self.rigid
    }

    /// Values of the arm's parameters, payloads included, SI.
    pub fn theta(&self) -> &[T; P] {
        &self.rigid.theta
    }

    /// Whether nothing but friction modes can change during a step of this plant: exact friction, no latent states, and no torque that jumps at a
    /// position.
    #[inline]
    pub fn only_modes_change(&self) -> bool {
        self.is_plain() && !self.jumps
    }

    /// Whether friction is exact and does not depend on accelerations, and there are no latent states; torques may jump at a position.
    #[inline]
    pub fn is_plain(&self) -> bool {
        !(0..N).any(|j| self.is_rounded(j))
            && !self.drivetrain.any()
            && !self.has_hysteresis
            && !self.passes_load
    }

    /// Whether the plant has latent states or regularised friction, and friction does not depend on accelerations; torques may jump at a position.
    #[inline]
    pub fn is_latent_or_regularised(&self) -> bool {
        !self.is_plain() && !self.passes_load
    }

    /// Whether another plant differs in values alone: it has the same transmissions, sides, effects and joints with regularised friction.
    pub fn is_alike(&self, other: &Self) -> bool {
        let (one, two) = (&self.drivetrain, &other.drivetrain);
        let joint = |j: usize| {
            let backlash =
                |of: &Drivetrain<T, N>| of.get(j).map(|transmission| transmission.backlash > T::zero());
            backlash(one) == backlash(two)
                && one.sides(j) == two.sides(j)
                && self.is_rounded(j) == other.is_rounded(j)
        };
        let same = |(a, b): (&Active<T>, &Active<T>)| {
            a.joint == b.joint && core::ptr::eq(a.law.spec(), b.law.spec())
        };
        self.n_effects == other.n_effects
            && self.effects().zip(other.effects()).all(same)
            && (0..N).all(joint)
    }

    /// Hooks of the effects on joint `j`: whether they add a torque, and whether they change its Coulomb level.
    #[inline]
    pub(crate) fn hooks(&self, j: usize) -> Hooks {
        self.hooks[j]
    }

    /// Effects of the plant with their values.
    pub(crate) fn effects(&self) -> impl Iterator<Item = &Active<T>> {
        self.effects.iter().take(self.n_effects).flatten()
    }

    /// Whether joint `j` has dry friction, or effects that may depend on the direction in which it slides.
    #[inline]
    pub fn is_dry(&self, j: usize) -> bool {
        self.rigid.coulomb[j] > T::zero() || self.hooks.iter().any(|on| on.force || on.coulomb)
    }

    /// 1 if joint `j` has dry friction, 0 if not.
    #[inline]
    pub(crate) fn dry(&self, j: usize) -> T {
        if self.is_dry(j) { T::one() } else { T::zero() }
    }

    /// Width of the smooth sign `tanh(dq / width)` in the dry friction of joint `j`, rad/s (m/s); zero for exact dry friction.
    #[inline]
    pub fn rounding(&self, j: usize) -> T {
        self.rounding[j]
    }

    /// Whether the sign in the dry friction of joint `j` is replaced by a smooth function.
    #[inline]
    pub fn is_rounded(&self, j: usize) -> bool {
        self.rounding[j] > T::zero()
    }

    /// Whether all parameter values of the arm are finite.
    pub fn is_finite(&self) -> bool {
        self.rigid.theta.iter().all(nalgebra::ComplexField::is_finite)
    }

    /// Equation of motion solved for `ddq` under the motor torques `tau`, N m (N), with stuck joints held at rest.
    #[inline]
    pub fn acceleration(
        &self,
        t: T,
        kinematics: &KinematicState<T, N>,
        tau: &SVector<T, N>,
        modes: &[Mode; N],
        latent: &LatentState<T, N>,
    ) -> Accelerations<T, N> {
        if !self.drivetrain.any() {
            return self.undriven(t, kinematics, tau, modes, latent);
        }
        let mut closed = *kinematics;
        self.drivetrain.add_closed_rotors(&mut closed.equation_terms.inertia, latent);
        if !self.drivetrain.brakes_motors() {
            let reaching = self.drivetrain.torque_at_joints(tau, latent);
            let mut motion = self.undriven(t, &closed, &reaching, modes, latent);
            motion.deflection_acceleration =
                self.drivetrain.deflection_accelerations(tau, &motion.ddq, latent);
            return motion;
        }
        let braked = self.motor_friction(t, kinematics, tau, modes, latent);
        let tau = tau - braked;
        let mut motion =
            self.undriven(t, &closed, &self.drivetrain.torque_at_joints(&tau, latent), modes, latent);
        motion.deflection_acceleration = self.drivetrain.deflection_accelerations(&tau, &motion.ddq, latent);
        let stuck = self.stuck(modes);
        for j in 0..N {
            if !self.drivetrain.sides(j).friction_at_motor {
                continue;
            }
            if self.drivetrain.brakes_motor(j, latent) {
                motion.motor_friction[j] = braked[j];
                if stuck[j] {
                    motion.friction_at_rest[j] = braked[j];
                    motion.deflection_acceleration[j] = -motion.ddq[j];
                }
            } else if stuck[j] {
                motion.motor_friction[j] = motion.friction_at_rest[j];
            } else {
                let JointState { q, dq } = kinematics.joints;
                let load = self.rigid.loads(&kinematics.equation_terms, &motion.ddq.into())[j];
                let (dq, x) = (dq[j], self.point(j, t, q[j], dq[j], tau[j], load));
                motion.motor_friction[j] = self.rigid.viscous[j] * dq + self.dry_friction(j, &x, modes[j]);
            }
        }
        motion
    }

    /// Friction torques on motors that move against their links, N m (N); on a stuck motor, the motor torque less the torque transmitted to the link.
    #[inline]
    fn motor_friction(
        &self,
        t: T,
        kinematics: &KinematicState<T, N>,
        tau: &SVector<T, N>,
        modes: &[Mode; N],
        latent: &LatentState<T, N>,
    ) -> SVector<T, N> {
        let mut braked = SVector::zeros();
        let stuck = self.stuck(modes);
        for j in 0..N {
            if !self.drivetrain.brakes_motor(j, latent) {
                continue;
            }
            if stuck[j] {
                braked[j] = tau[j] - self.drivetrain.transmitted(j, latent);
                continue;
            }
            let JointState { q, dq } = &kinematics.joints;
            let velocity = dq[j] + latent.deflection_rate[j];
            let at = q[j] + latent.deflection[j];
            let load = if A::ROTORS_APART {
                self.drivetrain.transmitted(j, latent)
            } else {
                kinematics.equation_terms.bias[j]
            };
            let x = self.point(j, t, at, velocity, tau[j], load);
            braked[j] = self.rigid.viscous[j] * velocity + self.dry_friction(j, &x, modes[j]);
        }
        braked
    }

    /// Velocity on which the dry friction of joint `j` acts, rad/s or m/s: that of the joint, or of its motor where friction acts on the motor.
    #[inline]
    pub(crate) fn friction_velocity(&self, j: usize, dq: &SVector<T, N>, latent: &LatentState<T, N>) -> T {
        self.drivetrain.friction_velocity(j, dq[j], latent)
    }

    /// Derivative of the velocity on which the dry friction of joint `j` acts, rad/s^2 or m/s^2: of the joint, or of its motor where friction acts
    /// there.
    #[inline]
    pub(crate) fn friction_acceleration(
        &self,
        j: usize,
        motion: &Accelerations<T, N>,
        latent: &LatentState<T, N>,
    ) -> T {
        if self.drivetrain.brakes_motor(j, latent) {
            motion.ddq[j] + motion.deflection_acceleration[j]
        } else {
            motion.ddq[j]
        }
    }

    /// Whether each joint is held at rest by exact dry friction.
    #[inline]
    pub(super) fn stuck(&self, modes: &[Mode; N]) -> [bool; N] {
        core::array::from_fn(|j| !self.is_rounded(j) && modes[j] == Mode::Stuck)
    }

    /// Stiction violation of joint `j` at rest, N m (N): friction torque at rest less the Coulomb level, positive where the joint breaks away; and
    /// the direction, -1 or 1, in which the joint would slide.
    #[inline]
    pub fn stiction_violation(&self, j: usize, t: T, q: T, tau: T, friction_at_rest: T) -> (T, T) {
        let direction = if friction_at_rest < T::zero() { -T::one() } else { T::one() };
        // At rest the load of a joint is its friction torque at rest less the motor torque.
        let x = self.point(j, t, q, T::zero(), tau, friction_at_rest - tau);
        (friction_at_rest.abs() - self.level(j, &x, direction), direction)
    }
}
