//! Standard deviation of a joint's residual torque at every point of a log: larger in violent motion, smaller in calm motion.
//!
//! The variance is modelled as a sum of non-negative multiples of the motion's activities (squared accelerations, speeds, torques and rates of
//! torque), by multiplicative updates of the likelihood of a scale mixture, robust to single large values, and combined with the local median of the
//! residual's size.

use super::residual::Residual;
use crate::log::track::median;

/// Degrees of freedom of the Student distribution assumed for the residual torque.
const FREEDOM: f64 = 5.0;

/// Number of multiplicative updates in the fit of the residual torque's variance to the motion's activities (squared accelerations, speeds, torques).
const UPDATES: usize = 60;

/// Smallest standard deviation of the residual torque that the activity of the motion may give, relative to the typical one.
const QUIET: f64 = 0.5;

/// Largest standard deviation of the residual torque that the activity of the motion may give, relative to the typical one.
const VIOLENT: f64 = 8.0;

/// Half width of the stretch of a log over which the local median of the residual torque's size is taken, s.
const MEDIAN_HALF_WIDTH: f64 = 1.0;

/// Number of grid points above which the local median of the residual torque's size is used.
const FEWEST_MEDIAN_POINTS: usize = 40;

/// Ratio of the standard deviation to the median absolute value of a normal variable.
pub(super) const MAD_TO_SIGMA: f64 = 1.4826;

/// Least standard deviation of the residual torque, relative to the joint's typical torque.
const FLOOR: f64 = 0.002;

/// Standard deviation of joint `j`'s residual torque at every grid point, N m or N, from the torque `left` after the fit of model errors and pushes.
pub fn scatter<const N: usize>(residual: &Residual<N>, j: usize, left: &[f64]) -> Vec<f64> {
    let moves: Vec<bool> = residual.joints[j].rest.iter().map(|r| *r < 0.3).collect();
    let of_moving = |x: &[f64]| x.iter().zip(&moves).filter(|(_, m)| **m).map(|(x, _)| x.abs()).collect();
    let floor = FLOOR * residual.joints[j].typical;
    let typical = (MAD_TO_SIGMA * median(of_moving(left))).max(floor).max(1e-12);
    let by_activity = by_activity(residual, j, left, &moves, typical);
    let half = (MEDIAN_HALF_WIDTH / residual.step).round() as usize;
    let mut local = typical;
    let at = |i: usize| {
        if i.is_multiple_of(10) {
            let range = i.saturating_sub(half)..(i + half).min(left.len());
            let near: Vec<f64> = range.filter(|&k| moves[k]).map(|k| left[k].abs()).collect();
            local = if near.len() > FEWEST_MEDIAN_POINTS { MAD_TO_SIGMA * median(near) } else { typical };
        }
        (local * local + by_activity[i] + floor * floor).sqrt()
    };
    (0..left.len()).map(at).collect()
}

/// Variance of joint `j`'s residual torque at every grid point, (N m)^2 or N^2, as a sum of non-negative multiples of the motion's activities.
fn by_activity<const N: usize>(
    residual: &Residual<N>,
    j: usize,
    left: &[f64],
    moves: &[bool],
    typical: f64,
) -> Vec<f64> {
    let near_rest: Vec<f64> = residual.joints[j].rest.iter().map(|r| 4.0 * r * (1.0 - r)).collect();
    let even = vec![1.0; left.len()];
    let features: Vec<&Vec<f64>> = [&even, &near_rest].into_iter().chain(residual.activity.iter()).collect();
    let least = 1e-3 * typical * typical;
    let sum = |a: &[f64], at: &[f64]| a.iter().zip(at).map(|(a, f)| a * f).sum::<f64>().max(least);
    let rows: Vec<usize> = (0..left.len()).filter(|&i| moves[i]).collect();
    let flat: Vec<f64> = rows.iter().flat_map(|&i| features.iter().map(move |f| f[i])).collect();
    let mut a = vec![typical * typical / features.len() as f64; features.len()];
    for _ in 0..UPDATES {
        let (mut up, mut down) = (vec![0.0; a.len()], vec![1e-300; a.len()]);
        for (at, &i) in flat.chunks_exact(a.len()).zip(&rows) {
            let precision = 1.0 / sum(&a, at);
            let square = left[i] * left[i] * precision;
            let weight = (FREEDOM + 1.0) / (FREEDOM + square) * square * precision;
            for ((up, down), feature) in up.iter_mut().zip(&mut down).zip(at) {
                *up += feature * weight;
                *down += feature * precision;
            }
        }
        for k in 0..a.len() {
            a[k] = (a[k] * (up[k] / down[k]).sqrt()).max(1e-8 * typical * typical);
        }
    }
    let variance = |i: usize| a.iter().zip(&features).map(|(a, f)| a * f[i]).sum::<f64>().max(least);
    let (least, most) = ((QUIET * typical).powi(2), (VIOLENT * typical).powi(2));
    (0..left.len()).map(|i| variance(i).clamp(least, most)).collect()
}
