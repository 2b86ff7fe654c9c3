//! The lanes on their way.

use super::bundle::{Bundle, Gliding};
use super::change::{Outcome, Taken};
use super::clock::Clock;
use super::lane::{Way, held_in, lane_of, numbers, set_out, state_of, turns_of};
use super::{Run, WIDTH};
use crate::arm::Arm;
use crate::cpu::Cpu;
use crate::glide::{Modes, Signs, Span, Step, glide};
use crate::integrate::{State, exact};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::plant::Mode;
use crate::pose::{Place, Pose, Reach};
use crate::real::{Real, lit};
use crate::trig::Turn;
use core::array::from_fn;
use nalgebra::SVector;

/// Steps after which sines and cosines that were turned on step by step are computed afresh.
const AFRESH: usize = 64;

/// Taken from what is wrong in lanes that have ended.
const IDLE: f64 = 1e30;

/// How the lanes go through a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Course {
    /// All from sample to sample.
    Even,
    /// Some through the rest of an interval.
    Parted,
    /// Some to a reversal.
    Aimed,
}

/// The lanes' states on their way.
pub(super) struct Abreast<'a, T: Real, C, A, const W: usize, const H: usize, const N: usize, const P: usize> {
    bundles: [Bundle<'a, T, C, A, W, N, P>; H],
    poses: [Pose<Lanes<T, C, W>, N>; H],
    modes: [Modes<Lanes<T, C, W>, N>; H],
    spans: [Span<Lanes<T, C, W>, N>; H],
    /// Where the last step started, with sines and cosines, and what it says.
    starts: [Place<Lanes<T, C, W>, N>; H],
    turns: [[Turn<Lanes<T, C, W>>; N]; H],
    signs: [Signs<Lanes<T, C, W>, N>; H],
    clocks: [Clock<T, N>; WIDTH],
    /// Nothing in lanes that move, so much that nothing is wrong in those that have ended.
    idle: [Lanes<T, C, W>; H],
    /// Which run is in which lane, and its way; none in lanes that have ended.
    runs: [usize; WIDTH],
    ways: [Option<Way<'a, T, N>>; WIDTH],
    /// Lanes that move.
    moving: usize,
    /// The run that enters next.
    waiting: usize,
    course: Course,
    /// Whether a lane has other directions than the modes say.
    turned: bool,
    steps: usize,
    limit: T,
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const W: usize, const H: usize, const N: usize, const P: usize>
    Abreast<'a, T, C, A, W, H, N, P>
{
    /// How many lanes there are.
    const LANES: usize = W * H;

    #[inline(always)]
    pub(super) fn new(runs: &mut [Run<'a, T, A, N, P>], limit: T) -> Option<Self> {
        let plant = runs.first()?.plant;
        let zero = Lanes::of(T::zero());
        let mut lanes = Self {
            bundles: from_fn(|_| Bundle::new(plant)),
            poses: [Pose::none(); H],
            modes: [Modes::new([zero; N], [zero; N]); H],
            spans: [Span { t: zero, h: zero, tau: [[zero; N]; 3] }; H],
            starts: [Pose::none().place; H],
            turns: [Pose::none().turns; H],
            signs: [Signs::none(); H],
            clocks: [Clock::new(); WIDTH],
            runs: [0; WIDTH],
            ways: from_fn(|_| None),
            idle: [zero; H],
            moving: Self::LANES,
            waiting: 0,
            course: Course::Even,
            turned: true,
            steps: 0,
            limit,
        };
        for l in 0..Self::LANES {
            lanes.enter(runs, l);
        }
        lanes.renew_modes();
        Some(lanes)
    }

    /// Whether any lane has not ended.
    #[inline(always)]
    pub(super) fn are_moving(&self) -> bool {
        self.moving > 0
    }

    /// One step of every lane.
    #[inline(always)]
    pub(super) fn step(&mut self, runs: &mut [Run<'a, T, A, N, P>]) {
        if self.course != Course::Even {
            self.parts();
        }
        let right = if self.bundles.iter().any(Bundle::has_effects) {
            self.glide::<true, true>()
        } else if self.modes.iter().any(|modes| modes.held) {
            self.glide::<false, true>()
        } else {
            self.glide::<false, false>()
        };
        if right {
            self.arrive_all(runs);
        } else {
            self.sort_out(runs);
        }
        self.steps += 1;
        if self.steps >= AFRESH {
            for i in 0..H {
                self.poses[i] = self.bundles[i].rigid.pose(&self.poses[i].place);
            }
            self.steps = 0;
        }
    }

    /// One step of every lane with the modes it has; whether it was right in all of them.
    #[inline(always)]
    fn glide<const EFFECTS: bool, const HELD: bool>(&mut self) -> bool {
        let mut right = self.course != Course::Aimed;
        for i in 0..H {
            (self.starts[i], self.turns[i]) = (self.poses[i].place, self.poses[i].turns);
            let step = Step {
                body: &Gliding::<_, EFFECTS, HELD>(&self.bundles[i]),
                start: &self.poses[i],
                modes: &self.modes[i],
                span: &self.spans[i],
            };
            self.poses[i] = glide(&step, &mut self.signs[i]);
            let mut wrong = self.signs[i].wrong - self.idle[i];
            for j in 0..N {
                wrong = wrong.larger(self.poses[i].place.q[j].size() - Lanes::of(self.limit));
            }
            right &= wrong.none_positive();
        }
        right
    }

    /// Goes on from a step that was right in all lanes.
    #[inline(always)]
    fn arrive_all(&mut self, runs: &mut [Run<'a, T, A, N, P>]) {
        if self.course != Course::Even {
            self.clocks = [Clock::new(); WIDTH];
        }
        let mut ended = false;
        for l in 0..Self::LANES {
            if let Some(way) = &mut self.ways[l] {
                way.arrive(lane_of(&self.poses[l / W].place, l % W).q);
                match &way.interval {
                    Some(interval) => set_out(&mut self.spans[l / W], l % W, interval),
                    None => ended = true,
                }
            }
        }
        self.course = Course::Even;
        if ended {
            for l in 0..Self::LANES {
                if self.ways[l].as_ref().is_some_and(|way| way.interval.is_none()) {
                    self.end(runs, l);
                }
            }
        }
        self.renew_modes();
    }

    /// Goes on from a step after which lanes go different ways.
    #[inline(always)]
    fn sort_out(&mut self, runs: &mut [Run<'a, T, A, N, P>]) {
        self.course = Course::Parted;
        for l in 0..Self::LANES {
            if self.ways[l].is_none() {
                continue;
            }
            let right = self.clocks[l].goal.is_none() && self.signs[l / W].wrong.0[l % W] <= T::zero();
            if right || self.judge(l) {
                self.arrive(runs, l);
            }
        }
        self.renew_modes();
    }

    /// Modes of the directions as they are now.
    #[inline(always)]
    fn renew_modes(&mut self) {
        for i in 0..H {
            if self.turned {
                self.modes[i] = Modes::new(self.modes[i].direction, self.bundles[i].dry);
            } else {
                self.modes[i].fresh = false;
            }
        }
        self.turned = false;
    }

    /// Lane `l`'s place.
    #[inline(always)]
    fn place(&self, l: usize) -> Place<T, N> {
        lane_of(&self.poses[l / W].place, l % W)
    }

    /// Writes lane `l`'s positions after its interval, or ends it where they are beyond the limit.
    #[inline]
    fn arrive(&mut self, runs: &mut [Run<'a, T, A, N, P>], l: usize) {
        let q = self.place(l).q;
        let within = q.iter().all(|q| q.abs() <= self.limit);
        self.clocks[l] = Clock::new();
        if let Some(way) = &mut self.ways[l]
            && within
        {
            way.arrive(q);
            if let Some(interval) = &way.interval {
                return set_out(&mut self.spans[l / W], l % W, interval);
            }
        }
        self.end(runs, l);
    }

    /// Ends lane `l`'s run; the next one enters, if any is left.
    #[inline(never)]
    fn end(&mut self, runs: &mut [Run<'a, T, A, N, P>], l: usize) {
        runs[self.runs[l]].state = state_of(&self.place(l), &numbers(&self.modes[l / W].direction, l % W));
        self.enter(runs, l);
    }

    /// Puts the next run into lane `l`, or the lane to rest.
    #[inline(never)]
    fn enter(&mut self, runs: &mut [Run<'a, T, A, N, P>], l: usize) {
        let mut state = State::new(SVector::zeros(), SVector::zeros());
        (self.clocks[l], self.ways[l]) = (Clock::new(), None);
        while self.ways[l].is_none() && self.waiting < runs.len() {
            let run = &mut runs[self.waiting];
            (self.runs[l], self.ways[l]) = (self.waiting, Way::of(run));
            state = run.state;
            self.bundles[l / W].put(l % W, run.plant);
            self.waiting += 1;
        }
        if let Some(Way { interval: Some(interval), .. }) = &self.ways[l] {
            set_out(&mut self.spans[l / W], l % W, interval);
        } else {
            // A step of no length, of which nothing is wrong.
            self.spans[l / W].h.0[l % W] = T::zero();
            self.idle[l / W].0[l % W] = lit(IDLE);
            self.moving -= 1;
            state = State { modes: [Mode::Forward; N], ..State::new(SVector::zeros(), SVector::zeros()) };
        }
        self.turn(l, &state.modes.map(Mode::direction));
        let rigid = self.bundles[l / W].plants[l % W].rigid();
        self.put(l, &rigid.pose(&Place { q: state.q.into(), dq: state.dq.into() }));
    }

    /// Gives lane `l` other directions.
    #[inline]
    fn turn(&mut self, l: usize, direction: &[T; N]) {
        for j in 0..N {
            self.modes[l / W].direction[j].0[l % W] = direction[j];
        }
        self.turned = true;
    }

    /// Puts lane `l` into a pose.
    #[inline]
    fn put(&mut self, l: usize, own: &Pose<T, N>) {
        let (l, i) = (l % W, l / W);
        let Pose { place, turns, balance } = &mut self.poses[i];
        for j in 0..N {
            (place.q[j].0[l], place.dq[j].0[l]) = (own.place.q[j], own.place.dq[j]);
            (turns[j].sine.0[l], turns[j].cosine.0[l]) = (own.turns[j].sine, own.turns[j].cosine);
            balance.bias[j].0[l] = own.balance.bias[j];
            for k in 0..N {
                balance.inertia[j][k].0[l] = own.balance.inertia[j][k];
            }
        }
    }

    /// Sets lanes that only go a part of their interval to that.
    #[inline(never)]
    fn parts(&mut self) {
        self.course = Course::Even;
        for l in 0..Self::LANES {
            let (clock, way) = (&self.clocks[l], &self.ways[l]);
            let Some(Way { interval: Some(interval), .. }) = way else { continue };
            if clock.is_whole() {
                continue;
            }
            self.course = self.course.max(if clock.goal.is_some() { Course::Aimed } else { Course::Parted });
            let h = clock.length();
            let (span, l) = (&mut self.spans[l / W], l % W);
            (span.t.0[l], span.h.0[l]) = (interval.t + clock.done, h);
            for (i, part) in [T::zero(), lit(0.5), T::one()].into_iter().enumerate() {
                let tau = interval.torque_at(clock.done + h * part);
                for j in 0..N {
                    span.tau[i][j].0[l] = tau[j];
                }
            }
        }
    }

    /// What comes of lane `l`'s step; whether it is at the end of its interval.
    #[inline(never)]
    fn judge(&mut self, l: usize) -> bool {
        let (i, lane) = (l / W, l % W);
        let Some(Way { interval: Some(interval), .. }) = &self.ways[l] else { return false };
        if self.clocks[l].is_whole() {
            self.clocks[l].left = interval.h;
        }
        let (signs, start, end) = (&self.signs[i], &self.starts[i], &self.poses[i]);
        let Bundle { rigid, dry, plants, .. } = &self.bundles[i];
        let taken = Taken {
            places: [lane_of(start, lane), lane_of(&end.place, lane)],
            ddq: [numbers(&signs.ddq[0], lane), numbers(&signs.ddq[1], lane)],
            held: self.modes[i].held.then(|| signs.held.each_ref().map(|held| held_in(held, lane))),
            far: signs.far.0[lane],
            dry: numbers(dry, lane).map(|dry| dry != T::zero()),
            coulomb: numbers(&rigid.coulomb, lane),
            inertia: end.balance.inertia.each_ref().map(|row| numbers(row, lane)),
        };
        let clock = &mut self.clocks[l];
        let before = numbers(&self.modes[i].direction, lane);
        let mut direction = before;
        let own = plants[lane].rigid();
        let (pose, arrived) = match taken.judge(clock, &mut direction) {
            Outcome::Right => return true,
            Outcome::Again => (own.turned(&taken.places[0], turns_of(&self.turns[i], lane)), false),
            Outcome::Reversed(place) => {
                let turns = turns_of(&end.turns, lane);
                (own.near(&place, &taken.places[1].q, &turns, Reach::Beside), clock.left <= T::zero())
            }
            Outcome::Alone => {
                let mut state = state_of(&taken.places[0], &direction);
                exact(plants[lane], &mut state, interval, clock.done);
                direction = state.modes.map(Mode::direction);
                (own.pose(&Place { q: state.q.into(), dq: state.dq.into() }), true)
            }
        };
        if direction != before {
            self.turn(l, &direction);
        }
        self.put(l, &pose);
        arrived
    }
}
