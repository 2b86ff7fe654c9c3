//! Example of a controller that identifies its arm while it moves it: 400 Hz, two links, no allocation.
//!
//! The arm is simulated; in a real controller encoders and motors take its place, and nothing else changes.

use armgap_core::arm::{Arm, TwoLink};
use armgap_core::effect::InputSegment;
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::online::{MOST_PARAMETERS, Online, OnlineError, OnlineSettings, When};
use armgap_core::plant::Plant;
use nalgebra::Vector2;

const PERIOD: f64 = 0.0025;
const TRUTH: [f64; 9] = [2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6095, 1.734];

/// Torques (31) and (32) of Reyes and Kelly (1997) at the time `t`, s, in N m.
fn excite(t: f64) -> [f64; 2] {
    [
        (1.0 - (-0.8 * t).exp()) * 29.0 + 68.0 * (16.0 * t + 0.1).sin() + 9.0 * (20.0 * t + 0.15).sin(),
        (1.0 - (-1.8 * t).exp()) * 1.2 + 8.0 * (26.0 * t + 0.08).sin() + 2.0 * (12.0 * t + 0.34).sin(),
    ]
}

fn main() -> Result<(), OnlineError> {
    let plant = Plant::new(TwoLink::new(9.81, None, &TRUTH), TRUTH);
    let mut arm = State::new(Vector2::zeros(), Vector2::zeros());
    let mut estimator = Online::<f64>::new(OnlineSettings::new(armgap_core::arm::ArmKind::TwoLink), &[])?;

    for k in 0..4000 {
        let t = f64::from(k) * PERIOD;
        let tau = excite(t);
        estimator.update(When::After(PERIOD), arm.q.as_slice(), None, &tau)?;
        advance(&plant, &mut arm, &Interval { t, h: PERIOD, torque: &tau.map(InputSegment::held) }, 1);
    }

    let mut sigma = [0.0; MOST_PARAMETERS];
    estimator.sigma(&mut sigma);
    let names = <TwoLink<f64> as Arm<f64, 2, 9>>::PARAMETERS.iter().map(|p| p.name);
    for (((name, theta), sigma), truth) in names.zip(estimator.theta()).zip(sigma).zip(TRUTH) {
        println!("{name:9} {theta:9.6} +- {sigma:.1e}   truth {truth:9.6}");
    }
    println!("alarm {:.2}, excitation {:.2}", estimator.alarm_level(), estimator.excitation());
    Ok(())
}
