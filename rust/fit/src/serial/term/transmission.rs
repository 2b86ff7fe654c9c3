//! Joint elasticity and backlash in the weak form: how a deflection between motor and link changes the equation of motion.
//!
//! The deflection between motor and link follows from the torque `T` that the transmission passes on: `T / stiffness` for an elastic shaft (Spong
//! 1987, without the damping), and, for backlash, half the gap towards the side that `T` pushes to (Nordin and Gutman 2002). Where the encoder
//! measures the motor, `T` is the motor's torque less those of rotor inertia and friction, and the link's position is the motor's less the
//! deflection; where the encoder measures the link, `T` is the torque of the links, and the motor's position, at which rotor inertia and friction
//! act, is the link's plus the deflection.

use crate::model::hypothesis::EffectInstance;
use crate::serial::term::TermParameter;
use crate::serial::weak_form::equation::Equation;
use crate::serial::weak_form::intervals::Middle;
use crate::serial::weak_form::rows::Signal;
use armgap_core::arm::Arm;
use armgap_core::effect::{Effect, find};
use armgap_core::kinematics::JointState;
use armgap_core::transmission::Sides;
use nalgebra::SVector;
use rayon::prelude::*;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Largest displacement of a joint in numerical derivatives of torques by the deflection of a transmission, rad (m); torques are smooth functions of
/// the displacement.
const DISPLACEMENT: f64 = 1e-3;

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
    /// Elastic shaft: the deflection is in proportion to the transmitted torque.
    Elastic,
    /// Backlash: the deflection is half the gap, to the side that the torque pushes to; the value is the torque around zero within which the link
    /// crosses the gap, N m (N).
    Backlash(f64),
}

impl Compliance {
    /// Deflection between motor and link under a transmitted torque, N m (N), per unit of the compliance or of the gap.
    fn deflection(self, torque: f64) -> f64 {
        match self {
            Self::Elastic => torque,
            Self::Backlash(crossing) => 0.5 * (torque / crossing).tanh(),
        }
    }
}

/// Damping ratio that predictions assume for an elastic joint; motion slower than the joint's oscillation does not determine the damping.
const DAMPING: f64 = 0.1;

/// Rotor inertia that predictions assume for a motor without one in the arm file, relative to the joint's inertia.
const ROTOR_SHARE: f64 = 0.03;

impl TransmissionLaw {
    /// Effect of the library that the transmission term is simulated with: joint elasticity or backlash.
    fn effect(&self) -> &'static dyn Effect<f64> {
        let name = match self.compliance {
            Compliance::Elastic => "joint_elasticity",
            Compliance::Backlash(_) => "backlash",
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

    /// Name, unit and bounds of the estimated parameter, compliance or gap; `rotary` is whether the joint is rotary.
    pub fn parameter(&self, rotary: bool) -> TermParameter {
        let (name, unit, inverse) = match (self.compliance, rotary) {
            (Compliance::Elastic, true) => ("compliance", "rad/(N m)", Some(("stiffness", "N m/rad"))),
            (Compliance::Elastic, false) => ("compliance", "m/N", Some(("stiffness", "N/m"))),
            (Compliance::Backlash(_), true) => ("gap", "rad", None),
            (Compliance::Backlash(_), false) => ("gap", "m", None),
        };
        TermParameter { name, unit, bounds: [0.0, f64::INFINITY], neutral: 0.0, inverse }
    }

    /// The effect that simulates a compliance, rad/(N m) (m/N), or a gap, rad (m), of `size`, and the part of the arm file's rotor inertia that the
    /// effect takes over; `rotor` is that rotor inertia and `inertia` the joint's inertia, kg m^2 (kg).
    pub fn instance(&self, size: f64, rotor: f64, inertia: f64) -> (EffectInstance, f64) {
        let rotor_inertia = if rotor > 0.0 { rotor } else { ROTOR_SHARE * inertia };
        let (p, taken) = match self.compliance {
            Compliance::Elastic => {
                let stiffness = 1.0 / size.max(f64::MIN_POSITIVE);
                ([stiffness, 2.0 * DAMPING * (stiffness * rotor_inertia).sqrt(), rotor_inertia], rotor)
            }
            Compliance::Backlash(_) => ([size, (rotor_inertia / inertia).clamp(0.005, 0.35), 0.0], 0.0),
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
    /// Torque by joint and row of the weak form, N m or N, due to the deflection of a transmission with a compliance, rad/(N m) (m/N), or a gap, rad
    /// (m), of `size`: to first order, so in proportion to `size`.
    pub(in crate::serial) fn of_transmission(
        &self,
        law: &TransmissionLaw,
        size: f64,
        theta: &[f64; P],
    ) -> Signal {
        if size == 0.0 {
            return vec![None; N];
        }
        let unit = self.computed.of(law, theta, || self.of_unit(law, theta));
        unit.iter().map(|s| s.as_ref().map(|s| s.iter().map(|x| size * x).collect())).collect()
    }

    /// Torque by joint and row of the weak form due to the deflection of a transmission, to first order, per unit of compliance or gap.
    fn of_unit(&self, law: &TransmissionLaw, theta: &[f64; P]) -> Signal {
        let j = law.joint;
        let mut links = *theta;
        links[10 * N..].fill(0.0);
        let deflections: Vec<Vec<[f64; 2]>> = self
            .logs()
            .iter()
            .map(|log| {
                let middles = &log.middles;
                let mut torques: Vec<f64> = if law.encoder_at_motor {
                    middles.par_iter().map(|m| self.motor_torque(m, j, theta)).collect()
                } else {
                    middles.par_iter().map(|m| self.link_torque(m, &links)[j]).collect()
                };
                if law.encoder_at_motor {
                    bridge_rest(middles, j, &mut torques);
                }
                let of = |torque: &f64| law.compliance.deflection(*torque);
                with_rates(middles, &torques.iter().map(of).collect::<Vec<f64>>())
            })
            .collect();
        if law.encoder_at_motor {
            self.behind_motors(j, &deflections, &links)
        } else {
            self.of_motor(j, &deflections, theta)
        }
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
    /// is behind by the deflection; `deflections` holds deflection and rate by log and sample interval.
    fn behind_motors(&self, j: usize, deflections: &[Vec<[f64; 2]>], links: &[f64; P]) -> Signal {
        let largest = deflections.iter().flatten().fold(0.0, |a: f64, d| a.max(d[0].abs()));
        if largest == 0.0 {
            return vec![None; N];
        }
        let step = DISPLACEMENT / largest;
        let changes: Vec<Vec<[SVector<f64, N>; 2]>> = self
            .logs()
            .iter()
            .zip(deflections)
            .map(|(log, deflections)| {
                let at = |(m, [deflection, rate]): (&Middle<N>, &[f64; 2])| {
                    let displaced = |by: f64| {
                        let mut there = *m;
                        there.q[j] -= by * deflection;
                        there.dq[j] -= by * rate;
                        there.mean_dq[j] -= by * rate;
                        self.parts(&there, links)
                    };
                    let ([pa, ra], [pb, rb]) = (displaced(step), displaced(-step));
                    [pa - pb, ra - rb].map(|x| x / (2.0 * step))
                };
                log.middles.par_iter().zip(deflections).map(at).collect()
            })
            .collect();
        self.weak_parts(&changes)
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

/// Cache of the last torques of transmissions per unit of compliance or gap; a fit needs each torque at several sizes.
#[derive(Debug)]
pub struct Computed<const P: usize>(Mutex<VecDeque<Entry<P>>>);

/// Cache entry: a transmission, the arm's parameters, and the transmission's torque per unit of compliance or gap.
type Entry<const P: usize> = (TransmissionLaw, [f64; P], Arc<Signal>);

/// Number of torque signals of transmissions that the cache holds.
const KEPT: usize = 16;

impl<const P: usize> Default for Computed<P> {
    fn default() -> Self {
        Self(Mutex::new(VecDeque::with_capacity(KEPT)))
    }
}

impl<const P: usize> Computed<P> {
    fn of(&self, law: &TransmissionLaw, theta: &[f64; P], compute: impl FnOnce() -> Signal) -> Arc<Signal> {
        let kept = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((.., signal)) = kept().iter().find(|(l, t, _)| l == law && t == theta) {
            return Arc::clone(signal);
        }
        let signal = Arc::new(compute());
        let mut all = kept();
        if all.len() == KEPT {
            all.pop_front();
        }
        all.push_back((*law, *theta, Arc::clone(&signal)));
        signal
    }
}

/// Replaces the torques that the motor of joint `j` passes on while it is at rest by linear interpolation in time between those before and after: the
/// friction of a motor at rest is unknown, and the shaft's torque is continuous. Where a log begins or ends at rest the nearest torque is held.
fn bridge_rest<const N: usize>(middles: &[Middle<N>], j: usize, torques: &mut [f64]) {
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
        for i in k..end {
            torques[i] = match (before, after) {
                (Some(a), Some(b)) => {
                    let part = (middles[i].t - middles[a].t) / (middles[b].t - middles[a].t);
                    torques[a] + part * (torques[b] - torques[a])
                }
                (Some(one), None) | (None, Some(one)) => torques[one],
                (None, None) => torques[i],
            };
        }
        k = end;
    }
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
        bridge_rest(&middles(&rest), 0, &mut torques);
        let expected = [1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 4.0, 4.0];
        assert!(torques.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{torques:?}");
    }

    #[test]
    fn a_motor_that_never_moves_keeps_its_torques() {
        let mut torques = [1.0, -2.0];
        bridge_rest(&middles(&[true; 2]), 0, &mut torques);
        assert_eq!(torques, [1.0, -2.0]);
    }
}
