//! Times of two seconds of the two-link arm without dry friction, by Runge-Kutta with one step per period: by the integrator of `armgap-core`, and by
//! one that calls ferromotion's articulated-body algorithm. Markdown on standard output.

use armgap_bench::run::{PERIOD, torque};
use armgap_core::arm::{LinkParameters, TwoLink};
use armgap_core::effect::InputSegment;
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use ferromotion_core::{LinkInertia, Robot, forward_dynamics_aba, from_urdf_full, inertial_regressor};
use nalgebra::{Vector2, Vector3};
use std::hint::black_box;
use std::time::Instant;

const SAMPLES: u32 = 800;
const ROUNDS: usize = 31;
const GRAVITY: f64 = 9.81;
const VISCOUS: [f64; 2] = [2.288, 0.175];
const LINKS: LinkParameters<f64> = LinkParameters {
    mass: [23.902, 3.880],
    length: [0.45, 0.30],
    com: [0.091, 0.048],
    inertia: [1.266, 0.093],
};

fn link(i: usize) -> String {
    let (m, c, j) = (LINKS.mass[i], LINKS.com[i], LINKS.inertia[i]);
    format!(
        r#"<link name="l{i}"><inertial><origin xyz="0 0 -{c}"/><mass value="{m}"/>
        <inertia ixx="{j}" ixy="0" ixz="0" iyy="{j}" iyz="0" izz="{j}"/></inertial></link>"#
    )
}

fn joint(i: usize, parent: &str, below: f64) -> String {
    format!(
        r#"<joint name="j{i}" type="continuous"><parent link="{parent}"/><child link="l{i}"/>
        <origin xyz="0 0 -{below}"/><axis xyz="0 1 0"/></joint>"#
    )
}

fn robot() -> (Robot, Vec<LinkInertia>) {
    let joints = joint(0, "base", 0.0) + &joint(1, "l0", LINKS.length[0]);
    let urdf = format!(r#"<robot name="arm"><link name="base"/>{}{}{joints}</robot>"#, link(0), link(1));
    let (mut robot, inertia) = from_urdf_full(&urdf, "base", "l1").expect("a valid description");
    for (joint, b) in robot.joints.iter_mut().zip(VISCOUS) {
        joint.damping = Some(b);
    }
    (robot, inertia)
}

fn theirs(robot: &Robot, inertia: &[LinkInertia]) -> Vec<[f64; 2]> {
    let down = Vector3::new(0.0, 0.0, -GRAVITY);
    let slope = |q: Vector2<f64>, v: Vector2<f64>, u: &[f64; 2]| {
        Vector2::from_row_slice(&forward_dynamics_aba(robot, inertia, q.as_slice(), v.as_slice(), u, down))
    };
    let (mut q, mut v) = (Vector2::zeros(), Vector2::zeros());
    (0..SAMPLES)
        .map(|k| {
            let (before, u, h) = (q.into(), torque(f64::from(k) * PERIOD), PERIOD);
            let a1 = slope(q, v, &u);
            let v2 = v + a1 * (h / 2.0);
            let a2 = slope(q + v * (h / 2.0), v2, &u);
            let v3 = v + a2 * (h / 2.0);
            let a3 = slope(q + v2 * (h / 2.0), v3, &u);
            let v4 = v + a3 * h;
            let a4 = slope(q + v3 * h, v4, &u);
            q += (v + (v2 + v3) * 2.0 + v4) * (h / 6.0);
            v += (a1 + (a2 + a3) * 2.0 + a4) * (h / 6.0);
            before
        })
        .collect()
}

fn ours(plant: &Plant<f64, TwoLink<f64>, 2, 9>) -> Vec<[f64; 2]> {
    let mut state = State::new(Vector2::zeros(), Vector2::zeros());
    (0..SAMPLES)
        .map(|k| {
            let (before, t) = (state.q.into(), f64::from(k) * PERIOD);
            advance(plant, &mut state, &Interval { t, h: PERIOD, torque: &torque(t).map(InputSegment::held) }, 1);
            before
        })
        .collect()
}

/// Median time of `work` per sample, ns.
fn timed<R>(mut work: impl FnMut() -> R) -> f64 {
    let mut times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            black_box(work());
            start.elapsed().as_nanos() as f64 / f64::from(SAMPLES)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[ROUNDS / 2]
}

fn main() {
    let (robot, inertia) = robot();
    let base = TwoLink::inertial_from_links(&LINKS, GRAVITY);
    let theta = [base[0], base[1], base[2], base[3], base[4], VISCOUS[0], VISCOUS[1], 0.0, 0.0];
    let plant = Plant::new(TwoLink::new(GRAVITY, None, &theta), theta);
    let (a, b) = (ours(&plant), theirs(&robot, &inertia));
    let off = a.iter().flatten().zip(b.iter().flatten()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    let core = timed(|| ours(&plant));
    let (x, down) = ([1.0; 2], Vector3::new(0.0, 0.0, -GRAVITY));
    let call = |mut one: Box<dyn FnMut()>| timed(|| (0..SAMPLES).for_each(|_| one()));
    let (r, i) = (robot.clone(), inertia.clone());
    let aba = call(Box::new(move || drop(black_box(forward_dynamics_aba(&r, &i, &x, &x, &x, down)))));
    let r = robot.clone();
    let regressor = call(Box::new(move || drop(black_box(inertial_regressor(&r, &x, &x, &x, down)))));
    let run = timed(|| theirs(&robot, &inertia));
    println!(
        "| compiled, 2 s, no dry friction | per sample | ratio | positions differ by at most |\n| --- | --- | --- | --- |"
    );
    println!("| armgap-core, Runge-Kutta, one step per period | {core:.0} ns | 1 | |");
    println!(
        "| ferromotion 0.73, Runge-Kutta around its ABA | {run:.0} ns | {:.1} | {off:.0e} rad |",
        run / core
    );
    println!("| ferromotion 0.73, one ABA | {aba:.0} ns | {:.1} | |", aba / core);
    println!("| ferromotion 0.73, one inertial regressor | {regressor:.0} ns | {:.1} | |", regressor / core);
}
