//! The position controller of logs that hold references in place of torques, along a measured path.
//!
//! ```text
//! tau = clip(kp e + kd de + ki int e dt),  e = q_ref - q,  de = -dq  or  dq_ref - dq
//! ```
//!
//! A servo runs much faster than it is logged: its reference is held from row to row, or follows that at a limited speed, while position and
//! velocity are continuous. So a sample interval has a torque at its start, its middle and its end, with positions and velocities from local
//! cubics, and the middle from the cubic between the samples (Hermite). What is late is late by the library's delay.

pub(in crate::serial) mod closed_loop;
pub(in crate::serial) mod commanded;

use crate::log::track::Track;
use armgap_core::effect::{InputSegment, find, interval};

/// A PD or PID controller of every joint; lists by joint, SI.
#[derive(Debug, Clone)]
pub struct PositionController {
    /// Controllers as the arm file has them.
    pub joints: Vec<JointController>,
    /// Standard deviations of `kp`, `kd` and `ki`; zero for a gain that is known.
    pub sigma: [Vec<f64>; 3],
}

/// The controller of one joint.
#[derive(Debug, Clone, Copy)]
pub struct JointController {
    /// `kp`, `kd` and `ki`.
    pub gains: [f64; 3],
    /// Whether `kd` acts on the error's rate in place of the measured velocity.
    pub rate_of_error: bool,
    /// Time by which the reference arrives late, s.
    pub reference_delay: f64,
    /// Time by which the torque is late, s.
    pub delay: f64,
    /// Error up to which the proportional part is zero.
    pub deadband: f64,
    /// Largest speed at which the reference is followed.
    pub speed_limit: f64,
    /// Largest torque.
    pub torque_limit: f64,
}

impl PositionController {
    /// Gains that are estimated: which of the three, and the joint.
    pub fn estimated(&self) -> Vec<(usize, usize)> {
        let free = |gain: usize| {
            let sigma = &self.sigma[gain];
            (0..sigma.len()).filter(|j| sigma[*j] > 0.0).map(move |j| (gain, j))
        };
        (0..3).flat_map(free).collect()
    }

    /// The controllers with estimated gains, as differences in the order of [`Self::estimated`].
    pub fn with_differences(&self, differences: &[f64]) -> Vec<JointController> {
        let mut joints = self.joints.clone();
        for ((gain, j), difference) in self.estimated().into_iter().zip(differences) {
            joints[j].gains[gain] += difference;
        }
        joints
    }

    /// Whether joint `j` has an integral part.
    pub fn integrates(&self, j: usize) -> bool {
        self.joints[j].gains[2] > 0.0
    }
}

/// What the controller of one joint is given over every sample interval of a log.
#[derive(Debug, Clone)]
pub struct Given {
    t: Vec<f64>,
    target: Vec<f64>,
    target_rate: Option<Vec<f64>>,
    q: Vec<InputSegment<f64>>,
    dq: Vec<InputSegment<f64>>,
}

impl Given {
    /// Reference and measured path of joint `j`; none for a log without a reference.
    pub fn new<const N: usize>(track: &Track<N>, j: usize) -> Option<Self> {
        let reference = track.reference.as_ref()?;
        let smoothed = track.smoothed();
        let at = |k: usize| {
            let next = (k + 1).min(track.len() - 1);
            let h = interval(&track.t, k);
            let (a, b) = (&smoothed[k][j].local, &smoothed[next][j].local);
            let middle = 0.5 * (a.q + b.q) + 0.125 * h * (a.dq - b.dq);
            // The same mean velocity as viscous friction has in the equation, so that no term can be the difference of the two.
            let mean = 0.5 * (a.dq + b.dq);
            (
                InputSegment { start: a.q, middle, end: b.q },
                InputSegment { start: a.dq, middle: mean, end: b.dq },
            )
        };
        let (q, dq) = (0..track.len()).map(at).unzip();
        let column = |rows: &Vec<[f64; N]>| rows.iter().map(|row| row[j]).collect();
        Some(Self {
            t: track.t.clone(),
            target: column(&reference.q),
            target_rate: reference.dq.as_ref().map(column),
            q,
            dq,
        })
    }
}

/// A controller's inputs over the intervals of a log: the error, its rate or the negative velocity, and the error's integral from the first sample.
pub type Errors = [Vec<InputSegment<f64>>; 3];

impl JointController {
    /// Proportional, derivative and integral input at one instant.
    pub fn proportional(&self, error: f64) -> f64 {
        if error.abs() > self.deadband { error } else { 0.0 }
    }

    /// Largest torque either way.
    pub fn clipped(&self, torque: f64) -> f64 {
        torque.clamp(-self.torque_limit, self.torque_limit)
    }

    /// The reference as it arrives, interval by interval.
    pub fn reference(&self, given: &Given) -> Vec<InputSegment<f64>> {
        let mut from = given.target.first().copied().unwrap_or(0.0);
        let follow = |(k, target): (usize, &f64)| {
            if self.speed_limit.is_infinite() {
                return InputSegment::held(*target);
            }
            let h = interval(&given.t, k);
            let start = from;
            let at =
                |s: f64| start + (target - start).clamp(-self.speed_limit * s * h, self.speed_limit * s * h);
            from = at(1.0);
            InputSegment { start, middle: at(0.5), end: at(1.0) }
        };
        let mut column: Vec<_> = given.target.iter().enumerate().map(follow).collect();
        late(&given.t, self.reference_delay, &mut column);
        column
    }

    /// The rate of the reference as it arrives: as logged, else by central differences; zero where the velocity alone is fed back.
    pub fn reference_rate(&self, given: &Given) -> Vec<InputSegment<f64>> {
        let count = given.t.len();
        if !self.rate_of_error {
            return vec![InputSegment::held(0.0); count];
        }
        let slope = |k: usize| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(count - 1));
            (given.target[b] - given.target[a]) / (given.t[b] - given.t[a])
        };
        let between = |k: usize| {
            let (start, end) = (slope(k), slope((k + 1).min(count - 1)));
            InputSegment { start, middle: 0.5 * (start + end), end }
        };
        let logged = given.target_rate.as_ref();
        let of_row = |k: usize| logged.map_or_else(|| between(k), |rate| InputSegment::held(rate[k]));
        let mut column: Vec<InputSegment<f64>> = (0..count).map(of_row).collect();
        late(&given.t, self.reference_delay, &mut column);
        column
    }

    /// The controller's inputs along the measured path.
    pub fn errors(&self, given: &Given) -> Errors {
        let (reference, rate) = (self.reference(given), self.reference_rate(given));
        let apart = |a: &[InputSegment<f64>], b: &[InputSegment<f64>]| -> Vec<InputSegment<f64>> {
            a.iter().zip(b).map(|(a, b)| a.plus(b.map(|x| -x))).collect()
        };
        let error = apart(&reference, &given.q);
        let mut integral = 0.0;
        let accumulated = error.iter().enumerate().map(|(k, e)| {
            let (start, h) = (integral, interval(&given.t, k));
            integral += h * e.mean();
            InputSegment {
                start,
                middle: start + h * (5.0 * e.start + 8.0 * e.middle - e.end) / 24.0,
                end: integral,
            }
        });
        let accumulated = accumulated.collect();
        let proportional = error.iter().map(|e| e.map(|e| self.proportional(e))).collect();
        [proportional, apart(&rate, &given.dq), accumulated]
    }

    /// The torque before the drive's limit, from the controller's inputs.
    fn asked(&self, errors: &Errors) -> Vec<InputSegment<f64>> {
        let part = |gain: usize, k: usize| errors[gain][k].map(|e| self.gains[gain] * e);
        (0..errors[0].len()).map(|k| part(0, k).plus(part(1, k)).plus(part(2, k))).collect()
    }

    /// The torque within the drive's limit, before its delay, along the measured path.
    pub fn prompt_torque(&self, errors: &Errors) -> Vec<InputSegment<f64>> {
        self.asked(errors).into_iter().map(|torque| torque.map(|tau| self.clipped(tau))).collect()
    }

    /// Torque that this controller commands along the measured positions, late by its delay, one input segment for each sample interval.
    pub fn torque(&self, given: &Given) -> Vec<InputSegment<f64>> {
        let mut torque = self.prompt_torque(&self.errors(given));
        late(&given.t, self.delay, &mut torque);
        torque
    }

    /// Mean derivative of the torque by one of the gains over every interval: nothing where the drive's limit is reached.
    pub fn derivative(&self, given: &Given, gain: usize) -> Vec<f64> {
        let errors = self.errors(given);
        let within = |tau: f64| if tau.abs() < self.torque_limit { 1.0 } else { 0.0 };
        let free = |tau: InputSegment<f64>, e: &InputSegment<f64>| InputSegment {
            start: within(tau.start) * e.start,
            middle: within(tau.middle) * e.middle,
            end: within(tau.end) * e.end,
        };
        let mut column: Vec<InputSegment<f64>> =
            self.asked(&errors).into_iter().zip(&errors[gain]).map(|(tau, e)| free(tau, e)).collect();
        late(&given.t, self.delay, &mut column);
        column.iter().map(InputSegment::mean).collect()
    }
}

/// Delays a column, by the law of the library.
fn late(t: &[f64], delay: f64, column: &mut [InputSegment<f64>]) {
    if delay > 0.0
        && let Some(law) = find::<f64>("actuator_delay")
    {
        law.command(&[delay, 0.0, 0.0], t, column);
    }
}

#[cfg(test)]
pub(in crate::serial) mod tests {
    use super::*;
    use crate::log::track::Reference;

    const PERIOD: f64 = 0.004;
    const COUNT: usize = 500;
    /// What local cubics, which may be as wide as a tenth of a second, and their middles miss of these torques of up to 10 N m.
    const CUBIC: f64 = 3e-3;
    pub(in crate::serial) const SERVO: JointController = JointController {
        gains: [40.0, 3.0, 0.0],
        rate_of_error: false,
        reference_delay: 0.0,
        delay: 0.0,
        deadband: 0.0,
        speed_limit: f64::INFINITY,
        torque_limit: f64::INFINITY,
    };

    fn q(t: f64) -> f64 {
        0.5 * (3.0 * t).sin()
    }

    fn dq(t: f64) -> f64 {
        1.5 * (3.0 * t).cos()
    }

    fn target(t: f64) -> f64 {
        0.6 * (3.0 * t + 0.2).sin()
    }

    /// A log of a sine, its reference another sine.
    fn given() -> Given {
        let t: Vec<f64> = (0..COUNT).map(|k| PERIOD * k as f64).collect();
        let path: Vec<f64> = t.iter().map(|t| q(*t)).collect();
        let mut track = Track::<1>::new("", &t, &path, &[], Some([1e-9]));
        track.reference = Some(Reference { q: t.iter().map(|t| [target(*t)]).collect(), dq: None });
        Given::new(&track, 0).unwrap()
    }

    /// Mean over an interval of a servo that runs a hundred times in it, with `reference` and `torque` late by so many seconds.
    fn fast_servo(k: usize, servo: &JointController, reference: f64, late: f64) -> f64 {
        let steps = 100;
        let one = |i: usize| {
            let now = PERIOD * (k as f64 + (i as f64 + 0.5) / f64::from(steps)) - late;
            let held = PERIOD * ((now - reference) / PERIOD).floor().max(0.0);
            (servo.gains[0] * (target(held) - q(now)) - servo.gains[1] * dq(now))
                .clamp(-servo.torque_limit, servo.torque_limit)
        };
        (0..steps as usize).map(one).sum::<f64>() / f64::from(steps)
    }

    fn worst(servo: &JointController, reference: f64, late: f64) -> f64 {
        let found = servo.torque(&given());
        let miss = |k: usize| (found[k].mean() - fast_servo(k, servo, reference, late)).abs();
        (60..COUNT - 60).map(miss).fold(0.0, f64::max)
    }

    #[test]
    fn the_torque_is_that_of_a_servo_much_faster_than_the_log() {
        assert!(worst(&SERVO, 0.0, 0.0) < CUBIC, "{}", worst(&SERVO, 0.0, 0.0));
    }

    #[test]
    fn reference_and_torque_may_be_late_by_parts_of_a_sample() {
        let reference = JointController { reference_delay: 0.0105, ..SERVO };
        assert!(worst(&reference, 0.0105, 0.0) < CUBIC, "{}", worst(&reference, 0.0105, 0.0));
        // Between the means of two intervals the torque is not straight where the reference jumps.
        let torque = JointController { delay: 0.0105, ..SERVO };
        assert!(worst(&torque, 0.0, 0.0105) < 0.02, "{}", worst(&torque, 0.0, 0.0105));
    }

    #[test]
    fn a_limit_clips_and_switches_its_gains_off() {
        let servo = JointController { torque_limit: 2.0, ..SERVO };
        assert!(worst(&servo, 0.0, 0.0) < 0.05);
        let (given, torque) = (given(), servo.torque(&given()));
        let slope = servo.derivative(&given, 0);
        let at_limit = |s: &InputSegment<f64>| [s.start, s.middle, s.end].iter().all(|x| x.abs() == 2.0);
        let clipped: Vec<usize> = (0..COUNT).filter(|k| at_limit(&torque[*k])).collect();
        assert!(clipped.len() > 50 && clipped.iter().all(|k| slope[*k] == 0.0));
    }

    #[test]
    fn gains_change_the_torque_by_their_derivatives() {
        for (gain, rate_of_error) in [(0, false), (1, false), (1, true), (2, false)] {
            let at = |by: f64| {
                let mut servo = JointController { gains: [40.0, 3.0, 5.0], rate_of_error, ..SERVO };
                servo.gains[gain] += by;
                servo
            };
            let (given, step) = (given(), 0.5);
            let (ahead, behind) = (at(step).torque(&given), at(-step).torque(&given));
            let slope = at(0.0).derivative(&given, gain);
            for k in 0..COUNT {
                let difference = (ahead[k].mean() - behind[k].mean()) / (2.0 * step);
                assert!((difference - slope[k]).abs() < 1e-9, "{gain} {k}");
            }
        }
    }

    #[test]
    fn a_deadband_and_a_speed_limit() {
        let still = JointController { deadband: 10.0, ..SERVO };
        let torque = still.torque(&given());
        assert!(
            (60..COUNT - 60).all(|k| (torque[k].mean() + 3.0 * dq(PERIOD * (k as f64 + 0.5))).abs() < CUBIC)
        );
        let slow = JointController { speed_limit: 0.4, ..SERVO };
        let followed = slow.reference(&given());
        let fastest =
            followed.windows(2).map(|w| (w[1].start - w[0].start).abs() / PERIOD).fold(0.0, f64::max);
        assert!((fastest - 0.4).abs() < 1e-9, "{fastest}");
        let quick = JointController { speed_limit: 1e3, ..SERVO };
        let same = quick.reference(&given());
        assert!((0..COUNT).all(|k| (same[k].end - target(PERIOD * k as f64)).abs() < 1e-12));
    }

    #[test]
    fn the_integral_is_that_of_the_error() {
        let [_, _, integral] = SERVO.errors(&given());
        let (mut sum, steps) = (0.0, 200);
        for k in 0..COUNT - 60 {
            for i in 0..steps {
                let now = PERIOD * (k as f64 + (f64::from(i) + 0.5) / f64::from(steps));
                sum += PERIOD / f64::from(steps) * (target(PERIOD * k as f64) - q(now));
            }
            assert!((integral[k].end - sum).abs() < 1e-6, "{k}");
        }
    }
}
