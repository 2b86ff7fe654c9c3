//! Times of rollouts of the two-link arm by `armgap-core` and by plain C: one run, 64 runs, and the windows of one log. Markdown on standard output.
//!
//! All columns of a row are measured in turn, over and over, so that disturbances of the machine fall on all of them alike.

use armgap_bench::run::{PERIOD, SAMPLES, THETA, arm, torque};
use armgap_benches::baseline::Build;
use armgap_benches::baseline_rollout;
use armgap_core::arm::TwoLink;
use armgap_core::cpu::Level;
use armgap_core::effect::InputSegment;
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use armgap_core::rollout::{BatchRollout, Run};
use nalgebra::Vector2;
use std::hint::black_box;
use std::io::Write;
use std::time::Instant;

const ROUNDS: usize = 21;
/// Largest difference of positions between `armgap-core` and plain C, rad, at which their work was equal.
const SAME: f64 = 1e-6;

type Seed = Plant<f64, TwoLink<f64>, 2, 9>;

/// Runs of one arm under parts of one sequence of torques, with their initial states.
struct Case {
    name: &'static str,
    plant: Seed,
    tau: Vec<f64>,
    torque: Vec<[InputSegment<f64>; 2]>,
    t: Vec<f64>,
    /// First period of every run, and positions and velocities at its start, rad and rad/s.
    initial_states: Vec<(usize, [f64; 4])>,
    periods: usize,
}

impl Case {
    fn new(name: &'static str, dry: bool) -> Self {
        let mut theta = THETA;
        if !dry {
            theta[7..].fill(0.0);
        }
        let rows: Vec<[f64; 2]> = (0..SAMPLES).map(|k| torque(f64::from(k) * PERIOD)).collect();
        Self {
            name,
            plant: Plant::new(arm::<f64>(), theta),
            tau: rows.concat(),
            torque: rows.iter().map(|row| row.map(InputSegment::held)).collect(),
            t: (0..=SAMPLES).map(|k| f64::from(k) * PERIOD).collect(),
            initial_states: vec![(0, [0.0; 4])],
            periods: SAMPLES as usize,
        }
    }

    /// Case of `count` runs of `periods` periods from different initial states.
    fn many(mut self, name: &'static str, count: u32, periods: usize) -> Self {
        let start = |l: u32| (0, [0.002 * f64::from(l), -0.003 * f64::from(l), 0.1, -0.2]);
        (self.name, self.initial_states, self.periods) = (name, (0..count).map(start).collect(), periods);
        self
    }

    /// Case of the run cut into windows of `periods` periods, each from the state of the run at its start.
    fn windows(mut self, name: &'static str, periods: usize) -> Self {
        let mut state = State::new(Vector2::zeros(), Vector2::zeros());
        self.initial_states.clear();
        for k in 0..self.torque.len() {
            if k % periods == 0 {
                self.initial_states.push((k, [state.q[0], state.q[1], state.dq[0], state.dq[1]]));
            }
            let interval = Interval { t: self.t[k], h: PERIOD, torque: &self.torque[k] };
            advance(&self.plant, &mut state, &interval, 1);
        }
        (self.name, self.periods) = (name, periods);
        self
    }

    fn steps(&self) -> usize {
        self.initial_states.len() * self.periods
    }

    fn baseline(&self, build: Build, q: &mut [f64]) {
        for ((first, x), q) in self.initial_states.iter().zip(q.chunks_exact_mut(2 * self.periods)) {
            let tau = &self.tau[2 * first..2 * (first + self.periods)];
            baseline_rollout::rollout(build, self.plant.theta(), x, tau, PERIOD, q);
        }
    }

    fn one_by_one(&self, q: &mut [f64]) {
        for ((first, x), q) in self.initial_states.iter().zip(q.chunks_exact_mut(2 * self.periods)) {
            let mut state = state(x);
            for (k, q) in (*first..).zip(q.chunks_exact_mut(2)) {
                let interval = Interval { t: self.t[k], h: PERIOD, torque: &self.torque[k] };
                advance(&self.plant, &mut state, &interval, 1);
                q.copy_from_slice(state.q.as_slice());
            }
        }
    }

    fn together(&self, level: Level, q: &mut [f64]) {
        let runs = self.initial_states.iter().zip(q.chunks_exact_mut(2 * self.periods));
        let mut runs: Vec<_> = runs
            .map(|((first, x), positions)| Run {
                plant: &self.plant,
                t: &self.t[*first..=first + self.periods],
                torque: &self.torque[*first..first + self.periods],
                state: state(x),
                positions,
            })
            .collect();
        BatchRollout { runs: &mut runs, limit: 1e3 }.run_all(level);
    }
}

fn state(x: &[f64; 4]) -> State<f64, 2> {
    State::new(Vector2::new(x[0], x[1]), Vector2::new(x[2], x[3]))
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Median times per step, ns, of portable C, C for this processor, `armgap-core` one run at a time, and in batches with portable code, with AVX2, and with
/// the widest vectors; and the largest difference of positions from C's, rad.
fn compare(case: &Case) -> ([f64; 6], f64) {
    let mut q: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; 2 * case.steps()]);
    let mut times: [Vec<f64>; 6] = Default::default();
    for _ in 0..ROUNDS {
        for column in 0..6 {
            let q = black_box(&mut q[column]);
            let start = Instant::now();
            match column {
                0 => case.baseline(Build::Portable, q),
                1 => case.baseline(Build::Native, q),
                2 => case.one_by_one(q),
                3 => case.together(Level::PORTABLE, q),
                4 => case.together(Level::detect(), q),
                _ => case.together(Level::widest(), q),
            }
            times[column].push(start.elapsed().as_nanos() as f64 / case.steps() as f64);
        }
    }
    let apart = |a: &[f64]| a.iter().zip(&q[0]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    (times.each_mut().map(|t| median(t)), q[1..].iter().map(|q| apart(q)).fold(0.0, f64::max))
}

/// Cases whose rollouts are timed: one run, many runs and windows, with and without dry friction.
fn cases() -> Vec<Case> {
    vec![
        Case::new("one of 10 s, dry friction", true),
        Case::new("one of 10 s, no dry friction", false),
        Case::new("", true).many("64 of 0.5 s, dry friction", 64, 200),
        Case::new("", false).many("64 of 0.5 s, no dry friction", 64, 200),
        Case::new("", true).windows("50 windows of 0.2 s, dry friction", 80),
        Case::new("", false).windows("50 windows of 0.2 s, no dry friction", 80),
    ]
}

fn main() -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    let (level, widest) = (Level::detect().name(), Level::widest().name());
    writeln!(
        out,
        "| runs | C -O3 | C -O3 -march=native | one by one | together, portable | together, {level} | together, {widest} | one by one / C | C / {level} | C / {widest} | positions differ |"
    )?;
    writeln!(out, "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    let mut same = true;
    for case in cases() {
        let (t, off) = compare(&case);
        same &= off < SAME;
        let times: Vec<String> = t.iter().map(|t| format!("{t:.0}")).collect();
        let (single, many, most) = (t[2] / t[0], t[0] / t[4], t[0] / t[5]);
        writeln!(
            out,
            "| {} | {} | {single:.2} | {many:.1} | {most:.1} | {off:.0e} |",
            case.name,
            times.join(" | ")
        )?;
    }
    if !same {
        eprintln!("positions differ by more than {SAME:e} rad: the work was not the same");
        std::process::exit(1);
    }
    Ok(())
}
