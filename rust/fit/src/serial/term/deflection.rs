//! Deflection between motor and link along a measured motion: of an elastic shaft, and in the gap of a backlash.
//!
//! Over an elastic shaft with a spring and a damper side by side (Spong 1987) the deflection `x` follows `damping x' + stiffness x = T`, with `T` the torque
//! that the shaft passes on: what the motor's torque leaves of rotor inertia and friction where the encoder measures the motor, and what the link needs
//! where it measures the link. Neither needs the motion of the other body, whose vibration is only as well known as its frequency.
//!
//! In a backlash one of the two bodies has an encoder; `T` is the torque that the other would need to move with it, and `I` the inertia of the other body:
//! of the link, with the other joints moving as measured, or of the rotor. The two bodies move as one on a flank, which only pushes: where it
//! would have to pull, the other body comes off, crosses the gap freely, `I x'' = T` (Nordin and Gutman 2002), and stops at the other flank without
//! rebound.

/// Torque on the deflection between motor and link over a sample interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::serial) struct Forcing {
    /// Length of the interval, s.
    pub h: f64,
    /// Torque `T` that the shaft passes on, or that the body without an encoder needs to move with the other, N m (N).
    pub torque: f64,
    /// Inertia `I` of the body without an encoder, kg m^2 (kg), for backlash.
    pub inertia: f64,
}

/// Replaces torques that are not known by a line between their neighbours: a step would be an impulse on the joints that move with the deflection.
pub(in crate::serial) fn bridge(forcings: &mut [Forcing]) {
    let known: Vec<usize> = (0..forcings.len()).filter(|k| forcings[*k].torque.is_finite()).collect();
    let (Some(&first), Some(&last)) = (known.first(), known.last()) else {
        for forcing in forcings {
            forcing.torque = 0.0;
        }
        return;
    };
    let ends = [forcings[first].torque, forcings[last].torque];
    for forcing in &mut forcings[..first] {
        forcing.torque = ends[0];
    }
    for forcing in &mut forcings[last..] {
        forcing.torque = ends[1];
    }
    for pair in known.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|k| forcings[k].torque);
        for k in pair[0] + 1..pair[1] {
            let part = (k - pair[0]) as f64 / (pair[1] - pair[0]) as f64;
            forcings[k].torque = a + part * (b - a);
        }
    }
}

/// Mean deflection of an elastic shaft over each sample interval, rad (m), and its mean rate, rad/s (m/s), from its `compliance`, rad/(N m) (m/N), and its
/// retardation time (damping by stiffness), s. The log begins at rest.
pub(in crate::serial) fn of_shaft(forcings: &[Forcing], compliance: f64, retardation: f64) -> Vec<[f64; 2]> {
    let mut x = forcings.first().map_or(0.0, |first| compliance * first.torque);
    let along = |forcing: &Forcing| {
        let settled = compliance * forcing.torque;
        let away = x - settled;
        let left = away * (-forcing.h / retardation).exp();
        let mean = settled + (away - left) * retardation / forcing.h;
        let next = settled + left;
        let middle = [mean, (next - x) / forcing.h];
        x = next;
        middle
    };
    forcings.iter().map(along).collect()
}

/// Deflection in a backlash of `gap`, rad (m), in the middle of each sample interval, and its mean rate over the interval, rad/s (m/s). The log
/// begins at rest on the flank that the first torque pushes to. After an impact the bodies stay on the flank for the time `settling`, s, at least.
pub(in crate::serial) fn in_gap(forcings: &[Forcing], gap: f64, settling: f64) -> Vec<[f64; 2]> {
    let half = 0.5 * gap;
    let mut x = forcings.first().map_or(0.0, |first| half.copysign(first.torque));
    let mut rate = 0.0_f64;
    let mut settled = f64::INFINITY;
    let across = |forcing: &Forcing| {
        let (h, acceleration) = (forcing.h, forcing.torque / forcing.inertia);
        settled += h;
        if settled < settling {
            return [x, 0.0];
        }
        let free = x + h * (rate + 0.5 * h * acceleration);
        let next = free.min(half).max(-half);
        let hits = next != free;
        if hits && next != x {
            settled = 0.0;
        }
        rate = if hits { 0.0 } else { rate + h * acceleration };
        let middle = [0.5 * (x + next), (next - x) / h];
        x = next;
        middle
    };
    forcings.iter().map(across).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const H: f64 = 1e-3;

    fn forcings(count: usize, torque: impl Fn(usize) -> f64, inertia: f64) -> Vec<Forcing> {
        (0..count).map(|k| Forcing { h: H, torque: torque(k), inertia }).collect()
    }

    #[test]
    fn a_crossing_takes_the_time_of_a_free_fall() {
        // 0.02 rad at 4 rad/s^2 take 0.1 s, from the flank that the torque pushed to before.
        let path = in_gap(&forcings(300, |k| if k < 50 { 2.0 } else { -8.0 }, 2.0), 0.02, 0.0);
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
        let path =
            in_gap(&forcings(400, |k| if (100..120).contains(&k) { -4.0 } else { 2.0 }, 1.0), 0.02, 0.0);
        let farthest = path.iter().map(|d| d[0]).fold(f64::INFINITY, f64::min);
        assert!(farthest > 0.005 && farthest < 0.01, "{farthest}");
        assert_eq!(path[399], [0.01, 0.0]);
    }

    #[test]
    fn an_impact_that_is_measured_late_does_not_push_the_bodies_apart_again() {
        // The motor is knocked forward by the link that arrives, which the torque shows 10 ms later and for 20 ms.
        let torque = |k: usize| match k {
            0..50 => 2.0,
            160..180 => 30.0,
            _ => -8.0,
        };
        let farthest = |settling: f64| {
            let path = in_gap(&forcings(300, torque, 2.0), 0.02, settling);
            path[155..].iter().map(|d| d[0]).fold(f64::NEG_INFINITY, f64::max)
        };
        assert_eq!(farthest(0.04), -0.01);
        assert!(farthest(0.0) > 0.0);
    }

    #[test]
    fn rates_are_the_mean_over_each_interval() {
        let path = in_gap(&forcings(500, |k| 30.0 * (0.02 * k as f64).sin(), 1.0), 0.01, 0.0);
        let travelled: f64 = path.iter().map(|d| d[1] * H).sum();
        let ends = [0.005, path[499][0] + 0.5 * H * path[499][1]];
        assert!((travelled - (ends[1] - ends[0])).abs() < 1e-12);
        assert!(in_gap(&[], 0.01, 0.0).is_empty() && of_shaft(&[], 0.01, 0.01).is_empty());
    }

    #[test]
    fn a_shaft_follows_its_torque_after_the_retardation_time() {
        let path = of_shaft(&forcings(2000, |k| if k < 10 { 0.0 } else { 5.0 }, 0.0), 2e-3, 0.1);
        // Mean over the interval from 100 to 101 ms after the step.
        let faded = |t: f64| (-t / 0.1).exp();
        let mean = 1.0 - 0.1 * (faded(100.0 * H) - faded(101.0 * H)) / H;
        let after = path[10 + 100][0] / 0.01;
        assert!((after - mean).abs() < 1e-12, "{after}");
        let stiff = of_shaft(&forcings(20, |_| 5.0, 0.0), 2e-3, 0.0);
        assert_eq!(stiff[19], [0.01, 0.0]);
    }

    #[test]
    fn unknown_torques_lie_on_a_line_between_their_neighbours() {
        let nan = f64::NAN;
        let bridged = |torques: &[f64]| -> Vec<f64> {
            let mut all: Vec<Forcing> =
                torques.iter().map(|torque| Forcing { h: 1e-3, torque: *torque, inertia: 1.0 }).collect();
            bridge(&mut all);
            all.iter().map(|forcing| forcing.torque).collect()
        };
        assert_eq!(bridged(&[nan, 1.0, nan, nan, 4.0, nan]), [1.0, 1.0, 2.0, 3.0, 4.0, 4.0]);
        assert_eq!(bridged(&[nan, nan]), [0.0, 0.0]);
    }
}
