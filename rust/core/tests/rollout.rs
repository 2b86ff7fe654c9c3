//! Tests of batch rollouts against the scalar integrator.

use armgap_core::arm::TwoLink;
use armgap_core::cpu::Level;
use armgap_core::effect::{Active, InputSegment, catalogue};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use armgap_core::rollout::{BatchRollout, Run, WIDTH};
use nalgebra::Vector2;

const THETA: [f64; 9] = [2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6, 1.734];
const H: f64 = 0.0025;
const ROWS: usize = 400;

type Seed = Plant<f64, TwoLink<f64>, 2, 9>;

fn seed(theta: [f64; 9]) -> Seed {
    Plant::new(TwoLink::new(9.81, Some(0.45), &theta), theta)
}

fn times() -> Vec<f64> {
    (0..=ROWS).map(|k| H * k as f64 + 2e-4 * (k % 3) as f64).collect()
}

/// Torques, N m, under which joints slide, reverse, stick and break away, different for every `l`.
fn torques(l: usize) -> Vec<[InputSegment<f64>; 2]> {
    let size = 1.0 / (1.0 + l as f64);
    let at = |t: f64| {
        [
            20.0 + 68.0 * size * (16.0 * t + 0.1).sin() + 9.0 * (20.0 * t).sin(),
            8.0 * size * (26.0 * t + l as f64).sin(),
        ]
    };
    let between = |a: f64, b: f64| InputSegment { start: a, middle: 0.4 * a + 0.6 * b, end: b };
    times().windows(2).map(|t| std::array::from_fn(|j| between(at(t[0])[j], at(t[1] - 1e-3)[j]))).collect()
}

fn start(l: usize) -> State<f64, 2> {
    let x = l as f64;
    State::new(
        Vector2::new(0.3 * x, -0.2 * x),
        Vector2::new(0.5 * x - 1.0, if l.is_multiple_of(2) { 0.0 } else { -x }),
    )
}

fn alone(plant: &Seed, l: usize) -> Vec<f64> {
    let (t, torque) = (times(), torques(l));
    let mut state = start(l);
    let mut out = Vec::new();
    for k in 0..ROWS {
        advance(plant, &mut state, &Interval { t: t[k], h: t[k + 1] - t[k], torque: &torque[k] }, 1);
        out.extend(state.q.iter());
    }
    out
}

/// Positions of each plant's run in a batch rollout with the instruction set `level`.
fn together(plants: &[Seed], level: Level) -> Vec<Vec<f64>> {
    let t = times();
    let torques: Vec<_> = (0..plants.len()).map(torques).collect();
    let mut out = vec![vec![f64::NAN; 2 * ROWS]; plants.len()];
    let mut runs: Vec<_> = out
        .iter_mut()
        .enumerate()
        .map(|(l, positions)| Run {
            plant: &plants[l],
            t: &t,
            torque: &torques[l],
            state: start(l),
            positions,
        })
        .collect();
    BatchRollout { runs: &mut runs, limit: 1e3 }.run_all(level);
    out
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, |most, x| if x > most || x.is_nan() { x } else { most })
}

fn assert_same(plants: &[Seed], what: &str) {
    for level in [Level::PORTABLE, Level::detect(), Level::widest()] {
        for (l, positions) in together(plants, level).iter().enumerate() {
            let off = apart(positions, &alone(&plants[l], l));
            assert!(off < 1e-10, "{what}, lane {l}, {}: {off:e}", level.name());
        }
    }
}

#[test]
fn lanes_of_different_arms_move_as_each_arm_does_alone() {
    let plants: Vec<Seed> = (0..WIDTH)
        .map(|l| seed(std::array::from_fn(|i| THETA[i] * (1.0 + 0.02 * ((i + 3 * l) % 7) as f64))))
        .collect();
    assert_same(&plants, "eight arms");
    assert_same(&plants[..3], "three arms");
}

#[test]
fn every_effect_acts_in_its_lane() {
    for law in catalogue::<f64>() {
        let p = law.spec().initial_guesses.first().copied().unwrap_or([0.01, 0.3, 0.1]);
        let plants: Vec<Seed> = (0..WIDTH)
            .map(|l| {
                let active =
                    Active { law: *law, joint: if law.spec().least_joints > 1 { 0 } else { l % 2 }, p };
                seed(THETA).with_effect(active).expect("room for one effect")
            })
            .collect();
        if plants.iter().all(Plant::only_modes_change) {
            assert_same(&plants, law.spec().name);
        }
    }
}

#[test]
fn more_runs_than_lanes_of_different_lengths_move_as_each_does_alone() {
    let plants = [seed(THETA), seed(std::array::from_fn(|i| 1.1 * THETA[i]))];
    let (t, torques): (_, Vec<_>) = (times(), (0..3 * WIDTH + 3).map(torques).collect());
    let length = |l: usize| (37 * l) % ROWS;
    for level in [Level::PORTABLE, Level::detect(), Level::widest()] {
        let mut out = vec![vec![f64::NAN; 2 * ROWS]; torques.len()];
        let mut runs: Vec<_> = out
            .iter_mut()
            .enumerate()
            .map(|(l, positions)| Run {
                plant: &plants[l % 2],
                t: &t[..=length(l)],
                torque: &torques[l][..length(l)],
                state: start(l % WIDTH),
                positions: &mut positions[..2 * length(l)],
            })
            .collect();
        BatchRollout { runs: &mut runs, limit: 1e3 }.run_all(level);
        for l in 0..torques.len() {
            let mut state = start(l % WIDTH);
            let mut expected = vec![f64::NAN; 2 * ROWS];
            for k in 0..length(l) {
                let interval = Interval { t: t[k], h: t[k + 1] - t[k], torque: &torques[l][k] };
                advance(&plants[l % 2], &mut state, &interval, 1);
                expected[2 * k..2 * k + 2].copy_from_slice(state.q.as_slice());
            }
            let n = 2 * length(l);
            assert!(apart(&out[l][..n], &expected[..n]) < 1e-10, "run {l}, {}", level.name());
            assert!(out[l][n..].iter().all(|q| q.is_nan()), "run {l} went on");
        }
    }
}

#[test]
fn a_run_that_leaves_the_limit_ends_and_leaves_its_neighbours_alone() {
    let (plant, t) = (seed(THETA), times());
    let mut torques: Vec<_> = (0..WIDTH).map(torques).collect();
    torques[2][50][0] = InputSegment::held(f64::NAN);
    torques[5][20][1] = InputSegment::held(1e9);
    let mut out = vec![vec![f64::NAN; 2 * ROWS]; WIDTH];
    let mut runs: Vec<_> = out
        .iter_mut()
        .zip(&torques)
        .enumerate()
        .map(|(l, (positions, torque))| Run { plant: &plant, t: &t, torque, state: start(l), positions })
        .collect();
    BatchRollout { runs: &mut runs, limit: 1e3 }.run_all(Level::widest());
    assert!(out[2][99].is_finite() && out[2][100].is_nan());
    assert!(out[5][2 * ROWS - 1].is_nan(), "what is thrown off goes on");
    for l in [0, 1, 3, 4, 6, 7] {
        assert!(apart(&out[l], &alone(&plant, l)) < 1e-10, "lane {l}");
    }
}
