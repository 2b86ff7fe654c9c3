//! A step over which no friction mode changes: the arm glides, some of its joints held.
//!
//! Classical Runge-Kutta on `M(q) ddq = tau - C dq - g - f` with the direction of every joint's dry friction given as a number, -1, 0
//! (stuck) or 1. A stuck joint's row and column are taken out by factors of zero, so one and the same arithmetic serves every mode,
//! one arm or several side by side. [`glide`] also says whether the modes it was given are those the motion has: if not, the step is
//! worth nothing and [`crate::integrate`] finds the instant of the change.

use crate::arm::{Arm, Balance};
use crate::linear::solve_positive_definite;
use crate::number::Number;
use crate::real::lit;
use crate::trig::{NEAR, Turn};

/// An arm with numbers in the form its equation needs them.
#[derive(Debug, Clone, Copy)]
pub struct Rigid<V, A, const N: usize, const P: usize> {
    /// The arm.
    pub arm: A,
    /// Parameters, payloads included.
    pub theta: [V; P],
    /// Viscous coefficients.
    pub viscous: [V; N],
    /// Coulomb coefficients.
    pub coulomb: [V; N],
    /// Inertia added by effects.
    pub added: [[V; N]; N],
    /// Angle by which the base is turned.
    pub tilt: V,
}

impl<V: Number, A: Arm<V::Real, N, P>, const N: usize, const P: usize> Rigid<V, A, N, P> {
    /// Inertia and `C dq + g`.
    #[inline(always)]
    pub fn balance(&self, place: &Place<V, N>) -> Balance<V, N> {
        self.pose(place).balance
    }

    /// A place with all that follows from it.
    #[inline(always)]
    pub fn pose(&self, place: &Place<V, N>) -> Pose<V, N> {
        let angles = self.arm.angles(&place.q, self.tilt);
        let mut turns = [Turn { sine: angles[0], cosine: angles[0] }; N];
        for j in 0..N {
            turns[j] = Turn::of(angles[j]);
        }
        self.turned(place, turns)
    }

    /// The pose at a place which is `by` further on than a known pose, and how far its angles are from there.
    #[inline(always)]
    pub fn near(&self, known: &Pose<V, N>, place: &Place<V, N>, by: &[V; N]) -> (Pose<V, N>, V) {
        let zero = V::of(lit(0.0));
        let angles = self.arm.angles(by, zero);
        let (mut turns, mut far) = (known.turns, zero);
        for j in 0..N {
            turns[j] = known.turns[j].by(angles[j]);
            far = angles[j].size().larger(far);
        }
        (self.turned(place, turns), far)
    }

    #[inline(always)]
    fn turned(&self, place: &Place<V, N>, turns: [Turn<V>; N]) -> Pose<V, N> {
        let mut balance = self.arm.balance(&self.theta, &turns, &place.dq);
        for i in 0..N {
            for j in 0..N {
                balance.inertia[i][j] = balance.inertia[i][j] + self.added[i][j];
            }
        }
        Pose { place: *place, turns, balance }
    }
}

/// Where joints are and how they move.
#[derive(Debug, Clone, Copy)]
pub struct Place<V, const N: usize> {
    /// Positions.
    pub q: [V; N],
    /// Velocities.
    pub dq: [V; N],
}

/// A place with all that follows from it.
#[derive(Debug, Clone, Copy)]
pub struct Pose<V, const N: usize> {
    /// Positions and velocities.
    pub place: Place<V, N>,
    /// Sines and cosines of the angles that the arm's equation depends on.
    pub turns: [Turn<V>; N],
    /// Inertia and `C dq + g`.
    pub balance: Balance<V, N>,
}

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
    /// The pose at a place which is `by` further on than a known pose, and how far its angles are from there.
    fn near(&self, known: &Pose<V, N>, place: &Place<V, N>, by: &[V; N]) -> (Pose<V, N>, V);

    /// Torques that accelerate: `tau - C dq - g - f` and what effects add, friction in these directions.
    fn pull(&self, at: &Instant<'_, V, N>, direction: &[V; N]) -> [V; N];

    /// 1 for a joint with dry friction; 0 for one that reverses without noticing.
    fn dry(&self, j: usize) -> V;

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
    /// Whether any is stuck.
    held: bool,
}

impl<V: Number, const N: usize> Modes<V, N> {
    /// Modes of these directions.
    #[inline(always)]
    pub fn new(direction: [V; N]) -> Self {
        let (mut slides, mut held) = (direction, false);
        for j in 0..N {
            slides[j] = direction[j] * direction[j];
            held |= direction[j].any_zero();
        }
        Self { direction, slides, held }
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

/// A step's end, and what it says of the modes on the way.
#[derive(Debug, Clone, Copy)]
pub struct Glided<V, const N: usize> {
    /// Where it ends.
    pub pose: Pose<V, N>,
    /// Positive, or no number, where the modes are not those of the motion, or the step is too far.
    pub wrong: V,
    /// Positive, or no number, where the motion is not finite or too far for one step.
    pub far: V,
    /// Accelerations at the start and, in the last stage's approximation, at the end.
    pub ddq: [[V; N]; 2],
    /// What holds stuck joints at the same two instants; of no meaning where none is stuck.
    pub held: [Held<V, N>; 2],
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
    if modes.held {
        let one = V::of(lit(1.0));
        for i in 0..N {
            for j in 0..N {
                let both = modes.slides[i] * modes.slides[j];
                let kept = inertia[i][j] * both;
                inertia[i][j] = if i == j { kept + (one - both) } else { kept };
            }
            right[i] = right[i] * modes.slides[i];
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

/// `place` moved on by `dt` at these rates, and by how far.
#[inline(always)]
fn moved<V: Number, const N: usize>(
    place: &Place<V, N>,
    dt: V,
    dq: &[V; N],
    ddq: &[V; N],
) -> (Place<V, N>, [V; N]) {
    let (mut next, mut by) = (*place, *dq);
    for j in 0..N {
        by[j] = dt * dq[j];
        next.q[j] = place.q[j] + by[j];
        next.dq[j] = dt.fused(ddq[j], place.dq[j]);
    }
    (next, by)
}

/// Positive where a joint's mode contradicts its velocity or its acceleration.
#[inline(always)]
fn contradiction<V: Number>(dq: V, ddq: V, direction: V, slides: V) -> V {
    // A joint that was just released stays at rest only if it is pulled back; `slides` is 1 there.
    let released = -(ddq * direction) * slides;
    dq.where_zero(released, dq.size() - dq * direction)
}

/// One step with these friction modes.
#[inline(always)]
pub fn glide<V: Number, B: Body<V, N>, const N: usize>(
    body: &B,
    start: &Pose<V, N>,
    modes: &Modes<V, N>,
    span: &Span<V, N>,
) -> Glided<V, N> {
    let c = |x: f64| V::of(lit(x));
    let (half, sixth) = (span.h * c(0.5), span.h * c(1.0 / 6.0));
    let (zero, place) = (c(0.0), &start.place);
    let at = Instant { t: span.t, pose: start, tau: &span.tau[0] };
    let m1 = motion(body, &at, modes);
    let none = Held { holding: [zero; N], excess: [zero; N] };
    let mut holds = [none; 2];
    if modes.held {
        holds[0] = held(body, &at, &m1, modes);
    }
    let (s2, by) = moved(place, half, &place.dq, &m1.ddq);
    let (pose, far2) = body.near(start, &s2, &by);
    let m2 = motion(body, &Instant { t: span.t + half, pose: &pose, tau: &span.tau[1] }, modes);
    let (s3, by) = moved(place, half, &s2.dq, &m2.ddq);
    let (pose, far3) = body.near(start, &s3, &by);
    let m3 = motion(body, &Instant { t: span.t + half, pose: &pose, tau: &span.tau[1] }, modes);
    let (s4, by) = moved(place, span.h, &s3.dq, &m3.ddq);
    let (pose, far4) = body.near(start, &s4, &by);
    let at = Instant { t: span.t + span.h, pose: &pose, tau: &span.tau[2] };
    let m4 = motion(body, &at, modes);
    if modes.held {
        holds[1] = held(body, &at, &m4, modes);
    }
    let (mut end, mut by) = (*place, place.q);
    let (mut wrong, mut finite) = (-c(1.0), zero);
    for j in 0..N {
        let (v, a) = (s2.dq[j] + s3.dq[j], m2.ddq[j] + m3.ddq[j]);
        by[j] = sixth * (place.dq[j] + (v + v) + s4.dq[j]);
        end.q[j] = place.q[j] + by[j];
        end.dq[j] = sixth.fused(m1.ddq[j] + (a + a) + m4.ddq[j], place.dq[j]);
        let direction = modes.direction[j];
        let off = contradiction(place.dq[j], m1.ddq[j], direction, modes.slides[j]);
        wrong = wrong.larger(off.larger(-(end.dq[j] * direction)) * body.dry(j));
        wrong = wrong.larger(holds[0].excess[j].larger(holds[1].excess[j]));
        // What is not finite leaves its mark in this sum.
        finite = end.q[j].fused(zero, end.dq[j].fused(zero, finite));
    }
    let (pose, far) = body.near(start, &end, &by);
    let far = far.larger(far2).larger(far3).larger(far4) - c(NEAR) + finite;
    Glided { pose, wrong: wrong.larger(far) + finite, far, ddq: [m1.ddq, m4.ddq], held: holds }
}
