//! Short windows cut from logs, and the simulation of a hypothesis over them.
//!
//! Every window starts from its measured initial state and runs under the logged torque; the predicted positions of all windows lie in one
//! flat vector, row by row and joint by joint.

use crate::log::cut::cut_at_smooth_motion;
use crate::log::track::{InitialState, Track};
use crate::model::hypothesis::Hypothesis;
use crate::predict::log_inputs::LogInputs;
use armgap_core::arm::Arm;
use armgap_core::cpu::Level;
use armgap_core::integrate::{Interval, State, StepLimits, advance_in_stable_steps};
use armgap_core::plant::{Mode, Plant};
use armgap_core::rollout::{BatchRollout, ElasticRollout, Run, WIDTH};
use armgap_core::transmission::LatentState;
use nalgebra::SVector;
use rayon::prelude::*;

/// Size of a predicted position [rad or m] beyond which the rollout has diverged; the predictions from there on have this value, so that the cost
/// stays finite.
pub(crate) const DIVERGED: f64 = 1e3;

/// Largest number of sub-steps per sample for joints whose regularised friction stops them near standstill. Widths of the regularisation that need
/// more are not tried.
pub(crate) const MAX_SUBSTEPS_FRICTION: usize = 16;

/// Largest number of sub-steps per sample for motors that oscillate against their links; a stiffer hypothesis is rejected by its cost.
const MAX_SUBSTEPS_DRIVEN: usize = 5;

/// Largest number of sub-steps per sample for joints that hit a joint limit.
const MAX_SUBSTEPS_IMPACT: usize = 12;

/// Largest number of sub-steps per sample for joints whose viscous friction stops them within less than a sample, as that of a geared wrist without
/// its rotor in the model does.
const MAX_SUBSTEPS_STIFF: usize = 100;

/// Length of the blocks of windows that count as independent observations, s: torques that no model describes are correlated over some tenths of a second,
/// and with them the windows of a log.
const BLOCK: f64 = 1.0;

/// Least number of blocks; a standard error from fewer is worth less than one that neglects what neighbouring windows share.
const FEWEST_WINDOW_BLOCKS: usize = 8;

/// Largest length of a block relative to `BLOCK`, as windows end where the state is measured best.
const BLOCK_SLACK: f64 = 1.1;

/// Window of a log: samples `first ..= last` of one track, with predictions from sample `first + 1` (row 0) on.
#[derive(Debug, Clone, Copy)]
pub struct Window<const N: usize> {
    /// Index of the log, or piece of a log, that the window is cut from.
    pub track: usize,
    /// Index of the sample that the window starts from.
    pub first: usize,
    /// Index of the last predicted sample.
    pub last: usize,
    /// Index of the window's first row in the flat vector of predictions.
    pub offset: usize,
    /// Measured initial state of the window, at its first sample.
    pub initial_state: InitialState<N>,
}

impl<const N: usize> Window<N> {
    /// Number of predicted samples of the window.
    pub fn rows(&self) -> usize {
        self.last - self.first
    }

    /// Range of the window in a flat vector of `N` values per row.
    pub fn range(&self) -> std::ops::Range<usize> {
        self.offset * N..(self.offset + self.rows()) * N
    }
}

/// Logs cut into windows.
#[derive(Debug, Clone)]
pub struct Dataset<const N: usize> {
    /// Logs that the windows are cut from.
    pub tracks: Vec<Track<N>>,
    /// Windows in the order of their rows in the flat vector.
    pub windows: Vec<Window<N>>,
    /// Number of predicted samples of all windows.
    pub rows: usize,
}

impl<const N: usize> Dataset<N> {
    /// A copy of the dataset, with all known external disturbances removed from its logs.
    pub fn without_pushes(&self) -> Self {
        let mut bare = self.clone();
        bare.tracks.iter_mut().for_each(|track| track.pushes.clear());
        bare
    }

    /// Indices of the windows in blocks: consecutive windows of one track over about `BLOCK` seconds; each window alone where there would be fewer than
    /// `FEWEST_WINDOW_BLOCKS`.
    pub fn blocks(&self) -> Vec<std::ops::Range<usize>> {
        let blocks = self.blocks_of_a_length();
        if blocks.len() >= FEWEST_WINDOW_BLOCKS {
            return blocks;
        }
        (0..self.windows.len()).map(|i| i..i + 1).collect()
    }

    fn blocks_of_a_length(&self) -> Vec<std::ops::Range<usize>> {
        let mut blocks: Vec<std::ops::Range<usize>> = Vec::new();
        for (i, window) in self.windows.iter().enumerate() {
            let joins = |block: &std::ops::Range<usize>| {
                let first = &self.windows[block.start];
                let t = &self.tracks[first.track].t;
                window.track == first.track && t[window.last] - t[first.first] < BLOCK * BLOCK_SLACK
            };
            match blocks.last_mut().filter(|block| joins(block)) {
                Some(block) => block.end = i + 1,
                None => blocks.push(i..i + 1),
            }
        }
        blocks
    }

    /// The windows of one track selected by `wanted`, as a dataset of this track alone.
    pub fn of_track(&self, track: usize, wanted: impl Fn(&Window<N>) -> bool) -> Self {
        let (mut windows, mut rows) = (Vec::new(), 0);
        for window in self.windows.iter().filter(|w| w.track == track && wanted(w)) {
            windows.push(Window { track: 0, offset: rows, ..*window });
            rows += window.rows();
        }
        Self { tracks: vec![self.tracks[track].clone()], windows, rows }
    }

    /// One dataset with the windows of both.
    pub fn and(mut self, other: Self) -> Self {
        let (tracks, rows) = (self.tracks.len(), self.rows);
        let moved = |w: Window<N>| Window { track: w.track + tracks, offset: w.offset + rows, ..w };
        self.windows.extend(other.windows.into_iter().map(moved));
        self.tracks.extend(other.tracks);
        self.rows += other.rows;
        self
    }

    /// Cuts every track into windows of about `horizon` seconds, with edges where the state is measured best; a gap in the samples ends a window.
    pub fn new(tracks: Vec<Track<N>>, horizon: f64) -> Self {
        let mut windows = Vec::new();
        let mut rows = 0;
        for (index, track) in tracks.iter().enumerate() {
            for (first, last) in cut_at_smooth_motion(track, horizon) {
                windows.push(Window {
                    track: index,
                    first,
                    last,
                    offset: rows,
                    initial_state: track.initial_state(first),
                });
                rows += last - first;
            }
        }
        Self { tracks, windows, rows }
    }

    /// Measured positions of all windows, rad or m, by window, sample and joint.
    pub fn measured(&self) -> Vec<f64> {
        let samples = |w: &Window<N>| {
            let track = w.track;
            (w.first + 1..=w.last).map(move |k| (track, k))
        };
        self.windows
            .iter()
            .flat_map(samples)
            .flat_map(|(track, k)| self.tracks[track].q[k].iter().copied().collect::<Vec<_>>())
            .collect()
    }

    /// Zero offsets for all windows, that is, initial states as measured.
    pub fn zero_offsets(&self) -> Vec<InitialStateOffset<N>> {
        vec![InitialStateOffset::none(); self.windows.len()]
    }

    /// Predicted positions of all windows, rad or m, each from its measured initial state displaced by its entry of `offsets`.
    pub fn predict<A: Arm<f64, N, P>, const P: usize>(
        &self,
        arm: &A,
        hypothesis: &Hypothesis<P>,
        offsets: &[InitialStateOffset<N>],
    ) -> Vec<f64> {
        self.predict_beside(arm, hypothesis, offsets, None).0
    }

    /// Predicted positions of all windows, rad or m, and the inputs of the logs that the predictions were made with; inputs that do not differ from
    /// those `known` of another hypothesis are not computed again. No inputs for a hypothesis that cannot be simulated.
    pub(crate) fn predict_beside<A: Arm<f64, N, P>, const P: usize>(
        &self,
        arm: &A,
        hypothesis: &Hypothesis<P>,
        offsets: &[InitialStateOffset<N>],
        known: Option<&LogInputs<N>>,
    ) -> (Vec<f64>, Option<LogInputs<N>>) {
        self.predict_by::<SideBySide, A, P>(arm, hypothesis, offsets, known)
    }

    /// Inputs of the logs under a hypothesis; none if it cannot be simulated.
    pub(crate) fn log_inputs<A: Arm<f64, N, P>, const P: usize>(
        &self,
        arm: &A,
        hypothesis: &Hypothesis<P>,
    ) -> Option<LogInputs<N>> {
        Some(LogInputs::new(self, hypothesis, &hypothesis.plant(arm)?, None))
    }

    /// Predicted positions of all windows, rad or m, one rollout at a time: for arms whose long equation of motion gains nothing from vector lanes.
    pub fn predict_singly<A: Arm<f64, N, P>, const P: usize>(
        &self,
        arm: &A,
        hypothesis: &Hypothesis<P>,
    ) -> Vec<f64> {
        self.predict_by::<Singly, A, P>(arm, hypothesis, &self.zero_offsets(), None).0
    }

    /// Predicted positions of all windows, rad or m, with the rollouts simulated by the method `R`, and the inputs of the logs.
    fn predict_by<R: Rollouts, A: Arm<f64, N, P>, const P: usize>(
        &self,
        arm: &A,
        hypothesis: &Hypothesis<P>,
        offsets: &[InitialStateOffset<N>],
        known: Option<&LogInputs<N>>,
    ) -> (Vec<f64>, Option<LogInputs<N>>) {
        let mut predicted = vec![DIVERGED; self.rows * N];
        let Some(plant) = hypothesis.plant(arm) else {
            return (predicted, None);
        };
        let inputs = LogInputs::new(self, hypothesis, &plant, known);
        let (mut batched, mut elastic, mut scalar) =
            (Vec::with_capacity(self.windows.len()), Vec::new(), Vec::new());
        let mut rest = predicted.as_mut_slice();
        for (window, shift) in self.windows.iter().zip(offsets) {
            let (positions, after) = rest.split_at_mut(window.rows() * N);
            rest = after;
            let track = &self.tracks[window.track];
            let torque = inputs.torques(window.track, track);
            let shown = window.initial_state.q + shift.q - shift.zero;
            let mut state = hypothesis.initial_state(shown, window.initial_state.dq + shift.dq);
            if let Some(states) = inputs.latent(window.track) {
                enter(&plant, &mut state, &states[window.first]);
            }
            let (t, torque) = (&track.t[window.first..=window.last], &torque[window.first..window.last]);
            let runs =
                if plant.only_modes_change() || (plant.is_plain() && !self.is_near_edge(window, &plant)) {
                    &mut batched
                } else if plant.is_elastic_or_regularised() {
                    &mut elastic
                } else {
                    &mut scalar
                };
            runs.push(Run { plant: &plant, t, torque, state, positions });
        }
        R::plain(&mut batched);
        R::elastic(&mut elastic);
        R::scalar(&mut scalar);
        if hypothesis.distorts() {
            for row in predicted.chunks_exact_mut(N) {
                for (j, q) in row.iter_mut().enumerate().filter(|(_, q)| **q < DIVERGED) {
                    *q = hypothesis.measured(j, *q);
                }
            }
        }
        for (window, shift) in self.windows.iter().zip(offsets) {
            if shift.zero.iter().all(|zero| *zero == 0.0) {
                continue;
            }
            for row in predicted[window.range()].chunks_exact_mut(N) {
                for (q, zero) in row.iter_mut().zip(&shift.zero).filter(|(q, _)| **q < DIVERGED) {
                    *q += zero;
                }
            }
        }
        (predicted, Some(inputs))
    }

    /// Whether a joint comes close to a position at which its torque jumps, such as a joint limit, in the measured motion of a window.
    fn is_near_edge<A: Arm<f64, N, P>, const P: usize>(
        &self,
        window: &Window<N>,
        plant: &Plant<f64, A, N, P>,
    ) -> bool {
        let q = &self.tracks[window.track].q[window.first..=window.last];
        (0..N).filter(|j| plant.edges(*j).next().is_some()).any(|j| {
            let low = q.iter().map(|q| q[j]).fold(f64::INFINITY, f64::min);
            let high = q.iter().map(|q| q[j]).fold(f64::NEG_INFINITY, f64::max);
            let margin = NEAR_EDGE * (high - low);
            plant.edges(j).any(|edge| (low - margin..=high + margin).contains(&edge.position))
        })
    }
}

/// Offset of a window's initial state from the measured one, and the zero of its log's encoders.
#[derive(Debug, Clone, Copy)]
pub struct InitialStateOffset<const N: usize> {
    /// Displacement of the initial positions from the measured ones, rad or m.
    pub q: SVector<f64, N>,
    /// Displacement of the initial velocities from the measured ones, rad/s or m/s.
    pub dq: SVector<f64, N>,
    /// Encoder zero of each joint, rad or m: what the encoder shows where the model's position is zero.
    pub zero: SVector<f64, N>,
}

impl<const N: usize> InitialStateOffset<N> {
    /// Zero offset of an initial state, with zero encoder zeros.
    pub fn none() -> Self {
        Self { q: SVector::zeros(), dq: SVector::zeros(), zero: SVector::zeros() }
    }
}

/// Distance beyond a window's measured travel, relative to this travel, within which a prediction may reach a discontinuity of the torque.
const NEAR_EDGE: f64 = 0.3;

/// Method of simulating the rollouts of many windows.
trait Rollouts {
    /// Simulates rollouts of a plant in which nothing but friction modes changes ([`Plant::is_plain`]).
    fn plain<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]);

    /// Simulates rollouts of a plant with elastic joints or regularised friction ([`Plant::is_elastic_or_regularised`]).
    fn elastic<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]);

    /// Simulates rollouts of any plant.
    fn scalar<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]);
}

/// Rollouts in vector lanes, several at a time.
struct SideBySide;

impl Rollouts for SideBySide {
    fn plain<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        let level = Level::widest();
        runs.par_chunks_mut(GROUP).for_each(|runs| BatchRollout { runs, limit: DIVERGED }.run_all(level));
    }

    fn elastic<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        let level = Level::widest();
        let Some(step_limits) = runs.first().map(|run| step_limits(run.plant)) else { return };
        runs.par_chunks_mut(GROUP)
            .for_each(|runs| ElasticRollout { runs, limit: DIVERGED, step_limits }.run_all(level));
    }

    fn scalar<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        runs.par_chunks_mut(WIDTH).for_each(|group| group.iter_mut().for_each(|run| run_scalar(run, false)));
    }
}

/// Rollouts one at a time.
struct Singly;

impl Rollouts for Singly {
    fn plain<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        Self::scalar(runs);
    }

    fn elastic<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        Self::scalar(runs);
    }

    fn scalar<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        runs.par_iter_mut().for_each(|run| run_scalar(run, true));
    }
}

/// Number of rollouts simulated as one group over vector lanes: enough that few lanes are idle at the end.
const GROUP: usize = 4 * WIDTH;

/// Adds latent states to a state whose positions are those that the encoders show: where the encoder is on the motor, the deflection is subtracted
/// from the shown position to give that of the link.
pub(crate) fn enter<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    plant: &Plant<f64, A, N, P>,
    state: &mut State<f64, N>,
    latent: &LatentState<f64, N>,
) {
    for j in (0..N).filter(|j| plant.drivetrain().sides(*j).encoder_at_motor) {
        state.q[j] -= latent.deflection[j];
        state.dq[j] -= latent.deflection_rate[j];
    }
    state.latent = LatentState { anchor: state.q, ..*latent };
    state.modes = std::array::from_fn(|j| {
        Mode::of(plant.drivetrain().friction_velocity(j, state.dq[j], &state.latent))
    });
}

/// Simulates one rollout by the scalar integrator, with as many steps per sample as its plant needs; with `resolves_viscous`, steps are short against
/// the time in which viscous friction stops a joint.
fn run_scalar<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    run: &mut Run<'_, f64, A, N, P>,
    resolves_viscous: bool,
) {
    let mut limits = step_limits(run.plant);
    if resolves_viscous {
        limits.elsewhere = limits.elsewhere.max(MAX_SUBSTEPS_STIFF);
    }
    let measures_motors = run.plant.drivetrain().measures_motors();
    let state = &mut run.state;
    for (k, row) in run.positions.chunks_exact_mut(N).enumerate() {
        let h = run.t[k + 1] - run.t[k];
        let mut rates = run.plant.step_rates(&state.q);
        if run.plant.jumps() {
            rates = rates.max(run.plant.step_rates(&(state.q + state.dq * h)));
        }
        if resolves_viscous {
            rates.elsewhere = rates.elsewhere.max(VISCOUS_STEPS * run.plant.viscous_rate(&state.q));
        }
        let interval = Interval { t: run.t[k], h, torque: &run.torque[k] };
        advance_in_stable_steps(run.plant, state, &interval, &rates, limits);
        if !state.is_finite() || state.q.amax() > DIVERGED {
            break;
        }
        if measures_motors {
            row.copy_from_slice(run.plant.drivetrain().shown(&state.q, &state.latent).as_slice());
        } else {
            row.copy_from_slice(state.q.as_slice());
        }
    }
}

/// Number of steps, relative to what stability needs, in which a joint is simulated that viscous friction stops within some samples: the speed that
/// Runge-Kutta leaves after a step is off by 6e-5 of the speed before it, where the longest stable step leaves 5e-2.
const VISCOUS_STEPS: f64 = 4.0;

/// Largest numbers of sub-steps per sample for a plant.
fn step_limits<A: Arm<f64, N, P>, const N: usize, const P: usize>(plant: &Plant<f64, A, N, P>) -> StepLimits {
    let elsewhere = match (plant.jumps(), plant.drivetrain().any()) {
        (true, _) => MAX_SUBSTEPS_IMPACT,
        (false, true) => MAX_SUBSTEPS_DRIVEN,
        (false, false) => 1,
    };
    StepLimits { near_standstill: MAX_SUBSTEPS_FRICTION, elsewhere }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_last_a_second_and_end_with_their_log() {
        let track = |count: u32| {
            let t: Vec<f64> = (0..count).map(|k| 0.01 * f64::from(k)).collect();
            let q: Vec<f64> = t.iter().map(|t| t.sin()).collect();
            Track::<1>::new("", &t, &q, &vec![0.0; t.len()], Some([1e-5]))
        };
        let data = Dataset::new(vec![track(800), track(150)], 0.25);
        let blocks = data.blocks();
        assert_eq!(blocks.iter().map(std::ops::Range::len).sum::<usize>(), data.windows.len());
        assert!(blocks.windows(2).all(|pair| pair[0].end == pair[1].start));
        for block in &blocks {
            let (first, last) = (&data.windows[block.start], &data.windows[block.end - 1]);
            let t = &data.tracks[first.track].t;
            assert_eq!(first.track, last.track);
            assert!(t[last.last] - t[first.first] < BLOCK * BLOCK_SLACK);
        }
        assert_eq!(blocks.len(), 8 + 2);
        for few in [Dataset::new(vec![track(1900)], 2.0), Dataset::new(vec![track(300)], 0.25)] {
            assert_eq!(few.blocks().len(), few.windows.len());
        }
    }
}
