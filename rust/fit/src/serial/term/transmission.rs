//! Joint elasticity and backlash in the weak form: how a deflection between motor and link changes the equation of motion.
//!
//! The deflection between motor and link follows from the torque that a shaft passes on, or in a backlash from the torque that the body without an encoder
//! would need to move with the other ([`super::deflection`]). Where the encoder measures the motor, the link's position is the motor's less the
//! deflection; where the encoder measures the link, the motor's position, at which rotor inertia and friction act, is the link's plus the deflection.

use crate::model::hypothesis::EffectInstance;
use crate::numeric::cache::Cache;
use crate::serial::term::deflection::{self, Forcing};
use crate::serial::term::{Term, TermKind, TermParameter};
use crate::serial::weak_form::equation::Equation;
use crate::serial::weak_form::intervals::{Intervals, Middle};
use crate::serial::weak_form::rows::Signal;
use armgap_core::arm::Arm;
use armgap_core::effect::{Effect, NEVER, find};
use armgap_core::kinematics::JointState;
use armgap_core::transmission::Sides;
use nalgebra::SVector;
use rayon::prelude::*;

/// Displacement of a joint, rad (m), and of its velocity, rad/s (m/s), in numerical derivatives of torques by the deflection of a transmission;
/// torques are smooth functions of both.
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
    /// Whether the joint's friction acts on the motor, where most of a gear's is; else it acts on the link.
    pub friction_at_motor: bool,
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

/// Least and largest damping ratio of the rotor on its shaft in predictions: beyond them the estimate is taken as uncertain.
const DAMPING: [f64; 2] = [0.02, 1.0];

/// Natural frequency of a joint's inertia on its shaft in the initial guesses of an elastic joint, rad/s: the deflection is in proportion to the compliance.
const LINK_FREQUENCY: f64 = 60.0;

/// Retardation times among the initial guesses of an elastic joint, s: steps of four, of which a fit finds those between.
const RETARDATIONS_S: [f64; 4] = [0.0005, 0.002, 0.008, 0.03];

/// Gaps among the initial guesses of backlash, relative to the standard deviation of the joint's positions: a fit finds a gap within a factor of two.
const GAPS: [f64; 7] = [0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16];

/// Time for which motor and link stay together after an impact in a gap, s. The measured accelerations smear the impact over the width of the local cubics,
/// and what they show of the body with the encoder after it would push the other body off the flank again.
const SETTLING_S: f64 = 0.04;

/// Rotor inertia that predictions assume for a motor without one in the arm file, relative to the joint's inertia.
const ROTOR_SHARE: f64 = 0.03;

/// From where the torque that an elastic shaft passes on is taken, for a joint whose encoder measures the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passed {
    /// From the motor: its torque less those of its rotor and friction, which contains what disturbs the motor.
    ByMotor,
    /// From the link: what it needs to move with the motor, as over a stiff shaft.
    Needed,
}

impl TransmissionLaw {
    /// Whether the law's torque is computed from logged torques.
    pub fn depends_on_logged_torques(&self) -> bool {
        self.encoder_at_motor && self.compliance == Compliance::Elastic
    }

    /// Laws of one compliance on a joint, for encoder and friction on either side. Over an elastic shaft the side of the friction hardly matters; a body
    /// in a gap is slowed by its own friction alone.
    pub fn on_all_sides(joint: usize, compliance: Compliance) -> Vec<Self> {
        let friction: &[bool] = if compliance == Compliance::Backlash { &[true, false] } else { &[true] };
        let law = |encoder_at_motor, friction_at_motor| Self {
            joint,
            encoder_at_motor,
            friction_at_motor,
            compliance,
        };
        [true, false].iter().flat_map(|e| friction.iter().map(move |f| law(*e, *f))).collect()
    }

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
    /// `inertia` the joint's inertia with its rotor, kg m^2 (kg), by which stiffnesses are.
    pub fn guesses(self, scale: f64, inertia: f64) -> Vec<Term> {
        let term = |p: Vec<f64>| Term::neutral(TermKind::Transmission(self)).with(p);
        match self.compliance {
            Compliance::Elastic => {
                let compliance = 1.0 / (inertia * LINK_FREQUENCY * LINK_FREQUENCY);
                RETARDATIONS_S.iter().map(|retardation| term(vec![compliance, *retardation])).collect()
            }
            Compliance::Backlash => GAPS.iter().map(|gap| term(vec![gap * scale])).collect(),
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
                TermParameter { neutral: NEVER, ..of("retardation_time", ["s", "s"], None) },
            ],
            Compliance::Backlash => vec![of("gap", ["rad", "m"], None)],
        }
    }

    /// Damping, N m s/rad (N s/m), of a transmission with the parameters `p`, and the damping's standard deviation from those of the parameters,
    /// `sigma`, taken as uncorrelated; `None` for backlash, or without a compliance.
    pub fn damping(p: &[f64], sigma: &[f64]) -> Option<[f64; 2]> {
        let (compliance, retardation) = (*p.first()?, *p.get(1)?);
        let damping = retardation / compliance;
        let own = sigma.get(1).copied().unwrap_or(0.0) / compliance;
        let scaled = damping * sigma.first().copied().unwrap_or(0.0) / compliance;
        damping.is_finite().then(|| [damping, own.hypot(scaled)])
    }

    /// The effect that simulates a transmission with the parameters `p` of [`Self::parameters`], and the part of the arm file's rotor inertia that
    /// the effect takes over; `rotor` is that rotor inertia and `inertia` the joint's inertia, kg m^2 (kg).
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
            Compliance::Backlash => ([size, (rotor_inertia / inertia).clamp(0.005, 0.8), 0.0], 0.0),
        };
        (EffectInstance::new(self.effect(), self.joint, p).with_sides(self.sides()), taken)
    }

    /// Sides of encoder and friction.
    pub(in crate::serial) fn sides(self) -> Sides {
        let Self { encoder_at_motor, friction_at_motor, .. } = self;
        Sides { encoder_at_motor, friction_at_motor, rotor_rides: false }
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
        passed: Passed,
    ) -> Signal {
        let (j, rotor) = (law.joint, theta[10 * N + law.joint]);
        if p[0] == 0.0 || !law.encoder_at_motor && rotor <= 0.0 {
            return vec![None; N];
        }
        let needs = self.computed.needs.of(theta, || self.link_needs(theta));
        let Some(forcings) = self.forcings(law, theta, &needs, passed) else { return vec![None; N] };
        let along = |forcings: &Vec<Forcing>| match law.compliance {
            Compliance::Elastic => deflection::of_shaft(forcings, p[0], p[1]),
            Compliance::Backlash => deflection::in_gap(forcings, p[0], SETTLING_S),
        };
        let deflections: Vec<Vec<[f64; 2]>> = forcings.iter().map(along).collect();
        if !law.encoder_at_motor {
            return self.of_motor(law, &deflections, theta);
        }
        let derivatives =
            self.computed.derivatives.of(&(j, *theta), || self.link_derivatives(j, &Self::links(theta)));
        self.weak_parts(&Self::behind_motors(&deflections, &derivatives))
    }

    /// What the links need along the logs, without rotors and friction: the torques on all joints, N m or N, and the diagonal of the inertia matrix,
    /// kg m^2 or kg.
    fn link_needs(&self, theta: &[f64; P]) -> LinkNeeds<N> {
        let links = Self::links(theta);
        let rigid = self.rigid(&links);
        let at = |m: &Middle<N>| {
            let inertia = self.arm.inertia(&links, &SVector::from(m.q));
            let bias = rigid.equation_terms(&JointState { q: m.q, dq: m.dq }).bias;
            [inertia * SVector::from(m.ddq) + SVector::from(bias), inertia.diagonal()]
        };
        self.logs().iter().map(|log| log.middles.par_iter().map(at).collect()).collect()
    }

    /// What forces the deflection of a transmission along the logs; `None` where a body that crosses a gap has no positive inertia.
    fn forcings(
        &self,
        law: &TransmissionLaw,
        theta: &[f64; P],
        needs: &LinkNeeds<N>,
        passed: Passed,
    ) -> Option<Vec<Vec<Forcing>>> {
        let j = law.joint;
        let rotor = theta[10 * N + j];
        let at = |(m, [torque, inertia]): (&Middle<N>, &[SVector<f64, N>; 2])| {
            let (torque, inertia) = match (law.encoder_at_motor, law.compliance) {
                // A motor at rest has unknown friction.
                (true, Compliance::Elastic) if passed == Passed::ByMotor => {
                    (if m.rest[j] { f64::NAN } else { self.of_the_motor(m, j, theta, true) }, inertia[j])
                }
                (_, Compliance::Elastic) => (torque[j], inertia[j]),
                (true, Compliance::Backlash) if law.friction_at_motor => (torque[j], inertia[j]),
                (true, Compliance::Backlash) => (torque[j] + self.friction(m, j, theta), inertia[j]),
                // A motor at rest has unknown friction: it carries what the link needs.
                (false, Compliance::Backlash) if law.friction_at_motor && m.rest[j] => (torque[j], rotor),
                (false, Compliance::Backlash) => {
                    (self.of_the_motor(m, j, theta, law.friction_at_motor), rotor)
                }
            };
            (law.compliance == Compliance::Elastic || inertia > 0.0).then_some(Forcing {
                h: m.h,
                torque,
                inertia,
            })
        };
        let along = |(log, needs): (&Intervals<N>, &Vec<[SVector<f64, N>; 2]>)| {
            let mut forcings = log.middles.iter().zip(needs).map(at).collect::<Option<Vec<Forcing>>>()?;
            deflection::bridge(&mut forcings);
            Some(forcings)
        };
        self.logs().iter().zip(needs).map(along).collect()
    }

    /// The arm's parameters without rotor inertias and friction.
    fn links(theta: &[f64; P]) -> [f64; P] {
        let mut links = *theta;
        links[10 * N..].fill(0.0);
        links
    }

    /// Torque that the motor of joint `j` has left for the link, N m or N: its torque less those of its rotor and, where friction is `at_motor`, of friction.
    fn of_the_motor(&self, m: &Middle<N>, j: usize, theta: &[f64; P], at_motor: bool) -> f64 {
        let friction = if at_motor { self.friction(m, j, theta) } else { 0.0 };
        m.tau[j] - theta[10 * N + j] * m.ddq[j] - friction
    }

    /// Friction torque of joint `j` at the measured velocity, N m or N.
    fn friction(&self, m: &Middle<N>, j: usize, theta: &[f64; P]) -> f64 {
        self.arm.friction(theta, &SVector::from(m.dq))[j]
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

    /// Change of the torque of rotor inertia and viscous friction at the motor, by joint and row of the weak form, where the encoder measures the link
    /// and the motor leads by the deflection; `deflections` holds deflection and rate by log and sample interval.
    fn of_motor(&self, law: &TransmissionLaw, deflections: &[Vec<[f64; 2]>], theta: &[f64; P]) -> Signal {
        let j = law.joint;
        let rotor = theta[10 * N + j];
        let viscous = if law.friction_at_motor { self.arm.viscous(theta)[j] } else { 0.0 };
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

/// Torques that the links need on all joints, and the diagonal of their inertia matrix, by log and sample interval.
type LinkNeeds<const N: usize> = Vec<Vec<[SVector<f64, N>; 2]>>;

/// What the last evaluations of transmissions computed along the logs; a fit needs each of these at several values.
#[derive(Debug, Default)]
pub struct Computed<const N: usize, const P: usize> {
    /// What the links need along the logs.
    needs: Cache<[f64; P], LinkNeeds<N>>,
    /// Derivatives of the links' torques by the position and velocity of a joint.
    derivatives: Cache<(usize, [f64; P]), LinkDerivatives<N>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::track::Track;
    use crate::serial::weak_form::intervals::HALF_WIDTH_S;
    use armgap_core::chain::{Chain, ChainJoint, JointKind};

    const PERIOD: f64 = 0.002;
    /// Inertia of the link, kg m^2.
    const LINK: f64 = 0.7;
    /// Inertia of the rotor, kg m^2.
    const ROTOR: f64 = 0.3;
    /// Viscous friction of the motor, N m s/rad.
    const VISCOUS: f64 = 0.9;

    /// Positions of motor and link, rad, and the motor's torques, N m, of two bodies about the vertical that `shaft` connects: the torque that it
    /// passes on at a deflection and deflection rate. Small semi-implicit steps.
    fn two_bodies(shaft: impl Fn(f64, f64) -> f64) -> [Vec<f64>; 3] {
        let steps = 200;
        let h = PERIOD / f64::from(steps);
        let (mut at, mut rate) = ([0.0_f64; 2], [0.0_f64; 2]);
        let [mut motor, mut link, mut torques] = [const { Vec::new() }; 3];
        for k in 0..4000 {
            let t = PERIOD * f64::from(k);
            // From rest: a start that jumps would ring for seconds.
            let torque = t.min(1.0) * (4.0 * (3.1 * t).cos() + 2.0 * (7.7 * t).cos());
            motor.push(at[0]);
            link.push(at[1]);
            torques.push(torque);
            for _ in 0..steps {
                let passed = shaft(at[0] - at[1], rate[0] - rate[1]);
                rate[0] += h * (torque - VISCOUS * rate[0] - passed) / ROTOR;
                rate[1] += h * passed / LINK;
                (0..2).for_each(|i| at[i] += h * rate[i]);
            }
        }
        [motor, link, torques]
    }

    /// RMS torque that the rows leave unexplained at the true parameters, N m: without the transmission, and with it at its true values `p`.
    fn left(law: TransmissionLaw, p: &[f64], [motor, link, torques]: &[Vec<f64>; 3]) -> [f64; 2] {
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let kind = JointKind::Revolute;
        let joint = ChainJoint { kind, rotation: identity, translation: [0.0; 3], axis: [0.0, 0.0, 1.0] };
        let mut theta = [0.0; 13];
        (theta[0], theta[9], theta[10], theta[11]) = (1.0, LINK, ROTOR, VISCOUS);
        let t: Vec<f64> = (0..motor.len()).map(|k| PERIOD * k as f64).collect();
        let q = if law.encoder_at_motor { motor } else { link };
        let track = Track::<1>::new("", &t, q, torques, Some([1e-9]));
        let equation = Equation::<1, 13>::new(Chain::new([joint], [0.0; 3]), &theta, &[track], HALF_WIDTH_S);
        let rms = |beside: &Signal| {
            let residual = &equation.rows.residual(&theta, beside)[0];
            assert!(residual.len() > 200);
            (residual.iter().map(|r| r * r).sum::<f64>() / residual.len() as f64).sqrt()
        };
        [rms(&vec![None]), rms(&equation.of_transmission(&law, p, &theta, Passed::ByMotor))]
    }

    #[test]
    fn rows_of_two_bodies_on_a_shaft_are_explained_at_the_true_values() {
        let [stiffness, damping] = [90.0, 0.6];
        let bodies = two_bodies(|deflection, rate| stiffness * deflection + damping * rate);
        for encoder_at_motor in [true, false] {
            let law = TransmissionLaw {
                joint: 0,
                encoder_at_motor,
                friction_at_motor: true,
                compliance: Compliance::Elastic,
            };
            let [rigid, elastic] = left(law, &[1.0 / stiffness, damping / stiffness], &bodies);
            assert!(elastic < 0.05 * rigid, "{encoder_at_motor}: {rigid} {elastic}");
        }
    }

    #[test]
    fn rows_of_two_bodies_with_backlash_are_explained_best_at_the_true_gap() {
        let gap = 0.05;
        // Flanks that are stiff beside all else, and damped so that the bodies do not rebound.
        let bodies = two_bodies(|deflection, rate| {
            let depth = deflection.abs() - 0.5 * gap;
            let push = 2e4 * depth + 250.0 * rate * deflection.signum();
            if depth > 0.0 { push.max(0.0) * deflection.signum() } else { 0.0 }
        });
        for encoder_at_motor in [true, false] {
            let law = TransmissionLaw {
                joint: 0,
                encoder_at_motor,
                friction_at_motor: true,
                compliance: Compliance::Backlash,
            };
            let [rigid, free] = left(law, &[gap], &bodies);
            assert!(free < 0.5 * rigid, "{encoder_at_motor}: {rigid} {free}");
            // Accelerations of local cubics smear the impacts: the best gap is within a quarter of the true one with the encoder at the motor, and a
            // half with it at the link.
            let others = if encoder_at_motor { [0.8, 1.25] } else { [0.67, 1.5] };
            for other in others {
                let [_, off] = left(law, &[other * gap], &bodies);
                assert!(off > free, "{encoder_at_motor}: {other} of the gap leaves {off}, the gap {free}");
            }
        }
    }
}
