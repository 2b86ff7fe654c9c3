//! Weak form of the equation of motion for an arm behind position controllers: their torque along the measured path, the change of this torque by
//! changed controller settings, and estimated gains as further parameters of the regression.
//!
//! With `tau = kp e + kd de + ki int e dt` and gains that exceed the arm file's by `d`, `tau(nominal) = psi theta - d e`: the regressor has one more
//! column for each estimated gain. The integral of the error up to the start of the log is unknown and makes a constant torque, which no log
//! distinguishes from a torque offset. So rows of a joint with an integral part are taken less their mean over each log.

use crate::log::track::Track;
use crate::serial::controller::{Given, JointController, PositionController};
use crate::serial::term::Term;
use crate::serial::term::controller_term::ControllerTerm;
use crate::serial::weak_form::equation::{Equation, Torques};
use crate::serial::weak_form::rows::{Signal, sum};
use armgap_core::effect::InputSegment;

/// Position controllers and their inputs along logs.
#[derive(Debug, Clone)]
pub struct Commanded<const N: usize> {
    /// Position controllers by joint.
    pub controller: PositionController,
    /// Reference and measured path of each joint's controller, log by log.
    pub given: Vec<[Given; N]>,
    /// Means of torque and regressor over the rows of each log, by log and joint; `None` for joints without an integral part.
    levels: Vec<Vec<Option<Level>>>,
}

/// Means of torque and regressor over the rows of one joint in one log.
type Level = (f64, Vec<f64>);

/// Torques of the controllers along a log's measured path, N m or N, by sample interval and joint; `None` for a log without a reference.
pub fn torques<const N: usize>(
    controller: &PositionController,
    track: &Track<N>,
) -> Option<Vec<[InputSegment<f64>; N]>> {
    let columns: Vec<Vec<InputSegment<f64>>> =
        (0..N).map(|j| Some(controller.joints[j].torque(&Given::new(track, j)?))).collect::<Option<_>>()?;
    Some((0..track.len()).map(|k| std::array::from_fn(|j| columns[j][k])).collect())
}

/// Reference and measured path of each joint's controller along a log; `None` for a log without a reference.
pub fn given<const N: usize>(track: &Track<N>) -> Option<[Given; N]> {
    (0..N).map(|j| Given::new(track, j)).collect::<Option<Vec<_>>>()?.try_into().ok()
}

impl<const N: usize, const P: usize> Equation<N, P> {
    /// The equation with its torques from `controller` and estimated gains as further parameters; unchanged if any log is without a reference.
    pub fn behind(mut self, controller: &PositionController, tracks: &[Track<N>]) -> Self {
        let Some(given) = tracks.iter().map(given).collect::<Option<Vec<_>>>() else { return self };
        self.commanded = Some(Commanded { controller: controller.clone(), given, levels: Vec::new() });
        self.append_gains();
        for j in 0..N {
            self.floor_behind(j, &controller.joints[j]);
        }
        self.leave_out_means();
        self
    }

    /// Adds one column to the regressor for every estimated gain of the controllers.
    fn append_gains(&mut self) {
        let Some(commanded) = &self.commanded else { return };
        let columns: Vec<Signal> = commanded
            .controller
            .estimated()
            .into_iter()
            .map(|(gain, j)| {
                let along = |given: &[Given; N]| {
                    let derivative = commanded.controller.joints[j].derivative(&given[j], gain);
                    derivative.into_iter().map(|e| -e).collect()
                };
                let mut torques: Torques<N> = std::array::from_fn(|_| None);
                torques[j] = Some(commanded.given.iter().map(along).collect());
                self.weak(&torques)
            })
            .collect();
        let before = self.rows.parameters;
        for (j, rows) in self.rows.joints.iter_mut().enumerate() {
            let mut psi = Vec::with_capacity(rows.y.len() * (before + columns.len()));
            for (i, row) in rows.psi.chunks_exact(before).enumerate() {
                psi.extend(row);
                psi.extend(columns.iter().map(|column| column[j].as_ref().map_or(0.0, |c| c[i])));
            }
            rows.psi = psi;
        }
        self.rows.parameters += columns.len();
    }

    /// Raises the noise floor of joint `j`'s rows, N m or N, to the standard deviation that position noise causes through inertia, `kp` and `kd`
    /// together.
    fn floor_behind(&mut self, j: usize, controller: &JointController) {
        let [kp, kd, _] = controller.gains;
        for (row, i) in self.kept[j].iter().enumerate() {
            let phi = &self.functions[*i];
            let log = &self.logs[phi.log];
            let square = |parts: [f64; 3]| -> f64 {
                phi.on_positions(&log.middles, parts).iter().map(|factor| factor.powi(2)).sum()
            };
            let momentum = square([1.0, 0.0, 0.0]);
            let floor = &mut self.rows.joints[j].floor[row];
            // Inertia that explains the floor so far, mostly the joint's own; its sign relative to the controller's gains matters little.
            let inertia = *floor / (log.noise[j] * momentum.sqrt()).max(f64::MIN_POSITIVE);
            *floor = floor.max(log.noise[j] * square([inertia, kp, kd]).sqrt());
        }
    }

    /// Subtracts the mean over each log from the rows of joints with an integral part, and stores the means.
    fn leave_out_means(&mut self) {
        let columns = self.rows.parameters;
        let mut levels = vec![vec![None; N]; self.logs.len()];
        for j in 0..N {
            if !self.integrates(j) {
                continue;
            }
            for (log, rows) in self.rows_by_log(j).into_iter().enumerate() {
                let count = rows.len().max(1) as f64;
                let joint = &mut self.rows.joints[j];
                let mean = rows.iter().map(|i| joint.y[*i]).sum::<f64>() / count;
                let psi: Vec<f64> = (0..columns)
                    .map(|c| rows.iter().map(|i| joint.psi[i * columns + c]).sum::<f64>() / count)
                    .collect();
                for i in rows {
                    joint.y[i] -= mean;
                    for (value, mean) in joint.psi[i * columns..][..columns].iter_mut().zip(&psi) {
                        *value -= mean;
                    }
                }
                levels[log][j] = Some((mean, psi));
            }
        }
        if let Some(commanded) = &mut self.commanded {
            commanded.levels = levels;
        }
    }

    fn integrates(&self, j: usize) -> bool {
        self.commanded.as_ref().is_some_and(|commanded| commanded.controller.integrates(j))
    }

    /// Indices of the rows of joint `j`, log by log.
    fn rows_by_log(&self, j: usize) -> Vec<Vec<usize>> {
        let mut by_log = vec![Vec::new(); self.logs.len()];
        for (row, i) in self.kept[j].iter().enumerate() {
            by_log[self.functions[*i].log].push(row);
        }
        by_log
    }

    /// Subtracts the mean over each log from `values`, one for each row of joint `j`; nothing for a joint without an integral part.
    pub(in crate::serial) fn centre(&self, j: usize, values: &mut [f64]) {
        if !self.integrates(j) {
            return;
        }
        for rows in self.rows_by_log(j) {
            let mean = rows.iter().map(|i| values[*i]).sum::<f64>() / rows.len().max(1) as f64;
            for i in rows {
                values[i] -= mean;
            }
        }
    }

    /// Torque of a controller with the arm file's settings minus its torque with one setting changed by `value`, N m or N, by joint and row of the
    /// weak form; see [`ControllerTerm::on`].
    pub(in crate::serial) fn of_controller(&self, term: ControllerTerm, value: f64) -> Signal {
        let Some(commanded) = &self.commanded else { return vec![None; N] };
        let j = term.joint;
        let changed = term.on(&commanded.controller.joints[j], value);
        let along = |(log, given): (usize, &[Given; N])| {
            let torque = changed.torque(&given[j]);
            let middles = &self.logs[log].middles;
            middles.iter().zip(&torque).map(|(m, torque)| m.tau[j] - torque.mean()).collect()
        };
        let mut torques: Torques<N> = std::array::from_fn(|_| None);
        torques[j] = Some(commanded.given.iter().enumerate().map(along).collect());
        self.weak(&torques)
    }

    /// Torque of each controller's integral part at the start of each log, N m or N, by log and joint: the mean torque that the arm with parameters
    /// `theta` and `terms` needs and the controller's proportional and derivative parts do not give; zero for joints without an integral part.
    pub fn held_before(&self, theta: &[f64], terms: &[Term]) -> Vec<[f64; N]> {
        let mut held = vec![[0.0; N]; self.logs.len()];
        let Some(commanded) = &self.commanded else { return held };
        let own: [f64; P] = std::array::from_fn(|i| theta[i]);
        let signals: Vec<Signal> = terms.iter().map(|term| self.signal_with_mean(term, &own)).collect();
        let beside = if signals.is_empty() { vec![None; N] } else { sum(&self.rows, &signals) };
        for j in (0..N).filter(|j| self.integrates(*j)) {
            for (log, rows) in self.rows_by_log(j).into_iter().enumerate() {
                let Some((mean, psi)) = &commanded.levels[log][j] else { continue };
                let arm: f64 = psi.iter().zip(theta).map(|(psi, theta)| psi * theta).sum();
                let terms = beside[j]
                    .as_ref()
                    .map_or(0.0, |s| rows.iter().map(|i| s[*i]).sum::<f64>() / rows.len().max(1) as f64);
                held[log][j] = arm + terms - mean;
            }
        }
        held
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::track::Reference;
    use crate::serial::controller::tests::SERVO;
    use crate::serial::term::controller_term::Setting;
    use crate::serial::weak_form::intervals::HALF_WIDTH_S;
    use armgap_core::chain::{Chain, ChainJoint, JointKind};

    const PERIOD: f64 = 0.004;
    const INERTIA: f64 = 0.7;
    const VISCOUS: f64 = 0.9;
    /// Constant torque that the joint needs on top of those of inertia and friction, N m.
    const OFFSET: f64 = 1.3;
    /// Largest error, N m, of torques of some 8 N m that are computed from a log by test functions, local cubics and references that are held from
    /// row to row.
    const MET: f64 = 0.02;

    /// One joint about the vertical, with a known moment of inertia and viscous friction.
    fn arm() -> (Chain<f64, 1>, [f64; 13]) {
        let joint = ChainJoint {
            kind: JointKind::Revolute,
            rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            translation: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
        };
        let mut theta = [0.0; 13];
        (theta[0], theta[9], theta[11]) = (1.0, INERTIA, VISCOUS);
        (Chain::new([joint], [0.0; 3]), theta)
    }

    /// A log in which a servo with gains `kp` times and `kd` times those of `stated` makes the joint follow a sum of sines against `offset`.
    fn track(stated: &JointController, [kp, kd]: [f64; 2], offset: f64) -> Track<1> {
        let t: Vec<f64> = (0..1500).map(|k| PERIOD * f64::from(k)).collect();
        let path = |t: f64| {
            let wave = |size: f64, rate: f64| {
                let (sine, cosine) = (rate * t).sin_cos();
                [size * sine, size * rate * cosine, -size * rate * rate * sine]
            };
            let (a, b) = (wave(0.6, 2.0), wave(0.2, 5.3));
            [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
        };
        let q: Vec<f64> = t.iter().map(|t| path(*t)[0]).collect();
        let wanted = |t: f64| {
            // Motion in the middle of the sample interval over which the reference is held.
            let [q, dq, ddq] = path(t + 0.5 * PERIOD);
            let torque = INERTIA * ddq + VISCOUS * dq + offset;
            q + (torque + kd * stated.gains[1] * dq) / (kp * stated.gains[0])
        };
        let mut track = Track::<1>::new("", &t, &q, &[], Some([1e-9]));
        track.reference = Some(Reference { q: t.iter().map(|t| [wanted(*t)]).collect(), dq: None });
        track
    }

    fn equation(controller: &PositionController, mut track: Track<1>) -> Equation<1, 13> {
        track.held = torques(controller, &track).unwrap();
        let (arm, theta) = arm();
        let tracks = [track];
        Equation::new(arm, &theta, &tracks, HALF_WIDTH_S).behind(controller, &tracks)
    }

    fn known(joint: JointController) -> PositionController {
        PositionController { joints: vec![joint], sigma: [vec![0.0], vec![0.0], vec![0.0]] }
    }

    fn worst(residual: &[Vec<f64>]) -> f64 {
        assert!(residual[0].len() > 100);
        residual[0].iter().fold(0.0, |worst, r| r.abs().max(worst))
    }

    #[test]
    fn the_torque_of_the_controller_is_what_the_arm_needs() {
        let equation = equation(&known(SERVO), track(&SERVO, [1.0; 2], 0.0));
        let left = worst(&equation.rows.residual(&arm().1, &vec![None]));
        assert!(left < MET, "{left}");
    }

    #[test]
    fn estimated_gains_are_parameters_beside_the_arm_s() {
        let controller = PositionController { sigma: [vec![4.0], vec![0.3], vec![0.0]], ..known(SERVO) };
        let equation = equation(&controller, track(&SERVO, [1.2, 0.8], 0.0));
        assert_eq!(equation.rows.parameters, 15);
        let mut theta = arm().1.to_vec();
        theta.extend([0.2 * SERVO.gains[0], -0.2 * SERVO.gains[1]]);
        let left = worst(&equation.rows.residual(&theta, &vec![None]));
        assert!(left < MET, "{left}");
        let joints = controller.with_differences(&theta[13..]);
        assert!((joints[0].gains[0] - 1.2 * SERVO.gains[0]).abs() < 1e-12);
    }

    #[test]
    fn settings_of_the_controller_are_terms() {
        let equation = equation(&known(SERVO), track(&SERVO, [1.2, 1.0], 0.0));
        let term = ControllerTerm { setting: Setting::Gain, joint: 0 };
        let left = worst(&equation.rows.residual(&arm().1, &equation.of_controller(term, 1.2)));
        assert!(left < MET, "{left}");
        assert!(worst(&equation.rows.residual(&arm().1, &vec![None])) > 20.0 * MET);
    }

    #[test]
    fn what_an_integral_held_before_is_an_offset() {
        let with_integral = JointController { gains: [SERVO.gains[0], SERVO.gains[1], 1e-9], ..SERVO };
        let plain = equation(&known(SERVO), track(&SERVO, [1.0; 2], -OFFSET));
        let held = equation(&known(with_integral), track(&SERVO, [1.0; 2], -OFFSET));
        let theta = arm().1;
        assert!(worst(&plain.rows.residual(&theta, &vec![None])) > OFFSET - MET);
        assert!(worst(&held.rows.residual(&theta, &vec![None])) < MET);
        // The servo gives `OFFSET` less than the motion needs, which the integral must have held.
        assert!((held.held_before(&theta, &[])[0][0] - OFFSET).abs() < MET);
    }

    #[test]
    fn the_floor_holds_the_noise_of_positions_times_the_gains() {
        let stiff = JointController { gains: [4000.0, 30.0, 0.0], ..SERVO };
        let equation = equation(&known(stiff), track(&stiff, [1.0; 2], 0.0));
        let (half, noise) = (HALF_WIDTH_S, equation.logs[0].noise[0]);
        // White noise of q in `int (kp phi - kd phi' + I phi'') q dt`, phi a raised cosine of unit area.
        let [kp, kd, _] = stiff.gains;
        let pi2 = std::f64::consts::PI.powi(2);
        let square = 0.75 * kp * kp / half
            + 0.25 * pi2 * (kd * kd - 2.0 * kp * INERTIA) / half.powi(3)
            + 0.25 * pi2 * pi2 * INERTIA * INERTIA / half.powi(5);
        let wanted = noise * (PERIOD * square).sqrt();
        let floor = equation.rows.joints[0].floor[50];
        assert!((floor / wanted - 1.0).abs() < 0.03, "{floor} {wanted}");
    }
}
