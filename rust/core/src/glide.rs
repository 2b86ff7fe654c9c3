//! A step over which no friction mode changes: the arm glides, some of its joints held.
//!
//! Classical Runge-Kutta on `M(q) ddq = tau - C dq - g - f` with the direction of every joint's dry friction given as a number, -1, 0
//! (stuck) or 1. What couples a stuck joint to others is taken out by factors of zero, so one and the same arithmetic serves every
//! mode, one arm or several side by side. [`glide`] also says whether the modes it was given are those the motion has: if not, the step is
//! worth nothing and [`crate::integrate`] finds the instant of the change.

use crate::linear::solve_positive_definite;
use crate::number::Number;
use crate::pose::{Place, Pose, Reach, turned};
use crate::real::lit;
use crate::trig::{Rotation, Turn};

/// An instant of a step.
#[derive(Debug, Clone, Copy)]
pub struct Instant<'a, V, const N: usize> {
    /// Time, s.
    pub t: V,
    /// Where the arm is.
    pub pose: &'a Pose<V, N>,
    /// Torques of the motors.
    pub tau: &'a [V; N],
}

/// What glides: an arm with its friction and effects, or several.
pub trait Body<V: Number, const N: usize> {
    /// What turns the arm's angles on where its joints move by so much, and the largest of these angles.
    fn rotations(&self, by: &[V; N], reach: Reach) -> ([Rotation<V>; N], V);

    /// A place whose angles have these sines and cosines, with all that follows from it.
    fn turned(&self, place: &Place<V, N>, turns: [Turn<V>; N]) -> Pose<V, N>;

    /// Torques that accelerate: `tau - C dq - g - f` and what effects add, friction in these directions.
    fn pull(&self, at: &Instant<'_, V, N>, direction: &[V; N]) -> [V; N];

    /// Whether any joint is stuck in these modes.
    #[inline(always)]
    fn holds(&self, modes: &Modes<V, N>) -> bool {
        modes.held
    }

    /// By how much holding each joint takes more than friction can give, where it is stuck; anything not positive elsewhere.
    fn excess(&self, at: &Instant<'_, V, N>, holding: &[V; N], direction: &[V; N]) -> [V; N];
}

/// Friction modes during a step.
#[derive(Debug, Clone, Copy)]
pub struct Modes<V, const N: usize> {
    /// The direction in which each joint slides: -1, 0 (stuck) or 1.
    pub direction: [V; N],
    /// 1 for joints that slide, 0 for those that are stuck.
    slides: [V; N],
    /// 1 for joints with dry friction; 0 for those that reverse without noticing.
    dry: [V; N],
    /// Against the direction where dry friction notices.
    against: [V; N],
    /// Whether any is stuck.
    pub(crate) held: bool,
    /// Whether the last step did not end in these modes.
    pub(crate) fresh: bool,
}

impl<V: Number, const N: usize> Modes<V, N> {
    /// Modes of these directions; `dry` is 1 for joints with dry friction, 0 for those that reverse without noticing.
    #[inline(always)]
    pub fn new(direction: [V; N], dry: [V; N]) -> Self {
        let (mut slides, mut against, mut held) = (direction, direction, false);
        for j in 0..N {
            slides[j] = direction[j] * direction[j];
            against[j] = -(direction[j] * dry[j]);
            held |= direction[j].any_zero();
        }
        Self { direction, slides, dry, against, held, fresh: true }
    }
}

/// A sample interval, or a part of it.
#[derive(Debug, Clone, Copy)]
pub struct Span<V, const N: usize> {
    /// Where it starts, s.
    pub t: V,
    /// How long it is, s.
    pub h: V,
    /// Torques at its start, its middle and its end.
    pub tau: [[V; N]; 3],
}

/// Whether a step's modes were those of the motion, and what tells which changed.
#[derive(Debug, Clone, Copy)]
pub struct Signs<V, const N: usize> {
    /// Positive, or no number, where the modes are not those of the motion, or the step is too far.
    pub wrong: V,
    /// Positive, or no number, where the motion is not finite or too far for one step.
    pub far: V,
    /// Accelerations at the start and, in the last stage's approximation, at the end.
    pub ddq: [[V; N]; 2],
    /// What holds stuck joints at the same two instants; of no meaning where none is stuck.
    pub held: [Held<V, N>; 2],
}

impl<V: Number, const N: usize> Signs<V, N> {
    /// Those of no step.
    #[inline(always)]
    pub fn none() -> Self {
        let zero = V::of(lit(0.0));
        let held = Held { holding: [zero; N], excess: [zero; N] };
        Self { wrong: zero, far: zero, ddq: [[zero; N]; 2], held: [held; 2] }
    }
}

/// What it takes to hold stuck joints.
#[derive(Debug, Clone, Copy)]
pub struct Held<V, const N: usize> {
    /// Torques of friction.
    pub holding: [V; N],
    /// By how much they are more than friction gives, where a joint is stuck; anything not positive elsewhere.
    pub excess: [V; N],
}

/// The torques that accelerate, and the accelerations.
#[derive(Clone, Copy)]
struct Motion<V, const N: usize> {
    pull: [V; N],
    ddq: [V; N],
}

#[inline(always)]
fn motion<V: Number, B: Body<V, N>, const N: usize>(
    body: &B,
    at: &Instant<'_, V, N>,
    modes: &Modes<V, N>,
) -> Motion<V, N> {
    let pull = body.pull(at, &modes.direction);
    let (mut inertia, mut right) = (at.pose.balance.inertia, pull);
    if body.holds(modes) {
        // What does not push a stuck joint and is not coupled to it leaves it at rest.
        for i in 0..N {
            right[i] = right[i] * modes.slides[i];
            for j in 0..i {
                let kept = inertia[i][j] * (modes.slides[i] * modes.slides[j]);
                (inertia[i][j], inertia[j][i]) = (kept, kept);
            }
        }
    }
    Motion { pull, ddq: solve_positive_definite(inertia, right) }
}

/// What holds stuck joints.
#[inline(always)]
fn held<V: Number, B: Body<V, N>, const N: usize>(
    body: &B,
    at: &Instant<'_, V, N>,
    motion: &Motion<V, N>,
    modes: &Modes<V, N>,
) -> Held<V, N> {
    let mut holding = motion.pull;
    for i in 0..N {
        for j in 0..N {
            holding[i] = (-at.pose.balance.inertia[i][j]).fused(motion.ddq[j], holding[i]);
        }
    }
    Held { holding, excess: body.excess(at, &holding, &modes.direction) }
}

/// `place` moved on by `dt` at these rates.
#[inline(always)]
fn moved<V: Number, const N: usize>(place: &Place<V, N>, dt: V, dq: &[V; N], ddq: &[V; N]) -> Place<V, N> {
    let mut next = *place;
    for j in 0..N {
        next.q[j] = dt.fused(dq[j], place.q[j]);
        next.dq[j] = dt.fused(ddq[j], place.dq[j]);
    }
    next
}

/// `x` times all of these.
#[inline(always)]
fn times<V: Number, const N: usize>(x: V, y: &[V; N]) -> [V; N] {
    let mut product = *y;
    for j in 0..N {
        product[j] = x * y[j];
    }
    product
}

/// Positive where a joint's mode contradicts its velocity or its acceleration.
#[inline(always)]
fn contradiction<V: Number>(dq: V, ddq: V, direction: V, slides: V) -> V {
    // A joint that was just released stays at rest only if it is pulled back; `slides` is 1 there.
    let released = -(ddq * direction) * slides;
    dq.where_zero(released, dq.size() - dq * direction)
}

/// Where the arm is at a stage, and how it accelerates there.
#[derive(Clone, Copy)]
struct Stage<V, const N: usize> {
    pose: Pose<V, N>,
    motion: Motion<V, N>,
}

/// The stage `dt` after the start, moved there at the velocities and accelerations of the stage before, under the `tau`-th torques.
#[inline(always)]
fn stage<V: Number, B: Body<V, N>, const N: usize>(
    step: &Step<'_, V, B, N>,
    dt: V,
    tau: usize,
    [dq, ddq]: [&[V; N]; 2],
    turns: [Turn<V>; N],
) -> Stage<V, N> {
    let Step { body, start, modes, span } = step;
    let pose = body.turned(&moved(&start.place, dt, dq, ddq), turns);
    let motion = motion(*body, &Instant { t: span.t + dt, pose: &pose, tau: &span.tau[tau] }, modes);
    Stage { pose, motion }
}

/// What a step is taken from.
pub struct Step<'a, V, B, const N: usize> {
    /// What moves.
    pub body: &'a B,
    /// Where it starts.
    pub start: &'a Pose<V, N>,
    /// Friction modes.
    pub modes: &'a Modes<V, N>,
    /// Times and torques.
    pub span: &'a Span<V, N>,
}

/// One step with these friction modes: where it ends. Its signs are written over `signs`.
///
/// From the start to the second stage, and from the third to the fourth, the arm turns by half a step at the velocity it starts with; the
/// rest of the ways between them follows from accelerations, and is short.
#[inline(always)]
pub fn glide<V: Number, B: Body<V, N>, const N: usize>(
    step: &Step<'_, V, B, N>,
    signs: &mut Signs<V, N>,
) -> Pose<V, N> {
    let Step { body, start, modes, span } = step;
    let half = span.h * V::of(lit(0.5));
    let square = half * span.h;
    let (half_way, near) = body.rotations(&times(half, &start.place.dq), Reach::Near);
    let s1 = motion(*body, &Instant { t: span.t, pose: start, tau: &span.tau[0] }, modes);
    let s2 = stage(step, half, 1, [&start.place.dq, &s1.ddq], turned(&start.turns, &half_way));
    let by = times(half * half, &s1.ddq);
    let (aside, far3) = body.rotations(&by, Reach::Beside);
    let s3 = stage(step, half, 1, [&s2.pose.place.dq, &s2.motion.ddq], turned(&s2.pose.turns, &aside));
    let mut by4 = by;
    for j in 0..N {
        by4[j] = square.fused(s2.motion.ddq[j], -by[j]);
    }
    let (aside, far4) = body.rotations(&by4, Reach::Beside);
    let s4 = stage(
        step,
        span.h,
        2,
        [&s3.pose.place.dq, &s3.motion.ddq],
        turned(&turned(&s3.pose.turns, &half_way), &aside),
    );
    let far = [Reach::Near.part(near), far3.larger(far4)];
    end(step, &s1, [&s2, &s3, &s4], far, signs)
}

/// The end of a step with these stages, between which the longest way is so far, and the longest that has to be short.
#[inline(always)]
fn end<V: Number, B: Body<V, N>, const N: usize>(
    step: &Step<'_, V, B, N>,
    s1: &Motion<V, N>,
    [s2, s3, s4]: [&Stage<V, N>; 3],
    [far, aside_far]: [V; 2],
    signs: &mut Signs<V, N>,
) -> Pose<V, N> {
    let c = |x: f64| V::of(lit(x));
    let Step { body, start, modes, span } = step;
    let place = &start.place;
    let mut wrong = -c(1.0);
    if body.holds(modes) {
        let at = Instant { t: span.t, pose: start, tau: &span.tau[0] };
        let first = held(*body, &at, s1, modes);
        let at = Instant { t: span.t + span.h, pose: &s4.pose, tau: &span.tau[2] };
        let last = held(*body, &at, &s4.motion, modes);
        for j in 0..N {
            wrong = wrong.larger(first.excess[j].larger(last.excess[j]));
        }
        signs.held = [first, last];
    }
    if modes.fresh {
        for j in 0..N {
            let off = contradiction(place.dq[j], s1.ddq[j], modes.direction[j], modes.slides[j]);
            wrong = wrong.larger(off * modes.dry[j]);
        }
    }
    // Adding -0 is the one sum that a compiler may leave out.
    let (mut end, mut by, mut sum) = (*place, place.q, c(-0.0));
    let sixth = span.h * c(1.0 / 6.0);
    let ddq = [s1.ddq, s4.motion.ddq];
    for j in 0..N {
        // The velocities of the stages are `dq` and half, half and all of a step at the accelerations before.
        let early = s1.ddq[j] + s2.motion.ddq[j] + s3.motion.ddq[j];
        by[j] = span.h * sixth * (-c(3.0)).fused(s2.motion.ddq[j], early);
        end.q[j] = span.h.fused(sixth.fused(early, place.dq[j]), place.q[j]);
        end.dq[j] = sixth.fused(early + early + (ddq[1][j] - ddq[0][j]), place.dq[j]);
        wrong = wrong.larger(end.dq[j] * modes.against[j]);
        sum = sum + end.dq[j];
    }
    let (aside, last) = body.rotations(&by, Reach::Beside);
    let pose = body.turned(&end, turned(&s4.pose.turns, &aside));
    // An acceleration that is not finite leaves its mark in this.
    let finite = sum * c(0.0);
    let far = Reach::Beside.part(aside_far.larger(last)).larger(far) - c(1.0) + finite;
    (signs.wrong, signs.far, signs.ddq) = (wrong.larger(far) + finite, far, ddq);
    pose
}
