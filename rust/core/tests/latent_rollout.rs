//! Tests of batch rollouts of plants with latent states and regularised friction against the scalar integrator.

use armgap_core::arm::{Pendulum, TwoLink};
use armgap_core::cpu::Level;
use armgap_core::effect::{Active, InputSegment, find};
use armgap_core::integrate::{Interval, State, StepLimits, advance, advance_in_stable_steps};
use armgap_core::plant::{Mode, Plant, StepRates};
use armgap_core::rollout::{Correction, LatentRollout, Run};
use armgap_core::transmission::Sides;
use nalgebra::{Vector1, Vector2};

const THETA: [f64; 9] = [2.3516, 0.0838, 0.1019, 38.465, 1.827, 2.288, 0.175, 7.6, 1.734];
const H: f64 = 0.0025;
const ROWS: usize = 300;
const RUNS: usize = 19;
const LIMITS: StepLimits = StepLimits { near_standstill: 16, elsewhere: 5 };

type Arm = Plant<f64, TwoLink<f64>, 2, 9>;

fn arm() -> Arm {
    Plant::new(TwoLink::new(9.81, Some(0.45), &THETA), THETA)
}

fn with(plant: Arm, name: &str, joint: usize, p: [f64; 3]) -> Arm {
    let law = find::<f64>(name).expect("in the catalogue");
    plant.with_effect(Active { law, joint, p }).expect("room for it")
}

fn elastic(joint: usize, sides: Sides) -> Arm {
    let (stiffness, inertia) = if joint == 0 { (4000.0, 0.3) } else { (150.0, 0.01) };
    with(arm(), "joint_elasticity", joint, [stiffness, 0.004 * stiffness, inertia])
        .with_sides(joint, sides)
        .expect("a joint of the arm")
}

fn times() -> Vec<f64> {
    (0..=ROWS).map(|k| H * k as f64 + 2e-4 * (k % 3) as f64).collect()
}

/// Torques, N m, under which joints slide, reverse, stick and break away, different for every run.
fn torques(run: usize) -> Vec<[InputSegment<f64>; 2]> {
    let size = 1.0 / (1.0 + 0.3 * run as f64);
    let at = |t: f64| {
        [
            20.0 + 68.0 * size * (16.0 * t + 0.1).sin() + 9.0 * (20.0 * t).sin(),
            8.0 * size * (26.0 * t + run as f64).sin(),
        ]
    };
    let between = |a: f64, b: f64| InputSegment { start: a, middle: 0.4 * a + 0.6 * b, end: b };
    times().windows(2).map(|t| std::array::from_fn(|j| between(at(t[0])[j], at(t[1] - 1e-3)[j]))).collect()
}

fn start(run: usize) -> State<f64, 2> {
    let x = run as f64;
    let still = run.is_multiple_of(3);
    State::new(Vector2::new(0.3 * x, -0.2 * x), if still { Vector2::zeros() } else { Vector2::new(0.5, -x) })
}

/// Number of rows of a run.
fn rows(run: usize) -> usize {
    (ROWS * (run % 4)) / 3
}

/// Positions that the encoders show in a run of the scalar integrator, with the state at every sample corrected by `correction`.
fn alone(plant: &Arm, run: usize, mut correction: Option<&mut dyn Correction<f64, 2>>) -> Vec<f64> {
    let (t, torque) = (times(), torques(run));
    let mut state = start(run);
    let mut shown = Vec::new();
    for k in 0..rows(run) {
        let h = t[k + 1] - t[k];
        let (interval, rates) = (Interval { t: t[k], h, torque: &torque[k] }, plant.step_rates(&state.q));
        advance_in_stable_steps(plant, &mut state, &interval, &rates, LIMITS);
        shown.extend(plant.drivetrain().shown(&state.q, &state.latent).iter());
        if let Some(correction) = &mut correction {
            correction.correct(run, &mut state);
        }
    }
    shown
}

/// Positions of the runs side by side, each with its own plant, with the states corrected by `correction`.
fn side_by_side(
    plants: &[Arm],
    level: Level,
    correction: Option<&mut dyn Correction<f64, 2>>,
) -> Vec<Vec<f64>> {
    let (t, torques): (_, Vec<_>) = (times(), (0..RUNS).map(torques).collect());
    let mut out = vec![vec![f64::NAN; 2 * ROWS]; RUNS];
    let mut runs: Vec<_> = out
        .iter_mut()
        .enumerate()
        .map(|(run, positions)| Run {
            plant: &plants[run % plants.len()],
            t: &t[..=rows(run)],
            torque: &torques[run][..rows(run)],
            state: start(run),
            positions: &mut positions[..2 * rows(run)],
        })
        .collect();
    let correction = correction.map(|correction| correction as &mut dyn Correction<f64, 2>);
    LatentRollout { runs: &mut runs, limit: 1e3, step_limits: LIMITS, correction }.run_all(level);
    out
}

/// Largest distance between the positions of two runs, rad; NaN if one is not finite.
fn apart(one: &[f64], other: &[f64]) -> f64 {
    let apart = one.iter().zip(other).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, |most, x| if x > most || x.is_nan() { x } else { most })
}

/// Largest distance of the runs side by side from those alone, rad.
fn distance(plant: &Arm, level: Level) -> f64 {
    let out = side_by_side(std::slice::from_ref(plant), level, None);
    let mut most = 0.0_f64;
    for (run, positions) in out.iter().enumerate() {
        let alone = alone(plant, run, None);
        assert!(positions[2 * rows(run)..].iter().all(|q| q.is_nan()), "run {run} went on");
        let off = apart(&positions[..alone.len()], &alone);
        most = if off > most || off.is_nan() { off } else { most };
    }
    most
}

fn assert_same(plant: &Arm, what: &str) {
    assert!(plant.is_latent_or_regularised(), "{what}");
    for level in [Level::PORTABLE, Level::detect(), Level::widest()] {
        let off = distance(plant, level);
        assert!(off < 1e-9, "{what}, {}: {off:e}", level.name());
    }
}

const SIDES: [Sides; 4] = [
    Sides::LINK,
    Sides::MOTOR,
    Sides { encoder_at_motor: false, friction_at_motor: true, rotor_rides: false },
    Sides { encoder_at_motor: true, friction_at_motor: false, rotor_rides: true },
];

#[test]
fn regularised_friction_in_lanes_is_that_of_one_run() {
    for widths in [[0.05, 0.2], [0.02, 0.0], [0.0, 0.1], [0.005, 0.012]] {
        assert_same(&arm().with_rounding(widths), "regularised");
    }
}

#[test]
fn elastic_joints_in_lanes_move_as_in_one_run() {
    for (joint, sides) in [0, 1].into_iter().flat_map(|j| SIDES.map(|sides| (j, sides))) {
        assert_same(&elastic(joint, sides), &format!("joint {joint}, {sides:?}"));
        assert_same(
            &elastic(joint, sides).with_rounding([0.05, 0.03]),
            &format!("joint {joint}, {sides:?}, regularised"),
        );
    }
}

/// Backlash of a joint, with a rotor that is a part of the link's inertia.
fn backlash(joint: usize, sides: Sides) -> Arm {
    let p = if joint == 0 { [0.04, 0.3, 0.6] } else { [0.06, 0.3, 0.0] };
    with(arm(), "backlash", joint, p).with_sides(joint, sides).expect("a joint of the arm")
}

#[test]
fn backlash_in_lanes_closes_and_opens_as_in_one_run() {
    for (joint, sides) in [0, 1].into_iter().flat_map(|j| SIDES.map(|sides| (j, sides))) {
        let plant = backlash(joint, sides);
        assert_same(&plant, &format!("joint {joint}, {sides:?}"));
        assert_same(
            &plant.clone().with_rounding([0.05, 0.03]),
            &format!("joint {joint}, {sides:?}, regularised"),
        );
        assert_same(
            &with(plant, "joint_elasticity", 1 - joint, [600.0, 2.0, 0.02]),
            &format!("both, {sides:?}"),
        );
    }
}

#[test]
fn hysteresis_in_lanes_is_that_of_one_run() {
    for joint in [0, 1] {
        let presliding = |plant| with(plant, "presliding", joint, [1.5, 80.0, 0.0]);
        assert_same(&presliding(arm()), "exact friction");
        assert_same(&presliding(arm().with_rounding([0.05, 0.03])), "regularised");
        assert_same(&presliding(elastic(1, Sides::MOTOR)), "elastic");
        assert_same(&presliding(backlash(1, Sides::MOTOR)), "backlash");
    }
}

/// Torques that jump at a position act in the step in which they are met.
#[test]
fn joint_limits_in_lanes_are_met_as_in_one_run() {
    for plant in [elastic(1, Sides::MOTOR), backlash(1, Sides::LINK), arm().with_rounding([0.05, 0.03])] {
        for p in [[0.4, 300.0, 3.0], [-0.6, 200.0, 2.0]] {
            let plant = with(plant.clone(), "contact", 1, p);
            assert!(plant.jumps());
            let out = side_by_side(std::slice::from_ref(&plant), Level::widest(), None);
            // Whether the spring of the limit is followed in short steps is decided anew at each sample: by the state there alone.
            let off = (0..RUNS).map(|run| apart(&out[run][..2 * rows(run)], &alone(&plant, run, None)));
            assert!(off.fold(0.0, f64::max) < 1e-9);
        }
    }
}

/// Correction that moves every state, in a different way in every run and at every sample.
struct Nudge([usize; RUNS]);

impl Correction<f64, 2> for Nudge {
    fn correct(&mut self, run: usize, state: &mut State<f64, 2>) {
        self.0[run] += 1;
        let x = (1 + run) as f64 * self.0[run] as f64;
        state.q[0] += 1e-3 * x.sin();
        state.dq[1] += 1e-2 * x.cos();
        state.latent.deflection_rate[1] *= 0.9;
        state.modes = std::array::from_fn(|j| Mode::of(state.dq[j]));
    }
}

#[test]
fn plants_of_other_values_run_side_by_side_with_corrections() {
    let of = |i: usize| {
        let x = 1.0 + 0.1 * i as f64;
        let theta = THETA.map(|value| value * x.sqrt());
        Plant::new(TwoLink::new(9.81, Some(0.45), &theta), theta)
    };
    let elastic = |i: usize| with(of(i), "joint_elasticity", 1, [150.0 + 20.0 * i as f64, 0.5, 0.012]);
    let backlash = |i: usize| with(of(i), "backlash", 1, [0.06 + 0.01 * i as f64, 0.3, 0.0]);
    let presliding = |i: usize| with(of(i), "presliding", 1, [1.5 + 0.2 * i as f64, 80.0, 0.0]);
    let regularised = |i: usize| of(i).with_rounding([0.05 + 0.01 * i as f64, 0.03]);
    for sides in SIDES {
        for plant in [&elastic as &dyn Fn(usize) -> Arm, &backlash, &presliding, &regularised] {
            let plants: Vec<Arm> =
                (0..5).map(|i| plant(i).with_sides(1, sides).expect("a joint of the arm")).collect();
            let out = side_by_side(&plants, Level::widest(), Some(&mut Nudge([0; RUNS])));
            for run in 0..RUNS {
                let alone = alone(&plants[run % 5], run, Some(&mut Nudge([0; RUNS])));
                let off = apart(&out[run][..alone.len()], &alone);
                assert!(off < 1e-9, "run {run}, {sides:?}: {off:e}");
            }
        }
    }
}

#[test]
fn effects_act_beside_elastic_joints_and_regularised_friction() {
    let effects = [
        ("stribeck", 0, [2.0, 0.3, 0.0]),
        ("stribeck", 1, [0.5, 0.3, 0.0]),
        ("coulomb_asymmetry", 1, [0.4, 0.0, 0.0]),
        ("torque_ripple", 1, [0.3, 7.0, 0.4]),
        ("cross_friction", 0, [0.8, 0.0, 0.0]),
        ("load_dependent_friction", 0, [0.1, 0.0, 0.0]),
        ("payload", 0, [0.5, 0.3, 0.0]),
        ("torque_saturation", 0, [50.0, 0.0, 0.0]),
    ];
    for (name, joint, p) in effects {
        for sides in [Sides::LINK, Sides::MOTOR] {
            assert_same(&with(elastic(joint, sides), name, joint, p), &format!("{name} {joint} {sides:?}"));
            assert_same(&with(backlash(joint, sides), name, joint, p), &format!("{name} {joint} {sides:?}"));
        }
        assert_same(&with(arm().with_rounding([0.05, 0.03]), name, joint, p), name);
    }
}

#[test]
fn a_run_that_leaves_the_limit_ends_alone() {
    let (plant, t) = (elastic(1, Sides::MOTOR), times());
    let mut torques: Vec<_> = (0..8).map(|run| torques(run + 1)).collect();
    torques[2][50][0] = InputSegment::held(f64::NAN);
    torques[5][20][1] = InputSegment::held(1e9);
    let mut out = vec![vec![f64::NAN; 2 * ROWS]; 8];
    let mut runs: Vec<_> = out
        .iter_mut()
        .zip(&torques)
        .map(|(positions, torque)| Run { plant: &plant, t: &t, torque, state: start(1), positions })
        .collect();
    LatentRollout { runs: &mut runs, limit: 1e3, step_limits: LIMITS, correction: None }
        .run_all(Level::widest());
    assert!(out[2][99].is_finite() && out[2][100].is_nan());
    assert!(out[5][2 * ROWS - 1].is_nan(), "what is thrown off goes on");
    for run in [0, 1, 3, 4, 6, 7] {
        assert!(out[run].iter().all(|q| q.is_finite()), "run {run}");
    }
}

/// Torque on a pendulum, N m, held from each sample to the next.
fn torque(t: f64) -> f64 {
    6.0 * (9.0 * t).sin()
}

/// Positions that the encoder shows of a pendulum that starts at 0.3 rad and 0.5 rad/s under [`torque`].
fn swung(plant: &Plant<f64, Pendulum<f64>, 1, 4>) -> Vec<f64> {
    let t: Vec<f64> = (0..=ROWS).map(|k| H * k as f64).collect();
    let held: Vec<_> = t.iter().map(|t| [InputSegment::held(torque(*t))]).collect();
    let mut positions = vec![f64::NAN; ROWS];
    let state = State::new(Vector1::new(0.3), Vector1::new(0.5));
    let run = Run { plant, t: &t, torque: &held[..ROWS], state, positions: &mut positions };
    LatentRollout { runs: &mut [run], limit: 1e3, step_limits: LIMITS, correction: None }
        .run_all(Level::widest());
    positions
}

/// Positions that an encoder on the motor shows, of a pendulum behind an elastic shaft: the equations in the motor's own position `motor`, in place
/// of a deflection (Siciliano 2009, section 6.1), by Runge-Kutta in steps of a hundredth of a sample.
fn elastic_pendulum(
    [inertia, weight, viscous, coulomb]: [f64; 4],
    [stiffness, damping, rotor]: [f64; 3],
    width: f64,
) -> Vec<f64> {
    let rates = |t: f64, [link, motor, link_speed, motor_speed]: [f64; 4]| {
        let shaft = stiffness * (motor - link) + damping * (motor_speed - link_speed);
        let friction = viscous * motor_speed + coulomb * (motor_speed / width).tanh();
        let of_link = (shaft - weight * link.sin()) / inertia;
        [link_speed, motor_speed, of_link, (torque(t) - friction - shaft) / rotor]
    };
    let ahead = |x: [f64; 4], k: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    let h = H / 100.0;
    let (mut x, mut shown) = ([0.3, 0.3, 0.5, 0.5], Vec::new());
    for k in 0..ROWS * 100 {
        let t = H * (k / 100) as f64;
        let k1 = rates(t, x);
        let k2 = rates(t, ahead(x, k1, h / 2.0));
        let k3 = rates(t, ahead(x, k2, h / 2.0));
        let k4 = rates(t, ahead(x, k3, h));
        x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        if k % 100 == 99 {
            shown.push(x[1]);
        }
    }
    shown
}

#[test]
fn an_elastic_pendulum_obeys_the_equations_in_its_motors_position() {
    let (theta, shaft, width) = ([0.5, 3.0, 0.1, 0.4], [60.0, 0.2, 0.05], 0.5);
    let law = find::<f64>("joint_elasticity").expect("in the catalogue");
    let plant = Plant::new(Pendulum { gravity: 9.81 }, theta)
        .with_effect(Active { law, joint: 0, p: shaft })
        .and_then(|plant| plant.with_sides(0, Sides::MOTOR))
        .expect("a joint of the pendulum")
        .with_rounding([width]);
    let positions = swung(&plant);
    let expected = elastic_pendulum(theta, shaft, width);
    let most = positions.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let travel = expected.iter().fold(0.0_f64, |most, q| most.max((q - 0.3).abs()));
    assert!(most < 1e-6 && travel > 0.3, "{most:e} of {travel}");
}

/// A pendulum behind backlash, in the motor's own position: motor and link move apart between the flanks, meet without rebound and with their momentum
/// kept, and move as one body while the flank pushes (Nordin and Gutman 2002). Small steps of the semi-implicit Euler method; events at their ends.
/// Returns what the encoder shows, and how often the two meet.
fn slack_pendulum(
    [inertia, weight, viscous, coulomb]: [f64; 4],
    [gap, rotor]: [f64; 2],
    width: f64,
    at_motor: bool,
) -> (Vec<f64>, usize) {
    const PARTS: usize = 4000;
    let link = inertia - rotor;
    let friction = |speed: f64| viscous * speed + coulomb * (speed / width).tanh();
    let h = H / PARTS as f64;
    let ([mut q, mut motor], [mut dq, mut dmotor]): ([f64; 2], [f64; 2]) = ([0.3, 0.3], [0.5, 0.5]);
    let (mut flank, mut shown, mut meetings) = (0.0_f64, Vec::new(), 0);
    for k in 0..ROWS * PARTS {
        let tau = torque(H * (k / PARTS) as f64);
        if flank != 0.0 {
            let together = (tau - weight * q.sin() - friction(dq)) / inertia;
            let on_motor = if at_motor { friction(dq) } else { 0.0 };
            if (tau - on_motor - rotor * together) * flank < 0.0 {
                flank = 0.0;
            } else {
                dq += h * together;
                dmotor = dq;
            }
        }
        if flank == 0.0 {
            let [of_link, of_motor] = if at_motor { [0.0, friction(dmotor)] } else { [friction(dq), 0.0] };
            dq += h * (-weight * q.sin() - of_link) / link;
            dmotor += h * (tau - of_motor) / rotor;
        }
        q += h * dq;
        motor += h * dmotor;
        let beyond = (motor - q).abs() - 0.5 * gap;
        if flank == 0.0 && beyond > 0.0 {
            flank = (motor - q).signum();
            motor -= flank * beyond;
            dq = (link * dq + rotor * dmotor) / inertia;
            dmotor = dq;
            meetings += 1;
        }
        if k % PARTS == PARTS - 1 {
            shown.push(if at_motor { motor } else { q });
        }
    }
    (shown, meetings)
}

#[test]
fn a_pendulum_behind_backlash_obeys_the_equations_in_its_motors_position() {
    let (theta, gap, share, width) = ([0.5, 3.0, 0.1, 0.4], 0.05, 0.2, 0.5);
    let law = find::<f64>("backlash").expect("in the catalogue");
    for sides in [Sides::LINK, Sides::MOTOR] {
        let plant = Plant::new(Pendulum { gravity: 9.81 }, theta)
            .with_effect(Active { law, joint: 0, p: [gap, share, 0.0] })
            .and_then(|plant| plant.with_sides(0, sides))
            .expect("a joint of the pendulum")
            .with_rounding([width]);
        let positions = swung(&plant);
        let rotor = share * theta[0];
        let (expected, meetings) = slack_pendulum(theta, [gap, rotor], width, sides == Sides::MOTOR);
        let most = apart(&positions, &expected);
        let travel = expected.iter().fold(0.0_f64, |most, q| most.max((q - 0.3).abs()));
        assert!(most < 5e-6 && travel > 0.3 && meetings > 1, "{sides:?}: {most:e} of {travel}, {meetings}");
    }
}

/// A pendulum with presliding: the friction contact's torque grows with the way, up to its amplitude (Dahl 1968), by Runge-Kutta in time.
#[test]
fn a_pendulum_with_presliding_obeys_the_equation_in_time() {
    let ([inertia, weight, viscous, coulomb], [amplitude, stiffness], width): ([f64; 4], [f64; 2], f64) =
        ([0.5, 3.0, 0.1, 0.4], [0.8, 40.0], 0.5);
    let rates = |t: f64, [q, dq, z]: [f64; 3]| {
        let friction = viscous * dq + coulomb * (dq / width).tanh();
        let growth = stiffness * dq * (1.0 - dq.signum() * z / amplitude);
        [dq, (torque(t) - weight * q.sin() - friction - z) / inertia, growth]
    };
    let ahead = |x: [f64; 3], k: [f64; 3], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
    let h = H / 100.0;
    let (mut x, mut expected): ([f64; 3], _) = ([0.3, 0.5, 0.0], Vec::new());
    for k in 0..ROWS * 100 {
        let t = H * (k / 100) as f64;
        let k1 = rates(t, x);
        let k2 = rates(t, ahead(x, k1, h / 2.0));
        let k3 = rates(t, ahead(x, k2, h / 2.0));
        let k4 = rates(t, ahead(x, k3, h));
        x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        if k % 100 == 99 {
            expected.push(x[0]);
        }
    }
    let law = find::<f64>("presliding").expect("in the catalogue");
    let plant = Plant::new(Pendulum { gravity: 9.81 }, [inertia, weight, viscous, coulomb])
        .with_effect(Active { law, joint: 0, p: [amplitude, stiffness, 0.0] })
        .expect("a joint of the pendulum")
        .with_rounding([width]);
    let positions = swung(&plant);
    let most = apart(&positions, &expected);
    let travel = expected.iter().fold(0.0_f64, |most, q| most.max((q - 0.3).abs()));
    assert!(most < 1e-5 && travel > 0.3, "{most:e} of {travel}");
}

#[test]
fn friction_over_narrow_widths_is_stable_near_standstill() {
    let t = times();
    for widths in [[0.005, 0.012], [0.01, 0.02], [0.02, 0.03], [0.02, 0.0], [0.05, 0.1], [0.002, 0.004]] {
        let plant = arm().with_rounding(widths);
        let (mut worst, mut travel) = (0.0_f64, 0.0_f64);
        for run in 1..8 {
            let (torque, mut fine) = (torques(run), start(run));
            let begin = fine.q;
            for (k, shown) in alone(&plant, run, None).chunks_exact(2).enumerate() {
                let interval = Interval { t: t[k], h: t[k + 1] - t[k], torque: &torque[k] };
                advance(&plant, &mut fine, &interval, 400);
                worst = worst.max((shown[0] - fine.q[0]).abs().max((shown[1] - fine.q[1]).abs()));
                travel = travel.max((fine.q - begin).amax());
            }
        }
        assert!(worst < 3e-6 && travel > 0.3, "{widths:?}: {worst:e} of {travel}");
    }
}

/// A joint that reverses late in an interval of many steps is located there: steps without an event do not count against the events of the interval.
#[test]
fn a_late_reversal_in_many_steps_is_located() {
    let plant = elastic(0, Sides::LINK);
    let torque = [(20.0, 20.0), (-8.0, -8.0)].map(|(start, end)| InputSegment { start, middle: start, end });
    let interval = Interval { t: 0.0, h: 0.01, torque: &torque };
    let begin = State::new(Vector2::new(0.3, -0.2), Vector2::new(0.5, 0.7));
    let rates = StepRates { friction: 0.0, elsewhere: 1e5 };
    let limits = StepLimits { near_standstill: 1, elsewhere: 100 };
    let (mut divided, mut prescribed) = (begin, begin);
    advance_in_stable_steps(&plant, &mut divided, &interval, &rates, limits);
    advance(&plant, &mut prescribed, &interval, 100);
    assert!(prescribed.dq[1] < 0.0, "the second joint has reversed: {}", prescribed.dq[1]);
    assert!((divided.dq - prescribed.dq).amax() < 1e-9, "{:?} {:?}", divided.dq, prescribed.dq);
}
