//! Benchmark of simulating the 10 s run of Reyes and Kelly (1997), by number of steps per period and by effect.

use armgap_bench::run::{PERIOD, SAMPLES, THETA, arm, rollout, torque};
use armgap_core::effect::{Active, InputSegment, catalogue};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector2;

fn rollouts(c: &mut Criterion) {
    let mut group = c.benchmark_group("rollout of 10 s");
    for substeps in [1_usize, 2, 4] {
        group.throughput(Throughput::Elements(u64::from(SAMPLES) * substeps as u64));
        group.bench_function(format!("{substeps} steps per period"), |b| b.iter(|| rollout(substeps)));
    }
    group.finish();
}

/// Simulates the 10 s run with the effects of `plant`, one step per period, and returns the last state.
fn with_effect(plant: &Plant<f64, armgap_core::arm::TwoLink<f64>, 2, 9>) -> State<f64, 2> {
    let mut state = State::new(Vector2::zeros(), Vector2::zeros());
    for k in 0..SAMPLES {
        let t = f64::from(k) * PERIOD;
        let torque = torque(t).map(InputSegment::held);
        advance(plant, &mut state, &Interval { t, h: PERIOD, torque: &torque }, 1);
    }
    state
}

fn effects(c: &mut Criterion) {
    let mut group = c.benchmark_group("one step per period");
    group.throughput(Throughput::Elements(u64::from(SAMPLES)));
    let bare = Plant::new(arm::<f64>(), THETA);
    group.bench_function("no effect", |b| b.iter(|| with_effect(&bare)));
    for law in catalogue::<f64>() {
        let mut p = law.spec().initial_guesses.first().copied().unwrap_or_default();
        for (value, parameter) in p.iter_mut().zip(law.spec().parameters) {
            *value = value.clamp(parameter.lower, parameter.upper);
        }
        let active = Active { law: *law, joint: 1, p };
        if let Some(plant) = Plant::new(arm::<f64>(), THETA).with_effect(active) {
            group.bench_function(law.spec().name, |b| b.iter(|| with_effect(&plant)));
        }
    }
    group.finish();
}

criterion_group!(benches, rollouts, effects);
criterion_main!(benches);
