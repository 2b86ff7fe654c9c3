//! Tests of recursive least squares in single precision, with the figures of `docs/decisions/006-least-squares-form.md`.

#[path = "../../bench/src/run.rs"]
mod run;

use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Settings};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::{Form, Rls};
use nalgebra::{SMatrix, SVector};

/// Largest relative difference of estimates in single and double precision on the run of Reyes and Kelly (1997); 1.1e-3 is the largest seen.
const SINGLE_AGAINST_DOUBLE: f64 = 0.005;

fn double<T: Real>(x: T) -> f64 {
    nalgebra::try_convert(x).expect("finite numbers convert")
}

fn is_positive_definite<T: Real, const R: usize>(p: &SMatrix<T, R, R>) -> bool {
    // LDL' in double precision, so that the judgement adds no rounding of its own.
    let mut a = p.map(double);
    (0..R).all(|k| {
        for i in (k + 1)..R {
            for j in (k + 1)..R {
                a[(i, j)] -= a[(i, k)] * a[(k, j)] / a[(k, k)];
            }
        }
        a[(k, k)] > 0.0
    })
}

/// Estimate after the run of Reyes and Kelly (1997); the covariance is checked after every sample.
fn seed_estimate<T: Real>(scheme: Scheme, variant: Variant) -> SVector<f64, 9> {
    let settings = Settings {
        scheme,
        variant,
        cutoff: Cutoff { rad_per_s: lit(50.0) },
        forgetting: T::one(),
        theta0: SVector::<T, 9>::zeros(),
        p0: lit(1000.0),
    };
    let mut estimator = Estimator::<T, _, 2, 9, 9>::new(run::arm::<T>(), settings);
    for (k, sample) in run::samples::<T>().iter().enumerate() {
        estimator.update(sample);
        assert!(
            is_positive_definite(&estimator.rls().covariance()),
            "{} {variant:?} at sample {k}",
            scheme.name()
        );
    }
    assert_eq!(estimator.rejected(), 0);
    estimator.rls().theta().map(double)
}

#[test]
fn the_seeds_run_in_single_precision() {
    for scheme in Scheme::ALL {
        for variant in [Variant::Paper, Variant::Exact] {
            let (fine, coarse) =
                (seed_estimate::<f64>(scheme, variant), seed_estimate::<f32>(scheme, variant));
            let off = (coarse - fine).component_div(&fine).amax();
            assert!(off < SINGLE_AGAINST_DOUBLE, "{} {variant:?}: {off:e}", scheme.name());
        }
    }
}

const TRUTH: [f64; 6] = [2.0, -0.1, 0.3, 38.0, 1.8, 7.6];
const SIZES: [f64; 6] = [1.0, 1e-2, 10.0, 1.0, 0.3, 5.0];

/// Result of a million random updates whose sizes differ by a factor of a thousand: samples after which `P` was not positive definite, and the
/// relative error of the estimate at the end.
fn life<T: Real>(p0: f64) -> (Vec<u32>, f64) {
    let mut state = 3_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut rls = Rls::<T, 6>::new(SVector::zeros(), lit(p0), T::one());
    let mut indefinite = Vec::new();
    for k in 0..1_000_000 {
        let psi = SMatrix::<f64, 2, 6>::from_fn(|_, j| noise() * SIZES[j]);
        rls.update(&psi.map(lit::<T>), &(psi * SVector::from(TRUTH)).map(lit::<T>));
        if (k < 1000 || k % 1000 == 0) && !is_positive_definite(&rls.covariance()) {
            indefinite.push(k);
        }
    }
    let off = (rls.theta().map(double) - SVector::from(TRUTH)).component_div(&SVector::from(TRUTH)).amax();
    (indefinite, off)
}

#[test]
fn a_million_random_updates() {
    // With P(0) = 10^6, P(0) |psi|^2 is ten times the reciprocal of single precision's rounding unit.
    for p0 in [1.0, 1e3, 1e6] {
        for (indefinite, off) in [life::<f64>(p0), life::<f32>(p0)] {
            assert!(indefinite.is_empty(), "P(0) = {p0}: {indefinite:?}");
            // P(0) itself pulls towards zero, by 1.5e-2 / P(0) for the smallest regressor; the rest is rounding times the ratio of the sizes.
            assert!(off < 0.02 / p0 + 1e-3, "P(0) = {p0}: off by {off:e}");
        }
    }
}

/// Result of a million samples of a motion that hardly excites one of three directions: the estimate, and whether the covariance was positive
/// definite at every thousandth sample.
fn weakly_excited<T: Real>(form: Form) -> (SVector<f64, 3>, bool) {
    let mut rls = Rls::<T, 3>::new(SVector::zeros(), lit(1000.0), T::one()).with_form(form);
    let mut definite = true;
    for k in 0..1_000_000 {
        let t = f64::from(k) * 0.0025;
        // The third regressor is the second's twin but for three parts in a thousand.
        let psi =
            [20.0 * (3.1 * t).sin(), 10.0 * (7.3 * t).sin(), 10.0 * (7.3 * t).sin() + 0.03 * (5.7 * t).cos()];
        let y = 2.0 * psi[0] + 0.5 * psi[1] + 1.5 * psi[2];
        rls.update(&SMatrix::<f64, 1, 3>::from_row_slice(&psi).map(lit::<T>), &SVector::<T, 1>::new(lit(y)));
        if k % 1000 == 0 {
            definite &= is_positive_definite(&rls.covariance());
        }
    }
    (rls.theta().map(double), definite)
}

#[test]
fn weak_excitation_needs_the_factorized_form_in_single_precision() {
    let (reference, _) = weakly_excited::<f64>(Form::Factorized);
    let off = |theta: SVector<f64, 3>| (theta - reference).component_div(&reference).amax();
    let (factorized, definite) = weakly_excited::<f32>(Form::Factorized);
    assert!(definite && off(factorized) < 0.01, "{definite} {:e}", off(factorized));
    let (plain, definite) = weakly_excited::<f64>(Form::Plain);
    assert!(definite && off(plain) < 1e-6, "{definite} {:e}", off(plain));
    // What the plain form does in single precision: it loses definiteness.
    let (_, definite) = weakly_excited::<f32>(Form::Plain);
    assert!(!definite);
}
