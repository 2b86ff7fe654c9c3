//! Plays that close and open inside a step.

use super::crossing::{Change, Event, Leap, Located};
use super::root::hermite_root;
use super::{State, Step};
use crate::arm::Arm;
use crate::plant::Motion;
use crate::pose::Place;
use crate::real::Real;

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Step<'_, T, A, N, P> {
    /// Opens the plays whose flank would have to pull; whether any was.
    pub(super) fn open(&self, x: T, state: &mut State<T, N>, motion: &Motion<T, N>) -> bool {
        let tau = self.interval.torque_at(x);
        let mut opened = false;
        for j in 0..N {
            let pull = self.plant.drives().pull(j, tau[j], &motion.ddq, &state.hidden);
            if pull.is_some_and(|pull| pull > T::zero()) {
                state.hidden.side[j] = T::zero();
                opened = true;
            }
        }
        opened
    }

    /// When joint `j`'s play closes or opens within the step.
    pub(super) fn flank(
        &self,
        j: usize,
        &Leap { state, x, dt, k1 }: &Leap<'_, T, N>,
        trial: &State<T, N>,
        end: &Motion<T, N>,
    ) -> Option<Event<T>> {
        let drives = self.plant.drives();
        if let Some(depth) = drives.depth(j, &trial.hidden) {
            let side = if trial.hidden.twist[j] < T::zero() { -T::one() } else { T::one() };
            let before = side * state.hidden.twist[j] - drives.get(j)?.half_gap();
            let (rate, later) = (side * state.hidden.dtwist[j] * dt, side * trial.hidden.dtwist[j] * dt);
            let s = hermite_root(before.min(T::zero()), rate, depth, later);
            return (depth > T::zero()).then_some(Event { joint: j, s, change: Change::Meet });
        }
        let pull = |x: T, at: &State<T, N>, motion: &Motion<T, N>| {
            drives.pull(j, self.interval.torque_at(x)[j], &motion.ddq, &at.hidden)
        };
        let (before, after) = (pull(x, state, k1)?, pull(x + dt, trial, end)?);
        let s = if before < T::zero() { before / (before - after) } else { T::zero() };
        (after > T::zero()).then_some(Event { joint: j, s, change: Change::Open { pull: [before, after] } })
    }

    /// Integrates to where joint `j`'s rotor meets its flank.
    pub(super) fn locate_meeting(&self, leap: &Leap<'_, T, N>, j: usize, s: T) -> Located<T, N> {
        let beyond = |there: &State<T, N>| {
            let depth = self.plant.drives().depth(j, &there.hidden)?;
            let side = if there.hidden.twist[j] < T::zero() { -T::one() } else { T::one() };
            Some((depth, side * there.hidden.dtwist[j])).filter(|(_, rate)| *rate > T::zero())
        };
        self.locate_crossing(leap, s, beyond)
    }

    /// The state just after joint `j`'s rotor has met its flank.
    pub(super) fn met(&self, j: usize, mut state: State<T, N>) -> State<T, N> {
        let place = Place { q: state.q.into(), dq: state.dq.into() };
        let inertia = self.plant.rigid().pose(&place).balance.inertia;
        self.plant.drives().meet(j, &inertia, &mut state.dq, &mut state.hidden);
        state
    }

    /// Closes the plays that a step without events has gone beyond.
    pub(super) fn close_crossed(&self, state: &mut State<T, N>) {
        for j in 0..N {
            if self.plant.drives().depth(j, &state.hidden).is_some_and(|depth| depth > T::zero()) {
                *state = self.met(j, *state);
            }
        }
    }
}
