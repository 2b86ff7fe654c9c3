//! The core beside plain C doing the same work: times, ratios, and by how much the estimates differ. Markdown on standard output.
//!
//! All columns of a row are measured in turn, over and over, so that whatever else the machine does falls on all of them alike.

use armgap_bench::cost::{fresh, readings};
use armgap_bench::run::{PERIOD, samples};
use armgap_bench::scaling;
use armgap_benches::peer::{Arrays, Build};
use armgap_core::identify::Reading;
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use std::hint::black_box;
use std::io::Write;
use std::time::Instant;

const ROUNDS: usize = 301;
/// Relative difference of the estimates beyond which the work was not the same.
const SAME: f64 = 1e-9;

/// The estimate after the whole run.
fn ours<T: Real>(data: &[Reading<T, 2>], scheme: Scheme, variant: Variant, form: Form) -> [T; 9] {
    let mut estimator = fresh::<T>(scheme, variant, form);
    let period = lit(PERIOD);
    for reading in data {
        estimator.update_after(period, reading);
    }
    (*estimator.rls().theta()).into()
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Median times per sample [ns] of plain C, C for this processor, and ours: plain, factorized, and both in single precision; and the
/// largest relative difference between C and ours in double precision.
fn compare(scheme: Scheme, variant: Variant) -> ([f64; 6], f64) {
    let (double, single) = (readings::<f64>(), readings::<f32>());
    let arrays = Arrays::of(&samples::<f64>());
    let mut times: [Vec<f64>; 6] = Default::default();
    let mut off = 0.0_f64;
    for _ in 0..ROUNDS {
        let mut timed = |column: usize, work: &mut dyn FnMut()| {
            let start = Instant::now();
            work();
            times[column].push(start.elapsed().as_nanos() as f64 / double.len() as f64);
        };
        let (mut c, mut plain, mut factorized) = ([0.0; 9], [0.0; 9], [0.0; 9]);
        timed(0, &mut || c = black_box(arrays.estimate(Build::Portable, scheme, variant, PERIOD)));
        timed(1, &mut || _ = black_box(arrays.estimate(Build::Native, scheme, variant, PERIOD)));
        timed(2, &mut || plain = black_box(ours(&double, scheme, variant, Form::Plain)));
        timed(3, &mut || factorized = black_box(ours(&double, scheme, variant, Form::Factorized)));
        timed(4, &mut || _ = black_box(ours(&single, scheme, variant, Form::Plain)));
        timed(5, &mut || _ = black_box(ours(&single, scheme, variant, Form::Factorized)));
        for j in 0..9 {
            off = off.max((plain[j] / c[j] - 1.0).abs()).max((factorized[j] / c[j] - 1.0).abs());
        }
    }
    (times.each_mut().map(|t| median(t)), off)
}

fn main() -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(
        out,
        "| scheme | filters | C -O3 | C -O3 -march=native | plain | factorized | plain f32 | factorized f32 | plain / C | estimates differ |"
    )?;
    writeln!(out, "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")?;
    let mut same = true;
    for variant in [Variant::Paper, Variant::Exact] {
        for scheme in Scheme::ALL {
            let (t, off) = compare(scheme, variant);
            same &= off < SAME;
            let filters = if variant == Variant::Paper { "paper" } else { "exact" };
            let times: Vec<String> = t.iter().map(|t| format!("{t:.0}")).collect();
            let ratio = t[2] / t[0];
            writeln!(
                out,
                "| {} | {filters} | {} | {ratio:.2} | {off:.0e} |",
                scheme.name(),
                times.join(" | ")
            )?;
        }
    }
    writeln!(out, "\n| parameters | joints | plain | factorized | plain f32 | factorized f32 |")?;
    writeln!(out, "| --- | --- | --- | --- | --- | --- |")?;
    for ((r, m, plain, factorized), (_, _, plain32, factorized32)) in
        scaling::table::<f64>().into_iter().zip(scaling::table::<f32>())
    {
        writeln!(out, "| {r} | {m} | {plain:.0} | {factorized:.0} | {plain32:.0} | {factorized32:.0} |")?;
    }
    if !same {
        eprintln!("the estimates differ by more than {SAME:e}: the work was not the same");
        std::process::exit(1);
    }
    Ok(())
}
