//! dev harness
use armgap_bench::run::{PERIOD, arm, samples};
use armgap_benches::peer::{Arrays, Build};
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Reading, Settings};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use nalgebra::SVector;
use std::hint::black_box;
use std::time::Instant;

fn ours<T: Real>(
    data: &[armgap_core::identify::Sample<T, 2>],
    scheme: Scheme,
    variant: Variant,
    form: Form,
    period: bool,
) -> SVector<T, 9> {
    let settings = Settings {
        scheme,
        variant,
        cutoff: Cutoff { rad_per_s: lit(50.0) },
        forgetting: T::one(),
        theta0: SVector::zeros(),
        p0: lit(1000.0),
    };
    let mut estimator = Estimator::<T, _, 2, 9, 9>::new(arm(), settings).with_form(form);
    if period {
        for s in data {
            estimator.update_after(lit(PERIOD), &Reading { q: s.q, dq: s.dq, tau: s.tau });
        }
    } else {
        for s in data {
            estimator.update(s);
        }
    }
    *estimator.rls().theta()
}

fn main() {
    let data = samples::<f64>();
    let single = samples::<f32>();
    let arrays = Arrays::of(&data);
    for variant in [Variant::Paper, Variant::Exact] {
        for scheme in Scheme::ALL {
            let mut times = [const { Vec::<f64>::new() }; 7];
            let mut theta = [[0.0; 9]; 7];
            for _ in 0..200 {
                for (i, t) in times.iter_mut().enumerate() {
                    let start = Instant::now();
                    theta[i] = black_box(match i {
                        0 => arrays.estimate(Build::Portable, scheme, variant, PERIOD),
                        1 => arrays.estimate(Build::Native, scheme, variant, PERIOD),
                        2 => ours(&data, scheme, variant, Form::Plain, false).into(),
                        3 => ours(&data, scheme, variant, Form::Plain, true).into(),
                        4 => ours(&data, scheme, variant, Form::Factorized, true).into(),
                        5 => ours(&single, scheme, variant, Form::Plain, true).map(f64::from).into(),
                        _ => ours(&single, scheme, variant, Form::Factorized, true).map(f64::from).into(),
                    });
                    t.push(start.elapsed().as_nanos() as f64 / data.len() as f64);
                }
            }
            let med: Vec<f64> = times
                .iter_mut()
                .map(|t| {
                    t.sort_by(f64::total_cmp);
                    t[t.len() / 2]
                })
                .collect();
            print!("{:16} {variant:?}  C {:6.1}  native {:6.1} |", scheme.name(), med[0], med[1]);
            for i in 2..7 {
                let off =
                    (0..9).map(|j| ((theta[0][j] - theta[i][j]) / theta[0][j]).abs()).fold(0.0, f64::max);
                print!(" {:6.1} {:.2} {off:.0e} |", med[i], med[i] / med[0]);
            }
            println!();
        }
    }
}
