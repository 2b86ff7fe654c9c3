//! Tests of the online estimator: excitation, alarm, forgetting while the arm rests, and periods instead of times.

#[path = "../../bench/src/run.rs"]
mod run;

use armgap_core::arm::ArmKind;
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Outcome, Reading, Sample, Settings};
use armgap_core::monitor::{Monitor, MonitorSettings};
use armgap_core::online::{MOST_PARAMETERS, Online, OnlineError, OnlineSettings, SampleStatus, When};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::{Form, Rls};
use nalgebra::{SMatrix, SVector, Vector1, Vector2};

/// Repeatable source of Gaussian random numbers.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

const WATCH: MonitorSettings<f64> =
    MonitorSettings { memory: 400.0, settling: 100, learning: 20_000, between: 1e4, floor: 0.0 };

/// Number of alarms, and sample of the first, over `samples` errors of correlation `rho` whose standard deviation is `sigma` times that learned.
fn alarms(sigma: f64, rho: f64, samples: u32) -> (u32, Option<u32>) {
    let (mut noise, mut monitor) = (Noise(5), Monitor::<f64, 2>::new(WATCH));
    let (mut e, mut raised, mut first, mut before) = (Vector2::zeros(), 0, None, false);
    for k in 0..(20_100 + samples) {
        let size = if k < 20_100 { 0.3 } else { 0.3 * sigma };
        let innovation = Vector2::new(noise.next(), noise.next()) * (size * (1.0 - rho * rho).sqrt());
        e = e * rho + innovation;
        monitor.update(&e, 0.0, 9, 1.0);
        let now = monitor.alarms().iter().any(|a| *a);
        if now && !before {
            raised += 1;
            first = first.or(Some(k - 20_100));
        }
        before = now;
    }
    (raised, first)
}

#[test]
fn false_alarms_are_as_rare_as_stated_and_true_ones_fast() {
    for rho in [0.0, 0.88] {
        // One in 10^4 samples at most: 100 expected at most in 10^6; three standard deviations of that count are allowed on top.
        let (raised, _) = alarms(1.0, rho, 1_000_000);
        assert!(raised < 130, "{raised} false alarms at correlation {rho}");
        let (_, first) = alarms(2.0, rho, 2_000);
        assert!(first.is_some_and(|k| k < 60), "doubled errors noticed after {first:?} samples");
    }
}

#[test]
fn one_outlier_raises_no_alarm() {
    let (mut noise, mut monitor) =
        (Noise(9), Monitor::<f64, 1>::new(MonitorSettings { between: 1e6, ..WATCH }));
    for k in 0..30_000 {
        let e = if k == 25_000 { 1e6 } else { noise.next() };
        monitor.update(&Vector1::new(e), 0.0, 1, 1.0);
        assert_eq!(monitor.alarms(), [false], "sample {k}");
    }
}

fn settings<const R: usize>(scheme: Scheme, forgetting: f64) -> Settings<f64, R> {
    Settings {
        scheme,
        variant: Variant::Exact,
        cutoff: Cutoff { rad_per_s: 50.0 },
        forgetting,
        theta0: SVector::zeros(),
        p0: 1000.0,
    }
}

#[test]
fn periods_and_times_give_the_same_estimate() {
    for scheme in Scheme::ALL {
        let mut by_time = Estimator::<f64, _, 2, 9, 9>::new(run::arm(), settings(scheme, 1.0));
        let mut by_period = by_time;
        for s in run::samples::<f64>() {
            by_time.update(&s);
            by_period.update_after(run::PERIOD, &Reading { q: s.q, dq: s.dq, tau: s.tau });
        }
        let (a, b) = (by_time.rls().theta(), by_period.rls().theta());
        assert!((a - b).component_div(a).amax() < 1e-9, "{}", scheme.name());
    }
}

#[test]
fn late_at_night_single_precision_needs_periods() {
    // Ten hours after the clock began; its steps in f32 are 4 ms.
    let data = run::samples::<f32>();
    let make = || {
        let s = Settings::<f32, 9> {
            scheme: Scheme::FilteredPower,
            variant: Variant::Exact,
            cutoff: Cutoff { rad_per_s: 50.0 },
            forgetting: 1.0,
            theta0: SVector::zeros(),
            p0: 1000.0,
        };
        Estimator::<f32, _, 2, 9, 9>::new(run::arm(), s)
    };
    let (mut by_time, mut by_period) = (make(), make());
    for s in &data {
        by_time.update(&Sample { t: s.t + 36_000.0, ..*s });
        by_period.update_after(run::PERIOD as f32, &Reading { q: s.q, dq: s.dq, tau: s.tau });
    }
    assert!(by_time.rejected() > 500, "times that do not advance are rejected");
    assert_eq!(by_period.rejected(), 0);
    for (j, truth) in run::THETA.iter().enumerate() {
        let off = (f64::from(by_period.rls().theta()[j]) / truth - 1.0).abs();
        assert!(off < 0.015, "theta{}: off by {off}", j + 1);
    }
}

#[test]
fn a_resting_arm_winds_nothing_up_in_either_form() {
    for form in [Form::Plain, Form::Factorized] {
        let mut rls = Rls::new(SVector::<f64, 3>::zeros(), 100.0, 0.99).with_form(form);
        let mut noise = Noise(2);
        let mut learn = |rls: &mut Rls<f64, 3>, count: u32, size: f64| {
            for _ in 0..count {
                let psi = SMatrix::<f64, 1, 3>::new(noise.next(), size * noise.next(), size * noise.next());
                let y = psi * SVector::from([1.0, 2.0, 3.0]);
                rls.update(&psi, &y);
            }
        };
        learn(&mut rls, 500, 1.0);
        // Two of three directions unexcited for ten thousand samples: 0.99^-10000 would be 1e43.
        learn(&mut rls, 10_000, 0.0);
        let p = rls.covariance();
        assert!(p.diagonal().iter().all(|v| *v <= 100.0 * (1.0 + 1e-9)), "{form:?}: {p}");
        assert!(p.cholesky().is_some(), "{form:?}");
        // The excited direction goes on forgetting: its variance is that of a memory of a hundred samples.
        assert!((0.003..0.05).contains(&p[(0, 0)]), "{form:?}: {}", p[(0, 0)]);
        learn(&mut rls, 500, 1.0);
        assert!((rls.theta() - SVector::from([1.0, 2.0, 3.0])).amax() < 1e-6);
    }
}

#[test]
fn both_forms_are_the_same_least_squares() {
    for forgetting in [1.0, 0.998] {
        for scheme in Scheme::ALL {
            let run = |form| {
                let mut e = Estimator::<f64, _, 2, 9, 11>::new(run::arm(), settings(scheme, forgetting))
                    .with_form(form);
                for s in run::samples::<f64>() {
                    assert_ne!(e.update(&s), Outcome::Rejected);
                }
                (*e.rls().theta(), e.rls().variances())
            };
            let ((a, va), (b, vb)) = (run(Form::Plain), run(Form::Factorized));
            assert!((a - b).amax() < 1e-7, "{}: {}", scheme.name(), (a - b).amax());
            assert!((va - vb).component_div(&va).amax() < 1e-6, "{}", scheme.name());
        }
    }
}

#[test]
fn excitation_falls_when_the_arm_stops_and_sigma_shrinks_while_it_moves() {
    let mut online = Online::<f64>::new(
        OnlineSettings { forgetting: 0.999, ..OnlineSettings::new(ArmKind::TwoLink) },
        &[],
    )
    .expect("valid");
    let data = run::samples::<f64>();
    let mut sigma = [[0.0; MOST_PARAMETERS]; 2];
    for (k, s) in data.iter().enumerate() {
        let result = online.update(When::After(run::PERIOD), s.q.as_slice(), None, s.tau.as_slice());
        assert_eq!(result, Ok(if k < 2 { SampleStatus::Starting } else { SampleStatus::Updated }));
        if k == 400 {
            assert_eq!(online.sigma(&mut sigma[0]), 9);
        }
    }
    let moving = online.excitation();
    online.variances(&mut sigma[1]);
    assert!((0.5..2.0).contains(&moving), "{moving}");
    let rest = data[data.len() - 1];
    for _ in 0..2000 {
        online
            .update(When::After(run::PERIOD), rest.q.as_slice(), None, rest.tau.as_slice())
            .expect("lengths");
    }
    assert!(online.excitation() < 0.1 * moving, "{} after {moving}", online.excitation());
}

#[test]
fn a_changed_arm_raises_the_alarm_and_an_unchanged_one_does_not() {
    let data = run::samples::<f64>();
    let alarm = |load: f64| {
        let monitor = MonitorSettings {
            settling: 800,
            learning: 1600,
            between: 1e6,
            floor: 0.1,
            ..MonitorSettings::default()
        };
        // The floor: joint 2 sticks and slips several times within a period now and then, which no regressor can follow.
        let settings = OnlineSettings {
            monitor,
            scheme: Scheme::FilteredDynamic,
            ..OnlineSettings::new(ArmKind::TwoLink)
        };
        let mut online = Online::<f64>::new(settings, &[]).expect("valid");
        let mut noise = Noise(4);
        data.iter().enumerate().any(|(k, s)| {
            let push = if k > 3000 { load } else { 0.0 };
            let tau = [s.tau[0] + noise.next(), s.tau[1] + 0.1 * noise.next() + push];
            online.update(When::After(run::PERIOD), s.q.as_slice(), None, &tau).expect("lengths");
            online.alarm_level() > 1.0
        })
    };
    assert!(!alarm(0.0));
    assert!(alarm(3.0));
}

#[test]
fn wrong_choices_and_lengths_are_errors() {
    let settings = OnlineSettings::<f64>::new(ArmKind::Pendulum);
    let mut online = Online::new(settings, &[]).expect("valid");
    let wrong = online.update(When::At(0.0), &[0.0, 1.0], None, &[0.0]);
    assert_eq!(wrong, Err(OnlineError::Length { name: "q", expected: 1 }));
    for (bad, name) in [
        (OnlineSettings { cutoff: 0.0, ..settings }, "cutoff"),
        (OnlineSettings { forgetting: 1.1, ..settings }, "forgetting"),
        (OnlineSettings { p0: f64::NAN, ..settings }, "p0"),
        (
            OnlineSettings {
                monitor: MonitorSettings { learning: 1, ..MonitorSettings::default() },
                ..settings
            },
            "learning",
        ),
    ] {
        assert_eq!(Online::new(bad, &[]).err(), Some(OnlineError::Range(name)));
    }
    assert_eq!(
        Online::new(settings, &[0.0; 3]).err(),
        Some(OnlineError::Length { name: "theta0", expected: 4 })
    );
}
