//! Many runs together, one in each lane of a vector unit.
//!
//! Each run has its own plant, start, times and torques. A step is taken by all lanes at once with the friction modes they have
//! ([`crate::glide`]); a lane whose modes change within it takes that step alone ([`crate::integrate`]) and goes back into its lane. A
//! run whose plant has more to it than friction modes, or that has no neighbours, is made alone from start to end.

use crate::arm::Arm;
use crate::cpu::{Cpu, Level, Work};
use crate::effect::{Hooks, JointPoint, Pulse};
use crate::glide::{Body, Glided, Instant, Modes, Place, Pose, Rigid, Span, glide};
use crate::integrate::{Interval, State, exact};
use crate::lanes::Lanes;
use crate::number::Number;
use crate::plant::{Mode, Plant};
use crate::real::Real;
use nalgebra::SVector;

/// Runs taken together.
pub const WIDTH: usize = 8;

type Wide<T, C> = Lanes<T, C, WIDTH>;

/// One run: from `state` at the first of the times to the last.
pub struct Run<'a, T: Real, A, const N: usize, const P: usize> {
    /// What moves; [`Plant::glides`].
    pub plant: &'a Plant<T, A, N, P>,
    /// Sample times, s.
    pub t: &'a [T],
    /// Torques from each sample to the next.
    pub torque: &'a [[Pulse<T>; N]],
    /// State at the first sample; once the run is made, where it ended.
    pub state: State<T, N>,
    /// Positions at all further samples, `N` for each; those after a run has left the limit stay as they are.
    pub positions: &'a mut [T],
}

/// Makes up to [`WIDTH`] runs; each ends where a position exceeds `limit` or is no number.
pub struct Together<'r, 'a, T: Real, A, const N: usize, const P: usize> {
    /// The runs.
    pub runs: &'r mut [Run<'a, T, A, N, P>],
    /// Largest position.
    pub limit: T,
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Together<'_, '_, T, A, N, P> {
    /// Makes them with these instructions.
    pub fn make(self, level: Level) {
        level.run_wide(self);
    }
}

impl<T: Real, A: Arm<T, N, P>, const N: usize, const P: usize> Work for Together<'_, '_, T, A, N, P> {
    type Output = ();

    #[inline(always)]
    fn run<C: Cpu>(self) {
        let rows = self.runs.iter().map(|run| run.torque.len().min(run.positions.len() / N)).max();
        let Some(mut lanes) = Abreast::<T, C, A, N, P>::new(self.runs, self.limit) else { return };
        for k in 0..rows.unwrap_or(0) {
            lanes.step(self.runs, k);
        }
        lanes.leave(self.runs);
    }
}

/// Plants side by side.
struct Bundle<'a, T: Real, C, A, const N: usize, const P: usize> {
    plants: [&'a Plant<T, A, N, P>; WIDTH],
    rigid: Rigid<Wide<T, C>, A, N, P>,
    /// One plant in all lanes.
    alike: bool,
    /// Hooks in use on each joint, in any lane.
    hooks: [Hooks; N],
    /// 1 where a joint has dry friction.
    dry: [Wide<T, C>; N],
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const N: usize, const P: usize> Bundle<'a, T, C, A, N, P> {
    fn new(plants: [&'a Plant<T, A, N, P>; WIDTH]) -> Self {
        let gather = |of: &dyn Fn(&Rigid<T, A, N, P>) -> T| Lanes::new(plants.map(|plant| of(plant.rigid())));
        let rigid = Rigid {
            arm: plants[0].rigid().arm.clone(),
            theta: core::array::from_fn(|i| gather(&|r| r.theta[i])),
            viscous: core::array::from_fn(|j| gather(&|r| r.viscous[j])),
            coulomb: core::array::from_fn(|j| gather(&|r| r.coulomb[j].max(T::zero()))),
            added: core::array::from_fn(|i| core::array::from_fn(|j| gather(&|r| r.added[i][j]))),
            tilt: gather(&|r| r.tilt),
        };
        let alike = plants.iter().all(|plant| core::ptr::eq(*plant, plants[0]));
        let hooks = core::array::from_fn(|j| Hooks {
            force: plants.iter().any(|plant| plant.hooks(j).force),
            coulomb: plants.iter().any(|plant| plant.hooks(j).coulomb),
            ..Hooks::NONE
        });
        let dry = core::array::from_fn(|j| Lanes::new(plants.map(|plant| plant.dry(j))));
        Self { plants, rigid, alike, hooks, dry }
    }

    /// Coulomb levels of sliding joints, and torques of the effects.
    #[inline(never)]
    fn laws(
        &self,
        at: &Instant<'_, Wide<T, C>, N>,
        direction: &[Wide<T, C>; N],
        j: usize,
    ) -> [Wide<T, C>; 2] {
        let mut x = [self.point(at, j, 0); WIDTH];
        for l in 1..WIDTH {
            x[l] = self.point(at, j, l);
        }
        let (mut level, mut force) = (self.rigid.coulomb[j], Wide::of(T::zero()));
        if self.hooks[j].coulomb {
            level = self.levels(&x, direction[j], j);
        }
        if self.hooks[j].force {
            for l in 0..WIDTH {
                x[l].other = direction[(j + 1) % N].0[l];
            }
            force = self.forces(&x, j);
        }
        [level, force]
    }

    #[inline]
    fn point(&self, at: &Instant<'_, Wide<T, C>, N>, j: usize, l: usize) -> JointPoint<T> {
        let Place { q, dq } = &at.pose.place;
        self.plants[l].point(
            j,
            at.t.0[l],
            q[j].0[l],
            dq[j].0[l],
            at.tau[j].0[l],
            at.pose.balance.bias[j].0[l],
        )
    }

    /// Coulomb levels of joint `j` in the lanes where it slides.
    #[inline]
    fn levels(&self, x: &[JointPoint<T>; WIDTH], direction: Wide<T, C>, j: usize) -> Wide<T, C> {
        let mut levels = self.rigid.coulomb[j];
        if !self.alike {
            for l in 0..WIDTH {
                levels.0[l] = self.plants[l].level(j, &x[l], direction.0[l]);
            }
            return levels;
        }
        let (mut sliding, mut count) = ([0; WIDTH], 0);
        let (mut points, mut along, mut sums) = (*x, direction.0, [T::zero(); WIDTH]);
        for l in 0..WIDTH {
            if direction.0[l] != T::zero() {
                (sliding[count], points[count], along[count]) = (l, x[l], direction.0[l]);
                sums[count] = self.plants[0].rigid().coulomb[j];
                count += 1;
            }
        }
        for effect in self.plants[0].effects() {
            if effect.joint == j && effect.law.spec().hooks.coulomb {
                effect.law.add_coulombs(&effect.p, &points[..count], &along[..count], &mut sums[..count]);
            }
        }
        for i in 0..count {
            levels.0[sliding[i]] = sums[i].max(T::zero());
        }
        levels
    }

    /// Torques of the effects on joint `j`.
    #[inline]
    fn forces(&self, x: &[JointPoint<T>; WIDTH], j: usize) -> Wide<T, C> {
        let mut sums = [T::zero(); WIDTH];
        if self.alike {
            for effect in self.plants[0].effects() {
                if effect.joint == j && effect.law.spec().hooks.force {
                    effect.law.add_forces(&effect.p, x, &mut sums);
                }
            }
        } else {
            for l in 0..WIDTH {
                sums[l] = self.plants[l].force(j, &x[l]);
            }
        }
        Lanes::new(sums)
    }

    /// By how much holding joint `j` takes more than friction gives, in the lanes where it is stuck.
    #[inline(never)]
    fn excesses(
        &self,
        at: &Instant<'_, Wide<T, C>, N>,
        holding: Wide<T, C>,
        direction: Wide<T, C>,
        j: usize,
    ) -> Wide<T, C> {
        let mut excess = Wide::of(T::zero());
        for l in 0..WIDTH {
            if direction.0[l] == T::zero() {
                let (t, q, tau) = (at.t.0[l], at.pose.place.q[j].0[l], at.tau[j].0[l]);
                excess.0[l] = self.plants[l].excess(j, t, q, tau, holding.0[l]).0;
            }
        }
        excess
    }
}

impl<T: Real, C: Cpu, A: Arm<T, N, P>, const N: usize, const P: usize> Body<Wide<T, C>, N>
    for Bundle<'_, T, C, A, N, P>
{
    #[inline(always)]
    fn near(
        &self,
        known: &Pose<Wide<T, C>, N>,
        place: &Place<Wide<T, C>, N>,
    ) -> (Pose<Wide<T, C>, N>, Wide<T, C>) {
        self.rigid.near(known, place)
    }

    #[inline(always)]
    fn dry(&self, j: usize) -> Wide<T, C> {
        self.dry[j]
    }

    #[inline(always)]
    fn pull(&self, at: &Instant<'_, Wide<T, C>, N>, direction: &[Wide<T, C>; N]) -> [Wide<T, C>; N] {
        let mut pull = *at.tau;
        for j in 0..N {
            pull[j] = (-self.rigid.viscous[j]).fused(at.pose.place.dq[j], pull[j] - at.pose.balance.bias[j]);
            if self.hooks[j].force || self.hooks[j].coulomb {
                let [level, force] = self.laws(at, direction, j);
                pull[j] = (-level).fused(direction[j], pull[j] + force);
            } else {
                pull[j] = (-self.rigid.coulomb[j]).fused(direction[j], pull[j]);
            }
        }
        pull
    }

    #[inline(always)]
    fn excess(
        &self,
        at: &Instant<'_, Wide<T, C>, N>,
        holding: &[Wide<T, C>; N],
        direction: &[Wide<T, C>; N],
    ) -> [Wide<T, C>; N] {
        let mut excess = *holding;
        for j in 0..N {
            excess[j] = if self.hooks[j].coulomb {
                self.excesses(at, holding[j], direction[j], j)
            } else {
                let slides = direction[j] * direction[j];
                (holding[j].size() - self.rigid.coulomb[j]) * (Wide::of(T::one()) - slides)
            };
        }
        excess
    }
}

/// Steps after which sines and cosines that were turned on step by step are computed afresh.
const AFRESH: usize = 64;

/// The lanes' states on their way.
struct Abreast<'a, T: Real, C, A, const N: usize, const P: usize> {
    bundle: Bundle<'a, T, C, A, N, P>,
    pose: Pose<Wide<T, C>, N>,
    modes: Modes<Wide<T, C>, N>,
    /// Samples of each lane; none once it has left the limit.
    rows: [usize; WIDTH],
    limit: T,
}

impl<'a, T: Real, C: Cpu, A: Arm<T, N, P>, const N: usize, const P: usize> Abreast<'a, T, C, A, N, P> {
    #[inline(always)]
    fn new(runs: &[Run<'a, T, A, N, P>], limit: T) -> Option<Self> {
        let first = runs.first()?;
        let of = |l: usize| runs.get(l).unwrap_or(first);
        let bundle = Bundle::new(core::array::from_fn(|l| of(l).plant));
        let zero = Wide::of(T::zero());
        let mut place = Place { q: [zero; N], dq: [zero; N] };
        let mut direction = [zero; N];
        let mut rows = [0; WIDTH];
        for l in 0..WIDTH {
            enter(&mut place, &mut direction, l, &of(l).state);
            rows[l] = runs.get(l).map_or(0, |run| run.torque.len().min(run.positions.len() / N));
        }
        let pose = bundle.rigid.pose(&place);
        Some(Self { bundle, pose, modes: Modes::new(direction), rows, limit })
    }

    /// All lanes over the interval after sample `k`.
    #[inline(always)]
    fn step(&mut self, runs: &mut [Run<'a, T, A, N, P>], k: usize) {
        let span = self.span(runs, k);
        let Glided { pose, wrong } = glide(&self.bundle, &self.pose, &self.modes, &span);
        let start = self.pose.place;
        self.pose = pose;
        let mut alone = false;
        for l in 0..WIDTH.min(runs.len()) {
            let right = wrong.0[l] <= T::zero();
            if !right && k < self.rows[l] {
                alone = true;
                self.step_alone(runs, k, l, &start);
            }
        }
        if alone {
            self.modes = Modes::new(self.modes.direction);
        }
        if alone || k % AFRESH == AFRESH - 1 {
            self.pose = self.bundle.rigid.pose(&self.pose.place);
        }
        for (l, run) in runs.iter_mut().enumerate() {
            if k < self.rows[l] {
                self.note(run, k, l);
            }
        }
    }

    /// Times and torques of the interval after sample `k`; of no length for lanes that have ended.
    #[inline(always)]
    fn span(&self, runs: &[Run<'a, T, A, N, P>], k: usize) -> Span<Wide<T, C>, N> {
        let zero = Wide::of(T::zero());
        let mut span = Span { t: zero, h: zero, tau: [[zero; N]; 3] };
        for (l, run) in runs.iter().enumerate() {
            if k < self.rows[l] {
                let (t, end) = (run.t[k], run.t[k + 1]);
                (span.t.0[l], span.h.0[l]) = (t, end - t);
                for j in 0..N {
                    let Pulse { start, middle, end } = run.torque[k][j];
                    span.tau[0][j].0[l] = start;
                    span.tau[1][j].0[l] = middle;
                    span.tau[2][j].0[l] = end;
                }
            }
        }
        span
    }

    /// Lane `l` over the interval after sample `k`, from mode change to mode change.
    #[inline(never)]
    fn step_alone(&mut self, runs: &[Run<'a, T, A, N, P>], k: usize, l: usize, start: &Place<Wide<T, C>, N>) {
        let run = &runs[l];
        let mut state = taken_out(start, &self.modes.direction, l);
        let interval = Interval { t: run.t[k], h: run.t[k + 1] - run.t[k], torque: &run.torque[k] };
        exact(run.plant, &mut state, &interval);
        enter(&mut self.pose.place, &mut self.modes.direction, l, &state);
    }

    /// Writes lane `l`'s positions after the interval, or ends it.
    #[inline(always)]
    fn note(&mut self, run: &mut Run<'a, T, A, N, P>, k: usize, l: usize) {
        let mut within = true;
        for j in 0..N {
            within &= self.pose.place.q[j].0[l].abs() <= self.limit;
        }
        if !within {
            self.rows[l] = 0;
            return;
        }
        for j in 0..N {
            run.positions[k * N + j] = self.pose.place.q[j].0[l];
        }
    }

    /// Hands the final states back.
    fn leave(&self, runs: &mut [Run<'a, T, A, N, P>]) {
        for (l, run) in runs.iter_mut().enumerate().take(WIDTH) {
            run.state = taken_out(&self.pose.place, &self.modes.direction, l);
        }
    }
}

/// Puts a state into lane `l`.
#[inline]
fn enter<T: Real, C: Cpu, const N: usize>(
    place: &mut Place<Wide<T, C>, N>,
    direction: &mut [Wide<T, C>; N],
    l: usize,
    state: &State<T, N>,
) {
    for j in 0..N {
        place.q[j].0[l] = state.q[j];
        place.dq[j].0[l] = state.dq[j];
        direction[j].0[l] = state.modes[j].direction();
    }
}

/// The state in lane `l`.
#[inline]
fn taken_out<T: Real, C: Cpu, const N: usize>(
    place: &Place<Wide<T, C>, N>,
    direction: &[Wide<T, C>; N],
    l: usize,
) -> State<T, N> {
    let q = SVector::from_fn(|j, _| place.q[j].0[l]);
    let mut state = State::new(q, SVector::from_fn(|j, _| place.dq[j].0[l]));
    for j in 0..N {
        state.modes[j] = Mode::of(direction[j].0[l]);
    }
    state
}
