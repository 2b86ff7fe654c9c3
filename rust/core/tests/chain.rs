//! Tests of chains: identities of mechanics for random chains, and the two-link arm as a chain.

mod common;

use armgap_core::arm::{Arm, EquationTerms, LinkParameters, TwoLink};
use armgap_core::chain::{Chain, ChainJoint, JointKind, parameter};
use armgap_core::cpu::Portable;
use armgap_core::effect::{Active, InputSegment, find};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::kinematics::JointState;
use armgap_core::lanes::Lanes;
use armgap_core::plant::{Accelerations, Mode, Plant};
use armgap_core::trig::SinCos;
use common::seed_torque;
use nalgebra::{Rotation3, SMatrix, SVector, Unit, Vector3};

/// Step of finite differences for directional derivatives, rad or m.
const STEP: f64 = 1e-6;

/// Largest relative error of torques by rounding in a few hundred operations, relative to the largest torque.
const ROUNDING: f64 = 1e-12;

/// Source of numbers from -1 to 1, equal in every run (Knuth's linear congruential generator).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.next())
    }

    fn many<const N: usize>(&mut self, size: f64) -> SVector<f64, N> {
        SVector::from_fn(|_, _| size * self.next())
    }

    fn rotation(&mut self) -> [[f64; 3]; 3] {
        let m = *Rotation3::new(self.vector() * 3.0).matrix();
        std::array::from_fn(|i| std::array::from_fn(|j| m[(i, j)]))
    }

    /// Random chain, about one in three of its joints prismatic.
    fn chain<const N: usize>(&mut self) -> Chain<f64, N> {
        let joints = std::array::from_fn(|_| ChainJoint {
            kind: if self.next() > 0.3 { JointKind::Prismatic } else { JointKind::Revolute },
            rotation: self.rotation(),
            translation: self.vector().into(),
            axis: Unit::new_normalize(self.vector()).into_inner().into(),
        });
        Chain::new(joints, (self.vector() * 9.81).into())
    }

    /// Ten inertial parameters of a random body: four points with masses.
    fn link(&mut self) -> [f64; 10] {
        let mut link = [0.0; 10];
        for _ in 0..4 {
            let point = armgap_core::chain::point_mass(0.3 + self.next().abs(), self.vector().into());
            link.iter_mut().zip(point).for_each(|(sum, x)| *sum += x);
        }
        link
    }

    /// Parameters of a random chain, friction included.
    fn theta<const N: usize, const P: usize>(&mut self) -> [f64; P] {
        let links: Vec<f64> = (0..N).flat_map(|_| self.link()).collect();
        std::array::from_fn(|i| links.get(i).copied().unwrap_or_else(|| 0.3 + self.next().abs()))
    }
}

/// Checks identities of mechanics for a random chain at a random state.
fn check<const N: usize, const P: usize>(numbers: &mut Numbers) {
    let chain: Chain<f64, N> = numbers.chain();
    let theta: [f64; P] = numbers.theta::<N, P>();
    let (q, dq, ddq) = (numbers.many::<N>(3.0), numbers.many::<N>(2.0), numbers.many::<N>(5.0));
    let vector = SVector::<f64, P>::from(theta);
    let links: [[f64; 10]; N] = std::array::from_fn(|k| std::array::from_fn(|c| theta[10 * k + c]));
    let m: SMatrix<f64, N, N> = chain.inertia(&theta, &q);
    let c: SMatrix<f64, N, N> = chain.coriolis(&theta, &q, &dq);
    let g: SVector<f64, N> = Arm::<f64, N, P>::gravity(&chain, &theta, &q, 0.0);
    let torque = m * ddq + c * dq + g;
    let scale = torque.amax().max(m.amax());
    let near =
        |a: &SVector<f64, N>, b: &SVector<f64, N>| assert!((a - b).amax() < ROUNDING * scale, "{a}{b}");

    // Inverse and forward dynamics, and the integrator's terms.
    let rotors = SVector::<f64, N>::from_fn(|j, _| theta[10 * N + j] * ddq[j]);
    near(
        &(SVector::from(chain.inverse_dynamics(&links, &q.into(), &dq.into(), &ddq.into())) + rotors),
        &torque,
    );
    let constant = Arm::<f64, N, P>::constant_inertia(&chain, &theta);
    let angles = Arm::<f64, N, P>::angles(&chain, &q.into(), 0.0);
    let sincos = angles.map(SinCos::of);
    let EquationTerms { inertia, bias } =
        Arm::<f64, N, P>::equation_terms(&chain, &theta, &constant, &sincos, &q.into(), &dq.into());
    assert!((SMatrix::<f64, N, N>::from_fn(|i, j| inertia[i][j]) - m).amax() < ROUNDING * scale);
    near(&SVector::from(bias), &(c * dq + g));
    let found = chain.forward_dynamics(&links, &constant, [&q.into(), &dq.into(), &torque.into()]);
    near(&(m * (SVector::from(found) - ddq)), &SVector::zeros());

    // Regressors.
    let friction = Arm::<f64, N, P>::friction(&chain, &theta, &dq);
    near(&(Arm::<f64, N, P>::regressor(&chain, &q, &dq, &ddq) * vector), &(torque + friction));
    let (momentum, potential): (SMatrix<f64, N, P>, SMatrix<f64, N, P>) =
        chain.momentum_and_potential::<Portable>(&q, &dq);
    near(&(momentum * vector), &(m * dq));
    let kinetic = 0.5 * dq.dot(&(m * dq));
    let energy_row =
        |q: &SVector<f64, N>, dq: &SVector<f64, N>| -> SVector<f64, P> { chain.energy_regressor(q, dq) };
    let energy = |q: &SVector<f64, N>, dq: &SVector<f64, N>| energy_row(q, dq).dot(&vector);
    let potential_energy = chain.links_potential_energy(&links, &q.into());
    assert!((energy(&q, &dq) - kinetic - potential_energy).abs() < ROUNDING * (kinetic + scale));
    let of_links = chain.links_kinetic_energy(&links, &q.into(), &dq.into());
    let of_rotors: f64 = (0..N).map(|j| 0.5 * theta[10 * N + j] * dq[j] * dq[j]).sum();
    assert!((of_links + of_rotors - kinetic).abs() < ROUNDING * kinetic.max(scale));
    assert!(energy(&SVector::zeros(), &SVector::zeros()).abs() < ROUNDING * scale);

    // dM/dt - 2 C is skew-symmetric; gravity is the slope of the potential energy; the momentum's rate and the rest are the torque.
    let [ahead, behind] = [STEP, -STEP].map(|s| (q + dq * s + ddq * (0.5 * s * s), dq + ddq * s));
    let m_of = |q: &SVector<f64, N>| -> SMatrix<f64, N, N> { chain.inertia(&theta, q) };
    let rate = (m_of(&ahead.0) - m_of(&behind.0)) / (2.0 * STEP);
    let skew = rate - c * 2.0;
    assert!((skew + skew.transpose()).amax() < 1e-7 * scale);
    let momentum_of = |(q, dq): &(SVector<f64, N>, SVector<f64, N>)| m_of(q) * dq;
    let momentum_rate = (momentum_of(&ahead) - momentum_of(&behind)) / (2.0 * STEP);
    assert!((momentum_rate + potential * vector - torque).amax() < 1e-7 * scale);
    for j in 0..N {
        let mut by = SVector::<f64, N>::zeros();
        by[j] = STEP;
        let still = SVector::zeros();
        let slope = (energy(&(q + by), &still) - energy(&(q - by), &still)) / (2.0 * STEP);
        assert!((slope - g[j]).abs() < 1e-7 * scale);
    }

    // Derivatives against differences, and the torque beside them.
    let of_motion = |q: SVector<f64, N>, dq: SVector<f64, N>| {
        SVector::from(chain.inverse_dynamics(&links, &q.into(), &dq.into(), &ddq.into()))
    };
    let analytic = chain.torque_derivatives(&links, [&q.into(), &dq.into(), &ddq.into()]);
    near(&(SVector::from(analytic.torque) + rotors), &torque);
    for i in 0..N {
        let mut by = SVector::<f64, N>::zeros();
        by[i] = STEP;
        let by_position = (of_motion(q + by, dq) - of_motion(q - by, dq)) / (2.0 * STEP);
        let by_velocity = (of_motion(q, dq + by) - of_motion(q, dq - by)) / (2.0 * STEP);
        for j in 0..N {
            assert!((analytic.by_position[j][i] - by_position[j]).abs() < 1e-7 * scale);
            assert!((analytic.by_velocity[j][i] - by_velocity[j]).abs() < 1e-7 * scale);
            let with_rotor = analytic.by_acceleration[j][i] + constant[j][i];
            assert!((with_rotor - m[(j, i)]).abs() < ROUNDING * scale);
        }
    }

    // Several side by side are each like one alone.
    let wide = |x: f64| Lanes::<f64, Portable, 4>::new([x; 4]);
    let terms = Arm::<f64, N, P>::equation_terms(
        &chain,
        &theta.map(wide),
        &constant.map(|row| row.map(wide)),
        &sincos.map(|x| SinCos { sine: wide(x.sine), cosine: wide(x.cosine) }),
        &<[f64; N]>::from(q).map(wide),
        &<[f64; N]>::from(dq).map(wide),
    );
    assert_eq!(terms.bias.map(|x| x.0[3]), bias);
}

#[test]
fn every_chain_obeys_its_own_mechanics() {
    let mut numbers = Numbers(7);
    for _ in 0..100 {
        check::<1, 13>(&mut numbers);
        check::<2, 26>(&mut numbers);
        check::<3, 39>(&mut numbers);
        check::<5, 65>(&mut numbers);
        check::<7, 91>(&mut numbers);
    }
}

#[test]
fn parameters_are_named_link_by_link_then_joint_by_joint() {
    let kinds = [JointKind::Revolute, JointKind::Prismatic];
    let named = |i| parameter(&kinds, i).map(|p| (p.to_string(), p.unit));
    let of = |name: &str, unit| Some((name.to_string(), unit));
    assert_eq!(named(0), of("mass1", "kg"));
    assert_eq!(named(9), of("izz1", "kg m^2"));
    assert_eq!(named(11), of("mx2", "kg m"));
    assert_eq!(named(20), of("rotor1", "kg m^2"));
    assert_eq!(named(21), of("rotor2", "kg"));
    assert_eq!(named(23), of("viscous2", "N s/m"));
    assert_eq!(named(24), of("coulomb1", "N m"));
    assert_eq!(named(25), of("coulomb2", "N"));
    assert_eq!(named(26), None);
    assert_eq!(parameter(&[], 0), None);
}

const LINKS: LinkParameters<f64> =
    LinkParameters { mass: [23.9, 4.44], length: [0.45, 0.45], com: [0.091, 0.105], inertia: [1.27, 0.24] };
const VISCOUS: [f64; 2] = [2.288, 0.175];
const COULOMB: [f64; 2] = [7.6, 1.734];
const GRAVITY: f64 = 9.81;

/// Two-link arm with its parameters, and the equivalent chain in the plane z = 0 with gravity along x, with its parameters.
fn both() -> (TwoLink<f64>, [f64; 9], Chain<f64, 2>, [f64; 26]) {
    let inertial = TwoLink::inertial_from_links(&LINKS, GRAVITY);
    let mut theta = [0.0; 9];
    theta[..5].copy_from_slice(&inertial);
    theta[5..7].copy_from_slice(&VISCOUS);
    theta[7..].copy_from_slice(&COULOMB);
    let joint = |x| ChainJoint {
        kind: JointKind::Revolute,
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [x, 0.0, 0.0],
        axis: [0.0, 0.0, 1.0],
    };
    let chain = Chain::new([joint(0.0), joint(LINKS.length[0])], [GRAVITY, 0.0, 0.0]);
    let mut of_chain = [0.0; 26];
    for k in 0..2 {
        let (m, c) = (LINKS.mass[k], LINKS.com[k]);
        of_chain[10 * k] = m;
        of_chain[10 * k + 1] = m * c;
        of_chain[10 * k + 9] = LINKS.inertia[k] + m * c * c;
        of_chain[22 + k] = VISCOUS[k];
        of_chain[24 + k] = COULOMB[k];
    }
    (TwoLink::new(GRAVITY, Some(LINKS.length[0]), &theta), theta, chain, of_chain)
}

/// Index of a chain's parameter, and the change of the two-link arm's parameters per unit of it: for `m c_x` and `I_zz` of both links, the mass
/// of the second link, and friction.
fn changes() -> [(usize, SVector<f64, 9>); 9] {
    let l = LINKS.length[0];
    let change = |at: &[(usize, f64)]| {
        let mut change = SVector::zeros();
        for (i, x) in at {
            change[*i] = *x;
        }
        change
    };
    [
        (1, change(&[(3, GRAVITY)])),
        (9, change(&[(0, 1.0)])),
        (10, change(&[(0, l * l), (3, GRAVITY * l)])),
        (11, change(&[(1, l), (4, GRAVITY)])),
        (19, change(&[(0, 1.0), (2, 1.0)])),
        (22, change(&[(5, 1.0)])),
        (23, change(&[(6, 1.0)])),
        (24, change(&[(7, 1.0)])),
        (25, change(&[(8, 1.0)])),
    ]
}

#[test]
fn a_two_link_arm_is_a_chain_too() {
    let (arm, theta, chain, of_chain) = both();
    let mut numbers = Numbers(3);
    for _ in 0..1000 {
        let (q, dq, ddq) = (numbers.many::<2>(3.0), numbers.many::<2>(4.0), numbers.many::<2>(20.0));
        let m = arm.inertia(&theta, &q);
        assert!((m - Arm::<f64, 2, 26>::inertia(&chain, &of_chain, &q)).amax() < 1e-14 * m.amax());
        let torque = arm.regressor(&q, &dq, &ddq) * SVector::from(theta);
        let y: SMatrix<f64, 2, 26> = Arm::<f64, 2, 26>::regressor(&chain, &q, &dq, &ddq);
        let scale = torque.amax().max(theta[3]);
        assert!((torque - y * SVector::from(of_chain)).amax() < 1e-13 * scale);
        for (column, change) in changes() {
            let expected = arm.regressor(&q, &dq, &ddq) * change;
            assert!((y.column(column) - expected).amax() < 1e-13 * scale, "column {column}");
        }
    }
}

/// Positions after every sample of 2 s under the torques of Reyes and Kelly (1997), which reverse every joint some thirty times.
fn run<A: Arm<f64, 2, P>, const P: usize>(plant: &Plant<f64, A, 2, P>) -> Vec<SVector<f64, 2>> {
    let (h, mut state) = (0.0025, State::new(SVector::zeros(), SVector::zeros()));
    let step = |k: usize| {
        let t = k as f64 * h;
        let torque = seed_torque(t).map(InputSegment::held);
        advance(plant, &mut state, &Interval { t, h, torque: &torque }, 1);
        state.q
    };
    (0..800).map(step).collect()
}

#[test]
fn stick_and_slip_of_a_chain_are_those_of_the_two_link_arm() {
    let (arm, theta, chain, of_chain) = both();
    let worst = |effects: &[Active<f64>]| {
        let (mut own, mut other) = (Plant::new(arm, theta), Plant::new(chain, of_chain));
        for effect in effects {
            own = own.with_effect(*effect).expect("room");
            other = other.with_effect(*effect).expect("room");
        }
        run(&own).iter().zip(run(&other)).map(|(a, b)| (a - b).amax()).fold(0.0, f64::max)
    };
    assert!(worst(&[]) < 1e-8);
    let active = |name: &str, joint, p| Active { law: find(name).expect("in the catalogue"), joint, p };
    let of_library = [
        active("stribeck", 0, [3.0, 0.1, 0.0]),
        active("rotor_inertia", 1, [0.05, 0.0, 0.0]),
        active("joint_elasticity", 1, [900.0, 0.5, 0.08]),
        active("torque_ripple", 0, [1.5, 6.0, 0.3]),
    ];
    let worst = worst(&of_library);
    assert!(worst < 1e-8, "{worst:e}");
}

#[test]
fn a_tilt_in_the_plane_is_refused_and_gravity_turned_instead() {
    let (_, _, chain, of_chain) = both();
    let tilt =
        |angle| Active { law: find("base_tilt").expect("in the catalogue"), joint: 0, p: [angle, 0.0, 0.0] };
    assert!(Plant::new(chain, of_chain).with_effect(tilt(0.1)).is_none());
    assert!(Plant::new(chain, of_chain).with_effect(tilt(0.0)).is_some());
    let (arm, theta, ..) = both();
    let tilted = chain.with_gravity([GRAVITY * 0.1_f64.cos(), -GRAVITY * 0.1_f64.sin(), 0.0]);
    let q = SVector::<f64, 2>::new(0.4, -1.1);
    let expected = arm.gravity(&theta, &q, 0.1);
    assert!((Arm::<f64, 2, 26>::gravity(&tilted, &of_chain, &q, 0.0) - expected).amax() < 1e-12);
}

#[test]
fn a_payload_is_a_point_mass_on_the_last_axis() {
    let mut numbers = Numbers(11);
    let (chain, theta) = (numbers.chain::<3>(), numbers.theta::<3, 39>());
    let load = |p| Active { law: find("payload").expect("in the catalogue"), joint: 0, p };
    let plant = Plant::new(chain, theta).with_effect(load([1.3, 0.4, 0.0])).expect("room");
    let mut heavier = theta;
    for (sum, x) in heavier[20..30].iter_mut().zip([1.3, 0.0, 0.0, 0.52, 0.208, 0.0, 0.208, 0.0, 0.0, 0.0]) {
        *sum += x;
    }
    let joints = JointState { q: [0.3, -0.2, 1.0], dq: [1.0, 0.4, -2.0] };
    let (own, other) =
        (plant.rigid().equation_terms(&joints), Plant::new(chain, heavier).rigid().equation_terms(&joints));
    for j in 0..3 {
        assert!((own.bias[j] - other.bias[j]).abs() < 1e-12 * (1.0 + other.bias[j].abs()));
    }
}

/// Plant of a random chain with friction, its state at rest, and torques near its Coulomb levels.
fn at_rest<const N: usize, const P: usize>(
    numbers: &mut Numbers,
) -> (Plant<f64, Chain<f64, N>, N, P>, State<f64, N>, SVector<f64, N>) {
    let (chain, mut theta) = (numbers.chain::<N>().with_gravity([0.0; 3]), numbers.theta::<N, P>());
    // Without rotors the joints are coupled as strongly as they can be.
    theta[10 * N..12 * N].fill(0.0);
    let state = State::new(numbers.many(3.0), SVector::zeros());
    (Plant::new(chain, theta), state, numbers.many(2.0))
}

/// Accelerations of a plant at rest with these friction modes, and whether friction agrees with them.
fn agrees<const N: usize, const P: usize>(
    plant: &Plant<f64, Chain<f64, N>, N, P>,
    state: &State<f64, N>,
    tau: &SVector<f64, N>,
    modes: &[Mode; N],
) -> (Accelerations<f64, N>, bool) {
    let kinematics = plant.rigid().kinematics(&JointState { q: state.q.into(), dq: state.dq.into() });
    let motion = plant.acceleration(0.0, &kinematics, tau, modes, &state.latent);
    let holds = |j: usize| match modes[j] {
        Mode::Stuck => motion.friction_at_rest[j].abs() <= plant.rigid().coulomb[j],
        slides => motion.ddq[j] * slides.direction::<f64>() > 0.0,
    };
    (motion, (0..N).all(holds))
}

/// Friction modes by a simple method: the joint with the largest stiction violation is released, one at a time, and held for good if it is pulled
/// back.
fn one_at_a_time<const N: usize, const P: usize>(
    plant: &Plant<f64, Chain<f64, N>, N, P>,
    state: &State<f64, N>,
    tau: &SVector<f64, N>,
) -> [Mode; N] {
    let (mut modes, mut held) = ([Mode::Stuck; N], [false; N]);
    for _ in 0..2 * N {
        let (motion, _) = agrees(plant, state, tau, &modes);
        let back = (0..N).find(|&j| motion.ddq[j] * modes[j].direction::<f64>() < 0.0);
        if let Some(j) = back {
            (modes[j], held[j]) = (Mode::Stuck, true);
            continue;
        }
        let excess = |j: usize| motion.friction_at_rest[j].abs() - plant.rigid().coulomb[j];
        let free = (0..N).filter(|&j| modes[j] == Mode::Stuck && !held[j] && excess(j) > 0.0);
        let Some(j) = free.max_by(|&a, &b| excess(a).total_cmp(&excess(b))) else { break };
        modes[j] = Mode::of(motion.friction_at_rest[j]);
    }
    modes
}

/// Checks the integrator's friction modes of plants at rest against an enumeration of all modes. Returns in how many plants three joints or more
/// break away at once, and in how many of those plants [`one_at_a_time`] is wrong.
fn break_away<const N: usize, const P: usize>(cases: usize) -> [usize; 2] {
    let (mut numbers, mut counts) = (Numbers(N as u64), [0; 2]);
    for _ in 0..cases {
        let (plant, state, tau) = at_rest::<N, P>(&mut numbers);
        let all = (0..3_usize.pow(N as u32)).map(|code| {
            let digit = |j: usize| code / 3_usize.pow(j as u32) % 3;
            std::array::from_fn(|j| [Mode::Stuck, Mode::Forward, Mode::Backward][digit(j)])
        });
        let right: Vec<[Mode; N]> = all.filter(|modes| agrees(&plant, &state, &tau, modes).1).collect();
        assert_eq!(right.len(), 1, "dry friction has one solution");
        let mut moved = state;
        let torque = <[f64; N]>::from(tau).map(InputSegment::held);
        advance(&plant, &mut moved, &Interval { t: 0.0, h: 1e-9, torque: &torque }, 1);
        assert_eq!(moved.modes, right[0], "{N} joints");
        if right[0].iter().filter(|mode| **mode != Mode::Stuck).count() >= 3 {
            counts[0] += 1;
            counts[1] += usize::from(one_at_a_time(&plant, &state, &tau) != right[0]);
        }
    }
    counts
}

#[test]
fn joints_that_break_away_together_are_those_of_an_enumeration() {
    let counts = [break_away::<3, 39>(2000), break_away::<4, 52>(1000), break_away::<6, 78>(60)];
    assert!(counts.iter().all(|[together, _]| *together > 20), "{counts:?}");
    let wrong: usize = counts.iter().map(|[_, wrong]| wrong).sum();
    assert!(wrong > 0, "no case in which releasing one joint at a time goes wrong: {counts:?}");
}
