//! Benchmark of the online estimator's time per sample, filters to covariance, by scheme, filters, precision and form of the covariance.

use armgap_bench::cost::{fresh, readings};
use armgap_bench::run::{PERIOD, SAMPLES};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};

fn estimators<T: Real>(c: &mut Criterion, real: &str) {
    let data = readings::<T>();
    let mut group = c.benchmark_group(format!("online {real}"));
    group.throughput(Throughput::Elements(u64::from(SAMPLES)));
    for (variant, filters) in [(Variant::Paper, "paper"), (Variant::Exact, "exact")] {
        for (form, kept) in [(Form::Plain, "plain"), (Form::Factorized, "factorized")] {
            for scheme in Scheme::ALL {
                let start = fresh::<T>(scheme, variant, form);
                group.bench_function(format!("{} {filters} {kept}", scheme.name()), |b| {
                    b.iter_batched_ref(
                        || start,
                        |estimator| data.iter().map(|r| estimator.update_after(lit(PERIOD), r)).last(),
                        BatchSize::SmallInput,
                    );
                });
            }
        }
    }
    group.finish();
}

fn online(c: &mut Criterion) {
    estimators::<f64>(c, "f64");
    estimators::<f32>(c, "f32");
}

criterion_group!(benches, online);
criterion_main!(benches);
