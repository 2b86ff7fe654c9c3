//! One lane's part of what is side by side.

use super::Run;
use crate::glide::Held;
use crate::integrate::State;
use crate::lanes::Lanes;
use crate::plant::Mode;
use crate::pose::Place;
use crate::real::Real;
use crate::trig::Turn;
use core::array::from_fn;
use nalgebra::SVector;

/// Writes the positions after interval `k`.
#[inline(always)]
pub(super) fn write<T: Real, A, const N: usize, const P: usize>(
    run: &mut Run<'_, T, A, N, P>,
    k: usize,
    q: &[T; N],
) {
    if let Some(row) = run.positions.get_mut(k * N..k * N + N) {
        row.copy_from_slice(q);
    }
}

/// The numbers of lane `l`.
#[inline]
pub(super) fn numbers<T: Real, C, const W: usize, const N: usize>(
    x: &[Lanes<T, C, W>; N],
    l: usize,
) -> [T; N] {
    from_fn(|j| x[j].0[l])
}

/// Lane `l`'s place.
#[inline]
pub(super) fn lane_of<T: Real, C, const W: usize, const N: usize>(
    place: &Place<Lanes<T, C, W>, N>,
    l: usize,
) -> Place<T, N> {
    Place { q: numbers(&place.q, l), dq: numbers(&place.dq, l) }
}

/// Lane `l`'s sines and cosines.
#[inline]
pub(super) fn turns_of<T: Real, C, const W: usize, const N: usize>(
    turns: &[Turn<Lanes<T, C, W>>; N],
    l: usize,
) -> [Turn<T>; N] {
    from_fn(|j| Turn { sine: turns[j].sine.0[l], cosine: turns[j].cosine.0[l] })
}

/// What holds lane `l`.
#[inline]
pub(super) fn held_in<T: Real, C, const W: usize, const N: usize>(
    held: &Held<Lanes<T, C, W>, N>,
    l: usize,
) -> Held<T, N> {
    Held { holding: numbers(&held.holding, l), excess: numbers(&held.excess, l) }
}

/// A state of its own.
#[inline]
pub(super) fn state_of<T: Real, const N: usize>(place: &Place<T, N>, direction: &[T; N]) -> State<T, N> {
    let mut state = State::new(SVector::from(place.q), SVector::from(place.dq));
    state.modes = direction.map(Mode::of);
    state
}
