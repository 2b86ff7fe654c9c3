//! Joint elasticity and backlash in the weak form: how a deflection between motor and link changes the equation of motion.
//!
//! The deflection between motor and link follows from the torque `T` that the transmission passes on: for an elastic shaft (Spong 1987), whose spring
//! and damper act side by side, `T / stiffness` delayed by the ratio of damping and stiffness, to first order in this time; for backlash, half the gap
//! towards the side that `T` pushes to, and a free motion from one flank to the other where `T` changes sign ([`super::backlash`]). Where the encoder
//! measures the motor, the link's position is the motor's less the deflection, and `T` in an elastic shaft is the motor's torque less those of rotor
//! inertia and friction; where the encoder measures the link, the motor's position, at which rotor inertia and friction act, is the link's plus the
//! deflection, and `T` in an elastic shaft is the torque of the links. The motor's torque is unknown while it is at rest, since its dry friction is:
//! it is interpolated there, as the deflection is continuous.

use crate::model::hypothesis::EffectInstance;
use crate::numeric::cache::Cache;
use crate::serial::term::{Term, TermKind, TermParameter, backlash};
use crate::serial::weak_form::equation::Equation;
use crate::serial::weak_form::intervals::{Intervals, Middle};
use crate::serial::weak_form::rows::{Signal, sum};
use armgap_core::arm::Arm;
use armgap_core::effect::{Effect, find};
use armgap_core::kinematics::JointState;
use armgap_core::transmission::Sides;
use nalgebra::SVector;
use rayon::prelude::*;

/// Displacement of a joint, rad (m), and of its velocity, rad/s (m/s), in numerical derivatives of torques by the deflection of a transmission; torques
/// are smooth functions of both.
const DISPLACEMENT: f64 = 1e-3;

/// Time between the instants at which these derivatives are computed, s: between them a motion of 2 Hz bends them by less than a hundredth.
const DERIVATIVES_S: f64 = 0.02;

/// Derivatives of momentum and torque of the links by a joint's position, and by its velocity.
type LinkDerivative<const N: usize> = [[SVector<f64, N>; 2]; 2];

/// Derivatives by log and sample interval.
type LinkDerivatives<const N: usize> = Vec<Vec<LinkDerivative<N>>>;

/// Elasticity or backlash of one joint's transmission.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransmissionLaw {
    /// 0-based joint of the transmission.
    pub joint: usize,
    /// Whether the joint's encoder measures the motor; else it measures the link.
    pub encoder_at_motor: bool,
    /// Law of the deflection between motor and link under the transmitted torque.
    pub compliance: Compliance,
}

/// Law of a transmission's deflection between motor and link under the transmitted torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Compliance {
    /// Elastic shaft: the deflection is `compliance T - lag dT/dt`, with the compliance the inverse stiffness and the lag the damping over the squared
    /// stiffness.
    Elastic,
    /// Backlash: the deflection is half the gap, to the side that the torque pushes to, and crosses the gap freely.
    Backlash,
}

/// Least and largest damping ratio of an elastic joint's oscillation in predictions: beyond them the estimate is taken as uncertain.
const DAMPING: [f64; 2] = [0.02, 1.0];

/// Half width of the raised cosine with which the transmitted torque is low-passed, s: it takes out noise of the acceleration of a motor, and passes
/// oscillations of a joint up to 15 Hz.
const LOW_PASS_S: f64 = 0.02;

/// Rotor inertia that predictions assume for a motor without one in the arm file, relative to the joint's inertia.
const ROTOR_SHARE: f64 = 0.03;

impl TransmissionLaw {
    /// Effect of the library that the transmission term is simulated with: joint elasticity or backlash.
    fn effect(&self) -> &'static dyn Effect<f64> {
        let name = match self.compliance {
            Compliance::Elastic => "joint_elasticity",
            Compliance::Backlash => "backlash",
        };
        find(name).expect("the library has both")
    }

    /// Name of the transmission term in results.
    pub fn name(&self) -> &'static str {
        self.effect().spec().name
    }

    /// Title of the transmission term in reports.
    pub fn title(&self) -> &'static str {
        self.effect().spec().title
    }

    /// Candidate terms of the law at its initial guesses; `scale` is the size of the joint's positions, rad or m, by which gaps are guessed.
    pub fn guesses(self, scale: f64) -> Vec<Term> {
        let neutral = Term::neutral(TermKind::Transmission(self));
        match self.compliance {
            Compliance::Elastic => vec![neutral],
            Compliance::Backlash => {
                let mut gaps: Vec<f64> = self.effect().spec().initial_guesses.iter().map(|p| p[0]).collect();
                gaps.dedup();
                gaps.into_iter().map(|gap| neutral.with(vec![gap * scale])).collect()
            }
        }
    }

    /// Number of leading parameters in which the torque is linear: the torque of an elastic shaft is, the time of a crossing depends on the gap.
    pub fn amplitudes(&self) -> usize {
        match self.compliance {
            Compliance::Elastic => 2,
            Compliance::Backlash => 0,
        }
    }

    /// Names, units and bounds of the estimated parameters, compliance and lag or gap; `rotary` is whether the joint is rotary.
    pub fn parameters(&self, rotary: bool) -> Vec<TermParameter> {
        let of = |name, units: [&'static str; 2], inverse: Option<(&'static str, [&'static str; 2])>| {
            let unit = |units: [&'static str; 2]| if rotary { units[0] } else { units[1] };
            let inverse = inverse.map(|(name, units)| (name, unit(units)));
            TermParameter { name, unit: unit(units), bounds: [0.0, f64::INFINITY], neutral: 0.0, inverse }
        };
        match self.compliance {
            Compliance::Elastic => vec![
                of("compliance", ["rad/(N m)", "m/N"], Some(("stiffness", ["N m/rad", "N/m"]))),
                of("lag", ["rad s/(N m)", "m s/N"], None),
            ],
            Compliance::Backlash => vec![of("gap", ["rad", "m"], None)],
        }
    }

    /// Damping, N m s/rad (N s/m), of a transmission with the parameters `p`, and the damping's standard deviation from those of the parameters,
    /// `sigma`; `None` for backlash, or without a compliance.
    pub fn damping(p: &[f64], sigma: &[f64]) -> Option<[f64; 2]> {
        let (compliance, lag) = (*p.first()?, *p.get(1)?);
        let damping = lag / (compliance * compliance);
        let own = sigma.get(1).copied().unwrap_or(0.0) / (compliance * compliance);
        let scaled = 2.0 * damping * sigma.first().copied().unwrap_or(0.0) / compliance;
        damping.is_finite().then(|| [damping, own.hypot(scaled)])
    }

    /// The effect that simulates a transmission with the parameters `p` of [`Self::parameters`], and the part of the arm file's rotor inertia that the
    /// effect takes over; `rotor` is that rotor inertia and `inertia` the joint's inertia, kg m^2 (kg).
    pub fn instance(&self, p: &[f64], rotor: f64, inertia: f64) -> (EffectInstance, f64) {
        let size = p[0];
        let rotor_inertia = if rotor > 0.0 { rotor } else { ROTOR_SHARE * inertia };
        let (p, taken) = match self.compliance {
            Compliance::Elastic => {
                let stiffness = 1.0 / size.max(f64::MIN_POSITIVE);
                let ratio =
                    0.5 * Self::damping(p, &[]).map_or(0.0, |d| d[0]) / (stiffness * rotor_inertia).sqrt();
                let damping = 2.0 * ratio.clamp(DAMPING[0], DAMPING[1]) * (stiffness * rotor_inertia).sqrt();
                ([stiffness, damping, rotor_inertia], rotor)
            }
            Compliance::Backlash => ([size, (rotor_inertia / inertia).clamp(0.005, 0.35), 0.0], 0.0),
        };
        let sides = if self.encoder_at_motor {
            Sides::MOTOR
        } else {
            Sides { friction_at_motor: true, ..Sides::LINK }
        };
        (EffectInstance::new(self.effect(), self.joint, p).with_sides(sides), taken)
    }
}

impl<const N: usize, const P: usize> Equation<N, P> {
    /// Torque by joint and row of the weak form, N m or N, due to the deflection of a transmission with the parameters `p` of
    /// [`TransmissionLaw::parameters`]: to first order in the deflection.
    pub(in crate::serial) fn of_transmission(
        &self,
        law: &TransmissionLaw,
        p: &[f64],
        theta: &[f64; P],
    ) -> Signal {
        if p.iter().all(|p| *p == 0.0) {
            return vec![None; N];
        }
        let at = (*law, *theta);
        match law.compliance {
            Compliance::Elastic => {
                let units = self.computed.units.of(&at, || self.of_elastic_units(law, theta));
                let scaled = |(unit, p): (&Signal, &f64)| -> Signal {
                    unit.iter().map(|s| s.as_ref().map(|s| s.iter().map(|x| p * x).collect())).collect()
                };
                sum(&self.rows, &units.iter().zip(p).map(scaled).collect::<Vec<Signal>>())
            }
            Compliance::Backlash => {
                let inside = self.computed.inside.of(&at, || self.inside_gap(law, theta));
                let paths: Vec<_> = inside.iter().map(|log| backlash::deflections(log, p[0])).collect();
                self.of_deflections(law, &paths, theta)
            }
        }
    }

    /// Torques by joint and row of the weak form due to the deflection of an elastic shaft, per unit of its compliance and of its lag.
    fn of_elastic_units(&self, law: &TransmissionLaw, theta: &[f64; P]) -> Vec<Signal> {
        let j = law.joint;
        let links = Self::links(theta);
        let along = |log: &Intervals<N>| {
            let middles = &log.middles;
            let mut torques: Vec<f64> = if law.encoder_at_motor {
                middles.par_iter().map(|m| self.motor_torque(m, j, theta)).collect()
            } else {
                middles.par_iter().map(|m| self.link_torque(m, &links)[j]).collect()
            };
            if law.encoder_at_motor {
                bridge_rest(middles, j, |k| self.link_torque(&middles[k], &links)[j], &mut torques);
            }
            with_rates(middles, &low_passed(middles, &torques))
        };
        let deflections: Vec<Vec<[f64; 2]>> = self.logs().iter().map(along).collect();
        let lagging = |(log, deflections): (&Intervals<N>, &Vec<[f64; 2]>)| {
            with_rates(&log.middles, &deflections.iter().map(|d| -d[1]).collect::<Vec<f64>>())
        };
        let lagging: Vec<_> = self.logs().iter().zip(&deflections).map(lagging).collect();
        [&deflections, &lagging].map(|deflections| self.of_deflections(law, deflections, theta)).to_vec()
    }

    /// Length of each sample interval, s, and acceleration of the deflection inside the gap of a backlash, rad/s^2 (m/s^2), log by log: the torque that
    /// the body whose motion is not measured would need to stay on its flank, by the inertia of this body.
    fn inside_gap(&self, law: &TransmissionLaw, theta: &[f64; P]) -> InsideGap {
        let j = law.joint;
        let links = Self::links(theta);
        let at = |m: &Middle<N>| {
            let inertia = self.arm.inertia(&links, &SVector::from(m.q))[(j, j)];
            if law.encoder_at_motor {
                return [m.h, self.link_torque(m, &links)[j] / inertia];
            }
            let rotor = if theta[10 * N + j] > 0.0 { theta[10 * N + j] } else { ROTOR_SHARE * inertia };
            [m.h, self.motor_torque(m, j, theta) / rotor]
        };
        self.logs().iter().map(|log| log.middles.par_iter().map(at).collect()).collect()
    }

    /// Torque by joint and row of the weak form due to deflections of a transmission, given with their rates by log and sample interval.
    fn of_deflections(
        &self,
        law: &TransmissionLaw,
        deflections: &[Vec<[f64; 2]>],
        theta: &[f64; P],
    ) -> Signal {
        let j = law.joint;
        if !law.encoder_at_motor {
            return self.of_motor(j, deflections, theta);
        }
        let at = (j, *theta);
        let derivatives = self.computed.derivatives.of(&at, || self.link_derivatives(j, &Self::links(theta)));
        self.weak_parts(&Self::behind_motors(deflections, &derivatives))
    }

    /// The arm's parameters without rotor inertias and friction.
    fn links(theta: &[f64; P]) -> [f64; P] {
        let mut links = *theta;
        links[10 * N..].fill(0.0);
        links
    }

    /// Torque that the motor of joint `j` passes on along the measured motion, N m or N: the motor's torque less those of rotor inertia and friction.
    fn motor_torque(&self, m: &Middle<N>, j: usize, theta: &[f64; P]) -> f64 {
        let friction = self.arm.friction(theta, &SVector::from(m.dq))[j];
        m.tau[j] - theta[10 * N + j] * m.ddq[j] - friction
    }

    /// Torque of the links on all joints along the measured motion, without rotors and friction, N m or N.
    fn link_torque(&self, m: &Middle<N>, links: &[f64; P]) -> SVector<f64, N> {
        let inertia = self.arm.inertia(links, &SVector::from(m.q));
        let bias = self.rigid(links).equation_terms(&JointState { q: m.q, dq: m.dq }).bias;
        inertia * SVector::from(m.ddq) + SVector::from(bias)
    }

    /// Change of the links' torque by joint and row of the weak form, to first order, where the encoder of joint `j` measures the motor and the link
    /// is behind by the deflection; `deflections` holds deflection and rate by log and sample interval, and `derivatives` [`Self::link_derivatives`].
    fn behind_motors(
        deflections: &[Vec<[f64; 2]>],
        derivatives: &LinkDerivatives<N>,
    ) -> Vec<Vec<[SVector<f64, N>; 2]>> {
        let at = |([deflection, rate], [by_position, by_velocity]): (&[f64; 2], &LinkDerivative<N>)| {
            std::array::from_fn(|part| -(by_position[part] * *deflection + by_velocity[part] * *rate))
        };
        let along = |(deflections, derivatives): (&Vec<[f64; 2]>, &Vec<LinkDerivative<N>>)| {
            deflections.iter().zip(derivatives).map(at).collect()
        };
        deflections.iter().zip(derivatives).map(along).collect()
    }

    /// Derivatives of the links' momentum, and of their torque without the momentum's derivative, by position and velocity of joint `j`, by log and
    /// sample interval; computed at instants [`DERIVATIVES_S`] apart and interpolated between them.
    fn link_derivatives(&self, j: usize, links: &[f64; P]) -> LinkDerivatives<N> {
        let at = |m: &Middle<N>| -> LinkDerivative<N> {
            let derivative = |place: fn(&mut Middle<N>, usize, f64)| {
                let displaced = |by: f64| {
                    // Velocities from local cubics are less noisy than differences of positions, and no mean over the interval is needed here.
                    let mut there = Middle { mean_dq: m.dq, ..*m };
                    place(&mut there, j, by);
                    self.parts(&there, links)
                };
                let ([pa, ra], [pb, rb]) = (displaced(DISPLACEMENT), displaced(-DISPLACEMENT));
                [pa - pb, ra - rb].map(|x| x / (2.0 * DISPLACEMENT))
            };
            [
                derivative(|m, j, by| m.q[j] += by),
                derivative(|m, j, by| {
                    m.dq[j] += by;
                    m.mean_dq[j] += by;
                }),
            ]
        };
        let along = |log: &Intervals<N>| {
            let middles = &log.middles;
            let mut knots: Vec<usize> = Vec::new();
            for (k, m) in middles.iter().enumerate() {
                let is_far =
                    knots.last().is_none_or(|last| m.t - middles[*last].t > DERIVATIVES_S - 0.5 * m.h);
                if is_far || k + 1 == middles.len() {
                    knots.push(k);
                }
            }
            let values: Vec<LinkDerivative<N>> = knots.par_iter().map(|k| at(&middles[*k])).collect();
            let between = |k: usize| {
                let i = knots.partition_point(|knot| *knot <= k).min(knots.len() - 1).max(1);
                let Some((a, b)) = values.get(i - 1).zip(values.get(i)) else { return values[0] };
                let span = middles[knots[i]].t - middles[knots[i - 1]].t;
                let part = (middles[k].t - middles[knots[i - 1]].t) / span;
                std::array::from_fn(|x| std::array::from_fn(|y| a[x][y] * (1.0 - part) + b[x][y] * part))
            };
            (0..middles.len()).map(between).collect()
        };
        self.logs().iter().map(along).collect()
    }

    /// Change of the torque of rotor inertia and viscous friction, by joint and row of the weak form, where the encoder of joint `j` measures the
    /// link and the motor leads by the deflection; `deflections` holds deflection and rate by log and sample interval.
    fn of_motor(&self, j: usize, deflections: &[Vec<[f64; 2]>], theta: &[f64; P]) -> Signal {
        let (rotor, viscous) = (theta[10 * N + j], self.arm.viscous(theta)[j]);
        if rotor == 0.0 && viscous == 0.0 {
            return vec![None; N];
        }
        let changes: Vec<Vec<[SVector<f64, N>; 2]>> = deflections
            .iter()
            .map(|log| {
                let at = |[_, rate]: &[f64; 2]| {
                    let mut parts = [SVector::zeros(); 2];
                    (parts[0][j], parts[1][j]) = (rotor * rate, viscous * rate);
                    parts
                };
                log.iter().map(at).collect()
            })
            .collect();
        let mut signal = self.weak_parts(&changes);
        (0..N).filter(|k| *k != j).for_each(|k| signal[k] = None);
        signal
    }
}

/// A transmission, and the arm's parameters along whose motion it was evaluated.
type At<const P: usize> = (TransmissionLaw, [f64; P]);

/// Length of each sample interval, s, and acceleration of a deflection inside its gap, rad/s^2 (m/s^2), log by log.
type InsideGap = Vec<Vec<[f64; 2]>>;

/// What the last evaluations of transmissions computed along the logs; a fit needs each of these at several values.
#[derive(Debug, Default)]
pub struct Computed<const N: usize, const P: usize> {
    /// Torques per unit of compliance and lag of an elastic shaft, by joint and row.
    units: Cache<At<P>, Vec<Signal>>,
    /// Motion inside a gap.
    inside: Cache<At<P>, InsideGap>,
    /// Derivatives of the links' torques by the position and velocity of a joint.
    derivatives: Cache<(usize, [f64; P]), LinkDerivatives<N>>,
}

/// Replaces the torques that the motor of joint `j` passes on while it is at rest by those that the links need there (`links`, by index of the sample
/// interval), plus the difference between the two, interpolated linearly in time between before and after the rest: the friction of a motor at rest is
/// unknown, and the shaft's torque is continuous. Where a log begins or ends at rest the nearest difference is held.
fn bridge_rest<const N: usize>(
    middles: &[Middle<N>],
    j: usize,
    links: impl Fn(usize) -> f64,
    torques: &mut [f64],
) {
    let mut before: Option<usize> = None;
    let mut k = 0;
    while k < middles.len() {
        if !middles[k].rest[j] {
            before = Some(k);
            k += 1;
            continue;
        }
        let after = (k..middles.len()).find(|i| !middles[*i].rest[j]);
        let end = after.unwrap_or(middles.len());
        let [from, to] = [before, after].map(|i| i.map(|i| (middles[i].t, torques[i] - links(i))));
        for i in k..end {
            let difference = match (from, to) {
                (Some((ta, a)), Some((tb, b))) => a + (middles[i].t - ta) / (tb - ta) * (b - a),
                (Some((_, one)), None) | (None, Some((_, one))) => one,
                (None, None) => 0.0,
            };
            torques[i] = links(i) + difference;
        }
        k = end;
    }
}

/// Values at the middles of sample intervals, low-passed by a raised cosine of half width [`LOW_PASS_S`].
fn low_passed<const N: usize>(middles: &[Middle<N>], values: &[f64]) -> Vec<f64> {
    let at = |k: usize| {
        let (mut sum, mut area) = (0.0, 0.0);
        let mut add = |i: usize| -> bool {
            let x = (middles[i].t - middles[k].t) / LOW_PASS_S;
            if x.abs() >= 1.0 {
                return false;
            }
            let weight = middles[i].h * (1.0 + (std::f64::consts::PI * x).cos());
            sum += weight * values[i];
            area += weight;
            true
        };
        (0..=k).rev().take_while(|i| add(*i)).for_each(drop);
        (k + 1..middles.len()).take_while(|i| add(*i)).for_each(drop);
        sum / area
    };
    (0..values.len()).map(at).collect()
}

/// Deflections of a transmission at the middles of sample intervals, each with its rate from central differences.
fn with_rates<const N: usize>(middles: &[Middle<N>], deflections: &[f64]) -> Vec<[f64; 2]> {
    let last = deflections.len().saturating_sub(1);
    let at = |k: usize| {
        let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
        let time = middles[to].t - middles[from].t;
        let rate = if time > 0.0 { (deflections[to] - deflections[from]) / time } else { 0.0 };
        [deflections[k], rate]
    };
    (0..deflections.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn middles(rest: &[bool]) -> Vec<Middle<1>> {
        let middle = |(k, rest): (usize, &bool)| Middle {
            t: 0.01 * k as f64,
            h: 0.01,
            q: [0.0],
            dq: [0.0],
            ddq: [0.0],
            mean_dq: [0.0],
            tau: [0.0],
            rest: [*rest],
        };
        rest.iter().enumerate().map(middle).collect()
    }

    #[test]
    fn torques_of_a_motor_at_rest_lie_between_those_before_and_after() {
        let rest = [true, false, true, true, true, false, false, true];
        let mut torques = [9.0, 1.0, 9.0, -9.0, 9.0, 5.0, 4.0, -9.0];
        bridge_rest(&middles(&rest), 0, |_| 0.0, &mut torques);
        let expected = [1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 4.0, 4.0];
        assert!(torques.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{torques:?}");
    }

    #[test]
    fn over_a_rest_torques_follow_those_of_the_links() {
        let rest = [false, true, true, true, false];
        let links = [1.0, 4.0, -2.0, 6.0, 3.0];
        let mut torques = [2.0, 0.0, 0.0, 0.0, 8.0];
        bridge_rest(&middles(&rest), 0, |k| links[k], &mut torques);
        let expected = [2.0, 6.0, 1.0, 10.0, 8.0];
        assert!(torques.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{torques:?}");
        let mut never = [1.0, -2.0];
        bridge_rest(&middles(&[true; 2]), 0, |k| links[k], &mut never);
        assert_eq!(never, [1.0, 4.0]);
    }
}
