//! Tests of recursive least squares against batch least squares, and over very many samples.

use armgap_core::rls::{Form, Rls, Update};
use nalgebra::{SMatrix, SVector};

/// Repeatable source of random numbers from -1 to 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

const TRUTH: [f64; 6] = [2.0, -0.1, 0.3, 38.0, 1.8, 7.6];

fn rows(count: usize) -> Vec<(SMatrix<f64, 3, 6>, SVector<f64, 3>)> {
    let mut noise = Noise(7);
    (0..count)
        .map(|_| {
            let psi = SMatrix::<f64, 3, 6>::from_fn(|_, _| noise.next());
            let y = psi * SVector::from(TRUTH) + SVector::from_fn(|_, _| 0.05 * noise.next());
            (psi, y)
        })
        .collect()
}

/// Batch least squares: the minimum of the cost of Reyes and Kelly (1997), equation (17), from `P(0) = p0 I`.
fn batch(rows: &[(SMatrix<f64, 3, 6>, SVector<f64, 3>)], p0: f64) -> SVector<f64, 6> {
    let mut normal = SMatrix::<f64, 6, 6>::identity() / p0;
    let mut right = SVector::<f64, 6>::zeros();
    for (psi, y) in rows {
        normal += psi.transpose() * psi;
        right += psi.transpose() * y;
    }
    normal.cholesky().expect("positive definite").solve(&right)
}

#[test]
fn with_forgetting_one_it_is_batch_least_squares_in_any_order_of_joints() {
    let data = rows(2000);
    let expected = batch(&data, 1000.0);
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        let mut rls = Rls::new(SVector::<f64, 6>::zeros(), 1000.0, 1.0);
        for (psi, y) in &data {
            let psi = SMatrix::<f64, 3, 6>::from_fn(|i, j| psi[(order[i], j)]);
            let y = SVector::<f64, 3>::from_fn(|i, _| y[order[i]]);
            assert!(matches!(rls.update(&psi, &y), Update::Used(_)));
        }
        let off = (rls.theta() - expected).norm() / expected.norm();
        assert!(off < 1e-9, "{order:?}: {off:e}");
    }
}

#[test]
fn forgetting_weighs_the_past_exponentially() {
    let data = rows(300);
    let mu = 0.98_f64;
    let mut rls = Rls::new(SVector::<f64, 6>::zeros(), 1000.0, mu);
    let mut normal = SMatrix::<f64, 6, 6>::identity() / 1000.0;
    let mut right = SVector::<f64, 6>::zeros();
    for (psi, y) in &data {
        rls.update(psi, y);
        normal = normal * mu + psi.transpose() * psi;
        right = right * mu + psi.transpose() * y;
    }
    let expected = normal.cholesky().expect("positive definite").solve(&right);
    assert!((rls.theta() - expected).norm() < 1e-9 * expected.norm());
}

#[test]
fn covariance_stays_positive_definite_over_a_million_updates() {
    let mut noise = Noise(3);
    let mut rls = Rls::new(SVector::<f64, 6>::zeros(), 1000.0, 1.0);
    for k in 0..1_000_000 {
        let psi = SMatrix::<f64, 2, 6>::from_fn(|_, j| noise.next() * [1.0, 1e-2, 10.0, 1.0, 0.3, 5.0][j]);
        let y = psi * SVector::from(TRUTH);
        rls.update(&psi, &y);
        if k % 50_000 == 0 || k == 999_999 {
            let p = rls.covariance();
            assert_eq!(p, p.transpose());
            assert!(p.cholesky().is_some(), "indefinite after {k} updates");
        }
    }
}

#[test]
fn a_rejected_sample_leaves_no_trace() {
    let mut rls = Rls::new(SVector::<f64, 6>::zeros(), 1000.0, 1.0);
    let (psi, y) = rows(1)[0];
    rls.update(&psi, &y);
    let before = rls;
    let mut broken = psi;
    broken[(1, 4)] = f64::INFINITY;
    assert_eq!(rls.update(&broken, &y), Update::Rejected);
    assert_eq!((rls.theta(), rls.covariance()), (before.theta(), before.covariance()));
    assert_eq!((rls.updates(), rls.rejected()), (1, 1));
}

#[test]
fn a_large_initial_covariance_is_kept_in_factors() {
    let form = |p0| Rls::new(SVector::<f64, 6>::zeros(), p0, 1.0).form();
    assert_eq!((form(1e6), form(1e7)), (Form::Plain, Form::Factorized));
    // Plain, an absurd row is rejected and leaves no trace; in factors it is used.
    let row = SMatrix::<f64, 1, 6>::repeat(1e8);
    let y = SVector::<f64, 1>::new(1.0);
    let mut plain = Rls::new(SVector::<f64, 6>::zeros(), 1000.0, 1.0);
    let before = plain;
    assert_eq!(plain.update(&row, &y), Update::Rejected);
    assert_eq!((plain.theta(), plain.covariance()), (before.theta(), before.covariance()));
    assert!(matches!(plain.with_form(Form::Factorized).update(&row, &y), Update::Used(_)));
}
