//! One log, ready to be simulated against: times, positions, held torques, and what its noise looks like.

use crate::latent_states::MeasuredState;
use crate::model::EffectInstance;
use crate::noise::noise;
use crate::smooth::{Local, local_cubic};
use armgap_core::effect::InputSegment;
use nalgebra::SVector;
use std::sync::OnceLock;

/// Half widths, in samples, that a local cubic may have.
const HALF_WIDTHS: [usize; 8] = [3, 4, 6, 8, 11, 15, 20, 27];

/// Half width of the confidence intervals that successive widths must share, in standard deviations.
const CONFIDENCE: f64 = 2.0;

/// Mean square errors of a measured state, in units of its variance, are kept within these: one estimate from one window is no better
/// known, and beyond the larger the positions are not what the arm did.
const LEAST_ERROR: f64 = 0.25;
const LARGEST_ERROR: f64 = 10.0;

/// A log of `N` joints.
#[derive(Debug, Clone)]
pub struct Track<const N: usize> {
    /// Name in results.
    pub name: String,
    /// Sample times, s, increasing; starts where the log starts.
    pub t: Vec<f64>,
    /// Measured positions.
    pub q: Vec<SVector<f64, N>>,
    /// Commanded torque, held until the next sample.
    pub held: Vec<[InputSegment<f64>; N]>,
    /// Standard deviation of the position measurement, per joint.
    pub noise: [f64; N],
    /// Whether its samples are held over several rows, per joint.
    pub is_held: [bool; N],
    /// Smallest step of the position measurement, per joint; zero where none is seen.
    pub step: [f64; N],
    /// Known external disturbances.
    pub pushes: Vec<EffectInstance>,
    /// Torque per unit of size of each custom effect, sample by sample.
    pub tables: Vec<Vec<f64>>,
    /// Smoothed motion, once it is asked for.
    path: OnceLock<Vec<MeasuredState<N>>>,
}

/// A measured initial state: position and velocity of each joint with their covariance.
#[derive(Debug, Clone, Copy)]
pub struct InitialState<const N: usize> {
    /// Positions.
    pub q: SVector<f64, N>,
    /// Velocities.
    pub dq: SVector<f64, N>,
    /// Per joint: variance of position, covariance, variance of velocity.
    pub covariance: [[f64; 3]; N],
    /// Per joint: mean square error of position and of velocity, bias of the local cubic included, in units of their variance.
    pub mean_square: [[f64; 2]; N],
}

impl<const N: usize> Track<N> {
    /// A track from columns; `counts_per_rev` gives encoder steps where the arm file knows them.
    pub fn new(name: &str, t: &[f64], q: &[f64], tau: &[f64], steps: Option<[f64; N]>) -> Self {
        let rows = |x: &[f64]| -> Vec<[f64; N]> {
            x.chunks_exact(N).map(|row| std::array::from_fn(|j| row[j])).collect()
        };
        let mut track = Self {
            name: name.to_owned(),
            t: t.to_vec(),
            q: rows(q).into_iter().map(SVector::from).collect(),
            held: rows(tau).into_iter().map(|row| row.map(InputSegment::held)).collect(),
            noise: [0.0; N],
            is_held: [false; N],
            step: [0.0; N],
            pushes: Vec::new(),
            tables: Vec::new(),
            path: OnceLock::new(),
        };
        for j in 0..N {
            let column = track.column(j);
            track.step[j] = steps.map_or_else(|| smallest_step(&column), |s| s[j]);
            let found = noise(&track.t, &column, track.step[j]);
            (track.noise[j], track.is_held[j]) = (found.sigma, found.is_held);
        }
        track
    }

    /// Replaces held torques by straight lines of the same mean and these first moments about the middle of each interval.
    pub fn with_moments(mut self, moments: Option<&[f64]>) -> Self {
        let Some(moments) = moments else { return self };
        for (k, row) in moments.chunks_exact(N).enumerate() {
            let Some(h) = self.t.get(k + 1).map(|next| next - self.t[k]) else { break };
            for (segment, moment) in self.held[k].iter_mut().zip(row) {
                *segment = InputSegment::with_moment(segment.mean(), *moment, h);
            }
        }
        self
    }

    /// Adds the torques of the custom effects to the log.
    pub fn with_tables(mut self, tables: Vec<Vec<f64>>) -> Self {
        self.tables = tables;
        self
    }

    /// One track of pieces that follow each other in time.
    pub fn joined(pieces: &[&Self]) -> Option<Self> {
        let (first, rest) = pieces.split_first()?;
        let mut whole = Self { path: OnceLock::new(), pushes: Vec::new(), ..(*first).clone() };
        for piece in rest {
            whole.t.extend(&piece.t);
            whole.q.extend(&piece.q);
            whole.held.extend(&piece.held);
            for (table, more) in whole.tables.iter_mut().zip(&piece.tables) {
                table.extend(more);
            }
        }
        Some(whole)
    }

    /// Positions of one joint.
    pub fn column(&self, j: usize) -> Vec<f64> {
        self.q.iter().map(|q| q[j]).collect()
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Median sample period, s.
    pub fn period(&self) -> f64 {
        median(self.t.windows(2).map(|w| w[1] - w[0]).collect())
    }

    /// The measured state at a sample, from a local cubic in each joint.
    pub fn initial_state(&self, at: usize) -> InitialState<N> {
        let mut start = InitialState {
            q: self.q[at],
            dq: SVector::zeros(),
            covariance: [[0.0; 3]; N],
            mean_square: [[1.0; 2]; N],
        };
        for j in 0..N {
            let (local, wider) = self.nested(j, at);
            start.mean_square[j] = self.mean_square(j, at, &local, &wider);
            let variance = self.noise[j] * self.noise[j];
            (start.q[j], start.dq[j]) = (local.q, local.dq);
            start.covariance[j] = local.covariance.map(|c| c * variance);
        }
        start
    }

    /// Smoothed motion at every sample.
    pub fn path(&self) -> &[MeasuredState<N>] {
        self.path.get_or_init(|| {
            let moving = |k: usize| {
                let locals: [Local; N] = std::array::from_fn(|j| self.local(j, k));
                MeasuredState {
                    q: SVector::from_fn(|j, _| locals[j].q),
                    dq: SVector::from_fn(|j, _| locals[j].dq),
                }
            };
            (0..self.len()).map(moving).collect()
        })
    }

    /// The local cubic of joint `j` around a sample, as wide as the motion there allows.
    ///
    /// Widths grow while the confidence intervals of their velocities still have a point in common; a jump of the acceleration
    /// nearby ends that early, smooth motion late (intersection of confidence intervals, Goldenshluger and Nemirovski 1997). The
    /// widest that passes may still err by several of its standard deviations, as its neighbours cannot tell; the one before
    /// errs by a third of that and has the larger deviation, so it is the one that keeps what its covariance promises.
    pub fn local(&self, j: usize, at: usize) -> Local {
        self.nested(j, at).0
    }

    /// That local cubic, and the widest that passes.
    fn nested(&self, j: usize, at: usize) -> (Local, Local) {
        let fit = |half: usize| local_cubic(&self.t, |k| self.q[k][j], at, half);
        let mut widest = fit(HALF_WIDTHS[0]);
        let mut before = widest;
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for half in HALF_WIDTHS.into_iter().filter(|half| 2 * half < self.len()) {
            let local = fit(half);
            let radius = CONFIDENCE * self.noise[j] * local.covariance[2].sqrt();
            (low, high) = (low.max(local.dq - radius), high.min(local.dq + radius));
            if low > high {
                break;
            }
            (before, widest) = (widest, local);
        }
        (before, widest)
    }

    /// Mean square error of a local cubic's position and velocity in units of their variance: what it leaves of its samples is more than
    /// noise where no cubic passes through the motion, and so is its distance from the sample itself, and from a wider cubic.
    ///
    /// Where positions are held, what a cubic leaves says nothing about the motion.
    fn mean_square(&self, j: usize, at: usize, local: &Local, wider: &Local) -> [f64; 2] {
        if self.is_held[j] {
            return [1.0; 2];
        }
        let noise = self.noise[j].powi(2);
        let [vq, _, vdq] = local.covariance;
        let misfit = local.misfit / noise;
        let position = ((self.q[at][j] - local.q).powi(2) / noise - (1.0 - vq)) / vq;
        let velocity = ((local.dq - wider.dq).powi(2) / noise - (vdq - wider.covariance[2])) / vdq;
        [position, velocity].map(|bias| (misfit + bias).clamp(LEAST_ERROR, LARGEST_ERROR))
    }
}

/// Median of a list; zero for an empty one.
pub fn median(mut x: Vec<f64>) -> f64 {
    if x.is_empty() {
        return 0.0;
    }
    x.sort_by(f64::total_cmp);
    x[x.len() / 2]
}

/// Smallest non-zero difference that repeats throughout a column, if the column sits on such a grid.
fn smallest_step(q: &[f64]) -> f64 {
    let mut steps: Vec<f64> = q.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 1e-12).collect();
    if steps.len() < 20 {
        return 0.0;
    }
    steps.sort_by(f64::total_cmp);
    let step = steps[steps.len() / 200];
    let on_grid = steps.iter().filter(|d| ((*d / step).round() * step - *d).abs() < 0.05 * step).count();
    if on_grid * 10 > steps.len() * 9 { step } else { 0.0 }
}
