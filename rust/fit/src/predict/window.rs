//! Short windows cut from logs, and the simulation of a hypothesis over them.
//!
//! Every window starts from its measured initial state and runs under the logged torque; the predicted positions of all windows lie in one
//! flat vector, row by row and joint by joint.

use crate::log::cut::cut_at_smooth_motion;
use crate::log::input::FEWEST_WINDOWS;
use crate::log::track::{InitialState, Track};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::log_inputs::LogInputs;
use crate::predict::rollouts::{DIVERGED, Rollouts, SideBySide, Singly};
use armgap_core::arm::Arm;
use armgap_core::integrate::State;
use armgap_core::plant::{Mode, Plant};
use armgap_core::rollout::Run;
use armgap_core::transmission::LatentState;
use nalgebra::SVector;

/// Length of the blocks of windows that count as independent observations, s: torques that no model describes are correlated over some tenths of a second,
/// and with them the windows of a log.
const BLOCK: f64 = 1.0;

/// Least number of blocks; a standard error from fewer is worth less than one that neglects what neighbouring windows share.
const FEWEST_WINDOW_BLOCKS: usize = 8;

/// Largest length of a block relative to `BLOCK`, as windows end where the state is measured best.
const BLOCK_SLACK: f64 = 1.1;

/// Half the time around a push, in its durations, in which it may act: half the period of the longest shape.
const PUSH_REACH: f64 = 0.8;

/// Least share of the windows that must be clear of pushes for the others to be left out.
const LEAST_CLEAR: f64 = 0.5;

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

    /// The dataset with only those windows in which no known external disturbance of their logs acts; all windows where too few are clear.
    ///
    /// A push is an unknown input, whose course is known by what the model leaves unexplained in these windows alone: what remains there says little of
    /// the arm.
    pub fn clear_of_pushes(self) -> Self {
        let (mut windows, mut rows) = (Vec::new(), 0);
        for window in self.windows.iter().filter(|w| !self.is_pushed(w)) {
            windows.push(Window { offset: rows, ..*window });
            rows += window.rows();
        }
        if windows.len() < FEWEST_WINDOWS.max((LEAST_CLEAR * self.windows.len() as f64) as usize) {
            return self;
        }
        Self { tracks: self.tracks, windows, rows }
    }

    /// Whether a known external disturbance may act in a window.
    fn is_pushed(&self, window: &Window<N>) -> bool {
        let track = &self.tracks[window.track];
        let acts = |push: &EffectInstance| {
            let [_, time, duration] = push.p;
            let reach = PUSH_REACH * duration;
            time - reach < track.t[window.last] && time + reach > track.t[window.first]
        };
        track.pushes.iter().any(acts)
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

    /// Inputs of the logs under hypotheses that differ in values alone, each beside the inputs `known` of another hypothesis; none for hypotheses that
    /// cannot be simulated.
    pub(crate) fn inputs_beside<A: Arm<f64, N, P>, const P: usize>(
        &self,
        arm: &A,
        hypotheses: &[Hypothesis<P>],
        known: &[Option<&LogInputs<N>>],
    ) -> Vec<Option<LogInputs<N>>> {
        let plants: Vec<_> = hypotheses.iter().map(|hypothesis| hypothesis.plant(arm)).collect();
        let simulated: Vec<_> = hypotheses
            .iter()
            .zip(&plants)
            .zip(known)
            .filter_map(|((hypothesis, plant), known)| Some((hypothesis, plant.as_ref()?, *known)))
            .collect();
        let mut inputs = LogInputs::of_all::<SideBySide, A, P>(self, &simulated).into_iter();
        plants.iter().map(|plant| plant.as_ref().and_then(|_| inputs.next())).collect()
    }

    /// Inputs of the logs under a hypothesis; none if it cannot be simulated.
    pub(crate) fn log_inputs<A: Arm<f64, N, P>, const P: usize>(
        &self,
        arm: &A,
        hypothesis: &Hypothesis<P>,
    ) -> Option<LogInputs<N>> {
        Some(LogInputs::new::<SideBySide, A, P>(self, hypothesis, &hypothesis.plant(arm)?, None))
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
        let inputs = LogInputs::new::<R, A, P>(self, hypothesis, &plant, known);
        let (mut batched, mut latent, mut scalar) =
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
            let runs = if plant.jumps() && self.is_near_edge(window, &plant) {
                &mut scalar
            } else if plant.is_plain() {
                &mut batched
            } else if plant.is_latent_or_regularised() {
                &mut latent
            } else {
                &mut scalar
            };
            runs.push(Run { plant: &plant, t, torque, state, positions });
        }
        R::plain(&mut batched);
        R::latent(&mut latent);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_in_which_pushes_act_are_left_out_unless_they_are_most() {
        let t: Vec<f64> = (0..800).map(|k| 0.01 * f64::from(k)).collect();
        let q: Vec<f64> = t.iter().map(|t| t.sin()).collect();
        let track = Track::<1>::new("", &t, &q, &vec![0.0; t.len()], Some([1e-5]));
        let law = armgap_core::effect::find::<f64>("external_pulse").expect("known");
        let beside = |pushes: &[[f64; 3]]| {
            let mut data = Dataset::new(vec![track.clone(), track.clone()], 0.25);
            data.tracks[1].pushes = pushes.iter().map(|p| EffectInstance::new(law, 0, *p)).collect();
            let clear = data.clone().clear_of_pushes();
            (data, clear)
        };
        let (all, clear) = beside(&[[1.0, 3.0, 0.1], [-0.5, 6.0, 0.2]]);
        for (window, kept) in all
            .windows
            .iter()
            .map(|w| (w, clear.windows.iter().find(|c| c.track == w.track && c.first == w.first)))
        {
            let [from, to] = [window.first, window.last].map(|k| t[k]);
            let acts = [(3.0, 0.1), (6.0, 0.2)]
                .iter()
                .any(|(at, long)| from < at + 0.8 * long && to > at - 0.8 * long);
            assert_eq!(kept.is_none(), window.track == 1 && acts, "{from} to {to} s of log {}", window.track);
        }
        assert_eq!(clear.measured().len(), clear.rows);
        assert!(clear.windows.iter().zip(&clear.windows[1..]).all(|(a, b)| b.offset == a.offset + a.rows()));
        let (all, same) = beside(&[[1.0, 4.0, 10.0]]);
        assert!(same.windows.len() == all.windows.len() / 2, "half of the windows are clear");
        let mut most = all;
        most.tracks[0].pushes = vec![EffectInstance::new(law, 0, [1.0, 4.0, 1.0])];
        assert_eq!(most.clone().clear_of_pushes().windows.len(), most.windows.len());
    }

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
