//! The library of unmodelled effects, one file each.
//!
//! An effect is what a real arm does and the rigid model of [`crate::arm`] leaves out. It acts through one or more
//! hooks of [`Effect`], all of which default to "nothing": on the command before it becomes torque, as a torque at the
//! joint, on the Coulomb level, on the inertia, on `theta`, on the direction of gravity, or on the measured position.
//! Adding an effect is one file here and one line in [`catalogue`].

mod actuator_delay;
mod actuator_lag;
mod backlash;
mod base_tilt;
mod contact;
mod coulomb_asymmetry;
mod cross_friction;
mod cubic_drag;
mod encoder_eccentricity;
mod encoder_offset;
mod external_pulse;
mod friction_warmup;
mod gear_efficiency;
mod hardening_spring;
mod joint_elasticity;
mod joint_spring;
mod load_dependent_friction;
mod payload;
mod position_dependent_friction;
mod presliding;
mod quadratic_drag;
mod rotor_coupling;
mod rotor_inertia;
mod stribeck;
mod torque_dead_zone;
mod torque_gain;
mod torque_offset;
mod torque_ripple;
mod torque_saturation;
mod viscous_asymmetry;

mod input_segment;
mod parameter;

pub use input_segment::{InputSegment, interval};
pub use parameter::{EffectParameter, NEVER, Quantity};

use crate::real::Real;
use crate::transmission::Transmission;

/// Most parameters an effect may have.
pub const MAX_PARAMETERS: usize = 3;

/// Every effect, in the order of the documentation.
pub fn catalogue<T: Real>() -> &'static [&'static dyn Effect<T>] {
    &[
        &coulomb_asymmetry::CoulombAsymmetry,
        &torque_offset::TorqueOffset,
        &stribeck::Stribeck,
        &quadratic_drag::QuadraticDrag,
        &cubic_drag::CubicDrag,
        &load_dependent_friction::LoadDependentFriction,
        &position_dependent_friction::PositionDependentFriction,
        &friction_warmup::FrictionWarmup,
        &presliding::Presliding,
        &viscous_asymmetry::ViscousAsymmetry,
        &cross_friction::CrossFriction,
        &gear_efficiency::GearEfficiency,
        &joint_elasticity::JointElasticity,
        &backlash::Backlash,
        &torque_gain::TorqueGain,
        &actuator_lag::ActuatorLag,
        &actuator_delay::ActuatorDelay,
        &torque_saturation::TorqueSaturation,
        &torque_ripple::TorqueRipple,
        &torque_dead_zone::TorqueDeadZone,
        &payload::Payload,
        &base_tilt::BaseTilt,
        &joint_spring::JointSpring,
        &hardening_spring::HardeningSpring,
        &rotor_inertia::RotorInertia,
        &rotor_coupling::RotorCoupling,
        &encoder_offset::EncoderOffset,
        &encoder_eccentricity::EncoderEccentricity,
        &contact::Contact,
        &external_pulse::ExternalPulse,
    ]
}

/// The effect with this name.
pub fn find<T: Real>(name: &str) -> Option<&'static dyn Effect<T>> {
    catalogue::<T>().iter().copied().find(|effect| effect.spec().name == name)
}

/// Where an effect can sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// On one joint.
    Joint,
    /// On the arm as a whole.
    Arm,
}

/// Which hooks an effect uses, so that the integrator calls no other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[expect(clippy::struct_excessive_bools, reason = "one flag per hook")]
pub struct Hooks {
    /// [`Effect::force`].
    pub force: bool,
    /// [`Effect::coulomb`].
    pub coulomb: bool,
    /// [`Effect::command`].
    pub command: bool,
    /// [`Effect::measured`].
    pub measured: bool,
    /// [`Effect::hysteresis_after`].
    pub memory: bool,
}

impl Hooks {
    /// No hook that is called during a step: the effect changes the arm itself.
    pub const NONE: Self =
        Self { force: false, coulomb: false, command: false, measured: false, memory: false };
    /// A torque at the joint.
    pub const FORCE: Self = Self { force: true, ..Self::NONE };
    /// A part of the Coulomb level.
    pub const COULOMB: Self = Self { coulomb: true, ..Self::NONE };
    /// A change of the command.
    pub const COMMAND: Self = Self { command: true, ..Self::NONE };
    /// A change of the measured position.
    pub const MEASURED: Self = Self { measured: true, ..Self::NONE };
}

/// What an effect is: the part that does not depend on the scalar type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spec {
    /// Name in results and on the command line.
    pub name: &'static str,
    /// Name for people.
    pub title: &'static str,
    /// Equation, in the notation of `docs/notation.md`.
    pub equation: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// What a log must contain for it to leave a trace.
    pub excited_by: &'static str,
    /// One joint or the whole arm.
    pub scope: Scope,
    /// Fewest joints of an arm that it can sit on.
    pub least_joints: usize,
    /// Its parameters; the first one switches it off at its neutral value.
    pub parameters: &'static [EffectParameter],
    /// Initial guesses, in units of the log's own scale of each quantity (see the fit's `scale`).
    pub initial_guesses: &'static [[f64; MAX_PARAMETERS]],
    /// How it is tested before it is fitted.
    pub trial: Trial,
    /// Hooks in use.
    pub hooks: Hooks,
}

impl Spec {
    /// What most effects share: they sit on one joint of any arm and are tested by their first parameter.
    const OF_JOINT: Self = Self {
        name: "",
        title: "",
        equation: "",
        source: "",
        excited_by: "",
        scope: Scope::Joint,
        least_joints: 1,
        parameters: &[],
        initial_guesses: &[],
        trial: Trial::Amplitudes(1),
        hooks: Hooks::NONE,
    };
}

/// How an effect is tested to first order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trial {
    /// By the derivative at neutral; so many of its first parameters are amplitudes that all vanish there.
    Amplitudes(usize),
    /// By the derivative at neutral along a ray on which all parameters grow together.
    Ray,
    /// Not at all: an external disturbance belongs to one log and is looked for there.
    Disturbance,
    /// By the whole difference it makes at a trial value: a threshold has no derivative where it is never reached.
    Whole,
}

/// A joint at one instant, as a torque law sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointPoint<T> {
    /// Time since the start of the log, s.
    pub t: T,
    /// Position.
    pub q: T,
    /// Velocity.
    pub dq: T,
    /// Torque of the actuator.
    pub tau: T,
    /// Torque that gravity and the motion of the other links put on the joint, `C dq + g`.
    pub load: T,
    /// Nominal friction `b |dq| + fc` at this speed.
    pub friction: T,
    /// Direction in which the next joint (after the last, the first) slides: -1, 0 or 1.
    pub other: T,
    /// Hysteresis state of the joint (see [`Effect::hysteresis_after`]).
    pub memory: T,
}

/// A position at which a joint's torque jumps, and the contact beyond it, on the side away from zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge<T> {
    /// Position.
    pub position: T,
    /// Stiffness beyond.
    pub stiffness: T,
    /// Damping beyond.
    pub damping: T,
}

impl<T: Real> Edge<T> {
    /// Whether `q` lies beyond.
    #[inline]
    pub fn is_behind(&self, q: T) -> bool {
        (q - self.position) * self.position > T::zero()
    }

    /// Fastest rate, 1/s, of an inertia in contact with it.
    pub fn rate(&self, inertia: T) -> T {
        (self.stiffness / inertia).sqrt().max(self.damping / inertia)
    }
}

/// One unmodelled effect: a law with up to [`MAX_PARAMETERS`] parameters `p`.
pub trait Effect<T: Real>: Sync {
    /// Name, parameters, hooks.
    fn spec(&self) -> &'static Spec;

    /// Name of the law that is left when the first parameter vanishes; it has the other parameters under the same names.
    fn simpler(&self) -> Option<&'static str> {
        None
    }

    /// Torque added to the actuator's side of the joint's equation.
    fn force(&self, _p: &[T; MAX_PARAMETERS], _x: &JointPoint<T>) -> T {
        T::zero()
    }

    /// Where [`Effect::force`] jumps, if it does; a step is cut there.
    fn edge(&self, _p: &[T; MAX_PARAMETERS]) -> Option<Edge<T>> {
        None
    }

    /// Addition to the Coulomb level while the joint slides, or is about to slide, in `direction` (+1 or -1).
    fn coulomb(&self, _p: &[T; MAX_PARAMETERS], _x: &JointPoint<T>, _direction: T) -> T {
        T::zero()
    }

    /// Adds [`Effect::force`] at many points to `sums`, in one call.
    fn add_forces(&self, p: &[T; MAX_PARAMETERS], points: &[JointPoint<T>], sums: &mut [T]) {
        for (sum, x) in sums.iter_mut().zip(points) {
            *sum += self.force(p, x);
        }
    }

    /// Adds [`Effect::coulomb`] at many points to `levels`, in one call.
    fn add_coulombs(
        &self,
        p: &[T; MAX_PARAMETERS],
        points: &[JointPoint<T>],
        directions: &[T],
        levels: &mut [T],
    ) {
        for ((level, x), direction) in levels.iter_mut().zip(points).zip(directions) {
            *level += self.coulomb(p, x, *direction);
        }
    }

    /// Inertia added to the joint's own acceleration only.
    fn inertia(&self, _p: &[T; MAX_PARAMETERS]) -> T {
        T::zero()
    }

    /// Mass and distance along the last link of an added point mass.
    fn payload(&self, _p: &[T; MAX_PARAMETERS]) -> Option<(T, T)> {
        None
    }

    /// Angle by which the base is turned against gravity.
    fn tilt(&self, _p: &[T; MAX_PARAMETERS]) -> T {
        T::zero()
    }

    /// Hysteresis state after moving by `distance` from a position where it was `memory`.
    fn hysteresis_after(&self, _p: &[T; MAX_PARAMETERS], memory: T, _distance: T) -> T {
        memory
    }

    /// Whether it puts a transmission between motor and link.
    fn has_transmission(&self) -> bool {
        false
    }

    /// Transmission of a joint whose own inertia at `q = 0` is `inertia`; none for a rigid joint.
    fn transmission(&self, _p: &[T; MAX_PARAMETERS], _inertia: T) -> Option<Transmission<T>> {
        None
    }

    /// Inertia added to `M_12`, between the first two joints.
    fn coupling(&self, _p: &[T; MAX_PARAMETERS]) -> T {
        T::zero()
    }

    /// Rewrites a whole log's command of one joint, sample times `t`, into the torque that reaches the joint.
    fn command(&self, _p: &[T; MAX_PARAMETERS], _t: &[T], _torque: &mut [InputSegment<T>]) {}

    /// Position the encoder shows when the joint stands at `q`.
    fn measured(&self, _p: &[T; MAX_PARAMETERS], q: T) -> T {
        q
    }
}

/// An effect on a joint of an arm, with its parameters' values.
#[derive(Clone, Copy)]
pub struct Active<T: Real> {
    /// The law.
    pub law: &'static dyn Effect<T>,
    /// 0-based joint; ignored by effects of the whole arm.
    pub joint: usize,
    /// Parameter values, SI, padded with zeros.
    pub p: [T; MAX_PARAMETERS],
}
