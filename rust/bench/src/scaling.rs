//! Time of recursive least squares alone with synthetic regressors: 2 to 60 parameters, 1 to 6 errors per sample.

use armgap_core::real::{Real, lit};
use armgap_core::rls::{Form, Rls};
use nalgebra::{SMatrix, SVector};
use std::hint::black_box;
use std::time::Instant;

/// Number of samples per run of recursive least squares.
const SAMPLES: usize = 400;

/// Number of runs whose median time counts.
const RUNS: usize = 15;

/// Median time of an update of recursive least squares with `R` parameters and `M` errors, ns.
pub fn update<T: Real, const M: usize, const R: usize>(form: Form) -> f64 {
    let mut state = 11_u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let data: Vec<(SMatrix<T, M, R>, SVector<T, M>)> = (0..SAMPLES)
        .map(|_| (SMatrix::from_fn(|_, _| lit(noise())), SVector::from_fn(|_, _| lit(noise()))))
        .collect();
    let fresh = Rls::<T, R>::new(SVector::zeros(), lit(1000.0), T::one()).with_form(form);
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| {
            let mut rls = fresh;
            let start = Instant::now();
            for (psi, y) in &data {
                black_box(rls.update(psi, y));
            }
            start.elapsed().as_nanos() as f64 / SAMPLES as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[RUNS / 2]
}

/// Numbers of parameters and of errors per sample, and times of an update with the plain and with the factorized form, ns.
pub type Row = (usize, usize, f64, f64);

fn row<T: Real, const M: usize, const R: usize>() -> Row {
    (R, M, update::<T, M, R>(Form::Plain), update::<T, M, R>(Form::Factorized))
}

/// Times of an update: with one error and 2 to 60 parameters, then with one error and ten parameters for each of 1 to 6 joints.
pub fn table<T: Real>() -> Vec<Row> {
    vec![
        row::<T, 1, 2>(),
        row::<T, 1, 4>(),
        row::<T, 1, 9>(),
        row::<T, 1, 12>(),
        row::<T, 1, 20>(),
        row::<T, 1, 30>(),
        row::<T, 1, 40>(),
        row::<T, 1, 60>(),
        row::<T, 1, 10>(),
        row::<T, 2, 20>(),
        row::<T, 3, 30>(),
        row::<T, 4, 40>(),
        row::<T, 5, 50>(),
        row::<T, 6, 60>(),
    ]
}
