//! What comes of a step in which a lane's friction modes may have changed.

use super::clock::{Clock, MAX_CHANGES, Reversal};
use crate::glide::Held;
use crate::integrate::root::{Close, hermite_root};
use crate::pose::Place;
use crate::real::Real;

/// One lane's part of a step.
pub(super) struct Taken<T, const N: usize> {
    /// Where it started and where it ended.
    pub(super) places: [Place<T, N>; 2],
    /// Accelerations there.
    pub(super) ddq: [[T; N]; 2],
    /// What it takes there to hold stuck joints, if there are any.
    pub(super) held: Option<[Held<T, N>; 2]>,
    /// Positive, or no number, where it went too far for one step.
    pub(super) far: T,
    /// Joints with dry friction.
    pub(super) dry: [bool; N],
    /// Coulomb coefficients.
    pub(super) coulomb: [T; N],
    /// Inertia at the end.
    pub(super) inertia: [[T; N]; N],
}

/// What to do about it.
pub(super) enum Outcome<T, const N: usize> {
    /// It is right: the lane goes on from its end.
    Right,
    /// It ended at a reversal, which is here.
    Reversed(Place<T, N>),
    /// It is taken again from its start.
    Again,
    /// What is left of the interval is for the lane alone.
    Alone,
}

impl<T: Real, const N: usize> Taken<T, N> {
    /// Decides, and sets the lane's clock and its joints' directions accordingly.
    pub(super) fn judge(&self, clock: &mut Clock<T, N>, direction: &mut [T; N]) -> Outcome<T, N> {
        let near = self.far <= T::zero();
        if !near || clock.changes >= MAX_CHANGES {
            return Outcome::Alone;
        }
        if let Some(goal) = clock.goal {
            return self.approach(goal, clock, direction);
        }
        let outcome = self.settle(clock, direction).unwrap_or_else(|| self.first_change(clock, direction));
        if matches!(outcome, Outcome::Again) {
            clock.changes += 1;
        }
        outcome
    }

    /// Releases the joint that friction holds least, and holds one that was released to no avail.
    fn settle(&self, clock: &mut Clock<T, N>, direction: &mut [T; N]) -> Option<Outcome<T, N>> {
        let (mut released, mut worst) = (None, T::zero());
        for j in 0..N {
            let (dq, along) = (self.places[0].dq[j], direction[j]);
            if dq != T::zero() {
                if (self.dry[j] || along == T::zero()) && dq * along <= T::zero() {
                    direction[j] = dq.signum();
                    return Some(Outcome::Again);
                }
            } else if along == T::zero() {
                if let Some([held, _]) = &self.held
                    && held.excess[j] > worst
                {
                    (released, worst) = (Some((j, held.holding[j].signum())), held.excess[j]);
                }
            } else if self.dry[j] && self.ddq[0][j] * along < T::zero() {
                (direction[j], clock.tried[j]) = (T::zero(), true);
                return Some(Outcome::Again);
            }
        }
        let (j, along) = released?;
        if clock.tried[j] {
            return Some(Outcome::Alone);
        }
        direction[j] = along;
        Some(Outcome::Again)
    }

    /// The reversal that comes first, if any.
    fn first_change(&self, clock: &mut Clock<T, N>, direction: &[T; N]) -> Outcome<T, N> {
        let [start, end] = &self.places;
        let mut first = None;
        for j in 0..N {
            if direction[j] == T::zero()
                && self.held.as_ref().is_some_and(|held| held[1].excess[j] > T::zero())
            {
                return Outcome::Alone;
            }
            if self.dry[j] && end.dq[j] * direction[j] < T::zero() {
                let h = clock.left;
                let s = hermite_root(start.dq[j], self.ddq[0][j] * h, end.dq[j], self.ddq[1][j] * h);
                if first.is_none_or(|(earliest, _)| s < earliest) {
                    first = Some((s, j));
                }
            }
        }
        let Some((s, joint)) = first else { return Outcome::Right };
        clock.goal = Some(Reversal { joint, length: s * clock.left });
        Outcome::Again
    }

    /// Ends at a reversal, or comes closer to it in another step.
    fn approach(&self, goal: Reversal<T>, clock: &mut Clock<T, N>, direction: &mut [T; N]) -> Outcome<T, N> {
        let Reversal { joint: j, length } = goal;
        let end = &self.places[1];
        let close = Close { place: end, j, length, ddq: [&self.ddq[0], &self.ddq[1]] };
        let next = length + close.correction();
        let within = next > T::zero() && next <= clock.left;
        let (more, mut place) = match close.reached(clock.left) {
            Some(reached) if within => reached,
            None if within => {
                clock.goal = Some(Reversal { joint: j, length: next });
                clock.changes += 1;
                return Outcome::Again;
            }
            _ => (T::zero(), *end),
        };
        place.dq[j] = T::zero();
        // As it seems; `settle` puts right what is not so.
        let goes_on = -(self.ddq[1][j] * direction[j]) > self.turn(j);
        direction[j] = if goes_on { -direction[j] } else { T::zero() };
        clock.pass(length + more);
        Outcome::Reversed(place)
    }

    /// By how much the acceleration of joint `j` changes where its dry friction turns round, all other joints free to move.
    fn turn(&self, j: usize) -> T {
        let mut own = self.inertia[j][j];
        for i in 0..N {
            if i != j {
                own -= self.inertia[j][i] * self.inertia[j][i] / self.inertia[i][i];
            }
        }
        (self.coulomb[j] + self.coulomb[j]) / own
    }
}
