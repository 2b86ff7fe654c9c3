//! Tests of events between samples: backlash that closes and opens, impacts on joint limits, disturbances that begin and end.

use armgap_core::arm::{Axis, TwoLink};
use armgap_core::effect::{Active, Effect, InputSegment, MAX_PARAMETERS, PulseShape, find};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use nalgebra::{SVector, Vector1, Vector2};
use std::f64::consts::PI;

const THETA: [f64; 9] = [2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6, 1.734];
const H: f64 = 0.0025;

fn law(name: &str) -> &'static dyn Effect<f64> {
    find(name).expect("a known effect")
}

fn two_link(
    theta: [f64; 9],
    name: &str,
    joint: usize,
    p: [f64; MAX_PARAMETERS],
) -> Plant<f64, TwoLink<f64>, 2, 9> {
    let plant = Plant::new(TwoLink::new(9.81, Some(0.45), &theta), theta);
    plant.with_effect(Active { law: law(name), joint, p }).expect("room")
}

fn axis(mass: f64) -> Plant<f64, Axis<f64>, 1, 4> {
    Plant::new(Axis { gravity: 0.0 }, [mass, 0.0, 0.0, 0.0])
}

fn axis_with_play(mass: f64, gap: f64, share: f64) -> Plant<f64, Axis<f64>, 1, 4> {
    axis(mass).with_effect(Active { law: law("backlash"), joint: 0, p: [gap, share, 1.0] }).expect("room")
}

fn swing(t: f64) -> [f64; 2] {
    [38.0 * (5.0 * t).sin() + 20.0 * (11.0 * t).sin(), 4.0 * (9.0 * t).sin() + 2.0 * (17.0 * t + 0.3).sin()]
}

/// Positions of the two-link arm over `seconds`, rad, integrated with `steps` steps per sample.
fn path(plant: &Plant<f64, TwoLink<f64>, 2, 9>, seconds: f64, steps: usize) -> Vec<Vector2<f64>> {
    let mut state = State::new(Vector2::zeros(), Vector2::zeros());
    (0..(seconds / H).round() as usize)
        .map(|k| {
            let t = k as f64 * H;
            advance(
                plant,
                &mut state,
                &Interval { t, h: H, torque: &swing(t).map(InputSegment::held) },
                steps,
            );
            state.q
        })
        .collect()
}

fn largest(a: &[Vector2<f64>], b: &[Vector2<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max)
}

#[test]
fn a_rotor_that_meets_its_flank_shares_its_momentum() {
    let (mass, share, gap) = (2.0, 0.25, 0.01);
    let plant = axis_with_play(mass, gap, share);
    let mut state = State::new(Vector1::zeros(), Vector1::new(0.3));
    state.latent.deflection_rate[0] = 1.0;
    // It has half the gap to go: 5 ms at 1 m/s.
    for k in 0..4 {
        advance(
            &plant,
            &mut state,
            &Interval { t: f64::from(k) * H, h: H, torque: &[InputSegment::held(0.0)] },
            1,
        );
    }
    let (rotor, link) = (share * mass, (1.0 - share) * mass);
    let together = (link * 0.3 + rotor * 1.3) / mass;
    assert!((state.dq[0] - together).abs() < 1e-12, "{}", state.dq[0]);
    assert_eq!(
        (state.latent.side[0], state.latent.deflection[0], state.latent.deflection_rate[0]),
        (1.0, 0.5 * gap, 0.0)
    );
    assert!((state.q[0] - (0.3 * 0.005 + together * 0.005)).abs() < 1e-12, "{}", state.q[0]);
}

#[test]
fn a_rotor_leaves_its_flank_when_its_torque_turns() {
    let (mass, share, gap) = (2.0, 0.25, 0.01);
    let plant = axis_with_play(mass, gap, share);
    let mut state = State::new(Vector1::zeros(), Vector1::new(0.5));
    (state.latent.side[0], state.latent.deflection[0]) = (1.0, 0.5 * gap);
    let torque = -3.0;
    advance(&plant, &mut state, &Interval { t: 0.0, h: H, torque: &[InputSegment::held(torque)] }, 1);
    // The rotor goes alone, and the link goes on.
    assert_eq!((state.dq[0], state.latent.side[0]), (0.5, 0.0));
    let deflection = 0.5 * gap + 0.5 * torque / (share * mass) * H * H;
    assert!((state.latent.deflection[0] - deflection).abs() < 1e-12);
}

#[test]
fn a_riding_rotor_keeps_the_momentum_of_a_free_arm() {
    let theta: [f64; 9] = [THETA[0], THETA[1], THETA[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (share, gap) = (0.15, 0.02);
    let plant = two_link(theta, "backlash", 1, [gap, share, 1.0]);
    let rotor = share * THETA[2];
    let momentum = |s: &State<f64, 2>| {
        let cos = s.q[1].cos();
        let (m11, m12) = (THETA[0] + 2.0 * THETA[1] * cos, THETA[2] + THETA[1] * cos);
        m11 * s.dq[0] + m12 * s.dq[1] + rotor * s.latent.deflection_rate[1]
    };
    let mut state = State::new(Vector2::new(0.2, 0.4), Vector2::new(0.7, -1.1));
    let before = momentum(&state);
    let mut met = 0;
    for k in 0..800 {
        let (t, side) = (f64::from(k) * H, state.latent.side[1]);
        let torque = [InputSegment::held(0.0), InputSegment::held(0.6 * (12.0 * t).sin())];
        advance(&plant, &mut state, &Interval { t, h: H, torque: &torque }, 1);
        met += u32::from(side == 0.0 && state.latent.side[1] != 0.0);
        assert!((momentum(&state) - before).abs() < 1e-7, "{k}: {} {before}", momentum(&state));
    }
    assert!(met > 5, "the play closed {met} times");
}

#[test]
fn a_play_is_as_exact_in_long_steps_as_in_short_ones() {
    let plant = two_link(THETA, "backlash", 0, [0.004, 0.1, 0.0]);
    let plain = Plant::new(TwoLink::new(9.81, Some(0.45), &THETA), THETA);
    let fine = path(&plant, 0.6, 16);
    assert!(largest(&path(&plant, 0.6, 2), &fine) < 1e-6);
    assert!(largest(&path(&plain, 0.6, 2), &fine) > 1e-4);
}

#[test]
fn a_stop_is_as_exact_in_long_steps_as_in_short_ones() {
    let plant = two_link(THETA, "contact", 0, [0.05, 2e3, 30.0]);
    let fine = path(&plant, 0.6, 32);
    assert!(fine.iter().map(|q| q[0]).fold(0.0, f64::max) > 0.052);
    assert!(largest(&path(&plant, 0.6, 4), &fine) < 2e-7, "{}", largest(&path(&plant, 0.6, 4), &fine));
}

#[test]
fn a_push_between_samples_moves_a_mass_as_far_as_it_should() {
    let (mass, impulse, duration, centre) = (2.0, 0.8, 0.0031, 0.0137);
    let t: Vec<f64> = (0..20).map(|k| f64::from(k) * H).collect();
    let plant = axis(mass);
    for shape in PulseShape::ALL {
        let mut torque = vec![InputSegment::held(0.0); t.len()];
        shape.law().command(&[impulse, centre, duration], &t, &mut torque);
        let mut state = State::new(SVector::zeros(), SVector::zeros());
        for (&t, segment) in t.iter().zip(&torque) {
            advance(&plant, &mut state, &Interval { t, h: H, torque: &[*segment] }, 1);
        }
        let end = 20.0 * H;
        assert!((state.dq[0] - impulse / mass).abs() < 1e-13, "{shape:?}");
        assert!((state.q[0] - impulse / mass * (end - centre)).abs() < 1e-13, "{shape:?}: {}", state.q[0]);
    }
}

/// Mean torques over samples of 1 ms against sums of the raised cosine `impulse / (2 l) (1 + cos(pi x / l))` in steps of a microsecond, with the half
/// period `l` from the variance of both shapes, `duration^2 / 12 = l^2 (1/3 - 2/pi^2)`.
#[test]
fn a_bell_is_a_raised_cosine_with_the_variance_of_the_rectangle() {
    let (impulse, duration, centre) = (0.3, 0.05, 0.0604);
    let l = duration / (12.0 * (1.0 / 3.0 - 2.0 / PI.powi(2))).sqrt();
    let step = 1e-3;
    let t: Vec<f64> = (0..120).map(|k| f64::from(k) * step).collect();
    let mut torque = vec![InputSegment::held(0.0); t.len()];
    PulseShape::Bell.law().command(&[impulse, centre, duration], &t, &mut torque);
    let at = |x: f64| if x.abs() < l { 0.5 * impulse / l * (1.0 + (PI * x / l).cos()) } else { 0.0 };
    for (t, segment) in t.iter().zip(&torque) {
        let mean: f64 = (0..1000).map(|i| at(t + (f64::from(i) + 0.5) * 1e-6 - centre)).sum::<f64>() * 1e-3;
        assert!((segment.mean() - mean).abs() < 1e-6, "{t}: {} {mean}", segment.mean());
    }
}
