//! Initial guesses of contacts from logs: position and stiffness of a joint limit.
//!
//! Beyond a joint limit the residual torque grows with depth and with speed and pushes back, like a spring and damper. The position of the limit is
//! found by a line search, stiffness and damping at each position by least squares.

use crate::log::track::Track;
use crate::model::hypothesis::Hypothesis;
use crate::predict::residual_torque::{InverseDynamicsResidual, inverse_dynamics_residuals};
use armgap_core::arm::Arm;

/// Half width, in samples, of the local cubic from which accelerations are taken; small because an impact is short.
const ACCELERATION_HALF_WIDTH: usize = 3;

/// Fewest samples beyond a joint limit for a guess of the limit's stiffness.
const FEWEST_CONTACT_SAMPLES: usize = 5;

/// Growth factor of the number of samples beyond a joint limit, from one tried position of the limit to the next.
const GROWTH: f64 = 1.15;

/// Largest part of a joint's samples that may lie beyond a joint limit.
const MAX_CONTACT_SHARE: f64 = 0.8;

/// Least part of the squared residual torque beyond a joint limit that the limit's spring and damper must explain.
const CONTACT_EXPLAINED_SHARE: f64 = 0.3;

/// Speed below which friction is regularised in the search for contacts, relative to the RMS speed of the slowest joint.
const REGULARISATION_SPEED: f64 = 0.02;

/// Guess of a contact: position, rad or m, stiffness, N m/rad or N/m, negative for a stop towards zero, and damping, N m s/rad or N s/m.
pub type ContactGuess = [f64; 3];

/// Position (rad or m), velocity (rad/s or m/s) and residual torque (N m or N) of a joint at one sample.
#[derive(Debug, Clone, Copy)]
struct ContactSample {
    q: f64,
    dq: f64,
    residual: f64,
}

/// Factor from the fitted stiffness of a contact to a second, stiffer guess: an impact shorter than the local cubic appears softer than it is.
const HARDER: f64 = 8.0;

/// Residual torques of logs under a model, from which guesses are made; `speed` is the RMS speed per joint, rad/s or m/s.
pub fn residual_torques<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    tracks: &[Track<N>],
    arm: &A,
    model: &Hypothesis<P>,
    speed: &[f64; N],
) -> Vec<InverseDynamicsResidual<N>> {
    let slow = REGULARISATION_SPEED * speed.iter().copied().fold(f64::INFINITY, f64::min);
    tracks
        .iter()
        .filter_map(|track| {
            inverse_dynamics_residuals(arm, track, model, &track.pushes, ACCELERATION_HALF_WIDTH, slow)
        })
        .flatten()
        .collect()
}

/// Guesses of contacts from the residual torques of logs (`residual_torques`), per joint: at most one contact at either end of the travel, each with its
/// fitted stiffness and a stiffer one.
pub fn contact_guesses<const N: usize>(rows: &[InverseDynamicsResidual<N>]) -> [Vec<ContactGuess>; N] {
    let of = |j: usize| {
        rows.iter().map(move |r| ContactSample {
            q: r.motion[0][j],
            dq: r.motion[1][j],
            residual: r.residual[j],
        })
    };
    std::array::from_fn(|j| {
        let mut samples: Vec<ContactSample> = of(j).collect();
        [1.0, -1.0].into_iter().flat_map(|side| both(&mut samples, side)).collect()
    })
}

/// Guesses of the contact at one end of the travel (`side` = 1 or -1): as fitted, and stiffer with less depth.
fn both(samples: &mut [ContactSample], side: f64) -> Vec<ContactGuess> {
    let Some(guess) = hinge(samples, side) else { return Vec::new() };
    let [position, stiffness, damping] = guess;
    let depth = samples[0].q - position;
    let shallower = depth / HARDER.sqrt();
    vec![guess, [position + depth - shallower, HARDER * stiffness, HARDER.sqrt() * damping]]
}

/// Contact at one end of the travel (`side` = 1 or -1) whose spring and damper explain most of a joint's squared residual torque. It lies in the
/// end's half of the travel, or between the end and zero.
fn hinge(samples: &mut [ContactSample], side: f64) -> Option<ContactGuess> {
    samples.sort_by(|a, b| (side * b.q).total_cmp(&(side * a.q)));
    let middle = 0.5 * (samples.first()?.q + samples.last()?.q);
    let most = (MAX_CONTACT_SHARE * samples.len() as f64) as usize;
    let counts = std::iter::successors(Some(FEWEST_CONTACT_SAMPLES), |n| {
        Some(((*n as f64 * GROWTH) as usize).max(n + 1))
    });
    let tried = counts.take_while(|n| *n < most).filter_map(|n| {
        let position = samples.get(n).map(|s| s.q).filter(|q| q * side > 0.0 || (q - middle) * side > 0.0)?;
        let (beyond, _) = samples.split_at(n);
        let ([stiffness, damping], gain) = spring(beyond, position, side)?;
        Some(([position, stiffness * side * position.signum(), damping], gain))
    });
    tried.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(guess, _)| guess)
}

/// Least-squares stiffness and damping of a contact at `position`, rad or m, from the samples `beyond` it, and the squared torque explained.
fn spring(beyond: &[ContactSample], position: f64, side: f64) -> Option<([f64; 2], f64)> {
    let [mut dd, mut dv, mut vv, mut dy, mut vy, mut yy] = [0.0; 6];
    for sample in beyond {
        let (d, v, y) = (side * (sample.q - position), side * sample.dq, -side * sample.residual);
        (dd, dv, vv) = (dd + d * d, dv + d * v, vv + v * v);
        (dy, vy, yy) = (dy + d * y, vy + v * y, yy + y * y);
    }
    let determinant = dd * vv - dv * dv;
    let both = [(dy * vv - vy * dv) / determinant, (vy * dd - dy * dv) / determinant];
    let [stiffness, damping] = if both[1] > 0.0 { both } else { [dy / dd, 0.0] };
    let gain = stiffness * dy + damping * vy;
    (stiffness > 0.0 && gain > CONTACT_EXPLAINED_SHARE * yy).then_some(([stiffness, damping], gain))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hinge_is_found_where_it_begins() {
        let (position, stiffness, damping) = (-0.4, 120.0, 3.0);
        let sample = |i: usize| {
            let t = 0.004 * i as f64;
            let (q, dq) = (-0.5 * t.sin(), -0.5 * t.cos());
            let depth = (position - q).max(0.0);
            let push = if depth > 0.0 { (stiffness * depth - damping * dq).max(0.0) } else { 0.0 };
            ContactSample { q, dq, residual: push }
        };
        let mut samples: Vec<ContactSample> = (0..4000).map(sample).collect();
        assert_eq!(hinge(&mut samples, 1.0), None);
        let found = hinge(&mut samples, -1.0).expect("the stop");
        for (value, true_value) in found.iter().zip([position, stiffness, damping]) {
            assert!((value / true_value - 1.0).abs() < 0.1, "{found:?}");
        }
    }

    #[test]
    fn where_all_of_the_travel_is_negative_its_upper_stop_lies_towards_zero() {
        let (position, stiffness, damping) = (-0.6, 120.0, 3.0);
        let sample = |i: usize| {
            let t = 0.004 * i as f64;
            let (q, dq) = (0.5 * t.sin() - 1.0, 0.5 * t.cos());
            let depth = q - position;
            let push = if depth > 0.0 { (stiffness * depth + damping * dq).max(0.0) } else { 0.0 };
            ContactSample { q, dq, residual: -push }
        };
        let mut samples: Vec<ContactSample> = (0..4000).map(sample).collect();
        let found = hinge(&mut samples, 1.0).expect("the stop");
        for (value, true_value) in found.iter().zip([position, -stiffness, damping]) {
            assert!((value / true_value - 1.0).abs() < 0.1, "{found:?}");
        }
        assert_eq!(hinge(&mut samples, -1.0), None);
    }
}
