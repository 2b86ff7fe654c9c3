//! Position of a lane in its run, and access to one lane's values.

use super::Run;
use crate::cpu::Cpu;
use crate::effect::InputSegment;
use crate::fixed_mode::{Span, StaticFriction};
use crate::integrate::{Interval, State};
use crate::kinematics::JointState;
use crate::lanes::Lanes;
use crate::plant::Mode;
use crate::real::Real;
use crate::trig::SinCos;
use core::array::from_fn;
use core::iter::Zip;
use core::slice::{Iter, IterMut};
use nalgebra::SVector;

/// Iterator over the intervals of a run: times at the start and the end, torques, and positions at the end to be written.
type Rows<'a, T, const N: usize> =
    Zip<Zip<Zip<Iter<'a, T>, Iter<'a, T>>, Iter<'a, [InputSegment<T>; N]>>, IterMut<'a, [T; N]>>;

/// Position of a lane in its run: the current sample interval and those that follow.
pub(super) struct RunCursor<'a, T, const N: usize> {
    rows: Rows<'a, T, N>,
    /// Current sample interval; `None` at the end of the run.
    pub(super) interval: Option<Interval<'a, T, N>>,
    /// Joint positions at the end of the current interval, to be written, rad or m.
    after: &'a mut [T; N],
}

impl<'a, T: Real, const N: usize> RunCursor<'a, T, N> {
    /// Cursor at the first interval of a run; `None` if the run has no interval.
    pub(super) fn of<A, const P: usize>(run: &mut Run<'a, T, A, N, P>) -> Option<Self> {
        let ends = run.t.get(1..)?;
        let positions = core::mem::take(&mut run.positions).as_chunks_mut().0;
        let mut rows = run.t.iter().zip(ends).zip(run.torque).zip(positions);
        let (row, after) = rows.next()?;
        Some(Self { rows, interval: Some(interval(row)), after })
    }

    /// Writes the positions `q`, rad or m, at the end of the current interval, and goes on to the next.
    #[inline(always)]
    pub(super) fn arrive(&mut self, q: [T; N]) {
        *self.after = q;
        self.interval = None;
        if let Some((row, after)) = self.rows.next() {
            (self.interval, self.after) = (Some(interval(row)), after);
        }
    }
}

#[inline(always)]
fn interval<'a, T: Real, const N: usize>(
    ((&t, &end), torque): ((&T, &T), &'a [InputSegment<T>; N]),
) -> Interval<'a, T, N> {
    Interval { t, h: end - t, torque }
}

/// Sets time, length and torques of lane `l` to those of an interval.
#[inline(always)]
pub(super) fn start_interval<T: Real, C: Cpu, const W: usize, const N: usize>(
    span: &mut Span<Lanes<T, C, W>, N>,
    l: usize,
    interval: &Interval<'_, T, N>,
) {
    (span.t.0[l], span.h.0[l]) = (interval.t, interval.h);
    for j in 0..N {
        let InputSegment { start, middle, end } = interval.torque[j];
        span.tau[0][j].0[l] = start;
        span.tau[1][j].0[l] = middle;
        span.tau[2][j].0[l] = end;
    }
}

/// Values of lane `l`, one per joint.
#[inline]
pub(super) fn lane_values<T: Real, C, const W: usize, const N: usize>(
    x: &[Lanes<T, C, W>; N],
    l: usize,
) -> [T; N] {
    from_fn(|j| x[j].0[l])
}

/// Joint state of lane `l`.
#[inline]
pub(super) fn lane_of<T: Real, C, const W: usize, const N: usize>(
    joints: &JointState<Lanes<T, C, W>, N>,
    l: usize,
) -> JointState<T, N> {
    JointState { q: lane_values(&joints.q, l), dq: lane_values(&joints.dq, l) }
}

/// Sines and cosines of lane `l`.
#[inline]
pub(super) fn sincos_of<T: Real, C, const W: usize, const N: usize>(
    sincos: &[SinCos<Lanes<T, C, W>>; N],
    l: usize,
) -> [SinCos<T>; N] {
    from_fn(|j| SinCos { sine: sincos[j].sine.0[l], cosine: sincos[j].cosine.0[l] })
}

/// Static friction of the joints of lane `l`.
#[inline]
pub(super) fn static_friction_of<T: Real, C, const W: usize, const N: usize>(
    friction: &StaticFriction<Lanes<T, C, W>, N>,
    l: usize,
) -> StaticFriction<T, N> {
    StaticFriction {
        friction_at_rest: lane_values(&friction.friction_at_rest, l),
        stiction_violation: lane_values(&friction.stiction_violation, l),
    }
}

/// State of the scalar integrator from a joint state and sliding directions.
#[inline]
pub(super) fn state_of<T: Real, const N: usize>(
    joints: &JointState<T, N>,
    direction: &[T; N],
) -> State<T, N> {
    let mut state = State::new(SVector::from(joints.q), SVector::from(joints.dq));
    state.modes = direction.map(Mode::of);
    state
}
