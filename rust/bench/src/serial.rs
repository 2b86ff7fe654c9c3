//! Simulated motion of a serial arm of seven joints, for benchmarks of online estimators.

use crate::run::PERIOD;
use armgap_core::chain::{Chain, ChainJoint, JointKind, point_mass};
use armgap_core::online::{ChainSettings, EstimatorSettings, LargeChain};
use armgap_core::regression::Scheme;
use armgap_core::rls::Form;

/// Number of joints of the serial arm of the benchmarks.
pub const JOINTS: usize = 7;
/// Rotor inertia, kg m^2, viscous, N m s/rad, and Coulomb coefficient, N m, of each joint of the serial arm.
const DRIVE: [f64; 3] = [0.3, 0.8, 1.5];

/// Serial arm of `N` revolute joints, similar to arms of six or seven axes: successive axes perpendicular, links of a third of a metre; with the
/// inertial parameters of its links.
pub fn arm<const N: usize>() -> (Chain<f64, N>, [[f64; 10]; N]) {
    let joints = std::array::from_fn(|j| {
        let across = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
        let back = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
        ChainJoint {
            kind: JointKind::Revolute,
            rotation: if j % 2 == 0 { across } else { back },
            translation: [0.02, 0.03, 0.3],
            axis: [0.0, 0.0, 1.0],
        }
    });
    let link = std::array::from_fn(|j| {
        let mut link = [0.0; 10];
        for at in [[0.1, 0.0, 0.0], [0.0, 0.05, 0.2], [-0.05, 0.1, 0.1], [0.0, -0.1, 0.05]] {
            let point = point_mass(2.0 / (1.0 + j as f64), at);
            for (sum, x) in link.iter_mut().zip(point) {
                *sum += x;
            }
        }
        link
    });
    (Chain::new(joints, [0.0, 0.0, -9.81]), link)
}

/// Joint positions, rad, and torques, N m, of one sample.
pub type Sample = ([f64; JOINTS], [f64; JOINTS]);

/// The first `count` samples of a motion of two sines per joint, each with the torques that the motion needs half a period later.
pub fn samples(count: usize) -> Vec<Sample> {
    let (chain, links) = arm::<JOINTS>();
    let wave = |t: f64, order: i32| -> [f64; JOINTS] {
        std::array::from_fn(|j| {
            let (slow, fast) = (1.3 + 0.37 * j as f64, 4.1 + 0.61 * j as f64);
            let of = |a: f64, w: f64, phase: f64| {
                a * w.powi(order) * (w * t + phase + f64::from(order) * std::f64::consts::FRAC_PI_2).sin()
            };
            of(0.9, slow, j as f64) + of(0.25, fast, 0.5 * j as f64)
        })
    };
    (0..count)
        .map(|k| {
            let (t, later) = (k as f64 * PERIOD, (k as f64 + 0.5) * PERIOD);
            let [q, dq, ddq] = [wave(later, 0), wave(later, 1), wave(later, 2)];
            let mut tau = chain.inverse_dynamics(&links, &q, &dq, &ddq);
            for j in 0..JOINTS {
                tau[j] += DRIVE[0] * ddq[j] + DRIVE[1] * dq[j] + DRIVE[2] * dq[j].signum();
            }
            (wave(t, 0), tau)
        })
        .collect()
}

/// Online estimator of the serial arm's parameters `columns`, with consistent filters, before its first sample.
///
/// # Panics
/// If there are more columns than the estimator has room for, or they do not ascend.
pub fn fresh(scheme: Scheme, form: Form, columns: &[usize]) -> LargeChain<f64> {
    let (chain, _) = arm::<JOINTS>();
    let settings = ChainSettings {
        common: EstimatorSettings { scheme, form: Some(form), ..EstimatorSettings::default() },
        joints: chain.joints(),
        gravity: *chain.gravity_vector(),
        columns,
        known: &[],
    };
    LargeChain::of_chain(&settings, &[]).expect("columns of this arm")
}
