//! Motion of motor and link against each other in the gap of a backlash, along a measured motion.
//!
//! On a flank the two move as one and the transmission passes on the torque `T` that the body whose motion is unknown needs for that. A flank only
//! pushes: where it would have to pull, the body comes off and crosses the gap freely (Nordin and Gutman 2002). With the measured body's motion
//! given, the deflection between motor and link then accelerates with `T / I`, where `I` is the inertia that moves freely: of the link, with the
//! other joints moving as measured, or of the rotor. At the other flank it stops without rebound.

/// Deflection between motor and link, rad (m), in the middle of each sample interval, and its mean rate over the interval, rad/s (m/s), for a backlash
/// of `gap`; `intervals` holds the length of each sample interval, s, and the acceleration of the deflection inside the gap, rad/s^2 (m/s^2). The log
/// begins at rest on the flank that the first torque pushes to.
pub(in crate::serial) fn deflections(intervals: &[[f64; 2]], gap: f64) -> Vec<[f64; 2]> {
    let half = 0.5 * gap;
    let mut x = intervals.first().map_or(0.0, |[_, acceleration]| half.copysign(*acceleration));
    let mut rate = 0.0_f64;
    let across = |[h, acceleration]: &[f64; 2]| {
        let free = x + h * (rate + 0.5 * h * acceleration);
        let next = free.clamp(-half, half);
        rate = if next == free { rate + h * acceleration } else { 0.0 };
        let middle = [0.5 * (x + next), (next - x) / h];
        x = next;
        middle
    };
    intervals.iter().map(across).collect()
}

#[cfg(test)]
mod tests {
    use super::deflections;

    const H: f64 = 1e-3;

    #[test]
    fn a_crossing_takes_the_time_of_a_free_fall() {
        // 0.02 rad at 4 rad/s^2 take 0.1 s, from the flank that the torque pushed to before.
        let intervals: Vec<[f64; 2]> = (0..300).map(|k| [H, if k < 50 { 1.0 } else { -4.0 }]).collect();
        let path = deflections(&intervals, 0.02);
        assert!(path[..50].iter().all(|d| (d[0] - 0.01).abs() < 1e-15 && d[1] == 0.0));
        let arrived = path.iter().position(|d| d[0] <= -0.01).unwrap();
        assert!((arrived as f64 - 150.0).abs() <= 1.0, "{arrived}");
        let half_way = path[50 + 50][0];
        let fallen = 0.5 * 4.0 * (50.5 * H).powi(2);
        assert!((half_way - (0.01 - fallen)).abs() < 1e-6, "{half_way}");
        assert!(path[arrived + 1..].iter().all(|d| d == &[-0.01, 0.0]));
    }

    #[test]
    fn a_torque_that_turns_back_in_time_leaves_the_link_on_its_flank() {
        let intervals: Vec<[f64; 2]> =
            (0..400).map(|k| [H, if (100..120).contains(&k) { -4.0 } else { 2.0 }]).collect();
        let path = deflections(&intervals, 0.02);
        let farthest = path.iter().map(|d| d[0]).fold(f64::INFINITY, f64::min);
        assert!(farthest > 0.005 && farthest < 0.01, "{farthest}");
        assert_eq!(path[399], [0.01, 0.0]);
    }

    #[test]
    fn rates_are_the_mean_over_each_interval() {
        let intervals: Vec<[f64; 2]> = (0..500).map(|k| [H, 30.0 * (0.02 * f64::from(k)).sin()]).collect();
        let path = deflections(&intervals, 0.01);
        let travelled: f64 = path.iter().map(|d| d[1] * H).sum();
        let ends = [0.005, path[499][0] + 0.5 * H * path[499][1]];
        assert!((travelled - (ends[1] - ends[0])).abs() < 1e-12);
        assert!(deflections(&[], 0.01).is_empty());
    }
}
