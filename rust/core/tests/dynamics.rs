//! Tests of the arms' dynamics: identities of mechanics that hold for every arm and every state.

use armgap_core::arm::{Arm, ArmKind, Axis, EquationTerms, Pendulum, TwoLink};
use armgap_core::cpu::Portable;
use armgap_core::trig::SinCos;
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

/// Step of finite differences for the directional derivative of the inertia matrix, rad or m.
const STEP: f64 = 1e-6;

fn check<A: Arm<f64, N, P>, const N: usize, const P: usize>(arm: &A, theta: [f64; P], x: [f64; 6]) {
    let part = |i: usize| SVector::<f64, N>::from_fn(|j, _| x[2 * i + j]);
    let (q, dq, ddq) = (part(0), part(1), part(2));
    let vector = SVector::from(theta);
    let m = arm.inertia(&theta, &q);
    let c = arm.coriolis(&theta, &q, &dq);
    let torque = m * ddq + c * dq + arm.gravity(&theta, &q, 0.0) + arm.friction(&theta, &dq);
    let scale = 1.0 + torque.amax();

    // Y theta = tau, and the integrator's shared terms are the same mathematics.
    assert!((arm.regressor(&q, &dq, &ddq) * vector - torque).amax() < 1e-12 * scale);
    let sincos = arm.angles(&q.into(), 0.0).map(SinCos::of);
    let EquationTerms { inertia, bias } =
        arm.equation_terms(&theta, &arm.constant_inertia(&theta), &sincos, &q.into(), &dq.into());
    assert!((SMatrix::from_fn(|i, j| inertia[i][j]) - m).amax() < 1e-12 * scale);
    assert!((SVector::from(bias) - c * dq - arm.gravity(&theta, &q, 0.0)).amax() < 1e-12 * scale);

    // Regressors of momentum and energy.
    assert!((arm.momentum_regressor(&q, &dq) * vector - m * dq).amax() < 1e-12 * scale);
    let energy = arm.energy_regressor(&q, &dq).dot(&vector);
    let kinetic = energy - arm.energy_regressor(&q, &SVector::zeros()).dot(&vector);
    assert!((kinetic - 0.5 * dq.dot(&(m * dq))).abs() < 1e-12 * (1.0 + energy.abs()));
    let both = (arm.momentum_regressor(&q, &dq), arm.potential_regressor(&q, &dq));
    let together = arm.momentum_and_potential::<Portable>(&q, &dq);
    assert!(
        (together.0 - both.0).amax().max((together.1 - both.1).amax())
            < 1e-12 * (1.0 + dq.amax() * dq.amax())
    );

    // dM/dt - 2 C is skew-symmetric.
    let rate = (arm.inertia(&theta, &(q + dq * STEP)) - arm.inertia(&theta, &(q - dq * STEP))) / (2.0 * STEP);
    let skew: SMatrix<f64, N, N> = rate - c * 2.0;
    assert!((skew + skew.transpose()).amax() < 1e-7 * (1.0 + rate.amax()));

    // g - dK/dq: the rest of the torque once the momentum's rate is taken out.
    let rest = arm.potential_regressor(&q, &dq) * vector;
    let direct = c * dq + arm.gravity(&theta, &q, 0.0) - rate * dq;
    assert!((rest - direct).amax() < 1e-7 * scale);

    // Power balance: supplied power is the energy's rate plus what is lost.
    let along = |s: f64| {
        let (q, dq) = (q + dq * s + ddq * (0.5 * s * s), dq + ddq * s);
        arm.energy_regressor(&q, &dq).dot(&vector)
    };
    let energy_rate = (along(STEP) - along(-STEP)) / (2.0 * STEP);
    let lost = dq.dot(&arm.friction(&theta, &dq));
    assert!((torque.dot(&dq) - energy_rate - lost).abs() < 1e-6 * (1.0 + scale * dq.amax()));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_arm_obeys_its_own_mechanics(
        x in proptest::array::uniform6(-3.0..3.0_f64),
        p in proptest::array::uniform9(0.05..3.0_f64),
    ) {
        check(&Axis { gravity: 9.81 }, [p[0], p[1], p[2], p[3]], x);
        check(&Pendulum { gravity: 9.81 }, [p[0], p[1], p[2], p[3]], x);
        check(&TwoLink { gravity: 9.81, length1: 0.45 }, p, x);
    }
}

#[test]
fn every_kind_is_listed_with_its_sizes() {
    for kind in ArmKind::ALL {
        assert_eq!(ArmKind::from_name(kind.name()), Some(kind));
        assert_eq!(kind.parameters().len(), kind.inertial() + 2 * kind.joints());
    }
    assert_eq!(ArmKind::from_name("hexapod"), None);
}

#[test]
fn a_payload_moves_the_parameters_as_a_heavier_link_does() {
    use armgap_core::arm::LinkParameters;
    let bare = LinkParameters::<f64> {
        mass: [2.0, 1.0],
        length: [0.4, 0.3],
        com: [0.2, 0.1],
        inertia: [0.05, 0.02],
    };
    let (mass, distance) = (0.5, 0.25);
    let total = bare.mass[1] + mass;
    let com = (bare.mass[1] * bare.com[1] + mass * distance) / total;
    let about_joint = bare.inertia[1] + bare.mass[1] * bare.com[1].powi(2) + mass * distance * distance;
    let loaded = LinkParameters {
        mass: [2.0, total],
        com: [0.2, com],
        inertia: [0.05, about_joint - total * com * com],
        ..bare
    };
    let [before, after] = [bare, loaded].map(|l| TwoLink::inertial_from_links(&l, 9.81));
    let delta = TwoLink { gravity: 9.81, length1: 0.4 }.payload(&[0.0; 9], mass, distance);
    for i in 0..5 {
        assert!((after[i] - before[i] - delta[i]).abs() < 1e-12, "theta{}", i + 1);
    }
}
