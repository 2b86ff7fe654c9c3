//! Rollouts of many windows or logs: side by side in vector lanes, or one at a time.

use armgap_core::arm::Arm;
use armgap_core::cpu::Level;
use armgap_core::integrate::{Interval, State, StepLimits, advance_in_stable_steps};
use armgap_core::plant::Plant;
use armgap_core::rollout::{BatchRollout, Correction, LatentRollout, Run, WIDTH};
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

/// Method of simulating the rollouts of many windows.
pub(crate) trait Rollouts {
    /// Simulates rollouts of a plant in which nothing but friction modes changes ([`Plant::is_plain`]).
    fn plain<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]);

    /// Simulates rollouts of a plant with latent states or regularised friction ([`Plant::is_latent_or_regularised`]).
    fn latent<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]);

    /// Simulates rollouts of any plant.
    fn scalar<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]);

    /// Simulates rollouts with the states at their samples corrected by `corrections`, one for each run; each run counts as the first of its
    /// correction.
    fn corrected<A: Arm<f64, N, P>, K: Correction<f64, N> + Send, const N: usize, const P: usize>(
        runs: &mut [Run<'_, f64, A, N, P>],
        corrections: &mut [K],
        step_limits: StepLimits,
    );
}

/// Corrections of the runs of a batch, one for each run.
struct Each<'a, K>(&'a mut [K]);

impl<K: Correction<f64, N>, const N: usize> Correction<f64, N> for Each<'_, K> {
    fn correct(&mut self, run: usize, state: &mut State<f64, N>) {
        self.0[run].correct(0, state);
    }
}

/// Rollouts in vector lanes, several at a time.
pub(crate) struct SideBySide;

impl Rollouts for SideBySide {
    fn plain<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        let level = Level::widest();
        runs.par_chunks_mut(GROUP).for_each(|runs| BatchRollout { runs, limit: DIVERGED }.run_all(level));
    }

    fn latent<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        let level = Level::widest();
        let Some(step_limits) = runs.first().map(|run| step_limits(run.plant)) else { return };
        runs.par_chunks_mut(GROUP).for_each(|runs| {
            LatentRollout { runs, limit: DIVERGED, step_limits, correction: None }.run_all(level);
        });
    }

    fn scalar<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        runs.par_chunks_mut(WIDTH).for_each(|group| group.iter_mut().for_each(|run| run_scalar(run, false)));
    }

    fn corrected<A: Arm<f64, N, P>, K: Correction<f64, N> + Send, const N: usize, const P: usize>(
        runs: &mut [Run<'_, f64, A, N, P>],
        corrections: &mut [K],
        step_limits: StepLimits,
    ) {
        if runs.iter().any(|run| !run.plant.is_latent_or_regularised()) {
            return Singly::corrected(runs, corrections, step_limits);
        }
        let (level, mut rest) = (Level::widest(), corrections);
        for alike in runs.chunk_by_mut(|a, b| a.plant.is_alike(b.plant)) {
            let (own, after) = rest.split_at_mut(alike.len());
            rest = after;
            alike.par_chunks_mut(WIDTH).zip(own.par_chunks_mut(WIDTH)).for_each(|(runs, corrections)| {
                let correction = Some(&mut Each(corrections) as &mut dyn Correction<f64, N>);
                LatentRollout { runs, limit: DIVERGED, step_limits, correction }.run_all(level);
            });
        }
    }
}

/// Rollouts one at a time.
pub(crate) struct Singly;

impl Rollouts for Singly {
    fn plain<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        Self::scalar(runs);
    }

    fn latent<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        Self::scalar(runs);
    }

    fn scalar<A: Arm<f64, N, P>, const N: usize, const P: usize>(runs: &mut [Run<'_, f64, A, N, P>]) {
        runs.par_iter_mut().for_each(|run| run_scalar(run, true));
    }

    fn corrected<A: Arm<f64, N, P>, K: Correction<f64, N> + Send, const N: usize, const P: usize>(
        runs: &mut [Run<'_, f64, A, N, P>],
        corrections: &mut [K],
        step_limits: StepLimits,
    ) {
        runs.par_iter_mut().zip(corrections).for_each(|(run, correction)| {
            for (k, torque) in run.torque.iter().enumerate() {
                let interval = Interval { t: run.t[k], h: run.t[k + 1] - run.t[k], torque };
                let rates = run.plant.step_rates(&run.state.q);
                advance_in_stable_steps(run.plant, &mut run.state, &interval, &rates, step_limits);
                correction.correct(0, &mut run.state);
            }
        });
    }
}

/// Number of rollouts simulated as one group over vector lanes: enough that few lanes are idle at the end.
const GROUP: usize = 4 * WIDTH;

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
