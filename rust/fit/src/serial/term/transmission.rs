//! Elastic joints and backlash in the weak form: what a deflection between motor and link changes in the equation of motion.
//!
//! The deflection between motor and link follows from the torque `T` that the transmission passes on: `T / stiffness` of a shaft (Spong 1987, without its
//! damping), and half the gap on the side that `T` pushes to of backlash (Nordin and Gutman 2002). Where the encoder measures the motor, `T` is what
//! rotor and friction leave of the motor's torque, and the links are where the motor is less the deflection; where it measures the link, `T` is the torque
//! of the links, and rotor and friction are where the link is and the deflection more.

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

/// Largest displacement for the derivative by the deflection, rad (m); torques are smooth in it.
const DISPLACEMENT: f64 = 1e-3;

/// A transmission that gives way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransmissionLaw {
    /// 0-based joint.
    pub joint: usize,
    /// Whether the encoder measures the motor; else it measures the link.
    pub encoder_at_motor: bool,
    /// How far it gives way.
    pub compliance: Compliance,
}

/// How far a transmission gives way under a torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Compliance {
    /// In proportion to it.
    Elastic,
    /// By half the gap towards the side it pushes to; the link crosses while the torque is within this one of zero, N m (N).
    Backlash(f64),
}

impl Compliance {
    /// Deflection under a torque, per unit of compliance or of gap.
    fn deflection(self, torque: f64) -> f64 {
        match self {
            Self::Elastic => torque,
            Self::Backlash(crossing) => 0.5 * (torque / crossing).tanh(),
        }
    }
}

/// Damping ratio of a shaft in predictions; motion slower than its oscillation does not tell it.
const DAMPING: f64 = 0.1;

/// A motor without a rotor inertia in the arm file has this part of its joint's, in predictions.
const ROTOR_SHARE: f64 = 0.03;

impl TransmissionLaw {
    /// Its effect in the library.
    fn effect(&self) -> &'static dyn Effect<f64> {
        let name = match self.compliance {
            Compliance::Elastic => "joint_elasticity",
            Compliance::Backlash(_) => "backlash",
        };
        find(name).expect("the library has both")
    }

    /// Name in results.
    pub fn name(&self) -> &'static str {
        self.effect().spec().name
    }

    /// Name for people.
    pub fn title(&self) -> &'static str {
        self.effect().spec().title
    }

    /// What it is estimated by.
    pub fn parameter(&self, rotary: bool) -> TermParameter {
        let (name, unit, inverse) = match (self.compliance, rotary) {
            (Compliance::Elastic, true) => ("compliance", "rad/(N m)", Some(("stiffness", "N m/rad"))),
            (Compliance::Elastic, false) => ("compliance", "m/N", Some(("stiffness", "N/m"))),
            (Compliance::Backlash(_), true) => ("gap", "rad", None),
            (Compliance::Backlash(_), false) => ("gap", "m", None),
        };
        TermParameter { name, unit, bounds: [0.0, f64::INFINITY], neutral: 0.0, inverse }
    }

    /// The effect as the integrator takes it, and the rotor inertia that it takes from the arm's own.
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
    /// The torque of a transmission of this compliance, rad/(N m), or gap, rad: to first order, and so in proportion to either.
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

    /// Per unit of compliance or gap.
    fn of_unit(&self, law: &TransmissionLaw, theta: &[f64; P]) -> Signal {
        let j = law.joint;
        let mut links = *theta;
        links[10 * N..].fill(0.0);
        let deflections: Vec<Vec<[f64; 2]>> = self
            .logs()
            .iter()
            .map(|log| {
                let of = |m: &Middle<N>| {
                    let torque = if law.encoder_at_motor {
                        self.motor_torque(m, j, theta)
                    } else {
                        self.link_torque(m, &links)[j]
                    };
                    law.compliance.deflection(torque)
                };
                with_rates(&log.middles, &log.middles.par_iter().map(of).collect::<Vec<f64>>())
            })
            .collect();
        if law.encoder_at_motor {
            self.behind_motors(j, &deflections, &links)
        } else {
            self.of_motor(j, &deflections, theta)
        }
    }

    /// What a motor passes on along its measured path: its torque less what its rotor and friction take.
    fn motor_torque(&self, m: &Middle<N>, j: usize, theta: &[f64; P]) -> f64 {
        let friction = self.arm.friction(theta, &SVector::from(m.dq))[j];
        m.tau[j] - theta[10 * N + j] * m.ddq[j] - friction
    }

    /// Torque of the links on all joints along their measured path.
    fn link_torque(&self, m: &Middle<N>, links: &[f64; P]) -> SVector<f64, N> {
        let inertia = self.arm.inertia(links, &SVector::from(m.q));
        let bias = self.rigid(links).equation_terms(&JointState { q: m.q, dq: m.dq }).bias;
        inertia * SVector::from(m.ddq) + SVector::from(bias)
    }

    /// Links behind the motor that the encoder measures: to first order in the deflection.
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

    /// Rotor and viscous friction of a motor that is ahead of the link that the encoder measures.
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

/// Torques of transmissions, per unit, that were computed last: a fit asks for the same at several sizes.
#[derive(Debug)]
pub struct Computed<const P: usize>(Mutex<VecDeque<Entry<P>>>);

/// A transmission and the arm's parameters with its torque.
type Entry<const P: usize> = (TransmissionLaw, [f64; P], Arc<Signal>);

/// Torques that are kept.
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

/// Deflections with their rates, from central differences.
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
