//! Test that the online estimator and the integrator never allocate memory.

use armgap_core::arm::TwoLink;
use armgap_core::effect::{Active, InputSegment, find};
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Sample, Settings};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use armgap_core::regression::{Scheme, Variant};
use nalgebra::{SVector, Vector2};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) };
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const THETA: [f64; 9] = [2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6, 1.734];

fn allocations(work: impl FnOnce()) -> usize {
    let before = COUNT.with(Cell::get);
    work();
    COUNT.with(Cell::get) - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(Box::new(1))), 1);
}

#[test]
fn estimators_and_integrator_allocate_nothing() {
    let arm = TwoLink::new(9.81, Some(0.45), &THETA);
    let law = find::<f64>("stribeck").expect("in the catalogue");
    let plant =
        Plant::new(arm, THETA).with_effect(Active { law, joint: 1, p: [0.5, 0.3, 0.0] }).expect("room");
    for scheme in Scheme::ALL {
        for variant in [Variant::Paper, Variant::Exact] {
            let settings = Settings {
                scheme,
                variant,
                cutoff: Cutoff { rad_per_s: 50.0 },
                forgetting: 1.0,
                theta0: SVector::<f64, 9>::zeros(),
                p0: 1000.0,
            };
            let count = allocations(|| {
                let mut estimator = Estimator::<f64, _, 2, 9, 9>::new(arm, settings);
                let mut state = State::new(Vector2::zeros(), Vector2::zeros());
                for k in 0..2000 {
                    let t = f64::from(k) * 0.0025;
                    let tau = Vector2::new(40.0 * (9.0 * t).sin(), 8.0 * (13.0 * t).cos());
                    estimator.update(&Sample { t, q: state.q, dq: None, tau });
                    let torque = [InputSegment::held(tau[0]), InputSegment::held(tau[1])];
                    advance(&plant, &mut state, &Interval { t, h: 0.0025, torque: &torque }, 1);
                }
                assert!(estimator.rls().updates() > 1900);
            });
            assert_eq!(count, 0, "{} {variant:?}", scheme.name());
        }
    }
}
