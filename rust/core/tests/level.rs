//! Tests that estimates agree up to rounding, and rejected samples exactly, whatever instruction set is used.

#[path = "../../bench/src/run.rs"]
mod run;

use armgap_core::cpu::Level;
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Settings};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::{Form, Rls};
use nalgebra::{SMatrix, SVector};

/// Largest relative difference of an estimate between instruction sets over the run; 9e-12 is the largest seen.
const ROUNDING: f64 = 1e-10;

fn estimates(scheme: Scheme, variant: Variant, form: Form, level: Level) -> Vec<SVector<f64, 9>> {
    let settings = Settings {
        scheme,
        variant,
        cutoff: Cutoff { rad_per_s: 50.0 },
        forgetting: 0.9999,
        theta0: SVector::zeros(),
        p0: 1000.0,
    };
    let mut estimator =
        Estimator::<f64, _, 2, 9, 9>::new(run::arm::<f64>(), settings).with_form(form).with_level(level);
    let path = run::samples::<f64>().into_iter().map(|sample| {
        estimator.update(&sample);
        *estimator.rls().theta()
    });
    path.skip(400).collect()
}

#[test]
fn every_level_gives_the_same_estimates() {
    for scheme in Scheme::ALL {
        for variant in [Variant::Paper, Variant::Exact] {
            for form in [Form::Plain, Form::Factorized] {
                let one = estimates(scheme, variant, form, Level::PORTABLE);
                let other = estimates(scheme, variant, form, Level::detect());
                let off = one.iter().zip(&other).map(|(a, b)| (b - a).component_div(a).amax());
                let off = off.fold(0.0, f64::max);
                assert!(off < ROUNDING, "{} {variant:?} {form:?}: {off:e}", scheme.name());
            }
        }
    }
}

#[test]
fn every_level_rejects_the_same_regressors() {
    for level in [Level::PORTABLE, Level::detect()] {
        for form in [Form::Plain, Form::Factorized] {
            let mut rls = Rls::<f64, 5>::new(SVector::zeros(), 1000.0, 1.0).with_form(form).with_level(level);
            for bad in [f64::NAN, f64::INFINITY, 1e40] {
                let psi = SMatrix::<f64, 2, 5>::from_fn(|m, j| if (m, j) == (1, 4) { bad } else { 1.0 });
                rls.update(&psi, &SVector::<f64, 2>::new(1.0, 2.0));
            }
            assert_eq!((rls.updates(), rls.rejected()), (0, 3), "{} {form:?}", level.name());
            rls.update(&SMatrix::<f64, 2, 5>::repeat(1.0), &SVector::<f64, 2>::new(1.0, 2.0));
            assert!(rls.updates() == 1 && rls.theta().iter().all(|x| x.is_finite()));
        }
    }
}
