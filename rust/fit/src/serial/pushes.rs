//! External pushes on a serial arm: events of one log in the torques that a model leaves unexplained.
//!
//! A push acts on several joints at once, for some tenths of a second, once. At every time and for several lengths a raised cosine is fitted to the
//! residuals of each joint; its heights, in robust standard deviations of all heights of that length on that joint, are squared and summed over the
//! joints (generalised likelihood ratio test on residuals, Willsky and Jones 1976). Residuals of real arms have heavy tails, so that no
//! critical value of a normal distribution applies: events are pushes down to the last one that stands out beside the next smaller event.

use crate::model::hypothesis::EffectInstance;
use crate::serial::weak_form::equation::Equation;
use crate::serial::weak_form::rows::JointRows;
use armgap_core::effect::PulseShape;
use std::f64::consts::PI;

/// Half lengths of the raised cosines, s: pushes of 0.1 s to 1 s. Neighbours differ by a factor of 1.6, at which a fit of the wrong length keeps 0.98
/// of a push's statistic.
const PUSH_HALF_LENGTHS: [f64; 6] = [0.08, 0.13, 0.2, 0.33, 0.52, 0.83];

/// Least statistic of a push: heights of six joints with normal residuals have 2.4 on average and 5 at most in a minute.
const LEAST_STATISTIC: f64 = 8.0;

/// Least ratio of the statistic of the smallest push to that of the largest event that is none. Largest values of residuals with heavy tails differ
/// from each other by less: of 200 logs of 20 s with the cubes of normal numbers as residuals (tails of the unit test) 9 % have such an event at 1.5,
/// 2 % at 1.8 and 1 % at 2.
const PUSH_STANDS_OUT: f64 = 2.0;

/// Largest number of pushes in all logs, per log: more are no rare events but something that the arm repeats.
const MOST_PUSHES_PER_LOG: usize = 4;

/// Least height of a push on a joint, in robust standard deviations, for the push to act on this joint.
const PUSH_ACTS: f64 = 6.0;

/// Least height of a push, as a part of the Coulomb friction of the joint, for it to be of consequence.
const PUSH_OF_COULOMB: f64 = 0.5;

/// Lengths that are tried where an event has been found: as many, from the one with which it was found to this multiple.
const REFINED_LENGTHS: i32 = 16;
const LARGEST_LENGTH: f64 = 4.0;

/// Least number of residuals under a raised cosine: of fewer, it fits any outlier of one row. Low-passed logs have wide test functions, far apart.
const FEWEST_ROWS: usize = 5;

/// Part of a joint's travel next to either limit in which a torque towards the middle is that of a stop.
const STOP_PART: f64 = 0.02;

/// Part of a joint's rows, in all logs, in which the motion may need more torque than in an event for the event to be that of a limit.
const LIMITED_PART: f64 = 0.01;

/// Part of a raised cosine that residuals have to cover.
const COVERED_PART: f64 = 0.5;

/// Standard deviation over half the width of the quartiles of a normal distribution.
const NORMAL_FROM_MEDIAN: f64 = 1.4826;

/// A raised cosine in the residuals of one log, with its heights by joint.
#[derive(Debug, Clone)]
pub struct Event {
    /// Index of the log.
    pub log: usize,
    /// Time of the largest torque, s: since the start of the log, and in results on the log's clock.
    pub time: f64,
    /// Half length, s.
    pub half: f64,
    /// Joint (from 0), height and standard deviation of the height, N m or N, of each joint that the event acts on.
    pub heights: Vec<(usize, f64, f64)>,
    /// Root of the summed squared heights of all joints, in standard deviations.
    pub statistic: f64,
    /// Share, 0 to 1, of the squared residuals that the event explains where it acts, on the joint with the largest height in standard deviations.
    pub share: f64,
    /// Probability, 0 to 1, of a push rather than one of the larger errors of the model.
    pub probability: f64,
}

impl Event {
    /// Pushes of the event, one per joint, as effects with impulse, time and duration, and the standard deviations of these.
    pub fn pushes(&self) -> Vec<(EffectInstance, [f64; 3])> {
        // A raised cosine has the variance over time of a rectangle of this duration.
        let duration = self.half * (4.0 - 24.0 / (PI * PI)).sqrt();
        let push = |(joint, height, sigma): &(usize, f64, f64)| {
            let relative = sigma / height.abs();
            let spread = [sigma * self.half, 0.5 * self.half * relative, duration * relative];
            // What the torques lack is what the push supplies.
            let impulse = -height * self.half;
            (EffectInstance::new(PulseShape::Bell.law(), *joint, [impulse, self.time, duration]), spread)
        };
        self.heights.iter().map(push).collect()
    }

    /// Joint (from 0), height and standard deviation of the joint on which the event stands out most.
    fn strongest(&self) -> Option<(usize, f64, f64)> {
        self.heights.iter().copied().max_by(|a, b| (a.1 / a.2).abs().total_cmp(&(b.1 / b.2).abs()))
    }

    /// Whether two events share a part of a log.
    pub fn overlaps(&self, other: &Self) -> bool {
        self.log == other.log && (self.time - other.time).abs() < self.half + other.half
    }
}

/// Residuals of one log at the times of the test functions, by joint; `None` where the joint has no row.
#[derive(Debug, Clone)]
pub struct Residuals {
    /// Times since the start of the log, s, in order.
    pub times: Vec<f64>,
    /// Residuals by joint and time, N m or N.
    pub joints: Vec<Vec<Option<f64>>>,
    /// Positions by joint and time, rad or m.
    pub positions: Vec<Vec<f64>>,
    /// Torque that the model needs for the motion by joint and time, N m or N: the logged torque less the residual; `None` where the joint has no row.
    pub needed: Vec<Vec<Option<f64>>>,
}

/// Residuals, log by log, of an equation's rows with the residuals `of_rows` by joint and row, N m or N.
pub fn residuals<const N: usize, const P: usize>(
    equation: &Equation<N, P>,
    of_rows: &[Vec<f64>],
) -> Vec<Residuals> {
    let mut at = vec![0; equation.functions.len()];
    let none = Residuals {
        times: Vec::new(),
        joints: vec![Vec::new(); N],
        positions: vec![Vec::new(); N],
        needed: vec![Vec::new(); N],
    };
    let mut found: Vec<Residuals> = vec![none; equation.logs.len()];
    for (i, phi) in equation.functions.iter().enumerate() {
        let log = &mut found[phi.log];
        at[i] = log.times.len();
        log.times.push(phi.centre);
        log.joints.iter_mut().chain(&mut log.needed).for_each(|joint| joint.push(None));
        let middle = &equation.logs[phi.log].middles[usize::midpoint(phi.first, phi.last)];
        log.positions.iter_mut().zip(middle.q).for_each(|(joint, q)| joint.push(q));
    }
    for (j, (kept, values)) in equation.kept.iter().zip(of_rows).enumerate() {
        for ((i, value), torque) in kept.iter().zip(values).zip(&equation.rows.joints[j].y) {
            let log = &mut found[equation.functions[*i].log];
            log.joints[j][at[*i]] = Some(*value);
            log.needed[j][at[*i]] = Some(torque - value);
        }
    }
    found
}

/// Events in the residuals of logs that are pushes, the largest first; `coulomb` is the Coulomb friction of each joint, N m or N.
pub fn pushes(logs: &[Residuals], coulomb: &[f64]) -> Vec<Event> {
    let most = MOST_PUSHES_PER_LOG * logs.len();
    let events = largest_events(logs, most + 1);
    let of = |k: usize| events.get(k).map_or(0.0, |event| event.statistic);
    let stands_out = |k: &usize| of(*k) >= LEAST_STATISTIC && of(*k) >= PUSH_STANDS_OUT * of(k + 1);
    let Some(last) = (0..events.len().min(most)).rfind(stands_out) else { return Vec::new() };
    let next = of(last + 1);
    let probable = |event: &Event| {
        let found = refined(&logs[event.log], event);
        let share = share(&logs[event.log], &found);
        Event { probability: 1.0 - (next / event.statistic).powi(4), share, ..found }
    };
    let matters = |event: &Event| {
        event.heights.iter().any(|(j, height, _)| height.abs() > PUSH_OF_COULOMB * coulomb[*j])
    };
    let mut found: Vec<Event> = Vec::new();
    for event in events[..=last].iter().map(probable) {
        // Lengths of neighbouring events may become those of one push.
        let is_new = !found.iter().any(|other| other.overlaps(&event));
        let is_known = is_of_a_stop(logs, &event) || is_of_a_limit(logs, &event);
        if is_new && matters(&event) && is_inside(&logs[event.log], &event) && !is_known {
            found.push(event);
        }
    }
    found
}

/// Whether an event is what a limit of the drive does: on the joint on which it stands out most it takes from the command, and the motion hardly ever needs
/// more torque in this direction than it gets then.
fn is_of_a_limit(logs: &[Residuals], event: &Event) -> bool {
    let Some((joint, height, scale)) = event.strongest() else { return false };
    let direction = height.signum();
    let log = &logs[event.log];
    let is_within = |t: f64| (t - event.time).abs() < 0.5 * event.half;
    let within = log.times.iter().zip(&log.needed[joint]).filter(|(t, _)| is_within(**t));
    let most =
        within.filter_map(|(_, needed)| *needed).map(|x| direction * x).fold(f64::NEG_INFINITY, f64::max);
    let (mut rows, mut more) = (0.0, 0.0);
    for needed in logs.iter().flat_map(|log| log.needed[joint].iter().flatten()) {
        rows += 1.0;
        more += f64::from(u8::from(direction * needed > most + scale));
    }
    most > 0.0 && more <= LIMITED_PART * rows
}

/// Whether an event lies inside its log: what happens at its begin or end may be a state of the arm that the log does not hold.
fn is_inside(log: &Residuals, event: &Event) -> bool {
    let reach = 2.0 * event.half;
    let (Some(first), Some(last)) = (log.times.first(), log.times.last()) else { return false };
    event.time - reach > *first && event.time + reach < *last
}

/// Whether an event is what a stop does: on the joint on which it stands out most it acts at a limit of the travel in all logs, towards the middle.
fn is_of_a_stop(logs: &[Residuals], event: &Event) -> bool {
    let Some((joint, height, _)) = event.strongest() else { return false };
    let all = || logs.iter().flat_map(|log| &log.positions[joint]).copied();
    let (low, high) = (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    let log = &logs[event.log];
    let at = log.times.partition_point(|t| *t < event.time).min(log.times.len() - 1);
    let (place, near) = (log.positions[joint][at], STOP_PART * (high - low));
    // What the torques lack is what the stop supplies.
    if height < 0.0 { place < low + near } else { place > high - near }
}

/// Share of a log's squared residuals, within an event, that the event explains on the joint on which it stands out most.
fn share(log: &Residuals, event: &Event) -> f64 {
    let Some((joint, height, _)) = event.strongest() else { return 0.0 };
    let (mut before, mut after) = (0.0, 0.0);
    for (t, residual) in log.times.iter().zip(&log.joints[joint]) {
        if let Some(residual) = residual.filter(|_| (t - event.time).abs() < event.half) {
            before += residual * residual;
            after += (residual - height * bell(*t, event.time, event.half)).powi(2);
        }
    }
    if before > 0.0 { (1.0 - after / before).max(0.0) } else { 0.0 }
}

/// A raised cosine of unit height around `centre`, with half length `half`, at time `t` within it.
fn bell(t: f64, centre: f64, half: f64) -> f64 {
    0.5 * (1.0 + (PI * (t - centre) / half).cos())
}

/// The `most` largest events that do not overlap, largest first.
fn largest_events(logs: &[Residuals], most: usize) -> Vec<Event> {
    let mut all: Vec<Event> = PUSH_HALF_LENGTHS.iter().flat_map(|half| events_of(logs, *half)).collect();
    all.sort_by(|a, b| b.statistic.total_cmp(&a.statistic));
    let mut found: Vec<Event> = Vec::new();
    for event in all {
        if found.len() == most {
            break;
        }
        if !found.iter().any(|other| other.overlaps(&event)) {
            found.push(event);
        }
    }
    found
}

/// Raised cosines of one half length at every time of every log.
fn events_of(logs: &[Residuals], half: f64) -> Vec<Event> {
    let joints = logs.first().map_or(0, |log| log.joints.len());
    let heights: Vec<Vec<Vec<Option<f64>>>> =
        logs.iter().map(|log| (0..joints).map(|j| heights_of(log, j, half)).collect()).collect();
    let scale = |j: usize| {
        let all = heights.iter().flat_map(|log| log[j].iter().flatten()).map(|height| height.abs());
        let mut all: Vec<f64> = all.collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).map_or(0.0, |median| NORMAL_FROM_MEDIAN * median)
    };
    let scales: Vec<f64> = (0..joints).map(scale).collect();
    let mut found = Vec::new();
    for (log, of_log) in heights.iter().enumerate() {
        for (k, time) in logs[log].times.iter().enumerate() {
            let known = scales.iter().enumerate().filter(|(_, scale)| **scale > 0.0);
            let at = known.filter_map(|(j, scale)| of_log[j][k].map(|height| (j, height, *scale)));
            let mut heights: Vec<(usize, f64, f64)> = at.collect();
            let statistic = heights.iter().map(|(_, h, s)| (h / s).powi(2)).sum::<f64>().sqrt();
            heights.retain(|(_, height, scale)| height.abs() > PUSH_ACTS * scale);
            found.push(Event { log, time: *time, half, heights, statistic, share: 0.0, probability: 0.0 });
        }
    }
    found
}

/// Height of the raised cosine that fits a joint's residuals best, N m or N, around every time of a log; `None` where too few residuals are known.
fn heights_of(log: &Residuals, joint: usize, half: f64) -> Vec<Option<f64>> {
    log.times.iter().map(|centre| Some(fit(log, joint, *centre, half)?.height)).collect()
}

/// Least-squares fit of a raised cosine to a joint's residuals.
struct Cosine {
    /// Height, N m or N.
    height: f64,
    /// Decrease of the sum of squared residuals by the raised cosine, (N m)^2 or N^2.
    explained: f64,
}

/// Fit of a raised cosine around `centre`; `None` where too few residuals are known.
fn fit(log: &Residuals, joint: usize, centre: f64, half: f64) -> Option<Cosine> {
    let first = log.times.partition_point(|t| *t <= centre - half);
    let last = log.times.partition_point(|t| *t < centre + half);
    let (mut product, mut square, mut whole, mut rows) = (0.0, 0.0, 0.0, 0);
    for k in first..last {
        let b = bell(log.times[k], centre, half);
        whole += b * b;
        if let Some(residual) = log.joints[joint][k] {
            product += b * residual;
            square += b * b;
            rows += 1;
        }
    }
    (rows >= FEWEST_ROWS && square > COVERED_PART * whole)
        .then(|| Cosine { height: product / square, explained: product * product / square })
}

/// The event with the time and length that explain most of the squared residuals of its joints. Events are found by their heights in standard deviations,
/// which hardly fall with the length where residuals are correlated, and so with short lengths.
fn refined(log: &Residuals, event: &Event) -> Event {
    let of = |centre: f64, half: f64| -> f64 {
        let explained = |(j, _, scale): &(usize, f64, f64)| {
            fit(log, *j, centre, half).map_or(0.0, |cosine| cosine.explained / (scale * scale))
        };
        event.heights.iter().map(explained).sum()
    };
    let near = log.times.iter().filter(|t| (*t - event.time).abs() < 2.0 * event.half);
    let lengths = (0..REFINED_LENGTHS)
        .map(|i| event.half * LARGEST_LENGTH.powf(f64::from(i) / f64::from(REFINED_LENGTHS - 1)));
    let tried = lengths.flat_map(|half| near.clone().map(move |t| (*t, half)));
    let best = tried.max_by(|a, b| of(a.0, a.1).total_cmp(&of(b.0, b.1)));
    let (time, half) = best.unwrap_or((event.time, event.half));
    let height = |(j, old, scale): &(usize, f64, f64)| {
        (*j, fit(log, *j, time, half).map_or(*old, |cosine| cosine.height), *scale)
    };
    Event { time, half, heights: event.heights.iter().map(height).collect(), ..event.clone() }
}

impl<const N: usize, const P: usize> Equation<N, P> {
    /// Leaves out the rows of all joints whose test functions lie within events of their logs.
    pub fn leave_out(&mut self, events: &[&Event]) {
        let functions = &self.functions;
        let inside = |i: usize| {
            let phi = &functions[i];
            events.iter().any(|event| {
                event.log == phi.log && (event.time - phi.centre).abs() < event.half + phi.half_width()
            })
        };
        let parameters = self.rows.parameters;
        for (kept, rows) in self.kept.iter_mut().zip(&mut self.rows.joints) {
            let stays: Vec<bool> = kept.iter().map(|i| !inside(*i)).collect();
            let only = |values: &[f64], each: usize| -> Vec<f64> {
                let of_row = values.chunks_exact(each).zip(&stays).filter(|(_, stays)| **stays);
                of_row.flat_map(|(values, _)| values.to_vec()).collect()
            };
            *rows = JointRows {
                y: only(&rows.y, 1),
                psi: only(&rows.psi, parameters),
                block: rows
                    .block
                    .iter()
                    .zip(&stays)
                    .filter(|(_, stays)| **stays)
                    .map(|(block, _)| *block)
                    .collect(),
                floor: only(&rows.floor, 1),
            };
            let mut stays = stays.iter();
            kept.retain(|_| *stays.next().unwrap_or(&true));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    const TIMES: usize = 800;
    const SPACING: f64 = 0.025;
    const JOINTS: usize = 3;

    /// Residuals of one log of 20 s with standard deviation 0.1 N m, correlated over two times, and with the torques `pushed(joint, t)`.
    fn log(seed: u64, tail: f64, pushed: impl Fn(usize, f64) -> f64) -> Residuals {
        let mut random = Random(seed);
        let times: Vec<f64> = (0..TIMES).map(|k| SPACING * k as f64).collect();
        let joint = |j: usize, random: &mut Random| {
            let white: Vec<f64> = (0..=TIMES).map(|_| random.normal()).collect();
            let heavy = |x: f64| 0.07 * x * (1.0 + tail * x * x);
            (0..TIMES).map(|k| Some(heavy(white[k]) + heavy(white[k + 1]) + pushed(j, times[k]))).collect()
        };
        let joints = (0..JOINTS).map(|j| joint(j, &mut random)).collect();
        let positions = vec![times.iter().map(|t| (0.9 * t).sin()).collect(); JOINTS];
        // The motion needs torques of up to 5 N m.
        let needed = vec![times.iter().map(|t| Some(5.0 * (0.9 * t).cos())).collect(); JOINTS];
        Residuals { times, joints, positions, needed }
    }

    fn pulse(t: f64, centre: f64, half: f64) -> f64 {
        if (t - centre).abs() < half { bell(t, centre, half) } else { 0.0 }
    }

    #[test]
    fn a_push_is_found_with_its_time_and_impulse() {
        let push = |j: usize, t: f64| [2.0, -1.0, 0.0][j] * pulse(t, 7.3, 0.2);
        let found = pushes(&[log(1, 0.0, |_, _| 0.0), log(2, 0.0, push)], &[1.0; JOINTS]);
        let [event] = &found[..] else { panic!("{found:?}") };
        assert_eq!(event.log, 1);
        assert!((event.time - 7.3).abs() < 0.03 && event.probability > 0.95, "{event:?}");
        let of_joint = event.pushes();
        assert_eq!(of_joint.iter().map(|(push, _)| push.joint).collect::<Vec<_>>(), [0, 1]);
        for ((push, sigma), impulse) in of_joint.iter().zip([-0.4, 0.2]) {
            assert!((push.p[0] - impulse).abs() < 4.0 * sigma[0], "{push:?}");
            assert!((push.p[2] - 0.25).abs() < 0.05, "{push:?}");
        }
    }

    #[test]
    fn pushes_of_different_size_are_all_found() {
        let push = |j: usize, t: f64| {
            let all = [(3.0, 4.0), (8.0, 1.5), (12.0, 0.9)];
            if j == 1 { all.iter().map(|(at, size)| size * pulse(t, *at, 0.33)).sum() } else { 0.0 }
        };
        let mut times: Vec<f64> =
            pushes(&[log(3, 0.0, push)], &[1.0; JOINTS]).iter().map(|e| e.time).collect();
        times.sort_by(f64::total_cmp);
        assert_eq!(times.iter().map(|t| t.round()).collect::<Vec<_>>(), [3.0, 8.0, 12.0]);
    }

    #[test]
    fn nothing_is_found_in_residuals_with_light_or_heavy_tails() {
        let false_ones =
            (0..20).map(|seed| pushes(&[log(seed, 0.0, |_, _| 0.0)], &[0.1; JOINTS]).len()).sum::<usize>();
        let of_tails =
            (0..20).map(|seed| pushes(&[log(seed, 0.3, |_, _| 0.0)], &[0.1; JOINTS]).len()).sum::<usize>();
        assert_eq!((false_ones, of_tails), (0, 0));
    }

    #[test]
    fn an_event_at_the_begin_of_a_log_is_no_push() {
        let early = |at: f64| move |j: usize, t: f64| if j == 0 { 2.0 * pulse(t, at, 0.2) } else { 0.0 };
        assert!(pushes(&[log(1, 0.0, early(0.2))], &[1.0; JOINTS]).is_empty());
        assert_eq!(pushes(&[log(1, 0.0, early(2.2))], &[1.0; JOINTS]).len(), 1);
    }

    #[test]
    fn a_torque_at_the_end_of_the_travel_towards_its_middle_is_a_stop() {
        // The joints are at their lower limit after three quarters of a period.
        let lower = 1.5 * PI / 0.9;
        let stop = |sign: f64| move |j: usize, t: f64| if j == 0 { sign * pulse(t, lower, 0.2) } else { 0.0 };
        assert!(pushes(&[log(1, 0.0, stop(-2.0))], &[1.0; JOINTS]).is_empty());
        assert_eq!(pushes(&[log(1, 0.0, stop(2.0))], &[1.0; JOINTS]).len(), 1);
    }

    #[test]
    fn torque_that_a_limit_takes_is_no_push() {
        // After one period the motion needs its largest torque, and after two fifths of one far less.
        let period = 2.0 * PI / 0.9;
        let taken =
            |at: f64, sign: f64| move |j: usize, t: f64| if j == 0 { sign * pulse(t, at, 0.2) } else { 0.0 };
        assert!(pushes(&[log(1, 0.0, taken(period, 2.0))], &[1.0; JOINTS]).is_empty());
        assert_eq!(pushes(&[log(1, 0.0, taken(period, -2.0))], &[1.0; JOINTS]).len(), 1);
        assert_eq!(pushes(&[log(1, 0.0, taken(0.4 * period, 2.0))], &[1.0; JOINTS]).len(), 1);
    }

    #[test]
    fn an_outlier_of_one_row_is_no_push() {
        let mut given = log(1, 0.0, |_, _| 0.0);
        let alone = |k: usize| k.is_multiple_of(8);
        given.joints[0].iter_mut().enumerate().filter(|(k, _)| !alone(*k)).for_each(|(_, r)| *r = None);
        given.joints[0][400] = Some(30.0);
        assert!(pushes(&[given], &[0.1; JOINTS]).is_empty());
    }

    #[test]
    fn what_an_arm_repeats_is_no_push() {
        let often = |j: usize, t: f64| if j == 0 { 3.0 * pulse(t.rem_euclid(2.0), 1.0, 0.13) } else { 0.0 };
        assert!(pushes(&[log(5, 0.0, often)], &[1.0; JOINTS]).is_empty());
    }

    #[test]
    fn a_push_far_below_friction_is_of_no_consequence() {
        let push = |j: usize, t: f64| if j == 0 { 2.0 * pulse(t, 7.3, 0.2) } else { 0.0 };
        assert!(pushes(&[log(1, 0.0, push)], &[10.0; JOINTS]).is_empty());
    }
}
