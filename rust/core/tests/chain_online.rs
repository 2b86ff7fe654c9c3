//! Tests of online estimators of serial arms: in a larger memory size, with known parameters, and in single precision, on an arm with friction.

use armgap_core::chain::{Chain, ChainJoint, JointKind, point_mass};
use armgap_core::effect::InputSegment;
use armgap_core::filter::Cutoff;
use armgap_core::identify::{Estimator, Reading, Settings};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::online::{
    ChainSettings, ChainSize, EstimatorSettings, LargeChain, MediumChain, OnlineError, OnlineEstimator,
    SampleStatus, When,
};
use armgap_core::plant::Plant;
use armgap_core::regression::{Scheme, Variant};
use nalgebra::{Rotation3, SVector, Vector3};

const PERIOD: f64 = 0.002;
const SAMPLES: usize = 3000;
const GRAVITY: [f64; 3] = [0.0, 0.3, -9.8];
const P: usize = 39;

/// Largest difference of estimates by rounding in least squares over some thousand samples, relative to the largest entry; with the paper's filters
/// and dependent columns two ways to round the plain form differ from the factorized form by 2e-8 and 1.2e-7.
const ROUNDING: f64 = 5e-7;
/// Largest relative error of the estimates, whose velocities are differences of positions and whose torques are held.
const ACCURACY: f64 = 0.02;

/// Joints of the tested arm: two rotary ones with perpendicular axes, and a linear one.
fn joints() -> [ChainJoint<f64>; 3] {
    let place = |kind, turn: [f64; 3], translation, axis| {
        let m = *Rotation3::new(Vector3::from(turn)).matrix();
        let rotation = std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]));
        ChainJoint { kind, rotation, translation, axis }
    };
    [
        place(JointKind::Revolute, [0.1, 0.2, 0.0], [0.0, 0.0, 0.3], [0.0, 0.0, 1.0]),
        place(JointKind::Revolute, [1.5, 0.0, 0.3], [0.1, 0.0, 0.2], [0.0, 0.0, 1.0]),
        place(JointKind::Prismatic, [0.3, 1.2, 0.0], [0.0, 0.3, 0.0], [0.0, 1.0, 0.0]),
    ]
}

fn theta() -> [f64; P] {
    let mut theta = [0.0; P];
    let points = [[0.1, 0.02, 0.1], [0.0, 0.1, 0.2], [-0.1, 0.05, 0.0], [0.05, -0.1, 0.1], [0.0, 0.0, -0.1]];
    for k in 0..3 {
        for (i, at) in points.into_iter().enumerate() {
            let point = point_mass(2.0 / (1.0 + k as f64) + 0.1 * i as f64, at);
            theta[10 * k..].iter_mut().zip(point).for_each(|(sum, x)| *sum += x);
        }
    }
    theta[30..].copy_from_slice(&[0.1, 0.2, 0.5, 0.5, 0.4, 3.0, 0.6, 0.8, 2.0]);
    theta
}

/// Positions, rad or m, and torques, N m or N, of a motion under position control.
fn motion() -> Vec<([f64; 3], [f64; 3])> {
    let plant = Plant::new(Chain::new(joints(), GRAVITY), theta());
    let mut state = State::<f64, 3>::new(SVector::zeros(), SVector::zeros());
    let sample = |k: usize| {
        let t = k as f64 * PERIOD;
        let aim = [
            1.2 * (1.9 * t).sin() + 0.4 * (5.3 * t).sin(),
            1.5 * (2.3 * t).sin() - 0.5 * (4.1 * t).sin(),
            0.15 * (2.9 * t).sin() + 0.05 * (6.1 * t).sin(),
        ];
        let [p, d] = [[60.0, 60.0, 900.0], [8.0, 6.0, 60.0]];
        let tau: [f64; 3] = std::array::from_fn(|j| p[j] * (aim[j] - state.q[j]) - d[j] * state.dq[j]);
        let now: ([f64; 3], [f64; 3]) = (state.q.into(), tau);
        let torque = tau.map(InputSegment::held);
        advance(&plant, &mut state, &Interval { t, h: PERIOD, torque: &torque }, 2);
        now
    };
    (0..SAMPLES).map(sample).collect()
}

fn common<T: armgap_core::real::Real>(scheme: Scheme, variant: Variant) -> EstimatorSettings<T> {
    EstimatorSettings { scheme, variant, ..EstimatorSettings::default() }
}

fn run<E: OnlineEstimator<f64>>(mut estimator: E, data: &[([f64; 3], [f64; 3])]) -> E {
    for (k, (q, tau)) in data.iter().enumerate() {
        let status = estimator.update(When::After(PERIOD), q, None, tau);
        assert!(k < 2 || status == Ok(SampleStatus::Updated), "sample {k}: {status:?}");
    }
    estimator
}

/// Torques at twenty states for the parameters `theta`, in which two estimates are compared.
fn torques(theta: &[f64]) -> Vec<f64> {
    let chain = Chain::new(joints(), GRAVITY);
    let theta = SVector::<f64, P>::from_column_slice(theta);
    let of = |k: usize| {
        let x = |a: f64| SVector::<f64, 3>::from_fn(|j, _| 0.7 * (a * (3 * k + j) as f64).sin());
        armgap_core::arm::Arm::<f64, 3, P>::regressor(&chain, &x(0.71), &x(1.13), &x(1.77)) * theta
    };
    (0..20).flat_map(|k| -> [f64; 3] { of(k).into() }).collect()
}

fn off(a: &[f64], b: &[f64]) -> f64 {
    let largest = b.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / largest
}

#[test]
fn an_arm_in_a_larger_size_is_the_same_arm() {
    let (data, joints, all) = (motion(), joints(), (0..P).collect::<Vec<_>>());
    for scheme in Scheme::ALL {
        for variant in [Variant::Paper, Variant::Exact] {
            let settings = ChainSettings {
                common: common(scheme, variant),
                joints: &joints,
                gravity: GRAVITY,
                columns: &all,
                known: &[],
            };
            let medium = run(MediumChain::of_chain(&settings, &[]).expect("room"), &data);
            let large = run(LargeChain::of_chain(&settings, &[]).expect("room"), &data);
            let plain = Settings {
                scheme,
                variant,
                cutoff: Cutoff { rad_per_s: 50.0 },
                forgetting: 1.0,
                theta0: SVector::<f64, P>::zeros(),
                p0: 1000.0,
            };
            let mut own = Estimator::<f64, _, 3, P, P>::new(Chain::new(joints, GRAVITY), plain);
            for (q, tau) in &data {
                let (q, tau) = (SVector::from(*q), SVector::from(*tau));
                own.update_after(PERIOD, &Reading { q, dq: None, tau });
            }
            let exact = own.rls().theta().as_slice();
            for found in [medium.theta(), large.theta()] {
                assert!(off(found, exact) < ROUNDING, "{}: {}", scheme.name(), off(found, exact));
            }
        }
    }
}

#[test]
fn all_parameters_explain_other_motion() {
    let (data, joints, all) = (motion(), joints(), (0..P).collect::<Vec<_>>());
    for scheme in Scheme::ALL {
        let common = EstimatorSettings { p0: 1e5, ..common(scheme, Variant::Exact) };
        let settings = ChainSettings { common, joints: &joints, gravity: GRAVITY, columns: &all, known: &[] };
        let found = run(MediumChain::of_chain(&settings, &[]).expect("room"), &data);
        let error = off(&torques(found.theta()), &torques(&theta()));
        assert!(error < ACCURACY, "{}: {error}", scheme.name());
    }
}

#[test]
fn known_parameters_are_known_torques() {
    // Rotors and friction are sought; all links are known, of which the first has wrong values where motion does not show them.
    let (data, joints, mut known) = (motion(), joints(), theta());
    known[4] += 1.0;
    let columns: Vec<usize> = (30..P).collect();
    for scheme in Scheme::ALL {
        let settings = ChainSettings {
            common: common(scheme, Variant::Exact),
            joints: &joints,
            gravity: GRAVITY,
            columns: &columns,
            known: &known,
        };
        let found = run(MediumChain::of_chain(&settings, &[]).expect("room"), &data);
        assert_eq!(found.theta().len(), 9);
        assert!(off(found.theta(), &theta()[30..]) < ACCURACY, "{}: {:?}", scheme.name(), found.theta());
    }
}

#[test]
fn single_precision_stays_beside_double() {
    let (data, joints) = (motion(), joints());
    // Independent ones of this arm.
    let columns = [9, 12, 11, 16, 30, 31, 32, 33, 34, 35, 36, 37, 38];
    let mut columns = columns.to_vec();
    columns.sort_unstable();
    columns.retain(|c| *c != 30 && *c != 31);
    for scheme in [Scheme::FilteredDynamic, Scheme::FilteredPower] {
        let double = ChainSettings {
            common: common(scheme, Variant::Exact),
            joints: &joints,
            gravity: GRAVITY,
            columns: &columns,
            known: &theta(),
        };
        let single_joints = joints.map(|joint| ChainJoint {
            kind: joint.kind,
            rotation: joint.rotation.map(|row| row.map(|x| x as f32)),
            translation: joint.translation.map(|x| x as f32),
            axis: joint.axis.map(|x| x as f32),
        });
        let single = ChainSettings {
            common: common::<f32>(scheme, Variant::Exact),
            joints: &single_joints,
            gravity: GRAVITY.map(|x| x as f32),
            columns: &columns,
            known: &theta().map(|x| x as f32),
        };
        let fine = run(MediumChain::of_chain(&double, &[]).expect("room"), &data);
        let mut coarse = MediumChain::<f32>::of_chain(&single, &[]).expect("room");
        for (q, tau) in &data {
            let (q, tau) = (q.map(|x| x as f32), tau.map(|x| x as f32));
            coarse.update(When::After(PERIOD as f32), &q, None, &tau).expect("lengths");
        }
        let theta: Vec<f64> = coarse.theta().iter().map(|x| f64::from(*x)).collect();
        // Differences of positions in single precision have steps of 1e-7 rad over 2 ms.
        assert!(off(&theta, fine.theta()) < 0.05, "{}: {theta:?} {:?}", scheme.name(), fine.theta());
    }
}

#[test]
fn sizes_and_wrong_settings() {
    assert_eq!(ChainSize::of(2, 20), Some(ChainSize::Small));
    assert_eq!(ChainSize::of(2, 21), Some(ChainSize::Medium));
    assert_eq!(ChainSize::of(5, 3), Some(ChainSize::Large));
    assert_eq!((ChainSize::of(8, 3), ChainSize::of(7, 73)), (None, None));
    let (joints, known) = (joints(), theta());
    let settings = ChainSettings {
        common: EstimatorSettings::default(),
        joints: &joints,
        gravity: GRAVITY,
        columns: &[9, 16],
        known: &known,
    };
    let make =
        |settings: &ChainSettings<'_, f64>, theta0: &[f64]| MediumChain::of_chain(settings, theta0).err();
    assert_eq!(make(&settings, &[1.0, 2.0]), None);
    assert_eq!(make(&settings, &[1.0]), Some(OnlineError::Length { name: "theta0", expected: 2 }));
    let mut bent = joints;
    bent[1].axis = [0.0, 1.0, 1.0];
    for (wrong, error) in [
        (ChainSettings { columns: &[16, 9], ..settings }, OnlineError::Range("columns")),
        (ChainSettings { columns: &[9, 9], ..settings }, OnlineError::Range("columns")),
        (ChainSettings { columns: &[42], ..settings }, OnlineError::Range("columns")),
        (ChainSettings { columns: &[], ..settings }, OnlineError::Range("columns")),
        (ChainSettings { joints: &bent, ..settings }, OnlineError::Range("joints")),
        (ChainSettings { joints: &[], known: &[], ..settings }, OnlineError::Range("joints")),
        (
            ChainSettings { known: &known[1..], ..settings },
            OnlineError::Length { name: "known", expected: P },
        ),
        (ChainSettings { gravity: [f64::NAN, 0.0, 0.0], ..settings }, OnlineError::Range("gravity")),
    ] {
        assert_eq!(make(&wrong, &[]), Some(error));
    }
    let mut estimator = MediumChain::of_chain(&settings, &[]).expect("valid");
    let short = estimator.update(When::At(0.0), &[0.0; 2], None, &[0.0; 3]);
    assert_eq!(short, Err(OnlineError::Length { name: "q", expected: 3 }));
}
