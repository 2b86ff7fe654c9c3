//! Times of the online estimator of `armgap-core` and of plain C doing equal work, with ratios and differences of the estimates. Markdown on
//! standard output.
//!
//! All columns of a row are measured in turn, over and over, so that disturbances of the machine fall on all of them alike.

use armgap_bench::cost::{fresh, readings};
use armgap_bench::run::{PERIOD, samples};
use armgap_bench::scaling;
use armgap_benches::baseline::{Arrays, Build};
use armgap_core::cpu::Level;
use armgap_core::identify::Reading;
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use std::hint::black_box;
use std::io::Write;
use std::time::Instant;

const ROUNDS: usize = 301;
/// Relative difference of the estimates of `armgap-core` and plain C above which their work counts as not equal.
const SAME: f64 = 1e-9;

/// Parameters estimated by `armgap-core` over the whole run.
fn ours<T: Real>(
    data: &[Reading<T, 2>],
    scheme: Scheme,
    variant: Variant,
    form: Form,
    level: Level,
) -> [T; 9] {
    let mut estimator = fresh::<T>(scheme, variant, form).with_level(level);
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

/// Headings of the measured columns: compiler options of plain C, or form of the covariance and precision.
const COLUMNS: [&str; 7] = [
    "C -O3",
    "C -O3 -march=native",
    "plain",
    "plain, without AVX2",
    "factorized",
    "plain f32",
    "factorized f32",
];

/// Median times per sample, ns, for each column, and the largest relative difference of estimates between plain C and `armgap-core` in double
/// precision.
fn compare(scheme: Scheme, variant: Variant) -> ([f64; COLUMNS.len()], f64) {
    let (double, single) = (readings::<f64>(), readings::<f32>());
    let arrays = Arrays::of(&samples::<f64>());
    let mut times: [Vec<f64>; COLUMNS.len()] = Default::default();
    let best = Level::detect();
    let in_double = |form, level| black_box(ours(&double, scheme, variant, form, level));
    let in_single = |form| black_box(ours(&single, scheme, variant, form, best));
    let in_c = |build| black_box(arrays.estimate(build, scheme, variant, PERIOD));
    let mut estimates = [[0.0; 9]; 5];
    for _ in 0..ROUNDS {
        let mut timed = |column: usize, work: &mut dyn FnMut()| {
            let start = Instant::now();
            work();
            times[column].push(start.elapsed().as_nanos() as f64 / double.len() as f64);
        };
        timed(0, &mut || estimates[0] = in_c(Build::Portable));
        timed(1, &mut || estimates[1] = in_c(Build::Native));
        timed(2, &mut || estimates[2] = in_double(Form::Plain, best));
        timed(3, &mut || estimates[3] = in_double(Form::Plain, Level::PORTABLE));
        timed(4, &mut || estimates[4] = in_double(Form::Factorized, best));
        timed(5, &mut || _ = in_single(Form::Plain));
        timed(6, &mut || _ = in_single(Form::Factorized));
    }
    let [c, others @ ..] = estimates;
    let off = others.iter().flatten().zip(c.iter().cycle()).map(|(x, c)| (x / c - 1.0).abs());
    (times.each_mut().map(|t| median(t)), off.fold(0.0, f64::max))
}

fn main() -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "instructions: {}\n", Level::detect().name())?;
    writeln!(out, "| scheme | filters | {} | plain / C | estimates differ |", COLUMNS.join(" | "))?;
    writeln!(out, "| --- | --- |{}", " --- |".repeat(COLUMNS.len() + 2))?;
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
