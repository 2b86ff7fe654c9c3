//! Cost of simulating the seed paper's 10 s.

use armgap_bench::run::rollout;
use criterion::{Criterion, criterion_group, criterion_main};

fn rollouts(c: &mut Criterion) {
    let mut group = c.benchmark_group("rollout of 10 s");
    for substeps in [1, 2, 4] {
        group.bench_function(format!("{substeps} steps per period"), |b| b.iter(|| rollout(substeps)));
    }
    group.finish();
}

criterion_group!(benches, rollouts);
criterion_main!(benches);
