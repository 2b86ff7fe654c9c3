//! Times of the online estimator of a seven-joint arm, of all base parameters with rotors and friction, and of plain C doing equal work.
//! Markdown on standard output.
//!
//! All columns of a row are measured in turn, over and over, so that disturbances of the machine fall on all of them alike.

use armgap_bench::run::PERIOD;
use armgap_bench::serial::{JOINTS, Sample, arm, fresh, samples};
use armgap_benches::baseline::Build;
use armgap_benches::baseline_chain::ChainArrays;
use armgap_core::chain::PARAMETERS_PER_JOINT;
use armgap_core::cpu::Level;
use armgap_core::online::{OnlineEstimator, When};
use armgap_core::regression::Scheme;
use armgap_core::rls::Form;
use armgap_fit::identify::base_parameters::AmongParameters;
use armgap_fit::model::chain::ChainDescription;
use std::hint::black_box;
use std::time::Instant;

const SAMPLES: usize = 1000;
const ROUNDS: usize = 101;
/// Difference of the estimates of `armgap-core` and plain C, relative to the largest estimate, above which their work counts as not equal.
const SAME: f64 = 1e-8;

const COLUMNS: [&str; 6] =
    ["C -O3", "C -O3 -march=native", "plain", "factorized", "plain, AVX2", "plain, without AVX2"];

/// Parameters estimated by `armgap-core` over the whole motion.
fn ours(data: &[Sample], scheme: Scheme, form: Form, level: Level, columns: &[usize]) -> Vec<f64> {
    let mut estimator = fresh(scheme, form, columns).with_level(level);
    for (q, tau) in data {
        let _ = black_box(estimator.update(When::After(PERIOD), q, None, tau));
    }
    estimator.theta().to_vec()
}

/// Middle one of the numbers `x`, of which there is an odd count.
fn median(mut x: Vec<f64>) -> f64 {
    x.sort_by(f64::total_cmp);
    x[x.len() / 2]
}

fn main() {
    let (chain, _) = arm::<JOINTS>();
    let description = ChainDescription { joints: chain.joints().to_vec(), gravity: *chain.gravity_vector() };
    let all: Vec<usize> = (0..PARAMETERS_PER_JOINT * JOINTS).collect();
    let base = AmongParameters(&all).of(&description).expect("seven joints").columns;
    let data = samples(SAMPLES);
    let arrays = ChainArrays::of(&chain, &base, &data);
    println!("{} parameters; instructions: {}\n", base.len(), Level::widest().name());
    println!("| us per sample | {} | plain / C | plain / native C | estimates differ |", COLUMNS.join(" | "));
    println!("| --- |{}", " --- |".repeat(COLUMNS.len() + 3));
    let mut same = true;
    for scheme in [Scheme::FilteredPower, Scheme::FilteredDynamic] {
        let power = scheme == Scheme::FilteredPower;
        let run = |column: usize| match column {
            0 => arrays.estimate(Build::Portable, power, PERIOD),
            1 => arrays.estimate(Build::Native, power, PERIOD),
            2 => ours(&data, scheme, Form::Plain, Level::widest(), &base),
            3 => ours(&data, scheme, Form::Factorized, Level::widest(), &base),
            4 => ours(&data, scheme, Form::Plain, Level::detect(), &base),
            _ => ours(&data, scheme, Form::Plain, Level::PORTABLE, &base),
        };
        let mut times = [const { Vec::new() }; COLUMNS.len()];
        let mut estimates = [const { Vec::new() }; COLUMNS.len()];
        for _ in 0..ROUNDS {
            for column in 0..COLUMNS.len() {
                let start = Instant::now();
                estimates[column] = black_box(run(column));
                times[column].push(start.elapsed().as_secs_f64() * 1e6 / SAMPLES as f64);
            }
        }
        // Of ratios within each round: what disturbs a whole round drops out.
        let ratio = |to: usize| median(times[2].iter().zip(&times[to]).map(|(a, b)| a / b).collect());
        let largest = estimates[0].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let off = estimates[1..].iter().flat_map(|e| e.iter().zip(&estimates[0]).map(|(a, b)| (a - b).abs()));
        let off = off.fold(0.0, f64::max) / largest;
        same &= off < SAME;
        let ratios = [ratio(0), ratio(1)];
        let cells: Vec<String> = times.into_iter().map(|t| format!("{:.2}", median(t))).collect();
        println!(
            "| {} | {} | {:.2} | {:.2} | {off:.0e} |",
            scheme.name(),
            cells.join(" | "),
            ratios[0],
            ratios[1]
        );
    }
    if !same {
        eprintln!("the estimates differ by more than {SAME:e}: the work was not the same");
        std::process::exit(1);
    }
}
