//! Predictions of an arm behind position controllers, in closed loop: the controllers act on the predicted motion, under the logged reference.
//!
//! Within a sample interval the controllers run at a period of a millisecond or less and hold their torque over the period. The torque is that of the
//! state expected in the middle of the period: with the state at the start, the torque would be late by half a period, which at a stiff gain feeds
//! energy into the motion. Effects of the drive (delay, lag, saturation) need the commanded torques of the last periods; before the start of a window
//! these are the controllers' torques along the measured path.

use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::log_inputs::LogInputs;
use crate::predict::rollouts::{DIVERGED, Singly};
use crate::predict::window::{Dataset, Window, enter};
use crate::serial::controller::{Given, JointController};
use armgap_core::arm::Arm;
use armgap_core::effect::{InputSegment, Quantity, find};
use armgap_core::integrate::{Interval, State, advance};
use armgap_core::plant::Plant;
use armgap_core::transmission::Sides;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

/// Longest period of a simulated position controller, s.
const PERIOD: f64 = 1e-3;

/// Largest period of a simulated position controller, relative to the time constant of its closed loop.
const RESOLVED: f64 = 0.2;

/// Largest number of controller periods in one sample interval.
const MOST_PERIODS: usize = 100;

/// Part of a controller period by which a sample interval may be longer than a whole number of periods before it is divided into one period more, as
/// sample times carry rounding errors.
const PERIOD_ROUNDING: f64 = 1e-6;

/// Time after which a commanded torque no longer influences a drive's torque, as a multiple of the sum of the drive's delays and time constants.
const FORGOTTEN: f64 = 8.0;

/// Position controllers in closed loop with a simulated arm.
#[derive(Debug, Clone)]
pub struct ClosedLoop<const N: usize> {
    /// Position controllers by joint.
    pub joints: Vec<JointController>,
    /// Torque of each controller's integral part at the start of each log, N m or N, by log and joint.
    pub held_before: Vec<[f64; N]>,
}

/// Position controller of one joint with its inputs along a log.
struct Servo {
    controller: JointController,
    reference: Vec<InputSegment<f64>>,
    rate: Vec<InputSegment<f64>>,
    integral: Vec<InputSegment<f64>>,
    /// Torque that the controller commands along the measured path after its limit and before its delay, N m or N, by sample interval.
    measured: Vec<InputSegment<f64>>,
    /// Effects of the drive on the commanded torque (delay, lag, saturation), the controller's own delay first.
    laws: Vec<EffectInstance>,
    /// Time for which a commanded torque influences the torque after the effects of the drive, s.
    memory: f64,
}

/// Commanded torques of one joint in the last controller periods, N m or N, each with the time, s, at which its period began.
#[derive(Default)]
struct Past {
    t: Vec<f64>,
    torque: Vec<InputSegment<f64>>,
}

impl Servo {
    fn new(
        controller: JointController,
        given: &Given,
        held_before: f64,
        effects: &[EffectInstance],
        j: usize,
    ) -> Self {
        let mut errors = controller.errors(given);
        if controller.gains[2] > 0.0 {
            let before = held_before / controller.gains[2];
            errors[2].iter_mut().for_each(|e| *e = e.map(|e| e + before));
        }
        let own = (controller.delay > 0.0).then(|| find::<f64>("actuator_delay")).flatten();
        let own = own.map(|law| EffectInstance {
            law,
            joint: j,
            p: [controller.delay, 0.0, 0.0],
            sides: Sides::LINK,
        });
        let of_joint = effects.iter().filter(|e| e.law.spec().hooks.command && e.joint == j).copied();
        let laws: Vec<EffectInstance> = own.into_iter().chain(of_joint).collect();
        let times = |e: &EffectInstance| -> f64 {
            let all = e.law.spec().parameters.iter().zip(&e.p);
            all.filter(|(p, _)| p.quantity == Quantity::Time).map(|(_, value)| value).sum()
        };
        Self {
            controller,
            reference: controller.reference(given),
            rate: controller.reference_rate(given),
            measured: controller.prompt_torque(&errors),
            integral: errors.into_iter().next_back().unwrap_or_default(),
            memory: FORGOTTEN * laws.iter().map(times).sum::<f64>(),
            laws,
        }
    }

    /// Commanded torques before sample `first` that still influence the torque after the effects of the drive.
    fn past(&self, t: &[f64], first: usize) -> Past {
        let begin = t[..first].partition_point(|at| *at < t[first] - self.memory).saturating_sub(1);
        let begin = if self.memory > 0.0 { begin } else { first };
        Past { t: t[begin..first].to_vec(), torque: self.measured[begin..first].to_vec() }
    }

    /// Torque that the drive delivers, after delay, lag and saturation, N m or N, where the controller commands `torque` at time `now`, s, and holds
    /// it for `period`, s.
    fn delivered(&self, past: &mut Past, now: f64, period: f64, torque: f64) -> InputSegment<f64> {
        if self.laws.is_empty() {
            return InputSegment::held(torque);
        }
        past.t.push(now);
        past.torque.push(InputSegment::held(torque));
        let begin = past.t.partition_point(|at| *at < now - self.memory).saturating_sub(1);
        if self.memory == 0.0 {
            (past.t, past.torque) = (vec![now], vec![InputSegment::held(torque)]);
        }
        let begin = begin.min(past.t.len() - 1);
        let mut t = past.t[begin..].to_vec();
        t.push(now + period);
        let mut column = past.torque[begin..].to_vec();
        for law in &self.laws {
            law.law.command(&law.p, &t, &mut column);
        }
        column.last().copied().unwrap_or(InputSegment::held(torque))
    }
}

impl<const N: usize> ClosedLoop<N> {
    /// Predicted positions of all windows, rad or m, each from its measured initial state; windows of logs without a reference count as diverged.
    /// `beside` holds torques that act against the motors' on the joints, N m or N, by log and sample interval; empty where there are none.
    pub fn predict<A: Arm<f64, N, P>, const P: usize>(
        &self,
        data: &Dataset<N>,
        arm: &A,
        hypothesis: &Hypothesis<P>,
        beside: &[Vec<[f64; N]>],
    ) -> Vec<f64> {
        let mut predicted = vec![DIVERGED; data.rows * N];
        let Some(plant) = hypothesis.plant(arm) else { return predicted };
        let servos: Vec<Option<Vec<Servo>>> = (0..data.tracks.len())
            .map(|log| {
                let servo = |j: usize| {
                    let given = Given::new(&data.tracks[log], j)?;
                    Some(Servo::new(self.joints[j], &given, self.held_before[log][j], &hypothesis.effects, j))
                };
                (0..N).map(servo).collect()
            })
            .collect();
        let inputs = LogInputs::new::<Singly, A, P>(data, hypothesis, &plant, None);
        let mut rest = predicted.as_mut_slice();
        let mut runs = Vec::with_capacity(data.windows.len());
        for window in &data.windows {
            let (positions, after) = rest.split_at_mut(window.rows() * N);
            rest = after;
            let Window { initial_state, track, first, .. } = window;
            let mut state = hypothesis.initial_state(initial_state.q, initial_state.dq);
            if let Some(states) = inputs.latent(*track) {
                enter(&plant, &mut state, &states[*first]);
            }
            runs.push((window, state, positions));
        }
        runs.into_par_iter().for_each(|(window, state, positions)| {
            if let Some(servos) = &servos[window.track] {
                let along = Along {
                    t: &data.tracks[window.track].t,
                    beside: beside.get(window.track).map(Vec::as_slice),
                };
                run(&plant, hypothesis, servos, along, (window, state), positions);
            }
        });
        predicted
    }
}

/// Sample times of a log, s, and torques against the motors' along it, N m or N, by sample interval.
#[derive(Clone, Copy)]
struct Along<'a, const N: usize> {
    t: &'a [f64],
    beside: Option<&'a [[f64; N]]>,
}

/// Simulates one window of a log, from a state at its start, and writes the predicted positions, rad or m, sample by sample and joint by joint, into
/// `positions`.
fn run<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    plant: &Plant<f64, A, N, P>,
    hypothesis: &Hypothesis<P>,
    servos: &[Servo],
    Along { t, beside }: Along<'_, N>,
    (window, mut state): (&Window<N>, State<f64, N>),
    positions: &mut [f64],
) {
    let mut past: Vec<Past> = servos.iter().map(|servo| servo.past(t, window.first)).collect();
    let mut ddq = SVector::<f64, N>::zeros();
    let mut integral: Vec<f64> = servos.iter().map(|servo| servo.integral[window.first].start).collect();
    for (row, k) in positions.chunks_exact_mut(N).zip(window.first..) {
        let h = t[k + 1] - t[k];
        let count = periods(plant, servos, &state.q, h);
        let period = h / count as f64;
        let against = beside.and_then(|torques| torques.get(k)).unwrap_or(&[0.0; N]);
        for i in 0..count {
            let (halfway, now) = ((i as f64 + 0.5) / count as f64, t[k] + i as f64 * period);
            let mut expected =
                State { q: state.q + 0.5 * period * state.dq, dq: state.dq + 0.5 * period * ddq, ..state };
            expected.latent.deflection += 0.5 * period * state.latent.deflection_rate;
            let torque: [InputSegment<f64>; N] = std::array::from_fn(|j| {
                let servo = &servos[j];
                let (q, dq) = shown(plant, hypothesis, &expected, j);
                let error = servo.reference[k].at(halfway) - q;
                let inputs =
                    [servo.controller.proportional(error), servo.rate[k].at(halfway) - dq, integral[j]];
                integral[j] += period * error;
                let asked: f64 = servo.controller.gains.iter().zip(inputs).map(|(gain, e)| gain * e).sum();
                let InputSegment { start, middle, end } =
                    servo.delivered(&mut past[j], now, period, servo.controller.clipped(asked));
                let by = against[j];
                InputSegment { start: start - by, middle: middle - by, end: end - by }
            });
            let before = state.dq;
            advance(plant, &mut state, &Interval { t: now, h: period, torque: &torque }, 1);
            ddq = (state.dq - before) / period;
        }
        if !state.is_finite() || state.q.amax() > DIVERGED {
            break;
        }
        for (j, q) in row.iter_mut().enumerate() {
            *q = shown(plant, hypothesis, &state, j).0;
        }
    }
}

/// Position, rad or m, and velocity, rad/s or m/s, that the encoder of joint `j` shows in a simulated state.
fn shown<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    plant: &Plant<f64, A, N, P>,
    hypothesis: &Hypothesis<P>,
    state: &State<f64, N>,
    j: usize,
) -> (f64, f64) {
    let (mut q, mut dq) = (state.q[j], state.dq[j]);
    if plant.drivetrain().sides(j).encoder_at_motor {
        (q, dq) = (q + state.latent.deflection[j], dq + state.latent.deflection_rate[j]);
    }
    if hypothesis.distorts() { (hypothesis.measured(j, q), dq * hypothesis.stretch(j, q)) } else { (q, dq) }
}

/// Number of controller periods in a sample interval of length `h`, s: a period is short compared with the time constants of the closed loop and of
/// viscous friction.
fn periods<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    plant: &Plant<f64, A, N, P>,
    servos: &[Servo],
    q: &SVector<f64, N>,
    h: f64,
) -> usize {
    let joints = armgap_core::kinematics::JointState { q: (*q).into(), dq: [0.0; N] };
    let inertia = plant.rigid().equation_terms(&joints).inertia;
    let free = SMatrix::<f64, N, N>::from_fn(|i, j| inertia[i][j]).try_inverse();
    let rate = |(j, servo): (usize, &Servo)| {
        let joint = free.as_ref().map_or(0.0, |free| free[(j, j)].max(0.0));
        // A motor behind a transmission answers to its controller alone.
        let mobility = plant.drivetrain().get(j).map_or(joint, |t| joint.max(1.0 / t.inertia));
        let [kp, kd, _] = servo.controller.gains.map(f64::abs);
        (kp * mobility).sqrt() + kd * mobility
    };
    let servo = servos.iter().enumerate().map(rate).fold(0.0, f64::max);
    let rate = (servo / RESOLVED).max(plant.fastest(q).max(plant.viscous_rate(q)) / 1.5);
    ((h * rate.max(1.0 / PERIOD) - PERIOD_ROUNDING).ceil() as usize).clamp(1, MOST_PERIODS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::track::{Reference, Track};
    use armgap_core::arm::Pendulum;

    const PERIOD: f64 = 0.005;
    const INERTIA: f64 = 0.5;
    const VISCOUS: f64 = 0.4;
    const SERVO: JointController = JointController {
        gains: [200.0, 6.0, 0.0],
        rate_of_error: false,
        reference_delay: 0.0,
        delay: 0.0,
        deadband: 0.0,
        speed_limit: f64::INFINITY,
        torque_limit: f64::INFINITY,
    };
    /// Largest difference of positions, rad, between servos with periods of one millisecond and of 20 microseconds, after a step of the reference of
    /// 0.1 rad.
    const STEPPED: f64 = 1e-4;

    /// Reference at sample `k`, rad: a step from 0 to 0.1 after a fifth of a second.
    fn target(k: usize) -> f64 {
        if k < 40 { 0.0 } else { 0.1 }
    }

    /// Predicted positions, rad, of a pendulum without gravity behind `servo`; its log is at rest and gives the initial state alone.
    fn predicted(servo: JointController, effects: Vec<EffectInstance>) -> Vec<f64> {
        predicted_beside(servo, effects, &[])
    }

    /// Predicted positions as of [`predicted`], beside torques against the motor's by log and sample interval, N m.
    fn predicted_beside(
        servo: JointController,
        effects: Vec<EffectInstance>,
        beside: &[Vec<[f64; 1]>],
    ) -> Vec<f64> {
        let count = 160;
        let t: Vec<f64> = (0..count).map(|k| PERIOD * k as f64).collect();
        let mut track = Track::<1>::new("", &t, &vec![0.0; count], &[], Some([1e-6]));
        track.reference = Some(Reference { q: (0..count).map(|k| [target(k)]).collect(), dq: None });
        let data = crate::result::gap::whole(&Dataset { tracks: vec![track], windows: Vec::new(), rows: 0 });
        let hypothesis = Hypothesis { effects, ..Hypothesis::rigid([INERTIA, 0.0, VISCOUS, 0.0]) };
        let closed_loop = ClosedLoop { joints: vec![servo], held_before: vec![[0.0]] };
        closed_loop.predict(&data, &Pendulum { gravity: 0.0 }, &hypothesis, beside)
    }

    /// Positions, rad, of a pendulum behind `servo` by explicit Euler steps; `torque` returns the delivered torque from the torques commanded so far.
    fn stepped(servo: &JointController, torque: impl Fn(&[f64]) -> f64) -> Vec<f64> {
        let steps = 250;
        let dt = PERIOD / f64::from(steps);
        let (mut q, mut dq, mut asked, mut positions) = (0.0, 0.0, Vec::new(), Vec::new());
        for k in 0..159 {
            for _ in 0..steps {
                let [kp, kd, _] = servo.gains;
                asked.push((kp * (target(k) - q) - kd * dq).clamp(-servo.torque_limit, servo.torque_limit));
                dq += dt * (torque(&asked) - VISCOUS * dq) / INERTIA;
                q += dt * dq;
            }
            positions.push(q);
        }
        positions
    }

    fn apart(a: &[f64], b: &[f64]) -> f64 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    fn last(asked: &[f64]) -> f64 {
        asked[asked.len() - 1]
    }

    #[test]
    fn a_servo_answers_a_step_of_its_reference() {
        let found = predicted(SERVO, Vec::new());
        let off = apart(&found, &stepped(&SERVO, last));
        assert!(off < STEPPED && (found[158] - 0.1).abs() < 0.01, "{off}");
    }

    #[test]
    fn limits_and_delays_act_in_the_loop() {
        let limited = JointController { torque_limit: 3.0, ..SERVO };
        let off = apart(&predicted(limited, Vec::new()), &stepped(&limited, last));
        assert!(off < STEPPED, "{off}");
        // A delay of 8 ms is 400 steps, by the controller itself or by an effect of the drive.
        let late = |asked: &[f64]| asked.len().checked_sub(401).map_or(0.0, |i| asked[i]);
        let wanted = stepped(&SERVO, late);
        assert!(apart(&wanted, &stepped(&SERVO, last)) > 10.0 * STEPPED);
        let own = predicted(JointController { delay: 0.008, ..SERVO }, Vec::new());
        assert!(apart(&own, &wanted) < STEPPED, "{}", apart(&own, &wanted));
        let law = find::<f64>("actuator_delay").unwrap();
        let effect = predicted(SERVO, vec![EffectInstance::new(law, 0, [0.008, 0.0, 0.0])]);
        assert!(apart(&effect, &wanted) < STEPPED, "{}", apart(&effect, &wanted));
    }

    #[test]
    fn a_servo_that_measures_its_motor_moves_a_link_behind_a_shaft() {
        let [stiffness, damping, rotor] = [150.0, 0.8, 0.1];
        let law = find::<f64>("joint_elasticity").unwrap();
        let shaft = EffectInstance::new(law, 0, [stiffness, damping, rotor]).with_sides(Sides::MOTOR);
        let found = predicted(SERVO, vec![shaft]);
        // Motor and link by explicit steps; the servo, its friction and its encoder are at the motor.
        let steps = 250;
        let dt = PERIOD / f64::from(steps);
        let ([mut motor, mut link], [mut of_motor, mut of_link]) = ([0.0_f64; 2], [0.0_f64; 2]);
        let mut wanted = Vec::new();
        for k in 0..159 {
            for _ in 0..steps {
                let passed = stiffness * (motor - link) + damping * (of_motor - of_link);
                let [kp, kd, _] = SERVO.gains;
                let torque = kp * (target(k) - motor) - kd * of_motor;
                of_motor += dt * (torque - VISCOUS * of_motor - passed) / rotor;
                of_link += dt * passed / INERTIA;
                motor += dt * of_motor;
                link += dt * of_link;
            }
            wanted.push(motor);
        }
        let [off, rigid] = [&found, &stepped(&SERVO, last)].map(|other| apart(other, &wanted));
        assert!(off < 0.02 * rigid, "{off} beside {rigid} of a rigid joint");
    }

    #[test]
    fn torques_of_rows_act_in_the_loop() {
        let torque = |k: usize| 3.0 * (0.1 * k as f64).sin();
        let found = predicted_beside(SERVO, Vec::new(), &[(0..159).map(|k| [torque(k)]).collect()]);
        let against = |asked: &[f64]| last(asked) - torque((asked.len() - 1) / 250);
        let off = apart(&found, &stepped(&SERVO, against));
        assert!(off < STEPPED && apart(&found, &predicted(SERVO, Vec::new())) > 50.0 * STEPPED, "{off}");
    }

    #[test]
    fn a_late_reference_moves_the_answer() {
        let late = predicted(JointController { reference_delay: 2.0 * PERIOD, ..SERVO }, Vec::new());
        let prompt = predicted(SERVO, Vec::new());
        let off = apart(&late[2..], &prompt[..157]);
        assert!(off < 1e-9, "{off}");
    }

    #[test]
    fn what_an_integral_part_held_goes_on() {
        let servo = JointController { gains: [200.0, 6.0, 1e-6], ..SERVO };
        let (count, held) = (160, 2.0);
        let t: Vec<f64> = (0..count).map(|k| PERIOD * k as f64).collect();
        let mut track = Track::<1>::new("", &t, &vec![0.0; count], &[], Some([1e-6]));
        track.reference = Some(Reference { q: vec![[0.0]; count], dq: None });
        let data = crate::result::gap::whole(&Dataset { tracks: vec![track], windows: Vec::new(), rows: 0 });
        let closed_loop = ClosedLoop { joints: vec![servo], held_before: vec![[held]] };
        let hypothesis = Hypothesis::rigid([INERTIA, 0.0, VISCOUS, 0.0]);
        let found = closed_loop.predict(&data, &Pendulum { gravity: 0.0 }, &hypothesis, &[]);
        assert!((found[158] - held / 200.0).abs() < STEPPED, "{}", found[158]);
    }
}
