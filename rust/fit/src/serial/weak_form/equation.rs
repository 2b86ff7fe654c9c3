//! Weak form of a serial arm's equation of motion along its logs, and the torque of any term of the model along the same motion.

use crate::log::track::Track;
use crate::model::hypothesis::EffectInstance;
use crate::serial::controller::commanded::Commanded;
use crate::serial::predict::turned;
use crate::serial::term::transmission::Computed;
use crate::serial::term::transmission::Passed;
use crate::serial::term::{Term, TermKind, of_load};
use crate::serial::weak_form::intervals::{Intervals, Middle, TestFunction};
use crate::serial::weak_form::rows::{JointRows, Rows, Signal, sum};
use armgap_core::arm::Arm;
use armgap_core::chain::Chain;
use armgap_core::effect::{InputSegment, JointPoint};
use armgap_core::kinematics::{JointState, RigidArm};
use nalgebra::SVector;
use rayon::prelude::*;

/// Length of a block of a log, s: residual torques may be correlated within a block, and are taken as uncorrelated beyond it.
const BLOCK_S: f64 = 1.0;

/// Integral of a test function over the time at rest of a joint, 0 to 1, above which the test function gives no row for the joint.
const MOSTLY_AT_REST: f64 = 0.05;

/// Time step of the numerical derivative of the inertia matrix along the motion, s.
const RATE_STEP: f64 = 1e-5;

/// Approximate number of samples along the logs at which the inertia matrix is evaluated.
const POSES: usize = 200;

/// Weak form of the equation of motion of a serial arm along logs: one row for each joint and each test function during which the joint moves.
pub struct Equation<const N: usize, const P: usize> {
    /// Kinematic chain of the arm.
    pub arm: Chain<f64, N>,
    /// Rows of the regression on the arm's parameters, and on controllers' estimated gains, by joint.
    pub rows: Rows,
    pub(in crate::serial) logs: Vec<Intervals<N>>,
    times: Vec<Vec<f64>>,
    held: Vec<Vec<[InputSegment<f64>; N]>>,
    pub(in crate::serial) functions: Vec<TestFunction>,
    /// Indices, by joint, of the test functions during which the joint moves; each gives one row.
    pub(in crate::serial) kept: Vec<Vec<usize>>,
    /// What elastic joints and backlash computed along the logs at the last parameters.
    pub(in crate::serial) computed: Computed<N, P>,
    /// Position controllers that command the torques in logs with references; `None` for logs with torques.
    pub(in crate::serial) commanded: Option<Commanded<N>>,
}

/// Torques by joint, log and sample interval, N m or N; `None` for joints that a term does not act on.
pub(in crate::serial) type Torques<const N: usize> = [Option<Vec<Vec<f64>>>; N];

impl<const N: usize, const P: usize> Equation<N, P> {
    /// Weak form of the equation of motion along `tracks`, with test functions of `half_width`, s; `theta` are the nominal parameters, SI.
    pub fn new(arm: Chain<f64, N>, theta: &[f64; P], tracks: &[Track<N>], half_width: f64) -> Self {
        let logs: Vec<Intervals<N>> = tracks.iter().map(Intervals::new).collect();
        let functions: Vec<TestFunction> =
            logs.iter().enumerate().flat_map(|(i, log)| log.test_functions(i, half_width)).collect();
        let mut equation = Self {
            arm,
            rows: Rows { joints: Vec::new(), parameters: P, blocks: 0, independent: 1 },
            logs,
            times: tracks.iter().map(|t| t.t.clone()).collect(),
            held: tracks.iter().map(|t| t.held.clone()).collect(),
            functions,
            kept: Vec::new(),
            computed: Computed::default(),
            commanded: None,
        };
        equation.kept = (0..N).map(|j| equation.moving(j)).collect();
        equation.rows = equation.all_rows(theta);
        equation
    }

    /// Indices of the test functions during which joint `j` moves.
    fn moving(&self, j: usize) -> Vec<usize> {
        let still = |phi: &TestFunction| -> f64 {
            let middles = &self.logs[phi.log].middles;
            phi.reach().filter(|k| middles[*k].rest[j]).map(|k| phi.weight(&middles[k])).sum()
        };
        (0..self.functions.len()).filter(|i| still(&self.functions[*i]) <= MOSTLY_AT_REST).collect()
    }

    fn all_rows(&self, theta: &[f64; P]) -> Rows {
        let mut first_block = vec![0];
        for log in &self.logs {
            let duration = log.middles.last().map_or(0.0, |m| m.t + 0.5 * m.h);
            first_block.push(first_block[first_block.len() - 1] + (duration / BLOCK_S) as usize + 1);
        }
        // For every sample interval, per unit of every parameter: the momentum, and the torque without the momentum's derivative.
        let terms: Vec<Vec<[Vec<f64>; 2]>> = self
            .logs
            .iter()
            .map(|log| log.middles.par_iter().map(|m| self.regressors(m)).collect())
            .collect();
        let inertia: Vec<[[f64; N]; N]> = self
            .functions
            .par_iter()
            .map(|phi| {
                let m = &self.logs[phi.log].middles[usize::midpoint(phi.first, phi.last)];
                let inertia = self.arm.inertia(theta, &SVector::from(m.q));
                std::array::from_fn(|j| std::array::from_fn(|k| inertia[(j, k)]))
            })
            .collect();
        let joint = |j: usize| {
            let row = |i: &usize| {
                let phi = &self.functions[*i];
                let log = &self.logs[phi.log];
                let mut psi = vec![0.0; P];
                let mut y = 0.0;
                for k in phi.reach() {
                    let m = &log.middles[k];
                    let (weight, rise) = (phi.weight(m), phi.rise(m));
                    y += weight * m.tau[j];
                    let [momentum, rest] = &terms[phi.log][k];
                    for (i, psi) in psi.iter_mut().enumerate() {
                        *psi += weight * rest[j * P + i] - rise * momentum[j * P + i];
                    }
                }
                (
                    y,
                    psi,
                    first_block[phi.log] + (phi.centre / BLOCK_S) as usize,
                    self.floor(phi, &inertia[*i][j]),
                )
            };
            let found: Vec<_> = self.kept[j].par_iter().map(row).collect();
            let mut rows = JointRows { y: vec![], psi: vec![], block: vec![], floor: vec![] };
            for (y, psi, block, floor) in found {
                rows.y.push(y);
                rows.psi.extend(psi);
                rows.block.push(block);
                rows.floor.push(floor);
            }
            rows
        };
        let joints = (0..N).map(joint).collect();
        let independent = self.functions.iter().map(TestFunction::independent).max().unwrap_or(1);
        Rows { joints, parameters: P, blocks: first_block[self.logs.len()], independent }
    }

    /// Regressors in the middle of a sample interval, by joint and parameter: of the momentum, and of the torque without the momentum's derivative.
    fn regressors(&self, m: &Middle<N>) -> [Vec<f64>; 2] {
        let q = SVector::from(m.q);
        let momentum = self.arm.momentum_regressor(&q, &SVector::from(m.mean_dq));
        let dq = SVector::from(m.dq);
        let rest: nalgebra::SMatrix<f64, N, P> =
            self.arm.potential_regressor(&q, &dq) + self.arm.friction_regressor(&dq);
        [momentum, rest].map(|x| (0..N).flat_map(|j| (0..P).map(move |i| (j, i))).map(|at| x[at]).collect())
    }

    /// Standard deviation, N m or N, of a row due to the noise of the positions in its momentum; `inertia` is the joint's row of the inertia matrix.
    fn floor(&self, phi: &TestFunction, inertia: &[f64; N]) -> f64 {
        let log = &self.logs[phi.log];
        let factors = phi.on_positions(&log.middles, [1.0, 0.0, 0.0]);
        let square: f64 = factors.iter().map(|factor| factor.powi(2)).sum();
        let variance: f64 = (0..N).map(|k| (inertia[k] * log.noise[k]).powi(2)).sum();
        (variance * square).sqrt()
    }

    /// Change, by row, of the regressor's column of joint `j`'s Coulomb coefficient when `sign(dq)` becomes `tanh(dq / width)`, with `width` in rad/s
    /// (m/s).
    pub fn regularised(&self, j: usize, width: f64) -> Vec<f64> {
        let row = |i: &usize| {
            let phi = &self.functions[*i];
            let middles = &self.logs[phi.log].middles;
            let at = |k: usize| {
                let dq = middles[k].dq[j];
                phi.weight(&middles[k]) * ((dq / width).tanh() - sign(dq))
            };
            phi.reach().map(at).sum()
        };
        let mut change: Vec<f64> = self.kept[j].iter().map(row).collect();
        self.centre(j, &mut change);
        change
    }

    /// Regularises the Coulomb friction of every joint over a width by joint, rad/s (m/s); zero leaves the friction dry.
    pub fn regularise(&mut self, widths: &[f64]) {
        for (j, width) in widths.iter().enumerate().filter(|(_, width)| **width > 0.0) {
            let change = self.regularised(j, *width);
            let columns = self.rows.parameters;
            for (psi, change) in self.rows.joints[j].psi.chunks_exact_mut(columns).zip(change) {
                psi[P - N + j] += change;
            }
        }
    }

    /// Torque of a term by joint and row of the weak form, N m or N, on the left-hand side of the equation of motion: added to the torque of the
    /// arm's own parameters.
    pub fn signal(&self, term: &Term, theta: &[f64; P]) -> Signal {
        self.centred(self.signal_with_mean(term, theta))
    }

    /// Torque of an elastic joint with its encoder at the motor on this joint alone, from the torque that the measured motion needs in place of the one that the
    /// motor passes on; `None` for other terms. On other joints their own elasticity is in the way.
    pub fn instrument(&self, term: &Term, theta: &[f64; P]) -> Option<Signal> {
        match &term.kind {
            TermKind::Transmission(law) if law.depends_on_logged_torques() => {
                let mut signal = self.centred(self.of_transmission(law, &term.p, theta, Passed::Needed));
                (0..N).filter(|j| *j != law.joint).for_each(|j| signal[j] = None);
                Some(signal)
            }
            TermKind::Joints(_) => {
                let members: Vec<Signal> =
                    term.members().iter().filter_map(|member| self.instrument(member, theta)).collect();
                (!members.is_empty()).then(|| sum(&self.rows, &members))
            }
            _ => None,
        }
    }

    /// A signal less its mean over each log for joints whose controller has an integral part.
    fn centred(&self, mut signal: Signal) -> Signal {
        for (j, values) in signal.iter_mut().enumerate() {
            if let Some(values) = values {
                self.centre(j, values);
            }
        }
        signal
    }

    /// Torque of a term by joint and row of the weak form, N m or N, like [`Self::signal`], but without subtraction of the mean over each log for
    /// joints whose controller has an integral part.
    pub(in crate::serial) fn signal_with_mean(&self, term: &Term, theta: &[f64; P]) -> Signal {
        match term.kind {
            TermKind::Law(_) => match term.effect() {
                Some(effect) if effect.law.spec().hooks.measured => self.displaced(&effect, theta),
                Some(effect) => self.of_law(&effect, theta),
                None => vec![None; N],
            },
            TermKind::Payload => self.of_link(N - 1, &of_load(&term.p)),
            TermKind::NominalLink(link) => self.of_link(link, &std::array::from_fn(|i| term.p[i])),
            TermKind::BaseTilt(axes) => self.of_tilt(axes, &term.p, theta),
            TermKind::Transmission(law) => self.of_transmission(&law, &term.p, theta, Passed::ByMotor),
            TermKind::Controller(setting) => self.of_controller(setting, term.p[0]),
            TermKind::Row(row) => self.of_row(&row, &term.p),
            TermKind::Table(ref table) => self.of_table(table, &term.p),
            TermKind::Joints(_) => {
                let members = term.members();
                sum(&self.rows, &members.iter().map(|m| self.signal_with_mean(m, theta)).collect::<Vec<_>>())
            }
        }
    }

    /// Torque by joint and row of the weak form, N m or N, due to a `change` of one link's ten inertial parameters.
    fn of_link(&self, link: usize, change: &[f64; 10]) -> Signal {
        let joint = |(j, rows): (usize, &JointRows)| {
            (j <= link).then(|| {
                let along = |psi: &[f64]| psi[10 * link..][..10].iter().zip(change).map(|(a, b)| a * b).sum();
                rows.psi.chunks_exact(self.rows.parameters).map(along).collect()
            })
        };
        self.rows.joints.iter().enumerate().map(joint).collect()
    }

    /// Torques averaged with the test functions as weights, by joint and row of the weak form, N m or N.
    pub(in crate::serial) fn weak(&self, torques: &Torques<N>) -> Signal {
        let joint = |j: usize| {
            torques[j].as_ref().map(|torque| {
                let row = |i: &usize| {
                    let phi = &self.functions[*i];
                    let middles = &self.logs[phi.log].middles;
                    phi.reach().map(|k| phi.weight(&middles[k]) * torque[phi.log][k]).sum()
                };
                self.kept[j].iter().map(row).collect()
            })
        };
        (0..N).map(joint).collect()
    }

    /// Torque by joint and row of the weak form, N m or N, of an effect on one joint that adds a torque, dry friction or inertia, or changes the
    /// commanded torque.
    fn of_law(&self, effect: &EffectInstance, theta: &[f64; P]) -> Signal {
        let (spec, j) = (effect.law.spec(), effect.joint);
        let mut torques: Torques<N> = std::array::from_fn(|_| None);
        if spec.hooks.command {
            let of = |i: usize| {
                let mut column: Vec<InputSegment<f64>> = self.held[i].iter().map(|row| row[j]).collect();
                effect.law.command(&effect.p, &self.times[i], &mut column);
                let middles = &self.logs[i].middles;
                (0..middles.len()).map(|k| middles[k].tau[j] - column[k].mean()).collect()
            };
            torques[j] = Some((0..self.logs.len()).map(of).collect());
            return self.weak(&torques);
        }
        if spec.hooks.force || spec.hooks.coulomb {
            torques[j] = Some(self.logs.iter().map(|log| self.along(log, effect, theta)).collect());
            return self.weak(&torques);
        }
        let inertia = effect.law.inertia(&effect.p);
        if inertia == 0.0 {
            return vec![None; N];
        }
        let mut signal = vec![None; N];
        let row = |i: &usize| {
            let phi = &self.functions[*i];
            let middles = &self.logs[phi.log].middles;
            phi.reach().map(|k| -phi.rise(&middles[k]) * inertia * middles[k].mean_dq[j]).sum()
        };
        signal[j] = Some(self.kept[j].iter().map(row).collect());
        signal
    }

    /// Torque of an effect along a log, sample interval by sample interval, N m or N.
    fn along(&self, log: &Intervals<N>, effect: &EffectInstance, theta: &[f64; P]) -> Vec<f64> {
        let (spec, j) = (effect.law.spec(), effect.joint);
        let viscous = self.arm.viscous(theta)[j];
        let coulomb = self.arm.coulomb(theta)[j];
        let rigid = self.rigid(theta);
        let (mut memory, mut before) = (0.0, None);
        let torque = |m: &Middle<N>| {
            if spec.hooks.memory {
                let travelled = before.map_or(0.0, |q: f64| m.q[j] - q);
                memory = effect.law.hysteresis_after(&effect.p, memory, travelled);
                before = Some(m.q[j]);
            }
            let mut x = JointPoint {
                t: m.t,
                q: m.q[j],
                dq: m.dq[j],
                tau: m.tau[j],
                load: 0.0,
                friction: viscous * m.dq[j].abs() + coulomb,
                other: sign(m.dq[(j + 1) % N]),
                memory,
            };
            let direction = sign(x.dq);
            if spec.hooks.load {
                let equation_terms = rigid.equation_terms(&JointState { q: m.q, dq: m.dq });
                x.load = rigid.loads(&equation_terms, &m.ddq)[j];
            }
            let level = if spec.hooks.coulomb { effect.law.coulomb(&effect.p, &x, direction) } else { 0.0 };
            let force = if spec.hooks.force { effect.law.force(&effect.p, &x) } else { 0.0 };
            level * direction - force
        };
        log.middles.iter().map(torque).collect()
    }

    /// Torque by joint and row of the weak form, N m or N, of an effect that distorts measured positions: the arm's torque along the true positions
    /// minus the torque along the measured positions.
    fn displaced(&self, effect: &EffectInstance, theta: &[f64; P]) -> Signal {
        let j = effect.joint;
        let actual = |reading: f64| {
            let mut q = reading;
            for _ in 0..4 {
                q += reading - effect.law.measured(&effect.p, q);
            }
            q
        };
        let differences: Vec<Vec<[SVector<f64, N>; 2]>> = self
            .logs
            .iter()
            .map(|log| {
                let at = |m: &Middle<N>| {
                    let mut there = *m;
                    let step = 0.5 * m.h * m.mean_dq[j];
                    let (from, to) = (actual(m.q[j] - step), actual(m.q[j] + step));
                    there.q[j] = 0.5 * (from + to);
                    there.mean_dq[j] = (to - from) / m.h;
                    if m.mean_dq[j] != 0.0 {
                        there.dq[j] = m.dq[j] * there.mean_dq[j] / m.mean_dq[j];
                    }
                    let ([pa, ra], [pb, rb]) = (self.parts(&there, theta), self.parts(m, theta));
                    [pa - pb, ra - rb]
                };
                log.middles.par_iter().map(at).collect()
            })
            .collect();
        self.weak_parts(&differences)
    }

    /// Torque by joint and row of the weak form, N m or N, due to changes of the momentum and of the torque without the momentum's derivative, given
    /// by log and sample interval.
    pub(in crate::serial) fn weak_parts(&self, changes: &[Vec<[SVector<f64, N>; 2]>]) -> Signal {
        let averaged = |phi: &TestFunction| -> SVector<f64, N> {
            let log = &self.logs[phi.log];
            let part = |k: usize| {
                let ([momentum, rest], m) = (&changes[phi.log][k], &log.middles[k]);
                rest * phi.weight(m) - momentum * phi.rise(m)
            };
            phi.reach().map(part).sum()
        };
        let averages: Vec<SVector<f64, N>> = self.functions.iter().map(averaged).collect();
        (0..N).map(|j| Some(self.kept[j].iter().map(|i| averages[*i][j]).collect())).collect()
    }

    /// Sample intervals of the logs, log by log.
    pub(in crate::serial) fn logs(&self) -> &[Intervals<N>] {
        &self.logs
    }

    /// Mean diagonal of the inertia matrix along the logs, by joint, kg m^2 or kg.
    pub fn mean_inertia(&self, theta: &[f64; P]) -> Vec<f64> {
        let mut total = [0.0; N];
        let mut count = 0.0;
        for m in self.poses() {
            let inertia = self.arm.inertia(theta, &SVector::from(m.q));
            (0..N).for_each(|j| total[j] += inertia[(j, j)]);
            count += 1.0;
        }
        total.map(|t| t / count).to_vec()
    }

    /// Middles of some 200 sample intervals, evenly spaced along the logs.
    fn poses(&self) -> impl Iterator<Item = &Middle<N>> {
        let stride = (self.logs.iter().map(|log| log.middles.len()).sum::<usize>() / POSES).max(1);
        self.logs.iter().flat_map(move |log| log.middles.iter().step_by(stride))
    }

    /// Smallest eigenvalue of the inertia matrix scaled to unit diagonal, at the pose along the logs where it is smallest; -1 where a diagonal entry
    /// is not positive.
    pub fn conditioning(&self, theta: &[f64; P]) -> f64 {
        let smallest = |m: &Middle<N>| {
            let inertia = self.arm.inertia(theta, &SVector::from(m.q));
            let scale = SVector::<f64, N>::from_fn(|j, _| 1.0 / inertia[(j, j)].max(0.0).sqrt());
            if scale.iter().any(|s| !s.is_finite()) {
                return -1.0;
            }
            let scaled = nalgebra::DMatrix::from_fn(N, N, |i, j| scale[i] * inertia[(i, j)] * scale[j]);
            scaled.symmetric_eigenvalues().min()
        };
        self.poses().map(smallest).fold(1.0, f64::min)
    }

    /// Momentum `M dq`, and the torque without the momentum's derivative, `C dq + g - dM/dt dq` plus friction, N m s (N s) and N m (N), in the middle
    /// of a sample interval.
    pub(in crate::serial) fn parts(&self, m: &Middle<N>, theta: &[f64; P]) -> [SVector<f64, N>; 2] {
        let (q, dq) = (SVector::from(m.q), SVector::from(m.dq));
        let momentum = self.arm.inertia(theta, &q) * SVector::from(m.mean_dq);
        let ahead = self.arm.inertia(theta, &(q + dq * RATE_STEP)) * dq;
        let behind = self.arm.inertia(theta, &(q - dq * RATE_STEP)) * dq;
        let bias = SVector::from(self.rigid(theta).equation_terms(&JointState { q: m.q, dq: m.dq }).bias);
        let friction = self.arm.friction(theta, &dq);
        [momentum, bias - (ahead - behind) / (2.0 * RATE_STEP) + friction]
    }

    pub(in crate::serial) fn rigid(&self, theta: &[f64; P]) -> RigidArm<f64, Chain<f64, N>, N, P> {
        RigidArm {
            arm: self.arm,
            theta: *theta,
            viscous: [0.0; N],
            coulomb: [0.0; N],
            constant_inertia: self.arm.constant_inertia(theta),
            tilt: 0.0,
        }
    }

    /// Torque by joint and row of the weak form, N m or N, due to a tilt of the base by `p`, rad, about two axes of the base frame.
    fn of_tilt(&self, axes: [usize; 2], p: &[f64], theta: &[f64; P]) -> Signal {
        let theta = SVector::from(*theta);
        if p[0] == 0.0 && p[1] == 0.0 {
            return vec![None; N];
        }
        let there = turned(&self.arm, axes, [p[0], p[1]]);
        let zero = SVector::zeros();
        let torques: Vec<Vec<SVector<f64, N>>> = self
            .logs
            .iter()
            .map(|log| {
                let at = |m: &Middle<N>| {
                    let q = SVector::from(m.q);
                    let of = |arm: &Chain<f64, N>| -> SVector<f64, N> {
                        let y: nalgebra::SMatrix<f64, N, P> = arm.potential_regressor(&q, &zero);
                        y * theta
                    };
                    of(&there) - of(&self.arm)
                };
                log.middles.par_iter().map(at).collect()
            })
            .collect();
        let by_joint: Torques<N> = std::array::from_fn(|j| {
            Some(torques.iter().map(|log| log.iter().map(|tau| tau[j]).collect()).collect())
        });
        self.weak(&by_joint)
    }
}

fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}
