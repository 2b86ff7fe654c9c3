//! Tests of the integrator against laws of mechanics.

mod common;

use armgap_core::arm::{Arm, TwoLink};
use armgap_core::effect::{Active, InputSegment, Trial, find};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::kinematics::JointState;
use armgap_core::plant::{Mode, Plant};
use armgap_core::transmission::LatentState;
use common::seed_torque;
use nalgebra::{SVector, Vector2};

const THETA: [f64; 9] = [2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6, 1.734];
const H: f64 = 0.0025;

type Seed = Plant<f64, TwoLink<f64>, 2, 9>;

fn seed(theta: [f64; 9]) -> Seed {
    Plant::new(TwoLink::new(9.81, Some(0.45), &theta), theta)
}

fn run(
    plant: &Seed,
    start: State<f64, 2>,
    duration: f64,
    h: f64,
    substeps: usize,
    tau: impl Fn(f64) -> [f64; 2],
) -> State<f64, 2> {
    let mut state = start;
    for k in 0..(duration / h).round() as usize {
        let t = k as f64 * h;
        let torque = tau(t).map(InputSegment::held);
        advance(plant, &mut state, &Interval { t, h, torque: &torque }, substeps);
    }
    state
}

fn at_rest() -> State<f64, 2> {
    State::new(Vector2::zeros(), Vector2::zeros())
}

#[test]
fn an_arm_below_its_coulomb_level_does_not_creep() {
    let mut start = at_rest();
    start.q = Vector2::new(0.1, -0.05);
    let end = run(&seed(THETA), start, 10.0, H, 1, |t| [2.0 + (7.0 * t).sin(), 0.8 * (3.0 * t).cos()]);
    assert_eq!(end.q, start.q);
    assert_eq!(end.dq, Vector2::zeros());
}

#[test]
fn a_sliding_arm_stops_and_stays() {
    let start = State::new(Vector2::zeros(), Vector2::new(0.3, -0.8));
    let stopped = run(&seed(THETA), start, 2.0, H, 1, |_| [0.0, 0.0]);
    let later = run(&seed(THETA), stopped, 5.0, H, 1, |_| [0.0, 0.0]);
    assert_eq!(stopped.dq, Vector2::zeros());
    assert_eq!(stopped.q, later.q);
}

#[test]
fn order_is_four_where_friction_is_smooth() {
    let plant = seed(THETA).with_smoothing(2.0);
    let end = |n| run(&plant, at_rest(), 0.5, 0.005, n, seed_torque).q;
    let reference = end(64);
    let errors = [1, 2, 4].map(|n| (end(n) - reference).norm());
    let orders = [errors[0] / errors[1], errors[1] / errors[2]].map(f64::log2);
    assert!(orders.iter().all(|p| (3.7..4.6).contains(p)), "orders {orders:?} of errors {errors:?}");
}

#[test]
fn reversals_keep_their_accuracy() {
    // 2 s of the seed's run hold some thirty reversals of each joint.
    let plant = seed(THETA);
    let end = |n| run(&plant, at_rest(), 2.0, H, n, seed_torque).q;
    let reference = end(32);
    let errors = [1, 2, 4].map(|n| (end(n) - reference).amax());
    assert!(errors[0] < 1e-6, "{errors:?}");
    assert!(errors[2] < errors[0] / 20.0, "{errors:?}");
}

#[test]
fn energy_is_kept_without_friction() {
    let mut theta = THETA;
    theta[5..].fill(0.0);
    let plant = seed(theta);
    let arm = TwoLink::new(9.81, Some(0.45), &theta);
    let energy = |s: &State<f64, 2>| arm.energy_regressor(&s.q, &s.dq).dot(&SVector::from(theta));
    let start = State::new(Vector2::new(1.2, -0.7), Vector2::zeros());
    let end = run(&plant, start, 10.0, H, 1, |_| [0.0, 0.0]);
    let drift = (energy(&end) - energy(&start)).abs() / energy(&start);
    assert!(drift < 1e-8, "relative drift {drift:e}");
}

#[test]
fn work_equals_stored_plus_dissipated_energy() {
    // Work of a held torque is tau (q(k+1) - q(k)); without viscous friction Coulomb friction takes fc times the path.
    let mut theta = THETA;
    theta[5] = 0.0;
    theta[6] = 0.0;
    let plant = seed(theta);
    let arm = TwoLink::new(9.81, Some(0.45), &theta);
    let (mut state, mut supplied, mut dissipated) = (at_rest(), 0.0, 0.0);
    for k in 0..4000 {
        let t = k as f64 * H;
        let tau = seed_torque(t);
        let torque = tau.map(InputSegment::held);
        for i in 0..8 {
            let before = state;
            let interval = Interval { t: t + H / 8.0 * f64::from(i), h: H / 8.0, torque: &torque };
            advance(&plant, &mut state, &interval, 1);
            for j in 0..2 {
                let path = state.q[j] - before.q[j];
                supplied += tau[j] * path;
                dissipated += theta[7 + j] * path.abs();
            }
        }
    }
    let stored = arm.energy_regressor(&state.q, &state.dq).dot(&SVector::from(theta));
    let gap = (supplied - stored - dissipated).abs() / dissipated;
    assert!(gap < 1e-4, "relative gap {gap:e}");
}

#[test]
fn effects_leave_the_rigid_arm_at_their_neutral_value() {
    let reference = run(&seed(THETA), at_rest(), 1.0, H, 1, seed_torque);
    for law in armgap_core::effect::catalogue::<f64>() {
        let spec = law.spec();
        let mut p = [1.0; 3];
        let amplitudes = if let Trial::Amplitudes(count) = spec.trial { count } else { 1 };
        for i in 0..amplitudes {
            p[i] = spec.parameters[i].neutral;
        }
        let plant = seed(THETA).with_effect(Active { law: *law, joint: 1, p }).expect("room for one effect");
        let end = run(&plant, at_rest(), 1.0, H, 1, seed_torque);
        assert!((end.q - reference.q).amax() < 1e-12, "{}", spec.name);
    }
}

#[test]
fn a_smoothed_sign_tends_to_dry_friction() {
    let exact = run(&seed(THETA), at_rest(), 1.0, H, 4, seed_torque).q;
    let gap = |width| {
        (run(&seed(THETA).with_smoothing(width), at_rest(), 1.0, H, 16, seed_torque).q - exact).amax()
    };
    let gaps = [0.1, 0.01, 0.001].map(gap);
    assert!(gaps[0] > 4.0 * gaps[1] && gaps[1] > 4.0 * gaps[2], "{gaps:?}");
}

#[test]
fn every_joint_is_rounded_over_a_width_of_its_own() {
    let of = |widths, substeps| {
        run(&seed(THETA).with_rounding(widths), at_rest(), 1.0, H, substeps, seed_torque).q
    };
    let exact = run(&seed(THETA), at_rest(), 1.0, H, 4, seed_torque).q;
    assert_eq!(
        of([0.1, 0.1], 16),
        run(&seed(THETA).with_smoothing(0.1), at_rest(), 1.0, H, 16, seed_torque).q
    );
    assert_eq!(of([0.0, 0.0], 4), exact);
    // Beside dry friction on the first joint, and a width too small to matter there.
    let [beside_dry, beside_narrow] = [of([0.0, 0.1], 32), of([5e-4, 0.1], 64)];
    assert!((beside_dry - beside_narrow).amax() < 0.1 * (beside_dry - exact).amax());
}

#[test]
fn a_delayed_command_keeps_its_impulse_and_its_moment() {
    let t: Vec<f64> = (0..50).map(|k| f64::from(k) * H + 1e-4 * f64::from(k % 3)).collect();
    let u: Vec<f64> = t.iter().map(|&t| seed_torque(t)[0]).collect();
    let laws = [
        ("actuator_delay", 0.0061),
        ("actuator_delay", 2e-4),
        ("actuator_lag", 0.004),
        ("actuator_lag", 2e-4),
    ];
    for (name, p) in laws {
        let mut segments: Vec<_> = u.iter().map(|&u| InputSegment::held(u)).collect();
        find::<f64>(name).expect("in the catalogue").command(&[p, 0.0, 0.0], &t, &mut segments);
        let (fine, mut y) = (2000, u[0]);
        for k in 0..49 {
            let h = t[k + 1] - t[k];
            let dt = h / f64::from(fine);
            let held = |now: f64| u[t.partition_point(|&x| x <= now).max(1) - 1];
            let (mut mean, mut moment, mut middle, mut line) = (0.0, 0.0, 0.0, 0.0);
            for i in 0..fine {
                let s = (f64::from(i) + 0.5) / f64::from(fine);
                let value = if name == "actuator_delay" {
                    held(t[k] + s * h - p)
                } else {
                    let decay = (-dt / p).exp();
                    let mean = u[k] + (y - u[k]) * (1.0 - decay) * p / dt;
                    y = u[k] + (y - u[k]) * decay;
                    mean
                };
                mean += value * dt;
                moment += value * dt * (s - 0.5) * h;
                middle += segments[k].at(s) * dt;
                line += segments[k].at(s) * dt * (s - 0.5) * h;
            }
            let size = u.iter().fold(0.0, |a: f64, b| a.max(b.abs())) * h;
            assert!((mean - middle).abs() < 1e-3 * size, "{name} {p}: {middle} against {mean}");
            assert!((moment - line).abs() < 1e-3 * size * h, "{name} {p}: moment {line} against {moment}");
        }
    }
}

/// Test that a short actuator lag and an equal delay shift the torque alike, without a step in the limit of zero.
#[test]
fn a_short_lag_is_like_a_short_delay() {
    let t: Vec<f64> = (0..20).map(|k| f64::from(k) * H).collect();
    let shifted = |name: &str, p: f64| {
        let mut segments: Vec<_> = t.iter().map(|&t| InputSegment::held(seed_torque(t)[0])).collect();
        find::<f64>(name).expect("in the catalogue").command(&[p, 0.0, 0.0], &t, &mut segments);
        segments
    };
    let [lag, delay] = ["actuator_lag", "actuator_delay"].map(|name| shifted(name, 1e-4 * H));
    for (a, b) in lag.iter().zip(&delay) {
        assert!((a.start - b.start).abs() < 1e-6 && (a.end - b.end).abs() < 1e-6, "{a:?} against {b:?}");
    }
}

#[test]
fn a_motion_lacks_the_torque_that_the_log_does_not_hold() {
    let law = find::<f64>("rotor_inertia").expect("in the catalogue");
    let plant = seed(THETA).with_effect(Active { law, joint: 1, p: [0.05, 0.0, 0.0] }).expect("room");
    let (q, dq) = (Vector2::new(0.7, -1.1), Vector2::new(1.3, -0.4));
    let (tau, push) = (Vector2::new(12.0, -3.0), Vector2::new(0.9, -0.6));
    let latent = LatentState::none(q);
    let modes = [Mode::of(dq[0]), Mode::of(dq[1])];
    let kinematics = plant.rigid().kinematics(&JointState { q: q.into(), dq: dq.into() });
    let motion = plant.acceleration(0.0, &kinematics, &(tau + push), &modes, &latent);
    let residual_torque = plant.residual_torque(0.0, [&q, &dq, &motion.ddq], &tau, &latent);
    assert!((residual_torque - push).norm() < 1e-12, "{residual_torque}");
}
