//! Joint elasticity and backlash in the weak form: how a deflection between motor and link changes the equation of motion.
//!
//! The deflection between motor and link follows from the torque that the body without an encoder would need to move with the other
//! ([`super::deflection`]). Where the encoder measures the motor, the link's position is the motor's less the deflection; where the encoder measures the
//! link, the motor's position, at which rotor inertia and friction act, is the link's plus the deflection.

use crate::model::hypothesis::EffectInstance;
use crate::numeric::cache::Cache;
use crate::serial::term::deflection::{self, Drive};
use crate::serial::term::{Term, TermKind, TermParameter};
use crate::serial::weak_form::equation::Equation;
use crate::serial::weak_form::intervals::{Intervals, Middle};
use crate::serial::weak_form::rows::Signal;
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
    /// Elastic shaft with a spring and a damper side by side.
    Elastic,
    /// Backlash: half the gap, to the side that the torque pushes to, and a free motion between the flanks.
    Backlash,
}

/// Least and largest damping ratio of an elastic joint's oscillation in predictions: beyond them the estimate is taken as uncertain.
const DAMPING: [f64; 2] = [0.02, 1.0];

/// Natural frequencies of a link on its shaft among the initial guesses of an elastic joint, rad/s: from the softest drives to those whose deflection
/// follows the torque within the test functions, in steps in which neighbours still explain most of each other's deflection.
const SHAFT_FREQUENCIES: [f64; 8] = [8.0, 12.0, 18.0, 27.0, 40.0, 60.0, 120.0, 240.0];

/// Damping ratio of a link on its shaft among the initial guesses of an elastic joint.
const SHAFT_DAMPING: f64 = 0.1;

/// Rotor inertia that is assumed for a motor without one in the arm file, relative to the joint's inertia.
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

    /// Candidate terms of the law at its initial guesses; `scale` is the size of the joint's positions, rad or m, by which gaps are guessed, and
    /// `inertia` the joint's inertia, kg m^2 (kg), by which stiffnesses are.
    pub fn guesses(self, scale: f64, inertia: f64) -> Vec<Term> {
        let term = |p: Vec<f64>| Term::neutral(TermKind::Transmission(self)).with(p);
        match self.compliance {
            Compliance::Elastic => SHAFT_FREQUENCIES
                .iter()
                .map(|frequency| {
                    let compliance = 1.0 / (inertia * frequency * frequency);
                    term(vec![compliance, 2.0 * SHAFT_DAMPING / frequency])
                })
                .collect(),
            Compliance::Backlash => {
                let mut gaps: Vec<f64> = self.effect().spec().initial_guesses.iter().map(|p| p[0]).collect();
                gaps.dedup();
                gaps.into_iter().map(|gap| term(vec![gap * scale])).collect()
            }
        }
    }

    /// Names, units and bounds of the estimated parameters, compliance and retardation time or gap; `rotary` is whether the joint is rotary.
    pub fn parameters(&self, rotary: bool) -> Vec<TermParameter> {
        let of = |name, units: [&'static str; 2], inverse: Option<(&'static str, [&'static str; 2])>| {
            let unit = |units: [&'static str; 2]| if rotary { units[0] } else { units[1] };
            let inverse = inverse.map(|(name, units)| (name, unit(units)));
            TermParameter { name, unit: unit(units), bounds: [0.0, f64::INFINITY], neutral: 0.0, inverse }
        };
        match self.compliance {
            Compliance::Elastic => vec![
                of("compliance", ["rad/(N m)", "m/N"], Some(("stiffness", ["N m/rad", "N/m"]))),
                of("retardation_time", ["s", "s"], None),
            ],
            Compliance::Backlash => vec![of("gap", ["rad", "m"], None)],
        }
    }

    /// Damping, N m s/rad (N s/m), of a transmission with the parameters `p`, and the damping's standard deviation from those of the parameters,
    /// `sigma`; `None` for backlash, or without a compliance.
    pub fn damping(p: &[f64], sigma: &[f64]) -> Option<[f64; 2]> {
        let (compliance, retardation) = (*p.first()?, *p.get(1)?);
        let damping = retardation / compliance;
        let own = sigma.get(1).copied().unwrap_or(0.0) / compliance;
        let scaled = damping * sigma.first().copied().unwrap_or(0.0) / compliance;
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
        if p[0] == 0.0 {
            return vec![None; N];
        }
        let (j, drives) = (law.joint, self.computed.drives.of(&(*law, *theta), || self.drives(law, theta)));
        let along = |drives: &Vec<Drive>| match law.compliance {
            Compliance::Elastic => deflection::of_shaft(drives, p[0], p[1]),
            Compliance::Backlash => deflection::in_gap(drives, p[0]),
        };
        let deflections: Vec<Vec<[f64; 2]>> = drives.iter().map(along).collect();
        if !law.encoder_at_motor {
            return self.of_motor(j, &deflections, theta);
        }
        let derivatives =
            self.computed.derivatives.of(&(j, *theta), || self.link_derivatives(j, &Self::links(theta)));
        self.weak_parts(&Self::behind_motors(&deflections, &derivatives))
    }

    /// What drives the deflection of a transmission along the logs.
    fn drives(&self, law: &TransmissionLaw, theta: &[f64; P]) -> Vec<Vec<Drive>> {
        let j = law.joint;
        let links = Self::links(theta);
        let at = |m: &Middle<N>| {
            let inertia = self.arm.inertia(&links, &SVector::from(m.q))[(j, j)];
            let (torque, inertia) = match (law.encoder_at_motor, law.compliance) {
                (true, _) => (self.link_torque(m, &links)[j], inertia),
                // The link's motion is known, and with it what the shaft passes on.
                (false, Compliance::Elastic) => (self.link_torque(m, &links)[j], 0.0),
                (false, Compliance::Backlash) => {
                    let rotor = theta[10 * N + j];
                    (self.motor_torque(m, j, theta), if rotor > 0.0 { rotor } else { ROTOR_SHARE * inertia })
                }
            };
            Drive { h: m.h, torque, inertia }
        };
        self.logs().iter().map(|log| log.middles.par_iter().map(at).collect()).collect()
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

/// What the last evaluations of transmissions computed along the logs; a fit needs each of these at several values.
#[derive(Debug, Default)]
pub struct Computed<const N: usize, const P: usize> {
    /// What drives the deflection of a transmission, log by log.
    drives: Cache<(TransmissionLaw, [f64; P]), Vec<Vec<Drive>>>,
    /// Derivatives of the links' torques by the position and velocity of a joint.
    derivatives: Cache<(usize, [f64; P]), LinkDerivatives<N>>,
}
