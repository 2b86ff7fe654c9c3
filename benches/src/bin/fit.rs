//! Fit of the two-link arm's nine parameters to 10 s of motion with dry friction, by output error over windows of 0.2 s. Markdown on
//! standard output; with a file's name as argument, also writes the problem as JSON for other solvers (`baselines/output_error.py`).

use armgap_bench::run::{PERIOD, SAMPLES, THETA, rollout, torque};
use armgap_core::arm::ArmKind;
use armgap_fit::identify::output_error::{Estimate, OutputError};
use armgap_fit::log::track::Track;
use armgap_fit::model::arm::ArmDescription;
use armgap_fit::predict::window::Dataset;
use std::fmt::Write as _;
use std::io::Write;
use std::time::Instant;

const ROUNDS: usize = 51;
/// Counts per turn of the encoders of Reyes and Kelly (1997), joints 1 and 2.
const COUNTS: [f64; 2] = [1_024_000.0, 655_360.0];
/// Length of a window of the output-error fit, s.
const HORIZON: f64 = 0.2;
/// Initial values of the nine fitted parameters relative to the true ones.
const FIRST: [f64; 9] = [1.1, 0.8, 1.2, 0.9, 1.15, 1.3, 0.7, 0.85, 1.2];

struct Log {
    t: Vec<f64>,
    q: Vec<f64>,
    tau: Vec<f64>,
    steps: [f64; 2],
}

fn log() -> Log {
    let steps = COUNTS.map(|counts| std::f64::consts::TAU / counts);
    let seen = |q: f64, step: f64| (q / step).round() * step;
    Log {
        t: (0..SAMPLES).map(|k| f64::from(k) * PERIOD).collect(),
        q: rollout(1).iter().flat_map(|s| [seen(s.q[0], steps[0]), seen(s.q[1], steps[1])]).collect(),
        tau: (0..SAMPLES).flat_map(|k| torque(f64::from(k) * PERIOD)).collect(),
        steps,
    }
}

fn fitted(log: &Log) -> Option<Estimate> {
    let first: Vec<f64> = THETA.iter().zip(FIRST).map(|(x, f)| x * f).collect();
    let arm = ArmDescription::plain(ArmKind::TwoLink, 9.81, first, Some(vec![0.45, 0.45]));
    let work = OutputError { t: &log.t, q: &log.q, tau: &log.tau, horizon: HORIZON, steps: Some(&log.steps) };
    arm.dispatch(work).flatten()
}

/// The fit's problem as JSON for other solvers, with first sample, last sample and initial state of every window.
fn problem(log: &Log, estimate: &Estimate, milliseconds: f64) -> String {
    let data = Dataset::new(vec![Track::<2>::new("", &log.t, &log.q, &log.tau, Some(log.steps))], HORIZON);
    let mut windows = String::new();
    for (i, w) in data.windows.iter().enumerate() {
        let (q, dq, comma) = (w.initial_state.q, w.initial_state.dq, if i == 0 { "" } else { "," });
        let _ = write!(windows, "{comma}[{},{},{},{},{},{}]", w.first, w.last, q[0], q[1], dq[0], dq[1]);
    }
    let first: Vec<f64> = THETA.iter().zip(FIRST).map(|(x, f)| x * f).collect();
    format!(
        "{{\"h\":{PERIOD},\"q\":{:?},\"tau\":{:?},\"windows\":[{windows}],\"first\":{first:?},\"true\":{THETA:?},\"theta\":{:?},\"ms\":{milliseconds}}}",
        log.q, log.tau, estimate.theta
    )
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let log = log();
    let mut times = Vec::new();
    let mut last = None;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        last = fitted(&log);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    let estimate = last.ok_or("the log has no whole window")?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "| fit | median | least | iterations | RMS error |\n| --- | --- | --- | --- | --- |")?;
    writeln!(
        out,
        "| nine parameters, 10 s in windows of {HORIZON} s | {:.1} ms | {:.1} ms | {} | {:.1e} rad |",
        times[ROUNDS / 2],
        times[0],
        estimate.iterations,
        estimate.rms
    )?;
    writeln!(out, "\n| true | fitted | sigma |\n| --- | --- | --- |")?;
    for ((truth, theta), sigma) in THETA.iter().zip(&estimate.theta).zip(&estimate.sigma) {
        writeln!(out, "| {truth} | {theta:.7} | {sigma:.1e} |")?;
    }
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(path, problem(&log, &estimate, times[ROUNDS / 2]))?;
    }
    if !estimate.settled {
        return Err("the fit did not settle".into());
    }
    Ok(())
}
