//! One Runge-Kutta step with fixed friction modes: every joint slides in one direction or is stuck throughout.
//!
//! Classical Runge-Kutta on `M(q) ddq = tau - C dq - g - f` with the direction of every joint's dry friction given as a number, -1, 0
//! (stuck) or 1. The coupling of a stuck joint to others is taken out by factors of zero, so one arithmetic serves every
//! mode, one arm or several side by side. [`rk4_fixed_mode`] also checks whether the given modes agree with the motion ([`ModeCheck`]); if they do
//! not, the step is discarded and [`crate::integrate`] finds the instant of the mode change.

use crate::kinematics::{AngleRange, JointState, KinematicState, rotated};
use crate::linear::solve_positive_definite;
use crate::number::Number;
use crate::real::lit;
use crate::trig::{Rotation, SinCos};

/// Time, kinematic state and motor torques at an instant of a step.
#[derive(Debug, Clone, Copy)]
pub struct Instant<'a, V, const N: usize> {
    /// Time of the instant, s.
    pub t: V,
    /// Kinematic state of the arm.
    pub kinematics: &'a KinematicState<V, N>,
    /// Torques of the motors, N m (N).
    pub tau: &'a [V; N],
}

/// Dynamics of an arm with its friction and effects, or of several arms side by side.
pub trait Dynamics<V: Number, const N: usize> {
    /// Rotations by which the arm's angles change when the joints move by `by`, rad or m, and the largest absolute rotation angle, rad.
    fn rotations(&self, by: &[V; N], reach: AngleRange) -> ([Rotation<V>; N], V);

    /// Kinematic state at the joint state `joints`, given the sines and cosines of the arm's angles.
    fn rotated(&self, joints: &JointState<V, N>, sincos: [SinCos<V>; N]) -> KinematicState<V, N>;

    /// Generalized force `tau - C dq - g - f`, N m (N), with the effects' torques, and dry friction against `direction`.
    fn generalized_force(&self, at: &Instant<'_, V, N>, direction: &[V; N]) -> [V; N];

    /// Whether any joint is stuck in the friction modes `modes`.
    #[inline(always)]
    fn any_stuck(&self, modes: &Modes<V, N>) -> bool {
        modes.any_stuck
    }

    /// Stiction violation of each stuck joint, N m (N): friction torque at rest less the Coulomb level. Not positive for sliding joints.
    fn stiction_violation(
        &self,
        at: &Instant<'_, V, N>,
        friction_at_rest: &[V; N],
        direction: &[V; N],
    ) -> [V; N];
}

/// Friction modes of all joints during a step.
#[derive(Debug, Clone, Copy)]
pub struct Modes<V, const N: usize> {
    /// Direction in which each joint slides: -1, 0 (stuck) or 1.
    pub direction: [V; N],
    /// 1 for joints that slide, 0 for stuck joints.
    slides: [V; N],
    /// 1 for joints with dry friction, 0 for joints without.
    dry: [V; N],
    /// `-direction` for joints with dry friction, 0 for joints without.
    against: [V; N],
    /// Whether any joint is stuck.
    pub(crate) any_stuck: bool,
    /// Whether the modes have changed since the last step, so that the check at the end of the last step does not hold for them.
    pub(crate) fresh: bool,
}

impl<V: Number, const N: usize> Modes<V, N> {
    /// Friction modes for sliding in `direction`; `dry` is 1 for joints with dry friction, 0 for joints without.
    #[inline(always)]
    pub fn new(direction: [V; N], dry: [V; N]) -> Self {
        let (mut slides, mut against, mut any_stuck) = (direction, direction, false);
        for j in 0..N {
            slides[j] = direction[j] * direction[j];
            against[j] = -(direction[j] * dry[j]);
            any_stuck |= direction[j].any_zero();
        }
        Self { direction, slides, dry, against, any_stuck, fresh: true }
    }
}

/// A sample interval, or a part of one, with the motor torques over it.
#[derive(Debug, Clone, Copy)]
pub struct Span<V, const N: usize> {
    /// Start time of the span, s.
    pub t: V,
    /// Length of the span, s.
    pub h: V,
    /// Motor torques at the start, the middle and the end of the span, N m (N).
    pub tau: [[V; N]; 3],
}

/// Check of the assumed friction modes after a step, with the quantities from which the changed mode is found.
#[derive(Debug, Clone, Copy)]
pub struct ModeCheck<V, const N: usize> {
    /// Mode violation: > 0 or NaN if the motion contradicts an assumed friction mode, or if `range_violation` is > 0 or NaN.
    pub mode_violation: V,
    /// Violation of the angle range: > 0 or NaN if the motion is not finite or turns the arm beyond the angle range of one step.
    pub range_violation: V,
    /// Joint accelerations, rad/s^2 (m/s^2), at the start of the step and, as the last Runge-Kutta stage has them, at the end.
    pub ddq: [[V; N]; 2],
    /// Static friction at the start and the end of the step; meaningless if no joint is stuck.
    pub static_friction: [StaticFriction<V, N>; 2],
}

impl<V: Number, const N: usize> ModeCheck<V, N> {
    /// Mode check of zeros, to be overwritten by a step.
    #[inline(always)]
    pub fn none() -> Self {
        let zero = V::of(lit(0.0));
        let static_friction = StaticFriction { friction_at_rest: [zero; N], stiction_violation: [zero; N] };
        Self {
            mode_violation: zero,
            range_violation: zero,
            ddq: [[zero; N]; 2],
            static_friction: [static_friction; 2],
        }
    }
}

/// Static friction of stuck joints at an instant.
#[derive(Debug, Clone, Copy)]
pub struct StaticFriction<V, const N: usize> {
    /// Friction torque that keeps a stuck joint at rest, N m (N).
    pub friction_at_rest: [V; N],
    /// Size of `friction_at_rest` less the Coulomb level, N m (N); not positive for sliding joints.
    pub stiction_violation: [V; N],
}

/// Generalized force and acceleration at one Runge-Kutta stage.
#[derive(Clone, Copy)]
struct StageMotion<V, const N: usize> {
    generalized_force: [V; N],
    ddq: [V; N],
}

#[inline(always)]
fn motion<V: Number, B: Dynamics<V, N>, const N: usize>(
    dynamics: &B,
    at: &Instant<'_, V, N>,
    modes: &Modes<V, N>,
) -> StageMotion<V, N> {
    let generalized_force = dynamics.generalized_force(at, &modes.direction);
    let (mut inertia, mut right) = (at.kinematics.equation_terms.inertia, generalized_force);
    if dynamics.any_stuck(modes) {
        // A stuck joint without generalized force and without inertial coupling has the acceleration zero.
        for i in 0..N {
            right[i] = right[i] * modes.slides[i];
            for j in 0..i {
                let kept = inertia[i][j] * (modes.slides[i] * modes.slides[j]);
                (inertia[i][j], inertia[j][i]) = (kept, kept);
            }
        }
    }
    StageMotion { generalized_force, ddq: solve_positive_definite(inertia, right) }
}

/// Static friction of stuck joints: generalized force less `M ddq`.
#[inline(always)]
fn static_friction<V: Number, B: Dynamics<V, N>, const N: usize>(
    dynamics: &B,
    at: &Instant<'_, V, N>,
    motion: &StageMotion<V, N>,
    modes: &Modes<V, N>,
) -> StaticFriction<V, N> {
    let mut friction_at_rest = motion.generalized_force;
    for i in 0..N {
        for j in 0..N {
            friction_at_rest[i] =
                (-at.kinematics.equation_terms.inertia[i][j]).fused(motion.ddq[j], friction_at_rest[i]);
        }
    }
    StaticFriction {
        friction_at_rest,
        stiction_violation: dynamics.stiction_violation(at, &friction_at_rest, &modes.direction),
    }
}

/// Joint state after `dt` seconds at the velocities `dq` and accelerations `ddq`.
#[inline(always)]
fn moved<V: Number, const N: usize>(
    joints: &JointState<V, N>,
    dt: V,
    dq: &[V; N],
    ddq: &[V; N],
) -> JointState<V, N> {
    let mut next = *joints;
    for j in 0..N {
        next.q[j] = dt.fused(dq[j], joints.q[j]);
        next.dq[j] = dt.fused(ddq[j], joints.dq[j]);
    }
    next
}

/// Product of the number `x` and the vector `y`.
#[inline(always)]
fn times<V: Number, const N: usize>(x: V, y: &[V; N]) -> [V; N] {
    let mut product = *y;
    for j in 0..N {
        product[j] = x * y[j];
    }
    product
}

/// Contradiction of a joint's motion and friction mode: > 0 if its velocity `dq`, or at rest its acceleration `ddq`, contradicts `direction`.
#[inline(always)]
pub(crate) fn contradiction<V: Number>(dq: V, ddq: V, direction: V, slides: V) -> V {
    // A joint at rest whose mode is sliding (`slides` is 1) has just been released: the mode is wrong if it accelerates against `direction`.
    let released = -(ddq * direction) * slides;
    dq.where_zero(released, dq.size() - dq * direction)
}

/// Kinematic state, generalized force and acceleration at one Runge-Kutta stage.
#[derive(Clone, Copy)]
struct RkStage<V, const N: usize> {
    kinematics: KinematicState<V, N>,
    motion: StageMotion<V, N>,
}

/// Runge-Kutta stage `dt` seconds after the start, from velocities and accelerations of the previous stage; `tau` is the index of the torques in the
/// span.
#[inline(always)]
fn rk_stage<V: Number, B: Dynamics<V, N>, const N: usize>(
    step: &FixedModeStep<'_, V, B, N>,
    dt: V,
    tau: usize,
    [dq, ddq]: [&[V; N]; 2],
    sincos: [SinCos<V>; N],
) -> RkStage<V, N> {
    let FixedModeStep { dynamics, start, modes, span } = step;
    let kinematics = dynamics.rotated(&moved(&start.joints, dt, dq, ddq), sincos);
    let motion =
        motion(*dynamics, &Instant { t: span.t + dt, kinematics: &kinematics, tau: &span.tau[tau] }, modes);
    RkStage { kinematics, motion }
}

/// Input of one Runge-Kutta step with fixed friction modes.
pub struct FixedModeStep<'a, V, B, const N: usize> {
    /// Dynamics of the arm.
    pub dynamics: &'a B,
    /// Kinematic state at the start of the step.
    pub start: &'a KinematicState<V, N>,
    /// Friction modes assumed during the step.
    pub modes: &'a Modes<V, N>,
    /// Times and motor torques of the step.
    pub span: &'a Span<V, N>,
}

/// One classical Runge-Kutta step with fixed friction modes; returns the kinematic state at its end and overwrites `mode_check`.
///
/// From the start to the second stage, and from the third to the fourth, the arm turns by half a step at its initial velocity; further
/// rotations between stages follow from accelerations, and are small.
#[inline(always)]
pub fn rk4_fixed_mode<V: Number, B: Dynamics<V, N>, const N: usize>(
    step: &FixedModeStep<'_, V, B, N>,
    mode_check: &mut ModeCheck<V, N>,
) -> KinematicState<V, N> {
    let FixedModeStep { dynamics, start, modes, span } = step;
    let half = span.h * V::of(lit(0.5));
    let square = half * span.h;
    let (half_way, near) = dynamics.rotations(&times(half, &start.joints.dq), AngleRange::Near);
    let s1 = motion(*dynamics, &Instant { t: span.t, kinematics: start, tau: &span.tau[0] }, modes);
    let s2 = rk_stage(step, half, 1, [&start.joints.dq, &s1.ddq], rotated(&start.sincos, &half_way));
    let by = times(half * half, &s1.ddq);
    let (aside, far3) = dynamics.rotations(&by, AngleRange::Slight);
    let s3 = rk_stage(
        step,
        half,
        1,
        [&s2.kinematics.joints.dq, &s2.motion.ddq],
        rotated(&s2.kinematics.sincos, &aside),
    );
    let mut by4 = by;
    for j in 0..N {
        by4[j] = square.fused(s2.motion.ddq[j], -by[j]);
    }
    let (aside, far4) = dynamics.rotations(&by4, AngleRange::Slight);
    let s4 = rk_stage(
        step,
        span.h,
        2,
        [&s3.kinematics.joints.dq, &s3.motion.ddq],
        rotated(&rotated(&s3.kinematics.sincos, &half_way), &aside),
    );
    let far = [AngleRange::Near.part(near), far3.larger(far4)];
    end(step, &s1, [&s2, &s3, &s4], far, mode_check)
}

/// Kinematic state at the end of a Runge-Kutta step from its stages, with the check of friction modes; `far` is the largest angle between stages as a
/// part of [`AngleRange::Near`], `aside_far` the largest of the small angles between stages, rad, which [`AngleRange::Slight`] limits.
#[inline(always)]
fn end<V: Number, B: Dynamics<V, N>, const N: usize>(
    step: &FixedModeStep<'_, V, B, N>,
    s1: &StageMotion<V, N>,
    [s2, s3, s4]: [&RkStage<V, N>; 3],
    [far, aside_far]: [V; 2],
    mode_check: &mut ModeCheck<V, N>,
) -> KinematicState<V, N> {
    let c = |x: f64| V::of(lit(x));
    let FixedModeStep { dynamics, start, modes, span } = step;
    let joints = &start.joints;
    let mut mode_violation = -c(1.0);
    if dynamics.any_stuck(modes) {
        let at = Instant { t: span.t, kinematics: start, tau: &span.tau[0] };
        let first = static_friction(*dynamics, &at, s1, modes);
        let at = Instant { t: span.t + span.h, kinematics: &s4.kinematics, tau: &span.tau[2] };
        let last = static_friction(*dynamics, &at, &s4.motion, modes);
        for j in 0..N {
            mode_violation =
                mode_violation.larger(first.stiction_violation[j].larger(last.stiction_violation[j]));
        }
        mode_check.static_friction = [first, last];
    }
    if modes.fresh {
        for j in 0..N {
            let off = contradiction(joints.dq[j], s1.ddq[j], modes.direction[j], modes.slides[j]);
            mode_violation = mode_violation.larger(off * modes.dry[j]);
        }
    }
    // Adding -0 is the one sum that a compiler may leave out.
    let (mut end, mut by, mut sum) = (*joints, joints.q, c(-0.0));
    let sixth = span.h * c(1.0 / 6.0);
    let ddq = [s1.ddq, s4.motion.ddq];
    for j in 0..N {
        // The velocities of the stages are `dq`, and `dq` plus 1/2, 1/2 and 1 steps at the acceleration of the stage before.
        let early = s1.ddq[j] + s2.motion.ddq[j] + s3.motion.ddq[j];
        by[j] = span.h * sixth * (-c(3.0)).fused(s2.motion.ddq[j], early);
        end.q[j] = span.h.fused(sixth.fused(early, joints.dq[j]), joints.q[j]);
        end.dq[j] = sixth.fused(early + early + (ddq[1][j] - ddq[0][j]), joints.dq[j]);
        mode_violation = mode_violation.larger(end.dq[j] * modes.against[j]);
        sum = sum + end.dq[j];
    }
    let (aside, last) = dynamics.rotations(&by, AngleRange::Slight);
    let kinematics = dynamics.rotated(&end, rotated(&s4.kinematics.sincos, &aside));
    // NaN if an acceleration, and so a velocity at the end of the step, is not finite; else zero.
    let finite = sum * c(0.0);
    let far = AngleRange::Slight.part(aside_far.larger(last)).larger(far) - c(1.0) + finite;
    (mode_check.mode_violation, mode_check.range_violation, mode_check.ddq) =
        (mode_violation.larger(far) + finite, far, ddq);
    kinematics
}
