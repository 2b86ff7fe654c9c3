//! Residual torque of a log under a model by inverse dynamics: what the measured motion needs beyond the given torque.

use crate::log::track::Track;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::numeric::smooth::{Local, local_cubic};
use crate::predict::latent_states::latent_states;
use armgap_core::arm::Arm;
use armgap_core::transmission::LatentState;
use nalgebra::SVector;

/// Half width of the local cubic that accelerations are taken from, s, and in samples at least.
const CUBIC: f64 = 0.014;
const CUBIC_SAMPLES: usize = 3;

/// A joint slower than this part of its RMS speed, or than the noise of its velocity times the other, may be at rest.
pub const SLOW: f64 = 0.05;
const SLOW_NOISE: f64 = 4.0;

/// Residual torque at one sample.
pub struct InverseDynamicsResidual<const N: usize> {
    /// Time of the sample, s.
    pub t: f64,
    /// Position, velocity and acceleration.
    pub motion: [SVector<f64, N>; 3],
    /// Given torque, mean of the intervals before and after.
    pub tau: SVector<f64, N>,
    /// Residual torque.
    pub residual: SVector<f64, N>,
}

/// Every sample of a log but the `half` at either end, with derivatives from local cubics of that half width, friction regularised below
/// the speed `slow`, and the disturbances `pushes` given; none if the model cannot be simulated.
pub fn inverse_dynamics_residuals<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    arm: &A,
    track: &Track<N>,
    model: &Hypothesis<P>,
    pushes: &[EffectInstance],
    half: usize,
    slow: f64,
) -> Option<Vec<InverseDynamicsResidual<N>>> {
    let held = model.command(&track.t, &track.held, pushes, &track.tables);
    let held = held.as_deref().unwrap_or(&track.held);
    let plant = model.plant(arm)?;
    let has_latent = plant.drivetrain().any() || plant.has_hysteresis();
    let latent = has_latent.then(|| latent_states(track, &plant, held, track.len() - 1));
    let widths = std::array::from_fn(|j| plant.rounding(j).max(slow));
    let soft = plant.with_rounding(widths);
    let sample = |k: usize| {
        let at: [Local; N] =
            std::array::from_fn(|j| local_cubic(&track.t, |i| model.actual(j, track.q[i][j]), k, half));
        let motion = [
            SVector::from_fn(|j, _| at[j].q),
            SVector::from_fn(|j, _| at[j].dq),
            SVector::from_fn(|j, _| at[j].ddq),
        ];
        let tau = SVector::from_fn(|j, _| 0.5 * (held[k.saturating_sub(1)][j].mean() + held[k][j].mean()));
        let [q, dq, ddq] = &motion;
        let latent = latent.as_ref().map_or_else(|| LatentState::none(*q), |latent| latent[k]);
        let residual = soft.residual_torque(track.t[k], [q, dq, ddq], &tau, &latent);
        InverseDynamicsResidual { t: track.t[k], motion, tau, residual }
    };
    Some((half..track.len().saturating_sub(half)).map(sample).collect())
}

/// Measured position, velocity and acceleration at a sample.
pub fn measured_motion<const N: usize>(track: &Track<N>, k: usize) -> [SVector<f64, N>; 3] {
    let half = half_width(track);
    let at: [Local; N] = std::array::from_fn(|j| local_cubic(&track.t, |i| track.q[i][j], k, half));
    let of = |f: fn(&Local) -> f64| SVector::from_fn(|j, _| f(&at[j]));
    [of(|x| x.q), of(|x| x.dq), of(|x| x.ddq)]
}

/// Samples on either side of the local cubic that accelerations are taken from.
pub fn half_width<const N: usize>(track: &Track<N>) -> usize {
    ((CUBIC / track.period().max(1e-9)).round() as usize).max(CUBIC_SAMPLES)
}

/// RMS speed of every joint.
pub fn rms_speeds<const N: usize>(track: &Track<N>) -> [f64; N] {
    let half = half_width(track);
    let places = || (0..track.len()).step_by((track.len() / 1000).max(1));
    std::array::from_fn(|j| rms(places().map(|k| local_cubic(&track.t, |i| track.q[i][j], k, half).dq)))
}

/// Speeds below which a joint may be at rest for all that its encoder says.
pub fn slow_speeds<const N: usize>(track: &Track<N>, speed: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|j| {
        let middle = local_cubic(&track.t, |i| track.q[i][j], track.len() / 2, half_width(track));
        let noise = track.noise[j] * middle.covariance[2].sqrt();
        (SLOW * speed[j]).max(SLOW_NOISE * noise).max(1e-9)
    })
}

/// Root mean square.
pub fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = x.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}
