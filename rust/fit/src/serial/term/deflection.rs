//! Deflection between motor and link along a measured motion: of an elastic shaft, and in the gap of a backlash.
//!
//! One of the two bodies has an encoder; `T` is the torque that the other would need to move with it, and `I` the inertia of the other body: of the
//! link, with the other joints moving as measured, or of the rotor. Over an elastic shaft with a spring and a damper side by side (Spong 1987) the
//! deflection `x` follows `I x'' + damping x' + stiffness x = T`. In a backlash the two bodies move as one on a flank, which only pushes: where it
//! would have to pull, the other body comes off, crosses the gap freely, `I x'' = T` (Nordin and Gutman 2002), and stops at the other flank without
//! rebound.

/// Torque on the deflection between motor and link over a sample interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::serial) struct Forcing {
    /// Length of the interval, s.
    pub h: f64,
    /// Torque `T` that the body without an encoder needs to move with the other, N m (N).
    pub torque: f64,
    /// Inertia `I` of the body without an encoder, kg m^2 (kg); zero where the torque `T` is what the shaft passes on.
    pub inertia: f64,
}

/// Deflection of an elastic shaft, rad (m), in the middle of each sample interval, and its mean rate over the interval, rad/s (m/s), from its
/// `compliance`, rad/(N m) (m/N), and its retardation time (damping by stiffness), s; without inertia the deflection is its mean over the interval.
/// The log begins at rest.
pub(in crate::serial) fn of_shaft(forcings: &[Forcing], compliance: f64, retardation: f64) -> Vec<[f64; 2]> {
    let mut x = forcings.first().map_or(0.0, |first| compliance * first.torque);
    let mut rate = 0.0;
    let along = |forcing: &Forcing| {
        let Forcing { h, torque, inertia } = *forcing;
        let settled = compliance * torque;
        let away = x - settled;
        let mean;
        let next = if inertia > 0.0 {
            let square = 1.0 / (compliance * inertia);
            let [left, speed] = free_oscillation([away, rate], [square, 0.5 * retardation * square], h);
            rate = speed;
            mean = settled + 0.5 * (away + left);
            settled + left
        } else {
            let left = away * (-h / retardation).exp();
            mean = settled + (away - left) * retardation / h;
            settled + left
        };
        let middle = [mean, (next - x) / h];
        x = next;
        middle
    };
    forcings.iter().map(along).collect()
}

/// Position and rate, after the time `h`, of an oscillator that starts at `[x, rate]`, with the square of its undamped frequency, 1/s^2, and its
/// decay rate, 1/s: the solution of `x'' + 2 decay x' + square x = 0`.
fn free_oscillation([x, rate]: [f64; 2], [square, decay]: [f64; 2], h: f64) -> [f64; 2] {
    let difference = square - decay * decay;
    let frequency = difference.abs().sqrt();
    // Both solutions: that with position one and rate `-decay` at the start, and that with position zero and rate one.
    let [even, odd] = if frequency * h < 1e-6 {
        let faded = (-decay * h).exp();
        [faded, faded * h]
    } else if difference > 0.0 {
        let faded = (-decay * h).exp();
        let (sine, cosine) = (frequency * h).sin_cos();
        [faded * cosine, faded * sine / frequency]
    } else {
        let [slow, fast] = [decay - frequency, decay + frequency].map(|decay| (-decay * h).exp());
        [0.5 * (slow + fast), 0.5 * (slow - fast) / frequency]
    };
    [x * even + (rate + decay * x) * odd, rate * even - (decay * rate + square * x) * odd]
}

/// Deflection in a backlash of `gap`, rad (m), in the middle of each sample interval, and its mean rate over the interval, rad/s (m/s). The log
/// begins at rest on the flank that the first torque pushes to.
pub(in crate::serial) fn in_gap(forcings: &[Forcing], gap: f64) -> Vec<[f64; 2]> {
    let half = 0.5 * gap;
    let mut x = forcings.first().map_or(0.0, |first| half.copysign(first.torque));
    let mut rate = 0.0_f64;
    let across = |forcing: &Forcing| {
        let (h, acceleration) = (forcing.h, forcing.torque / forcing.inertia);
        let free = x + h * (rate + 0.5 * h * acceleration);
        let next = free.min(half).max(-half);
        rate = if next == free { rate + h * acceleration } else { 0.0 };
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
        let path = in_gap(&forcings(300, |k| if k < 50 { 2.0 } else { -8.0 }, 2.0), 0.02);
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
        let path = in_gap(&forcings(400, |k| if (100..120).contains(&k) { -4.0 } else { 2.0 }, 1.0), 0.02);
        let farthest = path.iter().map(|d| d[0]).fold(f64::INFINITY, f64::min);
        assert!(farthest > 0.005 && farthest < 0.01, "{farthest}");
        assert_eq!(path[399], [0.01, 0.0]);
    }

    #[test]
    fn rates_are_the_mean_over_each_interval() {
        let path = in_gap(&forcings(500, |k| 30.0 * (0.02 * k as f64).sin(), 1.0), 0.01);
        let travelled: f64 = path.iter().map(|d| d[1] * H).sum();
        let ends = [0.005, path[499][0] + 0.5 * H * path[499][1]];
        assert!((travelled - (ends[1] - ends[0])).abs() < 1e-12);
        assert!(in_gap(&[], 0.01).is_empty() && of_shaft(&[], 0.01, 0.01).is_empty());
    }

    #[test]
    fn a_shaft_vibrates_at_the_frequency_of_its_inertia() {
        // A step of the torque: the deflection overshoots to twice the static one and is back after a period.
        let (compliance, inertia) = (1e-3_f64, 2.5);
        let path = of_shaft(&forcings(1000, |k| if k < 10 { 0.0 } else { 20.0 }, inertia), compliance, 0.0);
        let period = std::f64::consts::TAU * (compliance * inertia).sqrt();
        let at = |t: f64| path[10 + (t / H).round() as usize][0];
        assert!((at(0.5 * period) - 0.04).abs() < 1e-5 && at(period).abs() < 1e-4, "{period}");
    }

    #[test]
    fn damping_is_what_the_differential_equation_says() {
        // Light, critical and heavy damping against small steps of a semi-implicit method.
        let (compliance, inertia) = (2e-3_f64, 1.5);
        let torque = |k: usize| 3.0 + (0.013 * k as f64).sin();
        for ratio in [0.1, 1.0, 3.0] {
            let retardation = 2.0 * ratio * (compliance * inertia).sqrt();
            let path = of_shaft(&forcings(800, torque, inertia), compliance, retardation);
            let (fine, mut x, mut rate) = (2000, compliance * torque(0), 0.0);
            let mut largest = 0.0_f64;
            for (k, d) in path.iter().enumerate() {
                let before = x;
                for _ in 0..fine {
                    let force = torque(k) - (x + retardation * rate) / compliance;
                    rate += H / f64::from(fine) * force / inertia;
                    x += H / f64::from(fine) * rate;
                }
                largest = largest.max((d[0] - 0.5 * (before + x)).abs());
            }
            assert!(largest < 1e-7, "{ratio}: {largest}");
        }
    }

    #[test]
    fn a_shaft_without_inertia_follows_its_torque_after_the_retardation_time() {
        let path = of_shaft(&forcings(2000, |k| if k < 10 { 0.0 } else { 5.0 }, 0.0), 2e-3, 0.1);
        // Mean over the interval from 100 to 101 ms after the step.
        let faded = |t: f64| (-t / 0.1).exp();
        let mean = 1.0 - 0.1 * (faded(100.0 * H) - faded(101.0 * H)) / H;
        let after = path[10 + 100][0] / 0.01;
        assert!((after - mean).abs() < 1e-12, "{after}");
        let stiff = of_shaft(&forcings(20, |_| 5.0, 0.0), 2e-3, 0.0);
        assert_eq!(stiff[19], [0.01, 0.0]);
    }
}
