//! Diagnosis of serial arms of one to seven joints.
//!
//! A serial arm has dozens of parameters and hundreds of candidate effects. Its torques are mostly those of a controller or of measured currents, and
//! so are not an input that is independent of the model's errors. Missing terms are therefore sought by regression in the weak form of the equation
//! of motion along the measured path, where all parameters and most terms are linear and no simulation is needed; predictions over short windows only
//! say how far the gap shrinks. The data go through `weak_form` (intervals of a log, torques of terms, rows of the regression) -> `search` (which
//! terms) -> `predict` (gap) -> `result`.

mod constants;
pub mod controller;
mod predict;
mod pushes;
mod result;
mod search;
mod term;
mod weak_form;

use crate::candidates::screen::effect_instances;
use crate::likelihood::scale::Scales;
use crate::locate::table_form::TableForm;
use crate::log::input::{DiagnoseError, FEWEST_WINDOWS, LogData, Options, validate};
use crate::log::track::{Reference, Track};
use crate::model::chain::ChainDescription;
use crate::model::hypothesis::EffectInstance;
use crate::predict::window::Dataset;
use crate::progress::{Observer, ProgressReporter, guarded};
use crate::result::report::Diagnosis;
use armgap_core::chain::{Chain, ChainJoint, JointKind, PARAMETERS_PER_JOINT};
use armgap_core::effect::{Quantity, Scope, Trial, dead_zone_with_jump};
use controller::{PositionController, commanded};
use predict::horizontal_axes;
use pushes::Event;
use search::{Found, Motion, Search};
use std::time::Instant;
use term::controller_term::{ControllerTerm, Setting};
use term::table::Table;
use term::transmission::{Compliance, TransmissionLaw};
use term::{Term, TermKind, row_term};
use weak_form::equation::Equation;
use weak_form::intervals::HALF_WIDTH_S;
use weak_form::regularisation;
use weak_form::rows::{Prior, Rows, Signal};

/// A serial arm as an arm file describes it.
#[derive(Debug, Clone)]
pub struct SerialArm {
    /// Kinematic chain of the arm: one to seven joints, and gravity.
    pub chain: ChainDescription,
    /// Parameters of the arm, SI, 13 per joint: ten inertial parameters of each link, link by link, then rotor inertias, viscous and Coulomb
    /// coefficients of all joints.
    pub theta: Vec<f64>,
    /// Standard deviations of the arm's parameters, SI, in the order of the parameters; zero for a value that is not estimated.
    pub sigma: Vec<f64>,
    /// Encoder step of each joint, rad or m; `None` where the steps are unknown.
    pub steps: Option<Vec<f64>>,
    /// Whether the encoder of each joint is on the motor's side of its transmission; `None` where that is unknown.
    pub encoder_at_motor: Option<Vec<Option<bool>>>,
    /// Whether the friction of each joint is on the motor's side of its transmission; `None` where that is unknown.
    pub friction_at_motor: Option<Vec<Option<bool>>>,
    /// Position controllers of the arm's joints, needed for logs that hold references in place of torques; `None` where the arm file has none.
    pub controller: Option<PositionController>,
}

impl SerialArm {
    /// Whether each joint is revolute (rad, N m); else it is prismatic (m, N).
    pub fn rotary(&self) -> Vec<bool> {
        self.chain.joints.iter().map(|j| j.kind == JointKind::Revolute).collect()
    }
}

/// Arguments of [`diagnose`] for a serial arm.
struct Request<'a> {
    arm: &'a SerialArm,
    training: &'a [LogData<'a>],
    holdout: &'a [LogData<'a>],
    options: &'a Options,
    observer: &'a Observer,
}

/// Diagnoses the gap between a serial arm's model and its `training` and `holdout` logs; `observer` receives the progress and may cancel.
///
/// # Errors
///
/// Logs or options that a diagnosis cannot work with, and [`DiagnoseError::Stopped`] where `observer` cancels.
pub fn diagnose(
    arm: &SerialArm,
    training: &[LogData<'_>],
    holdout: &[LogData<'_>],
    options: &Options,
    observer: &Observer,
) -> Result<Diagnosis, DiagnoseError> {
    validate(arm.chain.joints.len(), training, holdout, options)?;
    let request = Request { arm, training, holdout, options, observer };
    guarded(|| by_size(&request)).ok_or(DiagnoseError::Stopped)?
}

/// Runs the diagnosis of a serial arm with the number of joints known at compile time.
fn by_size(request: &Request<'_>) -> Result<Diagnosis, DiagnoseError> {
    match request.arm.chain.joints.len() {
        1 => request.run::<1, 13>(),
        2 => request.run::<2, 26>(),
        3 => request.run::<3, 39>(),
        4 => request.run::<4, 52>(),
        5 => request.run::<5, 65>(),
        6 => request.run::<6, 78>(),
        7 => request.run::<7, 91>(),
        _ => Err(DiagnoseError::Joints(request.arm.chain.joints.len())),
    }
}

impl<const N: usize, const P: usize> Motion for Equation<N, P> {
    fn rows(&self) -> &Rows {
        &self.rows
    }

    fn signal(&self, term: &Term, theta: &[f64]) -> Signal {
        let theta = std::array::from_fn(|i| theta[i]);
        Equation::signal(self, term, &theta)
    }

    fn instrument(&self, term: &Term, theta: &[f64]) -> Option<Signal> {
        Equation::instrument(self, term, &std::array::from_fn(|i| theta[i]))
    }

    fn table_variable(&self, form: TableForm) -> Vec<[f64; 2]> {
        Self::table_variable(self, form)
    }

    fn columns_of_table(&self, table: &Table) -> Vec<Signal> {
        Self::columns_of_table(self, table)
    }

    fn inertia(&self, theta: &[f64]) -> Vec<f64> {
        self.mean_inertia(&std::array::from_fn(|i| theta[i]))
    }
}

/// Weak equation of motion and prediction windows of the training logs, or of the holdout.
pub(crate) struct Set<const N: usize, const P: usize> {
    pub(crate) equation: Equation<N, P>,
    pub(crate) data: Dataset<N>,
}

impl Request<'_> {
    fn run<const N: usize, const P: usize>(&self) -> Result<Diagnosis, DiagnoseError> {
        let started = Instant::now();
        let sizes = |found: usize| DiagnoseError::Sizes { found, needed: P };
        let joints: [ChainJoint<f64>; N] = self
            .arm
            .chain
            .joints
            .clone()
            .try_into()
            .map_err(|_| DiagnoseError::Joints(self.arm.chain.joints.len()))?;
        let theta: [f64; P] = self.arm.theta.clone().try_into().map_err(|_| sizes(self.arm.theta.len()))?;
        if self.arm.sigma.len() != P || P != PARAMETERS_PER_JOINT * N {
            return Err(sizes(self.arm.sigma.len()));
        }
        let arm = Chain::new(joints, self.arm.chain.gravity);
        let progress = ProgressReporter::new(Observer::clone(self.observer));
        let mut training = self.set::<N, P>("training", self.training, &arm, &theta)?;
        let mut holdout = self.set::<N, P>("holdout", self.holdout, &arm, &theta)?;
        let controller = training.equation.commanded.as_ref().map(|commanded| commanded.controller.clone());
        let prior = self.prior(&theta, controller.as_ref());
        let widths = {
            let equation = &training.equation;
            regularisation::widths(&equation.rows, &prior, P - N, |j, width| equation.regularised(j, width))
        };
        training.equation.regularise(&widths);
        holdout.equation.regularise(&widths);
        let mut candidates = candidates(&arm, &theta, &training.data.tracks, self.options.known_units);
        let of = |sides: &Option<Vec<Option<bool>>>, j: usize| sides.as_ref().and_then(|sides| sides[j]);
        let is_possible = |term: &Term| {
            let TermKind::Transmission(law) = &term.kind else { return true };
            let encoder = of(&self.arm.encoder_at_motor, law.joint);
            let friction =
                of(&self.arm.friction_at_motor, law.joint).filter(|_| law.compliance == Compliance::Backlash);
            encoder.is_none_or(|side| side == law.encoder_at_motor)
                && friction.is_none_or(|side| side == law.friction_at_motor)
        };
        for group in &mut candidates {
            group.retain(is_possible);
        }
        if self.options.half_width.is_some() {
            candidates.retain(|group| !constants::ROUNDED_BY_LOW_PASS.contains(&group[0].name()));
        }
        if let Some(controller) = &controller {
            // What a controller commanded before the log is unknown, and with it which flank a motor begins on.
            for group in &mut candidates {
                group.retain(|term| !term.is_backlash_of_link_encoder());
            }
            let inertia = training.equation.mean_inertia(&theta);
            let period = training.data.tracks.first().map_or(0.0, Track::period);
            candidates.extend(controller_settings(controller, &inertia, period));
        }
        let mut found = self.searched(&training, &holdout, &prior, &candidates, &progress);
        let mut events: Vec<Event> = Vec::new();
        for _ in 0..PUSH_ROUNDS {
            if controller.is_some() || self.options.max_causes == 0 {
                break;
            }
            let mut new = pushed(&training, &holdout, &found);
            // Next to a push stays what a raised cosine does not give of it.
            new.retain(|event| !events.iter().any(|known| known.overlaps(event)));
            if new.is_empty() {
                break;
            }
            let logs = training.data.tracks.len();
            let of = |held: bool| new.iter().filter(move |event| (event.log >= logs) == held);
            training.equation.leave_out(&of(false).collect::<Vec<&Event>>());
            let of_holdout = of(true).map(|event| Event { log: event.log - logs, ..event.clone() });
            holdout.equation.leave_out(&of_holdout.collect::<Vec<Event>>().iter().collect::<Vec<&Event>>());
            found = self.searched(&training, &holdout, &prior, &candidates, &progress);
            events.extend(new);
        }
        add_pushes(&mut training, &mut holdout, &mut events);
        let mut diagnosis = result::assemble(
            self.arm,
            &arm,
            &training,
            &holdout,
            &found,
            (self.options, &widths, &events),
            &progress,
        );
        diagnosis.seconds = started.elapsed().as_secs_f64();
        Ok(diagnosis)
    }

    /// Result of the model search on the logs.
    fn searched<const N: usize, const P: usize>(
        &self,
        training: &Set<N, P>,
        holdout: &Set<N, P>,
        prior: &Prior,
        candidates: &[Vec<Term>],
        progress: &ProgressReporter,
    ) -> Found {
        let nominal = &self.arm.theta;
        let is_feasible = |values: &[f64], apart: &[usize]| {
            // A motor with a position of its own leaves the links without its inertia.
            let conditioning = |values: &[f64]| {
                let is_apart = |i: usize| i >= 10 * N && apart.contains(&(i - 10 * N));
                let links = std::array::from_fn(|i| if is_apart(i) { 0.0 } else { values[i] });
                training.equation.conditioning(&links)
            };
            conditioning(values) > constants::CONDITIONED * conditioning(nominal).max(0.0)
        };
        let search = Search {
            training: &training.equation,
            holdout: &holdout.equation,
            prior,
            candidates: candidates.to_vec(),
            rotary: self.arm.rotary(),
            steps: training.data.tracks.first().map_or_else(Vec::new, |track| track.step.to_vec()),
            period: training.data.tracks.first().map_or(0.0, Track::period),
            is_feasible: &is_feasible,
            progress,
        };
        search.run(self.options.max_causes, self.options.seed)
    }

    /// Prior of the regression: the arm's parameters, then the controllers' estimated gains as differences from the arm file's gains, zero a priori.
    fn prior<const P: usize>(&self, theta: &[f64; P], controller: Option<&PositionController>) -> Prior {
        let gains: Vec<f64> = controller.map_or_else(Vec::new, |controller| {
            controller.estimated().into_iter().map(|(gain, j)| controller.sigma[gain][j]).collect()
        });
        let joints = self.arm.chain.joints.len();
        Prior {
            theta: theta.iter().copied().chain(gains.iter().map(|_| 0.0)).collect(),
            sigma: self.arm.sigma.iter().chain(&gains).copied().collect(),
            positive: (0..P + gains.len()).map(|i| (10 * joints..P).contains(&i)).collect(),
        }
    }

    fn set<const N: usize, const P: usize>(
        &self,
        set: &'static str,
        logs: &[LogData<'_>],
        arm: &Chain<f64, N>,
        theta: &[f64; P],
    ) -> Result<Set<N, P>, DiagnoseError> {
        let steps = self.arm.steps.as_ref().map(|steps| std::array::from_fn(|j| steps[j]));
        let track = |log: &LogData<'_>| -> Result<Track<N>, DiagnoseError> {
            let mut track = Track::new(&log.name, log.t, log.q, log.tau, steps).with_moments(log.moment);
            let Some((q, dq)) = log.reference else { return Ok(track) };
            let rows = |x: &[f64]| -> Vec<[f64; N]> { x.as_chunks().0.to_vec() };
            track.reference = Some(Reference { q: rows(q), dq: dq.map(rows) });
            let made = self.arm.controller.as_ref().and_then(|c| commanded::torques(c, &track));
            track.held = made.ok_or_else(|| DiagnoseError::NoTorque(log.name.clone()))?;
            Ok(track)
        };
        let tracks: Vec<Track<N>> = logs.iter().map(track).collect::<Result<_, _>>()?;
        let mut equation =
            Equation::new(*arm, theta, &tracks, self.options.half_width.unwrap_or(HALF_WIDTH_S));
        if let Some(controller) = &self.arm.controller {
            equation = equation.behind(controller, &tracks);
        }
        let data = Dataset::new(tracks, self.options.horizon);
        if data.windows.len() < FEWEST_WINDOWS {
            return Err(DiagnoseError::TooShort { set, windows: data.windows.len(), needed: FEWEST_WINDOWS });
        }
        Ok(Set { equation, data })
    }
}

/// Largest number of times that pushes are looked for, each time beside those found before: with them in the logs a first model may be wrong.
const PUSH_ROUNDS: usize = 2;

/// Pushes in what the reported model leaves of the torques of all logs; logs of the holdout count on from those of the training logs.
fn pushed<const N: usize, const P: usize>(
    training: &Set<N, P>,
    holdout: &Set<N, P>,
    found: &Found,
) -> Vec<Event> {
    let model = &found.reported;
    let mut logs = pushes::residuals(&training.equation, &model.estimate.residual);
    logs.extend(pushes::residuals(&holdout.equation, &model.held));
    pushes::pushes(&logs, &model.estimate.theta[P - N..P])
}

/// Adds the pushes of events to the logs, for predictions; times become those of the logs.
fn add_pushes<const N: usize, const P: usize>(
    training: &mut Set<N, P>,
    holdout: &mut Set<N, P>,
    events: &mut [Event],
) {
    let tracks = training.data.tracks.iter_mut().chain(&mut holdout.data.tracks);
    for (log, track) in tracks.enumerate() {
        let begin = track.t.first().copied().unwrap_or(0.0);
        for event in events.iter_mut().filter(|event| event.log == log) {
            event.time += begin;
            track.pushes.extend(event.pushes().into_iter().map(|(push, _)| push));
        }
    }
}

/// Candidate terms for controller settings that differ from the arm file's, at their initial guesses, grouped by setting and joint; `inertia` is each
/// joint's mean inertia, kg m^2 or kg, and `period` the logs' sample period, s.
fn controller_settings(controller: &PositionController, inertia: &[f64], period: f64) -> Vec<Vec<Term>> {
    let group = |setting: Setting, joint: usize| {
        let guesses = setting.guesses(&controller.joints[joint], inertia[joint], period);
        let kind = TermKind::Controller(ControllerTerm { setting, joint });
        guesses.into_iter().map(|value| Term { kind: kind.clone(), p: vec![value], degrees: 1.0 }).collect()
    };
    let all = Setting::ALL.into_iter().flat_map(|s| (0..controller.joints.len()).map(move |j| (s, j)));
    all.map(|(setting, joint)| group(setting, joint)).collect()
}

/// Largest number of half cycles over the travel of a joint among the initial guesses of a torque ripple.
const HALF_CYCLES: usize = 80;

/// Quantiles of the size of a joint's command that are tried as levels at which the torque of a dead zone jumps.
const LEVELS: usize = 20;

/// Levels, N m or N, that are tried for a dead zone of a joint whose torque jumps there: quantiles of the size of the command.
fn command_levels<const N: usize>(tracks: &[Track<N>], joint: usize) -> Vec<f64> {
    let mut sizes: Vec<f64> =
        tracks.iter().flat_map(|track| &track.held).map(|h| h[joint].mean().abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.retain(|size| *size > 0.0);
    let place = |i: usize| (i as f64 / LEVELS as f64 * sizes.len() as f64) as usize;
    let mut levels: Vec<f64> = (1..LEVELS).filter_map(|i| sizes.get(place(i))).copied().collect();
    levels.dedup();
    levels
}

/// Every candidate term besides settings of controllers, at each of its initial guesses, grouped by effect and joint. Left out are effects of the
/// library that simulate a motor as a body separate from its link (the weak form has terms of its own for transmissions), external disturbances, and
/// effects on the whole arm, which are stated for arms in a plane.
fn candidates<const N: usize, const P: usize>(
    arm: &Chain<f64, N>,
    theta: &[f64; P],
    tracks: &[Track<N>],
    known_units: bool,
) -> Vec<Vec<Term>> {
    let gravity = arm.gravity_vector().iter().map(|g| g * g).sum::<f64>().sqrt();
    let scales = Scales::new(arm, theta, tracks, gravity, None);
    let sides = std::array::from_fn(|_| Vec::new());
    let mut groups: Vec<Vec<Term>> = Vec::new();
    for effect in effect_instances(&scales, &sides, true) {
        let spec = effect.law.spec();
        // Arms in space tell rotors from links: the load is the torque that the transmission passes on.
        if effect.law.form() == Some("torque")
            || spec.scope == Scope::Arm
            || spec.trial == Trial::Disturbance
            || effect.law.has_transmission()
        {
            continue;
        }
        // Sine and cosine of a ripple are tested together, for as many cycles over the travel as the test functions let through.
        if effect.is_periodic() {
            if !groups.iter().any(|group| group[0].same_place(&Term::of_law(effect))) {
                let cycles = scales.size(Quantity::Cycles, effect.joint);
                let guess =
                    |half: usize| EffectInstance { p: [1.0, 0.5 * half as f64 * cycles, 0.0], ..effect };
                groups.push((1..=HALF_CYCLES).map(|half| Term::of_law(guess(half))).collect());
            }
            continue;
        }
        let term = Term::of_law(effect);
        if !known_units && term.is_gain() {
            continue;
        }
        let jumps = EffectInstance::new(dead_zone_with_jump(), effect.joint, effect.p);
        match groups.iter_mut().find(|group| group[0].same_place(&term)) {
            // A law that is linear in all of its parameters is tested at all of their values.
            Some(group)
                if term.amplitudes() == term.p.len() && group.iter().any(|t| t.title() == term.title()) => {}
            Some(group) => group.push(term),
            None if effect.same_place(&jumps) => {
                let levels = command_levels(tracks, effect.joint);
                let guess = |level: f64| Term::of_law(EffectInstance { p: [level, 1.0, 0.0], ..jumps });
                groups.push(std::iter::once(term).chain(levels.into_iter().map(guess)).collect());
            }
            None => groups.push(vec![term]),
        }
    }
    for joint in 0..N {
        for compliance in [Compliance::Elastic, Compliance::Backlash] {
            let laws = TransmissionLaw::on_all_sides(joint, compliance);
            groups.push(
                laws.iter()
                    .flat_map(|law| {
                        law.guesses(scales.size(Quantity::Position, joint), scales.inertia[joint])
                    })
                    .collect(),
            );
        }
    }
    groups.extend(row_term::candidates(&arm.joints().iter().map(|joint| joint.kind).collect::<Vec<_>>()));
    if gravity > 0.0 {
        groups.push(vec![Term::neutral(TermKind::BaseTilt(horizontal_axes(arm.gravity_vector())))]);
    }
    if known_units {
        groups.push(vec![Term::neutral(TermKind::Payload)]);
        groups.extend((0..N).map(|link| vec![Term::neutral(TermKind::NominalLink(link))]));
    }
    groups
}
