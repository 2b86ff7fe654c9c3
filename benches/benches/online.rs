//! Cost per sample of the online estimators, filters to covariance.

use armgap_bench::run::{SAMPLES, arm, samples};
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Settings};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::SVector;

fn estimators<T: Real>(c: &mut Criterion, real: &str) {
    let data = samples::<T>();
    let mut group = c.benchmark_group(format!("online {real}"));
    group.throughput(Throughput::Elements(u64::from(SAMPLES)));
    for (variant, name) in [(Variant::Paper, "paper"), (Variant::Exact, "exact")] {
        for scheme in Scheme::ALL {
            let settings = Settings {
                scheme,
                variant,
                cutoff: Cutoff { rad_per_s: lit(50.0) },
                forgetting: T::one(),
                theta0: SVector::<T, 9>::zeros(),
                p0: lit(1000.0),
            };
            let fresh = Estimator::<T, _, 2, 9, 9>::new(arm::<T>(), settings);
            group.bench_function(format!("{} {name}", scheme.name()), |b| {
                b.iter_batched_ref(
                    || fresh,
                    |estimator| data.iter().map(|sample| estimator.update(sample)).last(),
                    BatchSize::SmallInput,
                );
            });
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
