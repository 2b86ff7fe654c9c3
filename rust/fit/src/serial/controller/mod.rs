//! Torque of a position controller along the measured path, for logs that hold references in place of torques.
//!
//! ```text
//! tau = clip(kp e + kd de + ki int e dt),  e = q_ref - q,  de = -dq  or  dq_ref - dq
//! ```
//!
//! A servo runs much faster than it is logged: its reference is held from row to row, or follows the logged reference at a limited speed, while
//! position and velocity are continuous. So the torque of a sample interval has three values, at its start, middle and end. Positions and velocities
//! of the samples come from local cubics, and the position in the middle from the cubic (Hermite) through both samples. Delays of the reference and
//! of the torque are those of the effect `actuator_delay`.

pub(in crate::serial) mod closed_loop;
pub(in crate::serial) mod commanded;

use crate::log::track::Track;
use armgap_core::effect::{InputSegment, find, interval};

/// Position controllers (PD or PID) of all joints.
#[derive(Debug, Clone)]
pub struct PositionController {
    /// Controllers by joint, with the settings of the arm file.
    pub joints: Vec<JointController>,
    /// Standard deviations of `kp`, `kd` and `ki`, each by joint, in the gains' units; zero for a gain that is not estimated.
    pub sigma: [Vec<f64>; 3],
}

/// Position controller of one joint: `tau = clip(kp e + kd de + ki int e dt)`, `e = q_ref - q`.
#[derive(Debug, Clone, Copy)]
pub struct JointController {
    /// Gains `kp`, N m/rad (N/m), `kd`, N m s/rad (N s/m), and `ki`, N m/(rad s) (N/(m s)).
    pub gains: [f64; 3],
    /// Whether `kd` acts on the rate of the position error, `dq_ref - dq`; else on the measured velocity, `-dq`.
    pub rate_of_error: bool,
    /// Delay of the reference, s.
    pub reference_delay: f64,
    /// Delay of the torque, s.
    pub delay: f64,
    /// Position error, rad or m, up to which the proportional part is zero.
    pub deadband: f64,
    /// Largest speed at which the reference is followed, rad/s or m/s; infinite for no limit.
    pub speed_limit: f64,
    /// Largest torque in either direction, N m or N; infinite for no limit.
    pub torque_limit: f64,
}

impl PositionController {
    /// Gains that are estimated: for each its index among `kp`, `kd` and `ki`, and its 0-based joint.
    pub fn estimated(&self) -> Vec<(usize, usize)> {
        let free = |gain: usize| {
            let sigma = &self.sigma[gain];
            (0..sigma.len()).filter(|j| sigma[*j] > 0.0).map(move |j| (gain, j))
        };
        (0..3).flat_map(free).collect()
    }

    /// Controllers by joint with `differences`, in the gains' units, added to the estimated gains, in the order of [`Self::estimated`].
    pub fn with_differences(&self, differences: &[f64]) -> Vec<JointController> {
        let mut joints = self.joints.clone();
        for ((gain, j), difference) in self.estimated().into_iter().zip(differences) {
            joints[j].gains[gain] += difference;
        }
        joints
    }

    /// Whether the controller of joint `j` (0-based) has an integral part.
    pub fn integrates(&self, j: usize) -> bool {
        self.joints[j].gains[2] > 0.0
    }
}

/// Reference and measured path of one joint's controller, over every sample interval of a log.
#[derive(Debug, Clone)]
pub struct Given {
    t: Vec<f64>,
    target: Vec<f64>,
    target_rate: Option<Vec<f64>>,
    q: Vec<InputSegment<f64>>,
    dq: Vec<InputSegment<f64>>,
}

impl Given {
    /// Reference and measured path of joint `j` (0-based) along a log; `None` for a log without a reference.
    pub fn new<const N: usize>(track: &Track<N>, j: usize) -> Option<Self> {
        let reference = track.reference.as_ref()?;
        let smoothed = track.smoothed();
        let at = |k: usize| {
            let next = (k + 1).min(track.len() - 1);
            let h = interval(&track.t, k);
            let (a, b) = (&smoothed[k][j].local, &smoothed[next][j].local);
            let middle = 0.5 * (a.q + b.q) + 0.125 * h * (a.dq - b.dq);
            // The mean velocity is the one that viscous friction has in the weak form, so that no term can fit a difference of two velocities.
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

/// Inputs of a controller's proportional, derivative and integral part over the sample intervals of a log: position error, rad (m); the error's rate
/// or the negative velocity, rad/s (m/s); and integral of the error from the first sample, rad s (m s).
pub type Errors = [Vec<InputSegment<f64>>; 3];

impl JointController {
    /// Input of the proportional part at the position error `error`, rad or m: zero within the deadband.
    pub fn proportional(&self, error: f64) -> f64 {
        if error.abs() > self.deadband { error } else { 0.0 }
    }

    /// `torque` limited to the controller's largest torque, N m or N.
    pub fn clipped(&self, torque: f64) -> f64 {
        torque.clamp(-self.torque_limit, self.torque_limit)
    }

    /// Reference position over every sample interval after speed limit and delay, rad or m.
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

    /// Reference velocity over every sample interval after the delay of the reference, rad/s or m/s: as logged, else by central differences; zero for
    /// a controller that feeds the measured velocity back.
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

    /// Inputs of the controller's proportional, derivative and integral part along the measured path.
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

    /// Torque that the controller commands along the measured path before limit and delay, N m or N, from the inputs of its three parts.
    fn asked(&self, errors: &Errors) -> Vec<InputSegment<f64>> {
        let part = |gain: usize, k: usize| errors[gain][k].map(|e| self.gains[gain] * e);
        (0..errors[0].len()).map(|k| part(0, k).plus(part(1, k)).plus(part(2, k))).collect()
    }

    /// Torque that the controller commands along the measured path after the limit and before the delay, N m or N, from the inputs of its three
    /// parts.
    pub fn prompt_torque(&self, errors: &Errors) -> Vec<InputSegment<f64>> {
        self.asked(errors).into_iter().map(|torque| torque.map(|tau| self.clipped(tau))).collect()
    }

    /// Torque that the controller commands along the measured path, after limit and delay, N m or N, for every sample interval.
    pub fn torque(&self, given: &Given) -> Vec<InputSegment<f64>> {
        let mut torque = self.prompt_torque(&self.errors(given));
        late(&given.t, self.delay, &mut torque);
        torque
    }

    /// Mean derivative of the commanded torque by a gain over every sample interval, rad (m) for `kp` (`gain` 0), rad/s (m/s) for `kd` (1), rad s (m
    /// s) for `ki` (2); zero while the torque is at its limit.
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

/// Delays `column`, one input segment for each of the sample times `t`, by `delay`, s, as the effect `actuator_delay` does.
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
    /// Largest error, N m, of torques of up to 10 N m that are computed from local cubics, which may be as wide as a tenth of a second, and
    /// interpolated in the middle of sample intervals.
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

    /// Log of a joint that moves along a sine while its reference is another sine.
    fn given() -> Given {
        let t: Vec<f64> = (0..COUNT).map(|k| PERIOD * k as f64).collect();
        let path: Vec<f64> = t.iter().map(|t| q(*t)).collect();
        let mut track = Track::<1>::new("", &t, &path, &[], Some([1e-9]));
        track.reference = Some(Reference { q: t.iter().map(|t| [target(*t)]).collect(), dq: None });
        Given::new(&track, 0).unwrap()
    }

    /// Mean torque, N m, over sample interval `k` of a servo that runs a hundred times in the interval, with its reference late by `reference` and
    /// its torque late by `late`, s.
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
        // Between the middles of two intervals the torque is not linear in time where the reference jumps.
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
