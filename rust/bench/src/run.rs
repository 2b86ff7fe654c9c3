//! Simulated run of the benchmarks: the arm of Table I under the torques (31) and (32) of Reyes and Kelly (1997).

use armgap_core::arm::TwoLink;
use armgap_core::effect::InputSegment;
use armgap_core::identify::Sample;
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use armgap_core::real::{Real, lit};
use nalgebra::Vector2;

/// Sample period of the benchmarks, s.
pub const PERIOD: f64 = 0.0025;
/// Number of samples of the run of 10 s.
pub const SAMPLES: u32 = 4000;

/// Parameters of the two-link arm of Reyes and Kelly (1997), Table I, SI: theta1 to theta5, viscous 1 and 2, Coulomb 1 and 2.
pub const THETA: [f64; 9] = [2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6095, 1.734];

/// Torques (31) and (32) of Reyes and Kelly (1997) at the time `t`, s, in N m.
pub fn torque(t: f64) -> [f64; 2] {
    [
        (1.0 - (-0.8 * t).exp()) * 29.0 + 68.0 * (16.0 * t + 0.1).sin() + 9.0 * (20.0 * t + 0.15).sin(),
        (1.0 - (-1.8 * t).exp()) * 1.2 + 8.0 * (26.0 * t + 0.08).sin() + 2.0 * (12.0 * t + 0.34).sin(),
    ]
}

/// Two-link arm of Reyes and Kelly (1997), Table I.
pub fn arm<T: Real>() -> TwoLink<T> {
    TwoLink::new(lit(9.81), Some(lit(0.45)), &THETA.map(lit))
}

/// Simulates the run from rest with `substeps` steps per period; one state per sample.
pub fn rollout(substeps: usize) -> Vec<State<f64, 2>> {
    let plant = Plant::new(arm::<f64>(), THETA);
    let mut state = State::new(Vector2::zeros(), Vector2::zeros());
    (0..SAMPLES)
        .map(|k| {
            let (t, before) = (f64::from(k) * PERIOD, state);
            let torque = torque(t).map(InputSegment::held);
            advance(&plant, &mut state, &Interval { t, h: PERIOD, torque: &torque }, substeps);
            before
        })
        .collect()
}

/// Simulated run as an online estimator takes it: times, positions and torques.
pub fn samples<T: Real>() -> Vec<Sample<T, 2>> {
    let states = rollout(4);
    (0..SAMPLES)
        .zip(states)
        .map(|(k, state)| {
            let t = f64::from(k) * PERIOD;
            Sample { t: lit(t), q: state.q.map(lit), dq: None, tau: Vector2::from(torque(t).map(lit)) }
        })
        .collect()
}
