//! One call of `one_sample` per sample, for a tool that counts instructions: `instructions SCHEME paper|exact plain|factorized SAMPLES
//! best|portable`.

use armgap_bench::cost::{Online, fresh, readings};
use armgap_bench::run::PERIOD;
use armgap_core::cpu::Level;
use armgap_core::identify::Reading;
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use std::hint::black_box;

/// What is counted.
#[inline(never)]
fn one_sample(estimator: &mut Online<f64>, reading: &Reading<f64, 2>) {
    black_box(estimator.update_after(PERIOD, reading));
}

fn main() {
    let words: Vec<String> = std::env::args().collect();
    let word = |i: usize| words.get(i).map_or("", String::as_str);
    let (Some(scheme), Ok(count)) = (Scheme::from_name(word(1)), word(4).parse::<usize>()) else {
        eprintln!("usage: instructions SCHEME paper|exact plain|factorized SAMPLES best|portable");
        std::process::exit(2);
    };
    let variant = if word(2) == "paper" { Variant::Paper } else { Variant::Exact };
    let form = if word(3) == "plain" { Form::Plain } else { Form::Factorized };
    let level = if word(5) == "portable" { Level::PORTABLE } else { Level::detect() };
    let mut estimator = fresh::<f64>(scheme, variant, form).with_level(level);
    for reading in readings::<f64>().iter().take(count) {
        one_sample(&mut estimator, reading);
    }
}
