//! Tests of laws that filters, least squares and the online estimator obey for any input.

use armgap_core::arm::{Axis, TwoLink};
use armgap_core::cpu::Portable;
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Outcome, Sample, Settings};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::{Rls, Update};
use nalgebra::{SMatrix, SVector, Vector1, Vector2};
use proptest::prelude::*;

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

/// Strategy for any number that a broken sensor may deliver, NaN included.
fn anything() -> impl Strategy<Value = f64> {
    prop_oneof![6 => -10.0..10.0_f64, 1 => any::<f64>(), 1 => Just(f64::NAN), 1 => Just(f64::MAX), 1 => Just(0.0)]
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn an_interval_in_two_parts_is_the_interval(
        lambda in 0.1..2000.0_f64, h in 1e-5..0.1_f64, share in 0.01..0.99_f64, y in -5.0..5.0_f64, u in -5.0..5.0_f64, v in -5.0..5.0_f64,
    ) {
        let cutoff = Cutoff { rad_per_s: lambda };
        let middle = u + (v - u) * share;
        let (whole, first, second) = (cutoff.step(h), cutoff.step(h * share), cutoff.step(h - h * share));
        prop_assert!((whole.ramp::<Portable>(y, u, v)
            - second.ramp::<Portable>(first.ramp::<Portable>(y, u, middle), middle, v)).abs() < 1e-12);
        prop_assert!((whole.held::<Portable>(y, v) - second.held::<Portable>(first.held::<Portable>(y, v), v)).abs() < 1e-12);
        prop_assert_eq!(whole.ramp::<Portable>(y, u, v), whole.curve::<Portable>(y, u, v, 0.0));
    }

    #[test]
    fn least_squares_uses_a_sample_whole_or_not_at_all(
        numbers in prop::collection::vec(anything(), 40 * 8), forgetting in 0.9..=1.0_f64,
    ) {
        let mut rls = Rls::new(SVector::<f64, 3>::zeros(), 100.0, forgetting);
        for row in numbers.chunks_exact(8) {
            let before = rls;
            let psi = SMatrix::<f64, 2, 3>::from_row_slice(&row[..6]);
            match rls.update(&psi, &Vector2::new(row[6], row[7])) {
                Update::Used(error) => {
                    prop_assert!(row.iter().all(|x| x.is_finite()) && error.iter().all(|x| x.is_finite()));
                    prop_assert_eq!(rls.updates(), before.updates() + 1);
                }
                Update::Rejected => {
                    prop_assert_eq!((rls.theta(), rls.covariance()), (before.theta(), before.covariance()));
                    prop_assert_eq!(rls.rejected(), before.rejected() + 1);
                }
            }
            prop_assert!(rls.theta().iter().chain(rls.covariance().iter()).all(|x| x.is_finite()));
            prop_assert_eq!(rls.covariance(), rls.covariance().transpose());
        }
    }

    #[test]
    fn no_sequence_of_samples_breaks_the_estimator(
        numbers in prop::collection::vec(anything(), 60 * 7), scheme in 0..3_usize, exact: bool, sensor: bool,
    ) {
        let settings = Settings {
            scheme: Scheme::ALL[scheme],
            variant: if exact { Variant::Exact } else { Variant::Paper },
            cutoff: Cutoff { rad_per_s: 50.0 },
            forgetting: 1.0,
            theta0: SVector::<f64, 11>::zeros(),
            p0: 1000.0,
        };
        let mut estimator = Estimator::<f64, _, 2, 9, 11>::new(TwoLink { gravity: 9.81, length1: 0.45 }, settings);
        let mut last = f64::NEG_INFINITY;
        // Times so late that nothing can follow them are left out.
        let sane = |t: f64| if t.abs() < 1e10 { t } else { f64::NAN };
        for x in numbers.chunks_exact(7) {
            let dq = sensor.then(|| Vector2::new(x[5], x[6]));
            let sample = Sample { t: sane(x[0]), q: Vector2::new(x[1], x[2]), dq, tau: Vector2::new(x[3], x[4]) };
            let (before, rejected) = (*estimator.rls().theta(), estimator.rls().rejected());
            match estimator.update(&sample) {
                Outcome::Rejected => {
                    prop_assert_eq!(*estimator.rls().theta(), before);
                    // A sample whose regressor was rejected counts as taken.
                    if estimator.rls().rejected() > rejected {
                        last = x[0];
                    }
                }
                Outcome::Starting | Outcome::Updated(_) => {
                    prop_assert!(x[..5].iter().all(|v| v.is_finite()) && x[0] > last);
                    last = x[0];
                }
            }
            prop_assert!(estimator.rls().theta().iter().all(|v| v.is_finite()));
        }
        // Whatever came before, good samples are used again, once they can be reached from the last one taken.
        last = if last.is_finite() { last } else { 0.0 };
        let mut outcome = Outcome::Starting;
        for k in 1..=6 {
            let (t, zero) = (last + 10.0 + 0.01 * f64::from(k), Vector2::zeros());
            outcome = estimator.update(&Sample { t, q: zero, dq: sensor.then_some(zero), tau: zero });
        }
        prop_assert!(matches!(outcome, Outcome::Updated(_)));
    }

    #[test]
    fn one_good_run_after_a_bad_sample_is_as_good_as_without_it(at in 1..150_usize, bad in anything()) {
        // A sample that is rejected leaves no trace in filters, either.
        let settings = Settings {
            scheme: Scheme::FilteredPower,
            variant: Variant::Exact,
            cutoff: Cutoff { rad_per_s: 50.0 },
            forgetting: 1.0,
            theta0: SVector::<f64, 4>::zeros(),
            p0: 1000.0,
        };
        let run = |broken: bool| {
            let mut estimator = Estimator::<f64, _, 1, 4, 4>::new(Axis { gravity: 9.81 }, settings);
            for k in 0..200 {
                let t = k as f64 * 0.002;
                if broken && k == at {
                    let late = Sample { t: t - 0.001 - 0.002, q: Vector1::new(bad), dq: None, tau: Vector1::new(bad) };
                    assert_eq!(estimator.update(&late), Outcome::Rejected);
                }
                let (q, tau) = (Vector1::new((9.0 * t).sin()), Vector1::new((5.0 * t).cos()));
                estimator.update(&Sample { t, q, dq: None, tau });
            }
            *estimator.rls().theta()
        };
        prop_assert_eq!(run(true), run(false));
    }
}
