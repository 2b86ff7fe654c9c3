//! Pushes in the residual torque of one log: Gaussian pulses that stand out after the fit of all possible model errors.
//!
//! Parameters, unknown effects and pulses are fitted together, linearly; the gain of a pulse at one time, of one width, on one joint is compared with
//! the scatter around the pulse and reduced by the part that other columns could imitate (generalised likelihood ratio). The largest pulses are added
//! one by one, as one push hides another by raising the scatter; which of them are pushes is decided when all are known.

use super::bell::{Bell, all_but};
use super::linear::{Fitted, Linear};
use super::residual::Residual;
use super::scatter::MAD_TO_SIGMA;
use crate::log::track::median;
use rayon::prelude::*;

/// Standard deviations of the Gaussian pulses looked for, after the low-pass, s.
const PULSE_WIDTHS: [f64; 7] = [0.045, 0.055, 0.07, 0.09, 0.115, 0.145, 0.18];

/// Spacing of the times of pulses tried in the coarse search, in standard deviations of the pulses: the nearest pulse tried is off by a quarter
/// of its standard deviation at most and has 98 % of the size.
const COARSE: f64 = 0.5;

/// Spacing of the times of pulses tried in the fine search, s.
const FINE: f64 = 0.01;

/// Half range of times of the fine search around a pulse, s.
const FINE_HALF_RANGE: f64 = 0.08;

/// Size, in standard deviations, down to which pulses are added to the fit. Low, because the first pulses must be found while all others still raise the
/// scatter: with 2.5 two pushes on one joint of a real arm hid each other.
const TRIED_PULSE: f64 = 2.0;

/// Size, in standard deviations, from which a pulse may be a push; where the model describes the arm, it is one.
const LIKELY_PULSE: f64 = 5.0;

/// Size, in standard deviations of a fit of the larger pulses alone and of the friction that no law describes, from which a pulse and all larger ones
/// are pushes where the model leaves errors unexplained: the critical value of Rosner's test (1983) at 5 % for the 80 independent pulses that a log of
/// ten seconds has room for. With 2.9 eight times as many pulses of random torques pass, with 3.7 three quarters as many; the last of the four pushes on
/// a real arm has 3.3 to 4.1 (docs/decisions/050-how-many-pushes.md).
const LIKELY_BESIDE_REMAINDER: f64 = 3.3;

/// Size, in standard deviations, from which a pulse that is lighter than a push gives a first guess of a drive's limit or of a stop.
const CERTAIN_PULSE: f64 = 12.0;

/// Standard deviation of the friction of a real joint around any law of friction, relative to the joint's friction at rest.
const FRICTION_SCATTER: f64 = 0.25;

/// Largest number of pushes looked for in one log; so many are no rare events but something that the arm repeats.
pub const MAX_PUSHES: usize = 8;

/// Time in motion of a joint from which the typical size of its chance pulses is estimated, s.
const TYPICAL_OVER: f64 = 0.4;

/// Least time that a joint must move in a log for pushes on it to be looked for, s.
const MOVES: f64 = 0.5;

/// Pushes and lighter pulses found in a log, and the size of the largest pulse that is no push.
pub struct Found {
    /// Gaussian pulses that count as pushes, in the order in which they were found.
    pub bells: Vec<Bell>,
    /// Pulses that are certain and too light for pushes, where the model leaves errors unexplained.
    pub light: Vec<Bell>,
    /// Size, in standard deviations, of the largest pulse that is no push.
    pub rest: f64,
}

struct Search<'a, const N: usize> {
    linear: Linear<'a, N>,
    /// Whether the model leaves more error unexplained than noise.
    remainder: bool,
    /// Typical size of chance pulses, in standard deviations, per joint and width; at least one.
    chance: Vec<Vec<f64>>,
}

/// Looks for pushes in the residual torque of a log; `remainder` tells whether the model leaves more error unexplained than noise.
pub fn search<const N: usize>(residual: &Residual<N>, remainder: bool) -> Option<Found> {
    let chance = vec![vec![1.0; PULSE_WIDTHS.len()]; N];
    let mut search = Search { linear: Linear::new(residual), remainder, chance };
    let gathered = search.gather()?;
    let mut found = Found { bells: Vec::new(), light: Vec::new(), rest: TRIED_PULSE };
    for (bell, stands) in gathered.iter().zip(search.standing(&gathered)?) {
        if stands {
            found.bells.push(*bell);
            continue;
        }
        found.rest = found.rest.max(bell.z.min(LIKELY_PULSE));
        if bell.z > CERTAIN_PULSE {
            found.light.push(*bell);
        }
    }
    Some(found)
}

/// Number of the largest pulses that are pushes, from the size of each, the largest first, in a fit of the larger ones alone: the last that stands out
/// and all before it, as one push hides another by raising the scatter (generalised test for many outliers, Rosner 1983). Beside all others instead of
/// the larger ones, the largest few lobes of any random torque stand out of what is left.
fn push_count(beside_larger: &[f64]) -> usize {
    beside_larger.iter().rposition(|size| *size > LIKELY_BESIDE_REMAINDER).map_or(0, |last| last + 1)
}

impl<const N: usize> Search<'_, N> {
    /// The largest pulses, added one by one, each fitted in time and width beside the others; `None` if the linear fit is singular.
    fn gather(&mut self) -> Option<Vec<Bell>> {
        let mut bells: Vec<Bell> = Vec::new();
        loop {
            let fitted = self.linear.settle(&bells)?;
            let largest = self.scan(&fitted);
            bells = self.refine(bells)?;
            match largest.filter(|b| b.z > TRIED_PULSE && bells.len() < MAX_PUSHES) {
                Some(next) => bells.push(next),
                None => return Some(bells),
            }
            bells = self.refine(bells)?;
        }
    }

    /// Which of the pulses are pushes: where the model describes the arm, those that stand out beside all others; beside errors that the model leaves
    /// unexplained as many of these as [`push_count`] counts, the largest first.
    fn standing(&mut self, bells: &[Bell]) -> Option<Vec<bool>> {
        let likely = |i: &usize| bells[*i].z > LIKELY_PULSE;
        let (mut left, mut largest): (Vec<usize>, Vec<usize>) =
            ((0..bells.len()).filter(likely).collect(), Vec::new());
        if !self.remainder {
            return Some((0..bells.len()).map(|i| left.contains(&i)).collect());
        }
        let scatter = self.linear.scatter.clone();
        let mut sizes = Vec::with_capacity(bells.len());
        while !left.is_empty() {
            self.linear.scatter.clone_from(&scatter);
            let larger: Vec<Bell> = largest.iter().map(|i| bells[*i]).collect();
            let fitted = self.linear.settle(&larger)?;
            self.scan(&fitted);
            let of = |i: &usize| self.unaided(&fitted, &bells[*i]);
            let (place, size) = left.iter().map(of).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
            sizes.push(size);
            largest.push(left.remove(place));
        }
        largest.truncate(push_count(&sizes));
        Some((0..bells.len()).map(|i| largest.contains(&i)).collect())
    }

    /// Height of a pulse in standard deviations of what a fit without it leaves around it and of the friction that no law describes; zero where columns
    /// imitate it. A pulse that is fitted takes up errors that the model leaves around it, lowers the scatter there and so appears to stand out: this one
    /// is no part of the fit, and its own torque is part of the scatter.
    fn unaided(&self, fitted: &Fitted, bell: &Bell) -> f64 {
        let unaided = self.best_near(fitted, bell, true);
        let friction = FRICTION_SCATTER * self.linear.residual.joints[unaided.joint].holding;
        let is_distinct = unaided.z > 0.0;
        if is_distinct { unaided.height.abs() / unaided.sigma.hypot(friction) } else { 0.0 }
    }

    /// Scans pulses of all widths over the log, stores their typical sizes, and returns the largest pulse.
    fn scan(&mut self, fitted: &Fitted) -> Option<Bell> {
        let moves = |j: usize| self.linear.moving[j].iter().sum::<f64>() * self.linear.residual.step > MOVES;
        let kinds: Vec<(usize, usize)> =
            (0..N).filter(|&j| moves(j)).flat_map(|j| (0..PULSE_WIDTHS.len()).map(move |w| (j, w))).collect();
        let scanned: Vec<(f64, Option<Bell>)> =
            kinds.par_iter().map(|(joint, w)| self.scan_kind(fitted, *joint, PULSE_WIDTHS[*w])).collect();
        let mut largest: Option<Bell> = None;
        for ((joint, w), (chance, best)) in kinds.into_iter().zip(scanned) {
            self.chance[joint][w] = chance;
            largest = largest.filter(|l| best.is_none_or(|b| l.z >= b.z)).or(best);
        }
        largest
    }

    /// Tries pulses of one width on one joint over the log: their typical size in standard deviations, and the largest pulse, its size relative to
    /// the typical one.
    fn scan_kind(&self, fitted: &Fitted, joint: usize, width: f64) -> (f64, Option<Bell>) {
        let (from, to) = self.linear.span(width);
        let spacing = COARSE * width;
        let count = ((to - from) / spacing).floor().max(0.0) as usize;
        let tried: Vec<Bell> = (0..=count)
            .map(|i| from + i as f64 * spacing)
            .map(|time| Bell { joint, time, width, height: 0.0, sigma: 0.0, z: 0.0 })
            .map(|bell| self.linear.weigh(fitted, &bell))
            .collect();
        let chance = self.typical(joint, &tried, spacing);
        let apart = |b: &Bell| fitted.bells.iter().all(|o| !b.touches(o));
        let best = tried.into_iter().filter(apart).max_by(|a, b| a.z.total_cmp(&b.z));
        (chance, best.map(|best| Bell { z: best.z / chance, ..best }))
    }

    /// Typical size, in standard deviations, of chance pulses of one width while the joint moves, from pulses tried `spacing` seconds apart; at least
    /// one.
    fn typical(&self, joint: usize, tried: &[Bell], spacing: f64) -> f64 {
        let t = &self.linear.residual.t;
        let moves =
            |b: &&Bell| self.linear.moving[joint][t.partition_point(|t| *t < b.time).min(t.len() - 1)] > 0.5;
        let mut sizes: Vec<f64> = tried.iter().filter(moves).map(|b| b.z).collect();
        if (sizes.len() as f64) * spacing < TYPICAL_OVER {
            return 1.0;
        }
        sizes.sort_by(f64::total_cmp);
        let middle = MAD_TO_SIGMA * median(sizes.clone());
        middle.max(sizes[sizes.len() * 9 / 10] / 1.645).max(1.0)
    }

    /// The pulses with their best times and widths, each refined while the others are fitted.
    fn refine(&self, bells: Vec<Bell>) -> Option<Vec<Bell>> {
        let mut bells = bells;
        for i in 0..bells.len() {
            let fitted = self.linear.fit(&all_but(&bells, i))?;
            bells[i] = self.best_near(&fitted, &bells[i], false);
        }
        Some(bells)
    }

    /// Pulse of the largest size near `bell` in time, of any of the widths, added to a fit without `bell`; if `stands_out`, sizes are compared
    /// relative to those of chance pulses.
    fn best_near(&self, fitted: &Fitted, bell: &Bell, stands_out: bool) -> Bell {
        let mut best = Bell { z: -1.0, ..*bell };
        let mut largest = -1.0;
        let steps = (FINE_HALF_RANGE / FINE).round() as i32;
        for (w, &width) in PULSE_WIDTHS.iter().enumerate() {
            let (from, to) = self.linear.span(width);
            let chance = self.chance[bell.joint][w];
            for step in -steps..=steps {
                let time = (bell.time + f64::from(step) * FINE).max(from).min(to);
                let tried = self.linear.weigh(fitted, &Bell { time, width, ..*bell });
                let size = if stands_out { tried.z / chance } else { tried.z };
                if size > largest && fitted.bells.iter().all(|o| !tried.touches(o)) {
                    best = Bell { z: tried.z / chance, sigma: tried.sigma * chance, ..tried };
                    largest = size;
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::super::residual::Joint;
    use super::*;
    use crate::numeric::random::Random;

    const STEP: f64 = 0.01;
    /// Friction of the joint at rest, N m.
    const HOLDING: f64 = 0.25;

    /// Residual torque of a joint that always moves: scatter of a correlation time of 50 ms and of the standard deviation `scatter`, N m, beside pulses
    /// given as times, s, and heights, N m.
    fn residual(scatter: f64, pulses: &[(f64, f64)]) -> Residual<1> {
        drawn(5, scatter, HOLDING, pulses)
    }

    fn drawn(seed: u64, scatter: f64, holding: f64, pulses: &[(f64, f64)]) -> Residual<1> {
        let t: Vec<f64> = (0..1000).map(|i| STEP * f64::from(i)).collect();
        let mut random = Random(seed);
        let (decay, mut level) = ((-STEP / 0.05_f64).exp(), 0.0);
        let lack = |t: &f64| {
            level = decay * level + scatter * (1.0 - decay * decay).sqrt() * random.normal();
            let pulse = |(time, height): &(f64, f64)| {
                Bell { joint: 0, time: *time, width: 0.09, height: 0.0, sigma: 0.0, z: 0.0 }.at(*t) * height
            };
            level + pulses.iter().map(pulse).sum::<f64>()
        };
        let lack: Vec<f64> = t.iter().map(lack).collect();
        let columns = vec![vec![1.0; t.len()]];
        let rest = vec![0.0; t.len()];
        let joint = Joint { lack, columns, rest, holding, typical: 1.0 };
        Residual {
            activity: vec![vec![1.0; t.len()]],
            t,
            step: STEP,
            joints: [joint],
            prior: vec![(0.0, 0.1)],
        }
    }

    fn times(residual: &Residual<1>, remainder: bool) -> Vec<f64> {
        let mut times: Vec<f64> = search(residual, remainder).unwrap().bells.iter().map(|b| b.time).collect();
        times.sort_by(f64::total_cmp);
        times
    }

    #[test]
    fn pushes_that_hide_each_other_are_all_found() {
        let pulses = [(3.0, 0.8), (4.0, -0.7), (5.0, 0.8)];
        for remainder in [false, true] {
            let found = times(&residual(0.05, &pulses), remainder);
            assert_eq!(found.len(), 3, "{found:?}");
            assert!(found.iter().zip(&pulses).all(|(t, (time, _))| (t - time).abs() < 0.05), "{found:?}");
        }
    }

    #[test]
    fn a_push_next_to_an_end_of_the_log_is_found() {
        for time in [0.2, 9.79] {
            let found = times(&residual(0.05, &[(time, 0.8)]), false);
            assert!(found.len() == 1 && (found[0] - time).abs() < 0.05, "{found:?} for {time}");
        }
    }

    #[test]
    fn scatter_alone_is_hardly_ever_a_push() {
        let found = |seed: u64, remainder| times(&drawn(seed, 0.05, 0.0, &[]), remainder).len();
        for remainder in [false, true] {
            let pushes: usize = (0..20).map(|seed| found(seed, remainder)).sum();
            assert!(pushes <= 1, "{pushes} in 20 logs of ten seconds on a joint without friction");
        }
    }

    #[test]
    fn pushes_count_up_to_the_last_that_stands_out_beside_larger_ones() {
        for (sizes, count) in [
            (&[4.6, 3.9, 2.2, 4.5, 3.1, 2.1][..], 4),
            (&[2.7, 3.1, 2.8, 2.5], 0),
            (&[3.8, 1.8, 3.0], 1),
            (&[], 0),
        ] {
            assert_eq!(push_count(sizes), count, "{sizes:?}");
        }
    }

    #[test]
    fn lobes_of_a_random_torque_are_hardly_ever_pushes() {
        let pushes: usize = (0..20).map(|seed| times(&drawn(seed, 0.4, HOLDING, &[]), true).len()).sum();
        assert!(pushes <= 4, "{pushes} in 20 logs of ten seconds");
    }

    #[test]
    fn beside_a_remainder_a_pulse_below_the_scatter_of_friction_is_no_push() {
        let light = residual(0.01, &[(3.0, 2.0 * FRICTION_SCATTER * HOLDING)]);
        assert_eq!(times(&light, false).len(), 1);
        assert!(times(&light, true).is_empty());
        assert_eq!(search(&light, true).unwrap().light.len(), 1);
        let heavy = residual(0.01, &[(3.0, 5.0 * FRICTION_SCATTER * HOLDING)]);
        assert_eq!(times(&heavy, true).len(), 1);
    }
}
