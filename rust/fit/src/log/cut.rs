//! Cuts logs into windows at states that are measured well.
//!
//! A window is predicted from its measured initial state. At a reversal the acceleration jumps by twice the Coulomb friction over the inertia; a
//! local cubic cannot follow the jump, and its velocity errs by many times its standard deviation. One such initial state caused up to nine tenths of
//! the error of a perfect model. So the edges of windows are moved away from reversals; the motion between two edges is predicted in either case.

use crate::log::track::{Smoothed, Track, median};

/// Largest shift of a window's edge, relative to the window's length. With 0.4 noise floors are hardly lower, and the lengths of windows differ by
/// more than a factor of two.
const MAX_EDGE_SHIFT: f64 = 0.2;

/// Squared error of a velocity that is measured at a reversal, in units of the variance of a typical velocity: errors of some ten standard deviations
/// were seen. The value only has to exceed the differences between the variances of samples to which a window's edge may be shifted; other values
/// were not tried.
const REVERSAL: f64 = 100.0;

/// Index pairs `(first, last)` of consecutive windows of about `horizon` seconds, each edge shifted to the nearby sample with the smallest error of
/// the measured velocity.
pub fn cut_at_smooth_motion<const N: usize>(track: &Track<N>, horizon: f64) -> Vec<(usize, usize)> {
    let windows = cut(&track.t, horizon);
    if windows.is_empty() {
        return windows;
    }
    let error = velocity_errors(track.smoothed());
    let best = |from: usize, to: usize, middle: usize| -> usize {
        let farther = |a: &usize, b: &usize| a.abs_diff(middle).cmp(&b.abs_diff(middle));
        (from..=to)
            .min_by(|a, b| error[*a].total_cmp(&error[*b]).then_with(|| farther(a, b)))
            .unwrap_or(middle)
    };
    let reach = |rows: usize| (MAX_EDGE_SHIFT * rows as f64) as usize;
    let mut found: Vec<(usize, usize)> = Vec::with_capacity(windows.len());
    for (index, &(first, last)) in windows.iter().enumerate() {
        let slack = reach(last - first);
        let begin = match found.last() {
            Some(&(_, end)) if windows[index - 1].1 == first => end,
            _ => best(first, first + slack, first),
        };
        let end = match windows.get(index + 1) {
            Some(&(next, _)) if next == last => best(last - slack, last + slack, last),
            _ => last,
        };
        found.push((begin, end));
    }
    found
}

/// Expected squared error of the velocities at every sample, in units of the median variance of each joint, summed over the joints. No sample counts
/// as better than the median: where a local cubic is wider than at neighbouring samples, it is so by chance, and its velocity errs by more than its
/// variance says.
fn velocity_errors<const N: usize>(smoothed: &[[Smoothed; N]]) -> Vec<f64> {
    let distances: [Vec<f64>; N] = std::array::from_fn(|j| to_reversal(smoothed, j));
    let typical: [f64; N] =
        std::array::from_fn(|j| median(smoothed.iter().map(|s| s[j].local.covariance[2]).collect()));
    let at = |k: usize, j: usize| -> f64 {
        let near = |i: usize| (1.0 - distances[i][k] / smoothed[k][j].half_width as f64).max(0.0).powi(2);
        (smoothed[k][j].local.covariance[2] / typical[j]).max(1.0) + REVERSAL * (0..N).map(near).sum::<f64>()
    };
    (0..smoothed.len()).map(|k| (0..N).map(|j| at(k, j)).sum()).collect()
}

/// Distance, in samples, from each sample to the nearest reversal of joint `j`.
fn to_reversal<const N: usize>(smoothed: &[[Smoothed; N]], j: usize) -> Vec<f64> {
    let mut distance = vec![f64::INFINITY; smoothed.len()];
    let reverses = |k: usize| smoothed[k][j].local.dq * smoothed[k + 1][j].local.dq <= 0.0;
    let mut last = f64::NEG_INFINITY;
    for k in 0..smoothed.len() {
        distance[k] = k as f64 - last;
        if k + 1 < smoothed.len() && reverses(k) {
            last = k as f64 + 0.5;
        }
    }
    let mut next = f64::INFINITY;
    for k in (0..smoothed.len()).rev() {
        if k + 1 < smoothed.len() && reverses(k) {
            next = k as f64 + 0.5;
        }
        distance[k] = distance[k].min(next - k as f64);
    }
    distance
}

/// Index pairs `(first, last)` of consecutive windows of about `horizon` seconds, of equal length within a stretch without gaps.
pub fn cut(t: &[f64], horizon: f64) -> Vec<(usize, usize)> {
    let period = median(t.windows(2).map(|w| w[1] - w[0]).collect());
    let largest = (10.0 * period).max(0.25 * horizon);
    let mut found = Vec::new();
    let mut begin = 0;
    for k in 1..=t.len() {
        if k < t.len() && t[k] - t[k - 1] <= largest {
            continue;
        }
        let stretch = &t[begin..k];
        let duration = stretch[stretch.len() - 1] - stretch[0];
        let count = ((duration / horizon + 0.2).floor() as usize).min((stretch.len() - 1) / 4);
        let edge = |i: usize| {
            let time = stretch[0] + duration * i as f64 / count as f64;
            begin + stretch.partition_point(|&x| x < time - 1e-9).min(stretch.len() - 1)
        };
        found.extend((0..count).map(|i| (edge(i), edge(i + 1))).filter(|(a, b)| b > a));
        begin = k;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A mass braked by friction: its velocity is a triangle in time, with corners on either side of its reversals at 0.5 s, 1.5 s and so on.
    fn track() -> Track<1> {
        let t: Vec<f64> = (0..1000).map(|k| 0.002 * f64::from(k)).collect();
        let jumping = |t: f64| (PI * t).sin() + 0.4 * (t - 0.5) * (t - 0.5).abs();
        let q: Vec<f64> = t.iter().map(|t| (1e5 * jumping(*t)).round() / 1e5).collect();
        Track::new("", &t, &q, &vec![0.0; t.len()], Some([1e-5]))
    }

    #[test]
    fn windows_follow_each_other_and_cover_the_log() {
        let track = track();
        let windows = cut_at_smooth_motion(&track, 0.25);
        assert_eq!(windows.len(), cut(&track.t, 0.25).len());
        assert!(windows.windows(2).all(|pair| pair[0].1 == pair[1].0));
        assert!(windows[0].0 <= 25 && windows.last().unwrap().1 == 999);
        assert!(windows.iter().all(|(first, last)| last > first));
    }

    #[test]
    fn no_window_begins_at_a_reversal() {
        let track = track();
        let even = cut(&track.t, 0.25);
        assert!(even.iter().any(|w| w.0.abs_diff(250) < 3), "a case without an edge at the reversal");
        for (first, _) in cut_at_smooth_motion(&track, 0.25) {
            assert!(first.abs_diff(250) > 10, "{first}");
        }
    }

    #[test]
    fn a_log_shorter_than_a_window_has_none() {
        let t = [0.0, 0.1, 0.2];
        let track = Track::<1>::new("", &t, &[0.0; 3], &[0.0; 3], None);
        assert!(cut_at_smooth_motion(&track, 0.25).is_empty());
    }
}
