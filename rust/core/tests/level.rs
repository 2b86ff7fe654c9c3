//! Tests that estimates agree up to rounding, and rejected samples exactly, whatever instruction set is used.

#[path = "../../bench/src/run.rs"]
mod run;

use armgap_core::cpu::Level;
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Settings};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::{First, Form, Rls};
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

/// Estimate and covariance of `R` parameters, of which `count` are excited, from rows of noise, `M` at a time.
fn of_noise<const R: usize, const M: usize>(count: usize, form: Form, level: Level) -> Rls<f64, R, First> {
    let rls = Rls::<f64, R>::new(SVector::zeros(), 100.0, 0.999).with_count(First::new(count));
    let (mut rls, mut state) = (rls.with_form(form).with_level(level), 5_u64);
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    for _ in 0..300 {
        let psi = SMatrix::<f64, M, R>::from_fn(|_, j| if j < count { noise() } else { 0.0 });
        let y = psi * SVector::from_fn(|j, _| 1.0 + j as f64) + SVector::from_fn(|_, _| 0.01 * noise());
        rls.update(&psi, &y);
    }
    rls
}

fn forms_agree_on_many_parameters<const R: usize, const M: usize>(count: usize) {
    let expected = of_noise::<R, M>(count, Form::Factorized, Level::PORTABLE);
    for level in [Level::PORTABLE, Level::detect(), Level::widest()] {
        let found = of_noise::<R, M>(count, Form::Plain, level);
        let p = found.covariance();
        assert_eq!(p, p.transpose());
        assert_eq!(found.updates(), 300);
        let off = (found.theta() - expected.theta()).amax() / expected.theta().amax();
        let spread = (p - expected.covariance()).amax() / 100.0;
        assert!(off < ROUNDING && spread < ROUNDING, "{}, {count}: {off:e} {spread:e}", level.name());
        let variances = (found.variances() - p.diagonal()).component_div(&p.diagonal()).amax();
        assert!(variances < ROUNDING, "{}, {count}: {variances:e}", level.name());
    }
}

#[test]
fn many_parameters_are_estimated_alike_in_both_forms() {
    for count in [1, 3, 18, 20] {
        forms_agree_on_many_parameters::<20, 1>(count);
        forms_agree_on_many_parameters::<20, 2>(count);
    }
    for count in [37, 61, 64, 72] {
        forms_agree_on_many_parameters::<72, 1>(count);
        forms_agree_on_many_parameters::<72, 7>(count);
    }
}
