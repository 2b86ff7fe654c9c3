use armgap_bench::cost::{fresh, readings};
use armgap_bench::run::{PERIOD, samples};
use armgap_benches::peer::{Arrays, Build};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use std::hint::black_box;
use std::time::Instant;
fn main() {
    let only = std::env::args().nth(1);
    let loops: usize = if only.is_some() { 3000 } else { 200 };
    let data = readings::<f64>();
    let arrays = Arrays::of(&samples::<f64>());
    for variant in [Variant::Paper, Variant::Exact] {
        for scheme in Scheme::ALL {
            let name = format!("{} {:?}", scheme.name(), variant);
            if let Some(o) = &only { if !name.contains(o.as_str()) { continue; } }
            let mut t = [vec![], vec![], vec![]];
            for _ in 0..loops {
                let s = Instant::now();
                black_box(arrays.estimate(Build::Portable, scheme, variant, PERIOD));
                t[0].push(s.elapsed().as_nanos() as f64 / 4000.0);
                for (i, form) in [(1, Form::Plain), (2, Form::Factorized)] {
                    let s = Instant::now();
                    let mut e = fresh::<f64>(scheme, variant, form);
                    for r in &data { e.update_after(PERIOD, r); }
                    black_box(e.rls().theta());
                    t[i].push(s.elapsed().as_nanos() as f64 / 4000.0);
                }
            }
            for x in &mut t { x.sort_by(f64::total_cmp); }
            let m: Vec<f64> = t.iter().map(|x| x[x.len() / 2]).collect();
            println!("{name:28} C {:5.1} plain {:5.1} fact {:5.1} ratio {:.3} {:.3}", m[0], m[1], m[2], m[1] / m[0], m[2] / m[0]);
        }
    }
}
