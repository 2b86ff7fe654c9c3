//! The library of unmodelled effects, one file each.
//!
//! An effect is what a real arm does and the rigid model of [`crate::arm`] leaves out. It acts through one or more
//! hooks of [`Effect`], all of which default to no effect: on the command before it becomes torque, as a torque at the
//! joint, on the Coulomb level, on the inertia, on `theta`, on the direction of gravity, or on the measured position.
//! Adding an effect is one file in this folder and one line in [`catalogue`].

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

pub use external_pulse::PulseShape;
pub use input_segment::{InputSegment, interval};
pub use parameter::{EffectParameter, NEVER, Quantity};
pub use torque_dead_zone::with_jump as dead_zone_with_jump;

use crate::real::Real;
use crate::transmission::Transmission;

/// Largest number of parameters of an effect.
pub const MAX_PARAMETERS: usize = 3;

/// All effects of the library, in the order of the documentation.
pub fn catalogue<T: Real>() -> &'static [&'static dyn Effect<T>] {
    &[
        &coulomb_asymmetry::CoulombAsymmetry,
        &torque_offset::TorqueOffset,
        &stribeck::Stribeck,
        &quadratic_drag::QuadraticDrag,
        &cubic_drag::CubicDrag,
        &load_dependent_friction::LoadDependentFriction { of_torque: false },
        &position_dependent_friction::PositionDependentFriction { twice: false },
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
        &torque_dead_zone::TorqueDeadZone { jumps: false },
        &payload::Payload,
        &base_tilt::BaseTilt,
        &joint_spring::JointSpring,
        &hardening_spring::HardeningSpring,
        &rotor_inertia::RotorInertia,
        &rotor_coupling::RotorCoupling,
        &encoder_offset::EncoderOffset,
        &encoder_eccentricity::EncoderEccentricity,
        &contact::Contact,
        &external_pulse::ExternalPulse { shape: PulseShape::Rectangle },
    ]
}

/// Further forms of effects of the library: the same effects, by name, with another law.
pub fn further_forms<T: Real>() -> &'static [&'static dyn Effect<T>] {
    &[
        &load_dependent_friction::LoadDependentFriction { of_torque: true },
        &position_dependent_friction::PositionDependentFriction { twice: true },
    ]
}

/// The form of the effect called `name` whose [`Effect::form`] is `form`; `None` if there is none.
pub fn find_form<T: Real>(name: &str, form: &str) -> Option<&'static dyn Effect<T>> {
    further_forms::<T>().iter().copied().find(|e| e.spec().name == name && e.form() == Some(form))
}

/// The effect called `name`, `None` if there is none.
pub fn find<T: Real>(name: &str) -> Option<&'static dyn Effect<T>> {
    catalogue::<T>().iter().copied().find(|effect| effect.spec().name == name)
}

/// Whether an effect belongs to one joint or to the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// The effect belongs to one joint.
    Joint,
    /// The effect belongs to the arm as a whole.
    Arm,
}

/// Hooks of [`Effect`] that an effect uses, so that the integrator calls no others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[expect(clippy::struct_excessive_bools, reason = "one flag per hook")]
pub struct Hooks {
    /// Whether the effect has [`Effect::force`].
    pub force: bool,
    /// Whether the effect has [`Effect::coulomb`].
    pub coulomb: bool,
    /// Whether the effect has [`Effect::command`].
    pub command: bool,
    /// Whether the effect has [`Effect::measured`].
    pub measured: bool,
    /// Whether the effect has [`Effect::hysteresis_after`].
    pub memory: bool,
    /// Whether [`Effect::coulomb`] depends on the load of the joint.
    pub load: bool,
}

impl Hooks {
    /// Hooks of an effect that changes the arm itself: none is called during a step.
    pub const NONE: Self =
        Self { force: false, coulomb: false, command: false, measured: false, memory: false, load: false };
    /// Hooks of an effect that is a torque at the joint.
    pub const FORCE: Self = Self { force: true, ..Self::NONE };
    /// Hooks of an effect that is a part of the Coulomb level.
    pub const COULOMB: Self = Self { coulomb: true, ..Self::NONE };
    /// Hooks of an effect that changes the torque command.
    pub const COMMAND: Self = Self { command: true, ..Self::NONE };
    /// Hooks of an effect that changes the measured position.
    pub const MEASURED: Self = Self { measured: true, ..Self::NONE };
}

/// Description of an effect: all of it that does not depend on the scalar type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spec {
    /// Name of the effect in results and on the command line.
    pub name: &'static str,
    /// Name of the effect in reports.
    pub title: &'static str,
    /// Equation of the effect, in the notation of `docs/notation.md`.
    pub equation: &'static str,
    /// Literature or practice that the effect's equation comes from.
    pub source: &'static str,
    /// Motion that a log must contain for the effect to be detectable.
    pub excited_by: &'static str,
    /// Whether the effect belongs to one joint or to the arm.
    pub scope: Scope,
    /// Smallest number of joints of an arm that can have the effect.
    pub least_joints: usize,
    /// Parameters of the effect; the effect vanishes where the first has its neutral value.
    pub parameters: &'static [EffectParameter],
    /// Initial guesses of the parameters, in units of the log's own scale of each quantity (`scale` of `armgap-fit`).
    pub initial_guesses: &'static [[f64; MAX_PARAMETERS]],
    /// Test of the effect to first order, before it is fitted.
    pub trial: Trial,
    /// Hooks of [`Effect`] that the effect uses.
    pub hooks: Hooks,
}

impl Spec {
    /// Defaults of most effects: on one joint of any arm, tested by the first parameter.
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

/// First-order test of an effect on the residual, before the effect is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trial {
    /// Test by the derivatives of the predictions by the first parameters, which are amplitudes: the effect vanishes where all amplitudes have their
    /// neutral values. The value is the number of amplitudes.
    Amplitudes(usize),
    /// Test by the derivative of the predictions at the neutral value along a ray on which all parameters grow together.
    Ray,
    /// No test: an external disturbance is looked for in each log by itself.
    Disturbance,
    /// Test by the whole change of the predictions at a trial value, for an effect with a threshold: where the threshold is never reached, the
    /// derivative is zero.
    Whole,
}

/// State, torque and load of a joint at one instant, the arguments of an effect's law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointPoint<T> {
    /// Time since the start of the log, s.
    pub t: T,
    /// Joint position, rad or m.
    pub q: T,
    /// Joint velocity, rad/s or m/s.
    pub dq: T,
    /// Torque of the actuator, N m (N).
    pub tau: T,
    /// Torque that the joint's transmission passes on to the link, N m (N), where the arm's parameters tell rotors from links
    /// ([`crate::arm::Arm::ROTORS_APART`]); else the torque that gravity and the motion of other links put on the joint, `C dq + g`.
    pub load: T,
    /// Nominal friction `b |dq| + fc` at the joint's speed, N m (N).
    pub friction: T,
    /// Direction in which another joint slides, -1 or 1, or 0 if it sticks: of the joint after this one, or, for the last joint, of the first.
    pub other: T,
    /// Hysteresis state of the joint, N m (N); see [`Effect::hysteresis_after`].
    pub memory: T,
}

/// States, torques and loads of a joint at several instants, quantity by quantity: of each [`JointPoint`] the laws of effects read few fields.
#[derive(Debug, Clone, Copy)]
pub struct JointPoints<'a, T> {
    /// [`JointPoint::t`] at each instant, s.
    pub t: &'a [T],
    /// [`JointPoint::q`] at each instant, rad or m.
    pub q: &'a [T],
    /// [`JointPoint::dq`] at each instant, rad/s or m/s.
    pub dq: &'a [T],
    /// [`JointPoint::tau`] at each instant, N m (N).
    pub tau: &'a [T],
    /// [`JointPoint::load`] at each instant, N m (N).
    pub load: &'a [T],
    /// [`JointPoint::friction`] at each instant, N m (N).
    pub friction: &'a [T],
    /// [`JointPoint::other`] at each instant.
    pub other: &'a [T],
    /// [`JointPoint::memory`] at each instant, N m (N).
    pub memory: &'a [T],
}

impl<T: Real> JointPoints<'_, T> {
    /// State, torque and load at instant `i`.
    #[inline(always)]
    pub fn at(&self, i: usize) -> JointPoint<T> {
        JointPoint {
            t: self.t[i],
            q: self.q[i],
            dq: self.dq[i],
            tau: self.tau[i],
            load: self.load[i],
            friction: self.friction[i],
            other: self.other[i],
            memory: self.memory[i],
        }
    }
}

/// Joint limit: position at which a joint's torque jumps, and the side beyond it, and stiffness and damping of the contact there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge<T> {
    /// Joint position at which the torque jumps, rad or m.
    pub position: T,
    /// Direction in which the joint moves beyond the position, -1 or 1.
    pub side: T,
    /// Stiffness of the contact, N m/rad (N/m).
    pub stiffness: T,
    /// Damping of the contact, N m s/rad (N s/m).
    pub damping: T,
}

impl<T: Real> Edge<T> {
    /// Whether the joint position `q` lies beyond the edge.
    #[inline]
    pub fn is_behind(&self, q: T) -> bool {
        (q - self.position) * self.side > T::zero()
    }

    /// Rate of the contact with a body of `inertia`, kg m^2 (kg), in 1/s: natural frequency, or damping rate if that is larger.
    pub fn rate(&self, inertia: T) -> T {
        (self.stiffness / inertia).sqrt().max(self.damping / inertia)
    }
}

/// An unmodelled effect: a law with up to [`MAX_PARAMETERS`] parameters `p`, SI.
pub trait Effect<T: Real>: Sync {
    /// Name, parameters, hooks and further description of the effect.
    fn spec(&self) -> &'static Spec;

    /// Parameters at which the effect changes the motion by about `share`, 0 to 1, of its whole change at `p`; `p` where these are not known.
    fn at_share(&self, p: &[T; MAX_PARAMETERS], _share: T) -> [T; MAX_PARAMETERS] {
        *p
    }

    /// Torque that the effect adds to the actuator's, N m (N).
    fn force(&self, _p: &[T; MAX_PARAMETERS], _x: &JointPoint<T>) -> T {
        T::zero()
    }

    /// Position at which [`Effect::force`] jumps, if there is one; the integrator ends a step at the position.
    fn edge(&self, _p: &[T; MAX_PARAMETERS]) -> Option<Edge<T>> {
        None
    }

    /// Addition to the Coulomb level, N m (N), while the joint slides, or is about to slide, in `direction` (+1 or -1).
    fn coulomb(&self, _p: &[T; MAX_PARAMETERS], _x: &JointPoint<T>, _direction: T) -> T {
        T::zero()
    }

    /// Adds [`Effect::force`] at each of `points` to `sums`.
    fn add_forces(&self, p: &[T; MAX_PARAMETERS], points: &JointPoints<'_, T>, sums: &mut [T]) {
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum += self.force(p, &points.at(i));
        }
    }

    /// Adds [`Effect::coulomb`] at each of `points`, in `directions`, to `levels`.
    fn add_coulombs(
        &self,
        p: &[T; MAX_PARAMETERS],
        points: &JointPoints<'_, T>,
        directions: &[T],
        levels: &mut [T],
    ) {
        for (i, (level, direction)) in levels.iter_mut().zip(directions).enumerate() {
            *level += self.coulomb(p, &points.at(i), *direction);
        }
    }

    /// Inertia, kg m^2 (kg), added to the diagonal entry of the joint in the inertia matrix.
    fn inertia(&self, _p: &[T; MAX_PARAMETERS]) -> T {
        T::zero()
    }

    /// Mass, kg, and distance along the last link, m, of an added point mass.
    fn payload(&self, _p: &[T; MAX_PARAMETERS]) -> Option<(T, T)> {
        None
    }

    /// Angle by which the base is turned in the plane of motion, rad.
    fn tilt(&self, _p: &[T; MAX_PARAMETERS]) -> T {
        T::zero()
    }

    /// Hysteresis state, N m (N), after the joint has moved by `distance`, rad or m, from a position where the state was `memory`.
    fn hysteresis_after(&self, _p: &[T; MAX_PARAMETERS], memory: T, _distance: T) -> T {
        memory
    }

    /// Whether the effect puts a transmission between motor and link.
    fn has_transmission(&self) -> bool {
        false
    }

    /// Transmission of a joint whose own inertia at `q = 0` is `inertia`, kg m^2 (kg); `None` for a rigid joint.
    fn transmission(&self, _p: &[T; MAX_PARAMETERS], _inertia: T) -> Option<Transmission<T>> {
        None
    }

    /// Inertia, kg m^2, added to `M_12` and `M_21`, between the first two joints.
    fn coupling(&self, _p: &[T; MAX_PARAMETERS]) -> T {
        T::zero()
    }

    /// Rewrites the command of one joint over a whole log, with sample times `t`, s, into the torque that reaches the joint, N m (N).
    fn command(&self, _p: &[T; MAX_PARAMETERS], _t: &[T], _torque: &mut [InputSegment<T>]) {}

    /// Name in results of the form of the effect's law; none for effects with one form, and for the first form of others.
    fn form(&self) -> Option<&'static str> {
        self.pulse_shape().map(PulseShape::name)
    }

    /// Course of the torque over time, for an external disturbance.
    fn pulse_shape(&self) -> Option<PulseShape> {
        None
    }

    /// Position that the encoder shows when the joint stands at `q`, rad or m.
    fn measured(&self, _p: &[T; MAX_PARAMETERS], q: T) -> T {
        q
    }
}

/// An effect on a joint of an arm, with values of its parameters.
#[derive(Clone, Copy)]
pub struct Active<T: Real> {
    /// Law of the effect.
    pub law: &'static dyn Effect<T>,
    /// Joint that the effect is on, from 0; ignored by effects of the whole arm.
    pub joint: usize,
    /// Values of the effect's parameters, SI, padded with zeros.
    pub p: [T; MAX_PARAMETERS],
}
