//! Residual torque of a log under a model by inverse dynamics: torque that the measured motion needs minus the given torque.

use crate::log::track::Track;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::numeric::smooth::{Local, local_cubic};
use crate::predict::latent_states::{LatentRun, latent_states};
use crate::predict::rollouts::Singly;
use armgap_core::arm::Arm;
use armgap_core::transmission::LatentState;
use nalgebra::SVector;

/// Half width of the local cubic from which accelerations are taken, s.
const CUBIC: f64 = 0.014;

/// Least half width, in samples, of the local cubic from which accelerations are taken.
const CUBIC_SAMPLES: usize = 3;

/// Speed below which a joint may be at rest, relative to the joint's RMS speed; the larger of this speed and that of `SLOW_NOISE` counts.
pub const SLOW: f64 = 0.05;

/// Speed below which a joint may be at rest, relative to the standard deviation of its measured velocity.
const SLOW_NOISE: f64 = 4.0;

/// Residual torque of all joints at one sample, with the measured motion.
pub struct InverseDynamicsResidual<const N: usize> {
    /// Time of the sample, s.
    pub t: f64,
    /// Position, velocity and acceleration of all joints, SI.
    pub motion: [SVector<f64, N>; 3],
    /// Given torque, N m or N: mean of the intervals before and after the sample.
    pub tau: SVector<f64, N>,
    /// Residual torque, N m or N: torque that the motion needs minus the given torque.
    pub residual: SVector<f64, N>,
}

/// Residual torques of a log at all samples except `half` at either end, with derivatives from local cubics of that half width, friction regularised
/// below the speed `slow`, rad/s or m/s, and the disturbances `pushes` acting; `None` if the model cannot be simulated.
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
    let run = LatentRun { track, plant: &plant, torque: held, last: track.len() - 1 };
    let latent = plant.has_latent_states().then(|| latent_states::<Singly, A, N, P>(&[run]).concat());
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

/// Measured position, velocity and acceleration of all joints at sample `k`, from local cubics.
pub fn measured_motion<const N: usize>(track: &Track<N>, k: usize) -> [SVector<f64, N>; 3] {
    let half = half_width(track);
    let at: [Local; N] = std::array::from_fn(|j| local_cubic(&track.t, |i| track.q[i][j], k, half));
    let of = |f: fn(&Local) -> f64| SVector::from_fn(|j, _| f(&at[j]));
    [of(|x| x.q), of(|x| x.dq), of(|x| x.ddq)]
}

/// Half width, in samples, of the local cubic from which accelerations are taken.
pub fn half_width<const N: usize>(track: &Track<N>) -> usize {
    ((CUBIC / track.period().max(1e-9)).round() as usize).max(CUBIC_SAMPLES)
}

/// RMS speed of every joint, rad/s or m/s, from local cubics.
pub fn rms_speeds<const N: usize>(track: &Track<N>) -> [f64; N] {
    let half = half_width(track);
    let places = || (0..track.len()).step_by((track.len() / 1000).max(1));
    std::array::from_fn(|j| rms(places().map(|k| local_cubic(&track.t, |i| track.q[i][j], k, half).dq)))
}

/// Speeds of every joint, rad/s or m/s, below which the joint may be at rest within the accuracy of its encoder.
pub fn slow_speeds<const N: usize>(track: &Track<N>, speed: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|j| {
        let middle = local_cubic(&track.t, |i| track.q[i][j], track.len() / 2, half_width(track));
        let noise = track.noise[j] * middle.covariance[2].sqrt();
        (SLOW * speed[j]).max(SLOW_NOISE * noise).max(1e-9)
    })
}

/// Root mean square of numbers.
pub fn rms(x: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = x.fold((0.0, 0.0), |(s, n), x| (s + x * x, n + 1.0));
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}
