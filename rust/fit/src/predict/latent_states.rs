//! Latent states, which no encoder measures, at the start of every window: simulated along the measured motion from the start of the log.
//!
//! The hysteresis state of a joint depends on its path, and a motor behind a shaft or backlash moves under the logged torque against the measured
//! position of its link; so neither needs an initial guess at a window's start.

use crate::log::track::{MeasuredState, Track};
use crate::predict::rollouts::{MAX_SUBSTEPS_FRICTION, Rollouts};
use armgap_core::arm::Arm;
use armgap_core::effect::{InputSegment, interval};
use armgap_core::integrate::{State, StepLimits};
use armgap_core::plant::{Mode, Plant};
use armgap_core::rollout::{Correction, Run};
use armgap_core::transmission::{LatentState, Sides, Transmission};
use rayon::prelude::*;

/// Largest phase of a motor's natural oscillation within one step of the simulation of latent states, rad.
const MAX_PHASE_PER_STEP: f64 = 1.0;

/// Time constant with which the simulated deflection of a joint with its encoder on the motor is corrected to that from the motor's torque balance,
/// s: long compared with a sample interval, as accelerations are noisy, short compared with the ringing of a shaft with little damping, which would
/// carry an error along the log.
const MEMORY: f64 = 0.25;

/// Largest number of steps per sample in the simulation of latent states.
const MAX_STEPS: usize = 8;

/// Largest latent position or rate [SI]; larger values are set to it: the hypothesis is wrong then, and its cost will be large.
const LIMIT: f64 = 1e3;

/// A log and the plant whose latent states along it are wanted.
pub struct LatentRun<'a, A, const N: usize, const P: usize> {
    /// Log with the measured motion.
    pub track: &'a Track<N>,
    /// Plant with latent states.
    pub plant: &'a Plant<f64, A, N, P>,
    /// Torques of the motors from each sample to the next.
    pub torque: &'a [[InputSegment<f64>; N]],
    /// Index of the last sample at which the states are wanted.
    pub last: usize,
}

/// Latent states of plants that differ in values alone, at every sample of each run's log up to its last one; whole arms are simulated by the method
/// `R`.
pub fn latent_states<R: Rollouts, A: Arm<f64, N, P>, const N: usize, const P: usize>(
    runs: &[LatentRun<'_, A, N, P>],
) -> Vec<Vec<LatentState<f64, N>>> {
    let at_motor = |run: &LatentRun<A, N, P>| (0..N).any(|j| run.plant.drivetrain().sides(j) != Sides::LINK);
    if runs.iter().any(at_motor) {
        beside_measured_motors::<R, A, N, P>(runs)
    } else {
        runs.par_iter().map(beside_measured_links).collect()
    }
}

/// Latent states of an arm with encoders and friction on the links: each motor is simulated beside the measured motion of its link.
fn beside_measured_links<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    &LatentRun { track, plant, torque, last }: &LatentRun<'_, A, N, P>,
) -> Vec<LatentState<f64, N>> {
    let path = track.path();
    let mut now = LatentState::none(path[0].q);
    let rates: [f64; N] = std::array::from_fn(|j| {
        plant.drivetrain().get(j).map_or(0.0, |transmission| transmission.rate(f64::MAX))
    });
    let mut all = Vec::with_capacity(last + 1);
    for k in 0..=last {
        now.memory = plant.memory(&path[k].q, &now);
        now.anchor = path[k].q;
        all.push(rigid(&now, plant));
        let next = path.get(k + 1).unwrap_or(&path[k]);
        for j in 0..N {
            if let Some(transmission) = plant.drivetrain().get(j) {
                let h = interval(&track.t, k);
                let ends = [(path[k].q[j], path[k].dq[j]), (next.q[j], next.dq[j])];
                let carried: f64 = (0..j).map(|i| next.dq[i] - path[k].dq[i]).sum();
                let held =
                    transmission.coupling_ratio * transmission.inertia * carried / h.max(f64::MIN_POSITIVE);
                let torque = torque[k][j].map(|tau| tau - held);
                let motor_motion = MotorMotion { transmission, rate: rates[j], torque: &torque, h, ends };
                let (at, rate) =
                    motor_motion.advance(ends[0].0 + now.deflection[j], ends[0].1 + now.deflection_rate[j]);
                (now.deflection[j], now.deflection_rate[j]) = (at - ends[1].0, rate - ends[1].1);
            }
        }
    }
    all
}

/// Latent states of arms with encoders on motors or friction on motors: the whole arm is simulated from sample to sample, and measured positions and
/// velocities are inserted at each sample.
fn beside_measured_motors<R: Rollouts, A: Arm<f64, N, P>, const N: usize, const P: usize>(
    runs: &[LatentRun<'_, A, N, P>],
) -> Vec<Vec<LatentState<f64, N>>> {
    let mut insertions: Vec<_> = runs.iter().map(Insertion::new).collect();
    let mut shown: Vec<_> = runs.iter().map(|run| vec![0.0; run.last * N]).collect();
    let mut rollouts: Vec<_> = runs
        .iter()
        .zip(&mut shown)
        .zip(&mut insertions)
        .map(|((run, positions), insertion)| Run {
            plant: run.plant,
            t: &run.track.t[..=run.last],
            torque: &run.torque[..run.last],
            state: insertion.start(),
            positions,
        })
        .collect();
    let step_limits = StepLimits { near_standstill: MAX_SUBSTEPS_FRICTION, elsewhere: MAX_STEPS };
    R::corrected(&mut rollouts, &mut insertions, step_limits);
    insertions.into_iter().map(|insertion| insertion.states).collect()
}

/// Insertion of the measured positions and velocities of a log into a simulated arm, sample by sample.
struct Insertion<'a, A, const N: usize, const P: usize> {
    run: &'a LatentRun<'a, A, N, P>,
    /// Latent states at the samples so far.
    states: Vec<LatentState<f64, N>>,
}

impl<'a, A: Arm<f64, N, P>, const N: usize, const P: usize> Insertion<'a, A, N, P> {
    fn new(run: &'a LatentRun<'a, A, N, P>) -> Self {
        Self { run, states: Vec::with_capacity(run.last + 1) }
    }

    /// State of the arm at the first sample, with the measured motion inserted.
    fn start(&mut self) -> State<f64, N> {
        let first = self.run.track.path()[0];
        let mut state = State::new(first.q, first.dq);
        self.correct(0, &mut state);
        state
    }

    /// Part of the correction of the simulated deflection of joint `j`, whose encoder is on its motor, to that by the motor's torque balance that is
    /// made at a sample after the first, rad or m; zero where the motor may stick.
    fn balance_correction(&self, j: usize, latent: &LatentState<f64, N>) -> f64 {
        let LatentRun { track, plant, torque, .. } = self.run;
        let (path, k) = (track.path(), self.states.len());
        let sample = Motor { path: [&path[k - 1], &path[k]], h: track.t[k] - track.t[k - 1], j };
        let before = self.states[k - 1].deflection[j];
        let predicted = 0.5 * (before + latent.deflection[j]);
        sample
            .deflection(plant, &torque[k - 1][j], latent.deflection_rate[j])
            .map_or(0.0, |balance| (sample.h / MEMORY).min(0.5) * (balance - predicted))
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Correction<f64, N> for Insertion<'_, A, N, P> {
    /// Inserts the measured motion at the next sample into the state simulated from the sample before.
    fn correct(&mut self, _: usize, now: &mut State<f64, N>) {
        let (plant, k) = (self.run.plant, self.states.len());
        let (path, drivetrain) = (self.run.track.path(), plant.drivetrain());
        if !now.is_finite() || now.latent.deflection.amax() > LIMIT {
            *now = State::new(path[k].q, path[k].dq);
        }
        for j in 0..N {
            let (at, rate) = (path[k].q[j], path[k].dq[j]);
            let Some(transmission) = drivetrain.get(j) else {
                (now.q[j], now.dq[j]) = (at, rate);
                continue;
            };
            if drivetrain.sides(j).encoder_at_motor {
                (now.latent.deflection[j], now.latent.deflection_rate[j]) = (at - now.q[j], rate - now.dq[j]);
                if k > 0 && transmission.backlash <= 0.0 {
                    now.latent.deflection[j] += self.balance_correction(j, &now.latent);
                    now.q[j] = at - now.latent.deflection[j];
                }
            } else {
                now.latent.deflection[j] += now.q[j] - at;
                now.latent.deflection_rate[j] += now.dq[j] - rate;
                (now.q[j], now.dq[j]) = (at, rate);
            }
            if transmission.backlash > 0.0 {
                let beyond = now.latent.deflection[j].abs() >= transmission.half_backlash();
                if beyond || now.latent.side[j] != 0.0 {
                    let side = if beyond { now.latent.deflection[j].signum() } else { now.latent.side[j] };
                    now.latent.side[j] = side;
                    now.latent.deflection[j] = side * transmission.half_backlash();
                    now.latent.deflection_rate[j] = 0.0;
                }
                if drivetrain.sides(j).encoder_at_motor {
                    now.q[j] = at - now.latent.deflection[j];
                    now.dq[j] = rate - now.latent.deflection_rate[j];
                }
            }
        }
        now.modes =
            std::array::from_fn(|j| Mode::of(drivetrain.friction_velocity(j, now.dq[j], &now.latent)));
        now.latent.memory = plant.memory(&now.q, &now.latent);
        now.latent.anchor = now.q;
        self.states.push(now.latent);
    }
}

/// Measured motion of the motor of joint `j` over one sample interval of `h` seconds: the states at its ends, by the encoder on the motor.
struct Motor<'a, const N: usize> {
    path: [&'a MeasuredState<N>; 2],
    h: f64,
    j: usize,
}

impl<const N: usize> Motor<'_, N> {
    /// Deflection of the shaft by the torque balance of the measured motor, at deflection rate `rate`; `None` where the motor may stick.
    fn deflection<A: Arm<f64, N, P>, const P: usize>(
        &self,
        plant: &Plant<f64, A, N, P>,
        torque: &InputSegment<f64>,
        rate: f64,
    ) -> Option<f64> {
        let Self { path: [from, to], h, j } = *self;
        let transmission = plant.drivetrain().get(j)?;
        let speed = 0.5 * (from.dq[j] + to.dq[j]);
        let mut braked = 0.0;
        if plant.drivetrain().sides(j).friction_at_motor {
            if from.dq[j] * to.dq[j] <= 0.0 {
                return None;
            }
            let rigid = plant.rigid();
            braked = rigid.viscous[j] * speed + rigid.coulomb[j].max(0.0) * speed.signum();
        }
        let carried: f64 = (0..j).map(|i| to.dq[i] - from.dq[i]).sum();
        let gained = to.dq[j] - from.dq[j] + transmission.coupling_ratio * carried;
        let passed = torque.at(0.5) - braked - transmission.inertia * gained / h;
        Some((passed - transmission.damping * rate) / transmission.stiffness)
    }
}

/// Latent states with rigid backlash flanks: a rotor beyond a flank is moved onto the flank.
fn rigid<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    state: &LatentState<f64, N>,
    plant: &Plant<f64, A, N, P>,
) -> LatentState<f64, N> {
    let mut rigid = *state;
    for (j, transmission) in plant.drivetrain().iter().filter(|(_, transmission)| transmission.backlash > 0.0)
    {
        if state.deflection[j].abs() >= transmission.half_backlash() {
            rigid.side[j] = state.deflection[j].signum();
            (rigid.deflection[j], rigid.deflection_rate[j]) =
                (rigid.side[j] * transmission.half_backlash(), 0.0);
        }
    }
    rigid
}

/// A motor simulated over one sample interval, with known motion of its link.
struct MotorMotion<'a> {
    transmission: &'a Transmission<f64>,
    /// Natural frequency of the motor against a link that does not yield, or its damping rate if that is larger, 1/s.
    rate: f64,
    torque: &'a InputSegment<f64>,
    h: f64,
    /// Position and velocity of the link at the start and the end of the interval.
    ends: [(f64, f64); 2],
}

impl MotorMotion<'_> {
    /// Position and velocity of the link at the fraction `s` of the interval, by Hermite's cubic.
    fn link(&self, s: f64) -> (f64, f64) {
        let [(q0, v0), (q1, v1)] = self.ends;
        let (d0, d1) = (v0 * self.h, v1 * self.h);
        let (c2, c3) = (3.0 * (q1 - q0) - 2.0 * d0 - d1, 2.0 * (q0 - q1) + d0 + d1);
        (q0 + s * (d0 + s * (c2 + s * c3)), (d0 + s * (2.0 * c2 + 3.0 * s * c3)) / self.h)
    }

    /// Torque on the motor, and position and velocity of the link, at the fraction `s` of the sample interval.
    fn drawn(&self, s: f64) -> [f64; 3] {
        let (q, dq) = self.link(s);
        [self.torque.at(s), q, dq]
    }

    /// Acceleration of the motor at position `at` and velocity `rate`, under a torque and against a link position and velocity.
    fn slope(&self, [torque, q, dq]: &[f64; 3], at: f64, rate: f64) -> f64 {
        (torque - self.transmission.transmitted(at - q, rate - dq)) / self.transmission.inertia
    }

    /// Acceleration, at the fraction `s` of the sample interval, of a motor at rest at position zero on a shaft without backlash.
    fn push(&self, s: f64) -> f64 {
        let (q, dq) = self.link(s);
        (self.torque.at(s) + self.transmission.stiffness * q + self.transmission.damping * dq)
            / self.transmission.inertia
    }

    /// Position and velocity of the motor at the end of the sample interval, from its position `e` and velocity `v` at the start of the interval.
    fn advance(&self, e: f64, v: f64) -> (f64, f64) {
        if self.transmission.backlash > 0.0 {
            return self.steps((e, v), |s| self.drawn(s), |here, e, v| self.slope(here, e, v));
        }
        // Without backlash the motor's equation of motion is linear.
        let Transmission { stiffness, damping, inertia, .. } = self.transmission;
        let (pull, brake) = (stiffness / inertia, damping / inertia);
        self.steps((e, v), |s| self.push(s), |push, e, v| push - pull * e - brake * v)
    }

    /// Position and velocity of the motor at the end of the sample interval by Runge-Kutta, from position `e` and velocity `v`; `drawn` gives the
    /// motor's input at a fraction of the interval, and `slope` its acceleration under an input.
    #[inline(always)]
    fn steps<D>(
        &self,
        (mut e, mut v): (f64, f64),
        drawn: impl Fn(f64) -> D,
        slope: impl Fn(&D, f64, f64) -> f64,
    ) -> (f64, f64) {
        let count = ((self.h * self.rate / MAX_PHASE_PER_STEP).ceil() as usize).clamp(1, MAX_STEPS);
        let (dt, ds) = (self.h / count as f64, 1.0 / count as f64);
        let (half, sixth) = (0.5 * dt, dt / 6.0);
        let mut here = drawn(0.0);
        for i in 0..count {
            let s = i as f64 * ds;
            let (middle, end) = (drawn(s + 0.5 * ds), drawn(s + ds));
            let a1 = slope(&here, e, v);
            let v2 = v + half * a1;
            let a2 = slope(&middle, e + half * v, v2);
            let v3 = v + half * a2;
            let a3 = slope(&middle, e + half * v2, v3);
            let v4 = v + dt * a3;
            let a4 = slope(&end, e + dt * v3, v4);
            e += sixth * (v + 2.0 * (v2 + v3) + v4);
            v += sixth * (a1 + 2.0 * (a2 + a3) + a4);
            here = end;
        }
        (e.clamp(-LIMIT, LIMIT), v.clamp(-LIMIT, LIMIT))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_behind_a_shaft_swings_as_its_equation_says() {
        let (inertia, rate, torque, h) = (0.02, 150.0, 0.3, 0.002);
        let stiffness = inertia * rate * rate;
        let transmission = Transmission {
            inertia,
            stiffness,
            damping: 0.0,
            backlash: 0.0,
            part_of_link: false,
            coupling_ratio: 0.0,
        };
        let natural = transmission.rate(f64::MAX);
        let (speed, segment) = (0.4, InputSegment::held(torque));
        // Behind a link at constant speed: a motor that starts with it oscillates about the deflection that carries the torque.
        let (mut at, mut velocity) = (0.0, speed);
        for k in 0..50 {
            let t = f64::from(k) * h;
            let ends = [(speed * t, speed), (speed * (t + h), speed)];
            (at, velocity) =
                MotorMotion { transmission: &transmission, rate: natural, torque: &segment, h, ends }
                    .advance(at, velocity);
            let phase = rate * (t + h);
            let deflection = torque / stiffness * (1.0 - phase.cos());
            assert!(
                (at - speed * (t + h) - deflection).abs() < 1e-3 * torque / stiffness,
                "{k}: {at} {deflection}"
            );
        }
    }
}
