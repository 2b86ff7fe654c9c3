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
    pub fn balance(&self, q: &[V; N], dq: &[V; N]) -> Balance<V, N> {
        let mut balance = self.arm.balance(&self.theta, q, dq, self.tilt);
        for i in 0..N {
            for j in 0..N {
                balance.inertia[i][j] = balance.inertia[i][j] + self.added[i][j];
            }
        }
        balance
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

/// An instant of a step.
#[derive(Debug, Clone, Copy)]
pub struct Instant<'a, V, const N: usize> {
    /// Time, s.
    pub t: V,
    /// State.
    pub place: &'a Place<V, N>,
    /// Torques of the motors.
    pub tau: &'a [V; N],
    /// Inertia and `C dq + g` there.
    pub balance: &'a Balance<V, N>,
}

/// What glides: an arm with its friction and effects, or several.
pub trait Body<V: Number, const N: usize> {
    /// Inertia and `C dq + g`.
    fn balance(&self, place: &Place<V, N>) -> Balance<V, N>;

    /// Torques that accelerate: `tau - C dq - g - f` and what effects add, friction in these directions.
    fn pull(&self, at: &Instant<'_, V, N>, direction: &[V; N]) -> [V; N];

    /// By how much holding each joint takes more than friction can give, where it is stuck; anything not positive elsewhere.
    fn excess(&self, at: &Instant<'_, V, N>, holding: &[V; N], direction: &[V; N]) -> [V; N];
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

/// A step's end.
#[derive(Debug, Clone, Copy)]
pub struct Glided<V, const N: usize> {
    /// State.
    pub place: Place<V, N>,
    /// Inertia and `C dq + g` there.
    pub balance: Balance<V, N>,
    /// Positive, or no number, where the modes are not those of the motion or the motion is not finite.
    pub wrong: V,
}

/// Accelerations, and the torques that hold stuck joints.
#[inline(always)]
fn accelerations<V: Number, const N: usize>(inertia: &[[V; N]; N], pull: &[V; N], slides: &[V; N]) -> [V; N] {
    let one = V::of(lit(1.0));
    let (mut reduced, mut right) = (*inertia, *pull);
    for i in 0..N {
        for j in 0..N {
            let both = slides[i] * slides[j];
            let kept = reduced[i][j] * both;
            reduced[i][j] = if i == j { kept + (one - both) } else { kept };
        }
        right[i] = right[i] * slides[i];
    }
    solve_positive_definite(reduced, right)
}

/// Torques that hold the joints at these accelerations; zero where they slide, to rounding.
#[inline(always)]
fn holding<V: Number, const N: usize>(inertia: &[[V; N]; N], pull: &[V; N], ddq: &[V; N]) -> [V; N] {
    let mut torque = *pull;
    for i in 0..N {
        for j in 0..N {
            torque[i] = (-inertia[i][j]).fused(ddq[j], torque[i]);
        }
    }
    torque
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

/// The accelerations at a stage of the step.
#[inline(always)]
fn stage<V: Number, B: Body<V, N>, const N: usize>(
    body: &B,
    t: V,
    place: &Place<V, N>,
    tau: &[V; N],
    direction: &[V; N],
    slides: &[V; N],
) -> [V; N] {
    let balance = body.balance(place);
    let pull = body.pull(&Instant { t, place, tau, balance: &balance }, direction);
    accelerations(&balance.inertia, &pull, slides)
}

/// Positive where a joint's mode contradicts its velocity or its acceleration.
#[inline(always)]
fn contradiction<V: Number>(dq: V, ddq: V, direction: V, slides: V) -> V {
    // A joint that was just released stays at rest only if it is pulled back; `slides` is 1 there.
    let released = -(ddq * direction) * slides;
    dq.where_zero(released, dq.size() - dq * direction)
}

/// One step from `start`, whose inertia and bias are known, with friction in these directions.
#[inline(always)]
pub fn glide<V: Number, B: Body<V, N>, const N: usize>(
    body: &B,
    start: &Place<V, N>,
    balance: &Balance<V, N>,
    direction: &[V; N],
    span: &Span<V, N>,
) -> Glided<V, N> {
    let c = |x: f64| V::of(lit(x));
    let (half, sixth) = (span.h * c(0.5), span.h * c(1.0 / 6.0));
    let mut slides = *direction;
    for j in 0..N {
        slides[j] = direction[j] * direction[j];
    }
    let at = Instant { t: span.t, place: start, tau: &span.tau[0], balance };
    let pull = body.pull(&at, direction);
    let a1 = accelerations(&balance.inertia, &pull, &slides);
    let early = body.excess(&at, &holding(&balance.inertia, &pull, &a1), direction);
    let s2 = moved(start, half, &start.dq, &a1);
    let middle = span.t + half;
    let a2 = stage(body, middle, &s2, &span.tau[1], direction, &slides);
    let s3 = moved(start, half, &s2.dq, &a2);
    let a3 = stage(body, middle, &s3, &span.tau[1], direction, &slides);
    let s4 = moved(start, span.h, &s3.dq, &a3);
    let t = span.t + span.h;
    let a4 = stage(body, t, &s4, &span.tau[2], direction, &slides);
    let mut place = *start;
    for j in 0..N {
        let (v, a) = (s2.dq[j] + s3.dq[j], a2[j] + a3[j]);
        place.q[j] = sixth.fused(start.dq[j] + (v + v) + s4.dq[j], start.q[j]);
        place.dq[j] = sixth.fused(a1[j] + (a + a) + a4[j], start.dq[j]);
    }
    let balance = body.balance(&place);
    let at = Instant { t, place: &place, tau: &span.tau[2], balance: &balance };
    let pull = body.pull(&at, direction);
    let last = accelerations(&balance.inertia, &pull, &slides);
    let late = body.excess(&at, &holding(&balance.inertia, &pull, &last), direction);
    let zero = c(0.0);
    let (mut wrong, mut finite) = (-c(1.0), zero);
    for j in 0..N {
        let reversed = -(place.dq[j] * direction[j]);
        let at_start = contradiction(start.dq[j], a1[j], direction[j], slides[j]);
        wrong = wrong.larger(at_start).larger(early[j]).larger(late[j]).larger(reversed);
        // What is not finite leaves its mark in this sum.
        finite = place.q[j].fused(zero, place.dq[j].fused(zero, finite));
    }
    Glided { place, balance, wrong: wrong + finite }
}
