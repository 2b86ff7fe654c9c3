//! Simulation of a hypothesis under given torques, with sub-steps chosen from an error tolerance.

use crate::model::arm::{ArmDescription, WithArm};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::progress::{Phase, ProgressReporter};
use armgap_core::arm::Arm;
use armgap_core::effect::{InputSegment, interval};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::kinematics::JointState;
use nalgebra::SVector;
use rayon::prelude::*;
use std::ops::Range;

/// Sub-steps per sample beyond which the error tolerance of a simulation is given up, by default.
pub const MAX_SUBSTEPS: usize = 256;

/// Samples of a simulation between two checks for progress and cancellation.
const LOOK: usize = 4096;

/// Input of a simulation: sample times, torques, initial state, effects and tolerance.
#[derive(Clone)]
pub struct Simulation<'a> {
    /// Sample times, s.
    pub t: &'a [f64],
    /// Torques held from each sample to the next, N m or N, row by row.
    pub tau: &'a [f64],
    /// Positions at the first sample, rad or m.
    pub q0: &'a [f64],
    /// Velocities at the first sample, rad/s or m/s.
    pub dq0: &'a [f64],
    /// Effects with the values of their parameters.
    pub effects: &'a [EffectInstance],
    /// Largest admissible change of any position when the sub-steps are halved, rad or m.
    pub tolerance: f64,
    /// Largest number of sub-steps per sample.
    pub max_substeps: usize,
    /// Width of the friction regularisation of each joint, rad/s (m/s); zero for exact dry friction, also where none is given.
    pub smoothing: &'a [f64],
    /// Receiver of progress reports, with cancellation.
    pub progress: &'a ProgressReporter,
}

/// Simulated positions and velocities at the samples, row by row.
#[derive(Debug, Clone)]
pub struct Trajectory {
    /// Positions as the encoders show them, rad or m.
    pub q: Vec<f64>,
    /// Velocities, rad/s or m/s.
    pub dq: Vec<f64>,
    /// Smallest number of sub-steps per sample tried that met the tolerance; the trajectory may have been computed with more.
    pub substeps: usize,
}

/// Reason why a simulation has no result.
#[derive(Debug, Clone, PartialEq)]
pub enum SimulationError {
    /// The effects are more than a plant carries, or one acts on a joint that the arm does not have.
    Effects,
    /// The simulated motion diverged at this sample (from 0).
    Diverged(usize),
    /// Halving the sub-steps still changes a position by this much, rad or m, more than the tolerance.
    Tolerance(f64),
    /// Stability needs this many sub-steps per sample, more than there may be.
    Stiff(f64),
}

impl std::fmt::Display for SimulationError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Effects => write!(f, "too many effects, or an effect on a joint the arm does not have"),
            Self::Diverged(k) => write!(f, "the simulated motion diverges at sample {}", k + 1),
            Self::Stiff(n) => write!(f, "the arm is so stiff that it needs {n:.0} steps per sample"),
            Self::Tolerance(e) => write!(f, "positions still change by {e:.1e} when the steps are halved"),
        }
    }
}

impl WithArm for Simulation<'_> {
    type Output = Result<Trajectory, SimulationError>;

    /// Simulates with twice as many sub-steps each time, until the positions change by less than the tolerance.
    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        theta: [f64; P],
    ) -> Self::Output {
        let hypothesis = self.hypothesis::<N, P>(theta);
        let first = self.first_substeps::<A, N, P>(&arm, &hypothesis)?;
        let mut coarse = self.run::<A, N, P>(&arm, &hypothesis, first)?;
        let mut substeps = 2 * first;
        loop {
            let fine = self.run::<A, N, P>(&arm, &hypothesis, substeps)?;
            let change = coarse.q.iter().zip(&fine.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            if change <= self.tolerance {
                return Ok(Trajectory { substeps: substeps / 2, ..fine });
            }
            if substeps >= self.max_substeps {
                return Err(SimulationError::Tolerance(change));
            }
            coarse = fine;
            substeps *= 2;
        }
    }
}

/// Part of a simulation's samples, simulated by itself.
#[derive(Debug, Clone)]
pub struct Window<'a> {
    /// Samples of the window.
    pub rows: Range<usize>,
    /// Positions at its first sample, rad or m.
    pub q0: &'a [f64],
    /// Velocities at its first sample, rad/s or m/s.
    pub dq0: &'a [f64],
    /// Sub-steps per sample, more where stability needs more; `None` to choose them by the tolerance.
    pub substeps: Option<usize>,
}

/// Simulation with a given number of sub-steps per sample, more where stability needs more.
struct FixedSubsteps<'a>(Simulation<'a>, usize);

impl WithArm for FixedSubsteps<'_> {
    type Output = Result<Trajectory, SimulationError>;

    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        theta: [f64; P],
    ) -> Self::Output {
        let Self(simulation, substeps) = self;
        let hypothesis = simulation.hypothesis::<N, P>(theta);
        let stable = simulation.first_substeps::<A, N, P>(&arm, &hypothesis)?;
        simulation.run::<A, N, P>(&arm, &hypothesis, substeps.max(stable))
    }
}

impl Simulation<'_> {
    fn hypothesis<const N: usize, const P: usize>(&self, theta: [f64; P]) -> Hypothesis<P> {
        let width = |j: usize| self.smoothing.get(j).copied().unwrap_or(0.0);
        Hypothesis {
            effects: self.effects.to_vec(),
            ..Hypothesis::rigid(theta).rounded_over::<N>(std::array::from_fn(width))
        }
    }

    /// Trajectories of windows of the samples, on all threads; `None` if the parameters do not fit the arm.
    ///
    /// # Errors
    ///
    /// The error of the first window that has no trajectory.
    ///
    /// # Panics
    ///
    /// If a window contains samples that the simulation does not have.
    pub fn windows(
        &self,
        arm: &ArmDescription,
        windows: &[Window<'_>],
    ) -> Option<Result<Vec<Trajectory>, SimulationError>> {
        let torques = self.q0.len();
        let each = |w: &Window<'_>| {
            let tau = &self.tau[w.rows.start * torques..w.rows.end * torques];
            let window = Simulation { t: &self.t[w.rows.clone()], tau, q0: w.q0, dq0: w.dq0, ..self.clone() };
            match w.substeps {
                None => arm.dispatch(window),
                Some(substeps) => arm.dispatch(FixedSubsteps(window, substeps)),
            }
        };
        // Collected first, so that the error does not depend on the threads.
        let all: Vec<_> = windows.par_iter().map(each).collect();
        all.into_iter().collect()
    }

    /// Number of sub-steps per sample that keeps the stiffest part of the arm stable.
    fn first_substeps<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        &self,
        arm: &A,
        hypothesis: &Hypothesis<P>,
    ) -> Result<usize, SimulationError> {
        let plant = hypothesis.plant(arm).ok_or(SimulationError::Effects)?;
        let longest = self.t.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
        let rate = plant.fastest(&SVector::from_fn(|j, _| self.q0[j]));
        let needed = (rate * longest).ceil();
        if needed > self.max_substeps as f64 {
            return Err(SimulationError::Stiff(needed));
        }
        Ok((needed as usize).clamp(1, (self.max_substeps / 2).max(1)))
    }

    fn run<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        &self,
        arm: &A,
        hypothesis: &Hypothesis<P>,
        substeps: usize,
    ) -> Result<Trajectory, SimulationError> {
        self.progress.begin(Phase::Simulate, self.t.len() / LOOK);
        let plant = hypothesis.plant(arm).ok_or(SimulationError::Effects)?;
        let held: Vec<[InputSegment<f64>; N]> =
            self.tau.chunks_exact(N).map(|row| std::array::from_fn(|j| InputSegment::held(row[j]))).collect();
        let torque = hypothesis.command(self.t, &held, &[], &[]).unwrap_or(held);
        let start = |x: &[f64]| SVector::<f64, N>::from_fn(|j, _| x[j]);
        let mut state = State::new(start(self.q0), start(self.dq0));
        let n = self.t.len();
        let (mut q, mut dq) = (Vec::with_capacity(n * N), Vec::with_capacity(n * N));
        for k in 0..n {
            if k % LOOK == LOOK - 1 {
                self.progress.unit();
            }
            if !state.is_finite() {
                return Err(SimulationError::Diverged(k));
            }
            let shown = plant.drivetrain().shown(&state.q, &state.latent);
            q.extend((0..N).map(|j| hypothesis.measured(j, shown[j])));
            let rates = |j: usize| {
                let moves = plant.drivetrain().sides(j).encoder_at_motor;
                state.dq[j] + if moves { state.latent.deflection_rate[j] } else { 0.0 }
            };
            dq.extend((0..N).map(rates));
            let step = Interval { t: self.t[k], h: interval(self.t, k), torque: &torque[k] };
            advance(&plant, &mut state, &step, substeps);
        }
        Ok(Trajectory { q, dq, substeps })
    }
}

/// Inertia matrices of an arm with effects at the positions `q`, row by row.
#[derive(Debug, Clone)]
pub struct InertiaMatrices<'a> {
    /// Positions, rad or m, row by row.
    pub q: &'a [f64],
    /// Effects with the values of their parameters.
    pub effects: &'a [EffectInstance],
}

impl WithArm for InertiaMatrices<'_> {
    type Output = Option<Vec<f64>>;

    /// Entries of all inertia matrices, row by row; `None` for more effects than a plant carries.
    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        theta: [f64; P],
    ) -> Self::Output {
        let hypothesis = Hypothesis { effects: self.effects.to_vec(), ..Hypothesis::rigid(theta) };
        let plant = hypothesis.plant::<A, N>(&arm)?;
        let at = |q: &[f64]| {
            let joints = JointState { q: std::array::from_fn(|j| q[j]), dq: [0.0; N] };
            plant.rigid().equation_terms(&joints).inertia
        };
        Some(self.q.chunks_exact(N).flat_map(|q| at(q).into_iter().flatten()).collect())
    }
}
