//! Program with one call of `one_sample` per sample, for tools that count instructions: `instructions SCHEME paper|exact plain|factorized
//! SAMPLES best|portable two-link|serial`. The serial arm has seven joints and consistent filters.

use armgap_bench::cost::{fresh, readings};
use armgap_bench::run::PERIOD;
use armgap_bench::serial;
use armgap_core::chain::PARAMETERS_PER_JOINT;
use armgap_core::cpu::Level;
use armgap_core::online::{OnlineEstimator, When};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use armgap_fit::identify::base_parameters::AmongParameters;
use armgap_fit::model::chain::ChainDescription;
use std::hint::black_box;

/// Lets the estimator take sample `k`; the function whose instructions are counted.
#[inline(never)]
fn one_sample(take: &mut dyn FnMut(usize), k: usize) {
    take(k);
}

fn main() {
    let words: Vec<String> = std::env::args().collect();
    let word = |i: usize| words.get(i).map_or("", String::as_str);
    let (Some(scheme), Ok(count)) = (Scheme::from_name(word(1)), word(4).parse::<usize>()) else {
        eprintln!(
            "usage: instructions SCHEME paper|exact plain|factorized SAMPLES best|portable two-link|serial"
        );
        std::process::exit(2);
    };
    let variant = if word(2) == "paper" { Variant::Paper } else { Variant::Exact };
    let form = if word(3) == "plain" { Form::Plain } else { Form::Factorized };
    let portable = word(5) == "portable";
    let [level, wide] = if portable { [Level::PORTABLE; 2] } else { [Level::detect(), Level::widest()] };
    if word(6) == "serial" {
        let (chain, _) = serial::arm::<{ serial::JOINTS }>();
        let arm = ChainDescription { joints: chain.joints().to_vec(), gravity: *chain.gravity_vector() };
        let all: Vec<usize> = (0..PARAMETERS_PER_JOINT * serial::JOINTS).collect();
        let base = AmongParameters(&all).of(&arm).expect("seven joints").columns;
        let mut estimator = serial::fresh(scheme, form, &base).with_level(wide);
        let data = serial::samples(count);
        let mut take = |k: usize| {
            let _ = black_box(estimator.update(When::After(PERIOD), &data[k].0, None, &data[k].1));
        };
        (0..count).for_each(|k| one_sample(&mut take, k));
    } else {
        let mut estimator = fresh::<f64>(scheme, variant, form).with_level(level);
        let data = readings::<f64>();
        let mut take = |k: usize| {
            black_box(estimator.update_after(PERIOD, &data[k]));
        };
        (0..count.min(data.len())).for_each(|k| one_sample(&mut take, k));
    }
}
