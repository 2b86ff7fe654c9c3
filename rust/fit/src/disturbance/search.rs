//! Pushes in the residual torque of one log: Gaussian pulses that stand out after the fit of all possible model errors.
//!
//! Parameters, unknown effects and pulses are fitted together, linearly; the gain of a pulse at one time, of one width, on one joint is compared with
//! the scatter around the pulse and reduced by the part that other columns could imitate (generalised likelihood ratio). The largest pulses are added
//! one by one, as one push hides another by raising the scatter. Doubtful pulses are then removed, and, where the model leaves errors unexplained,
//! also pulses that stand out only while they are fitted.

use super::bell::{Bell, all_but};
use super::linear::{Fitted, Linear};
use super::residual::Residual;
use super::scatter::MAD_TO_SIGMA;
use crate::log::track::median;
use rayon::prelude::*;

/// Standard deviations of the Gaussian pulses looked for, after the low-pass, s.
const PULSE_WIDTHS: [f64; 7] = [0.045, 0.055, 0.07, 0.09, 0.115, 0.145, 0.18];

/// Spacing of the times of pulses tried in the coarse search, s.
const COARSE: f64 = 0.02;

/// Spacing of the times of pulses tried in the fine search, s.
const FINE: f64 = 0.01;

/// Half range of times of the fine search around a pulse, s.
const FINE_HALF_RANGE: f64 = 0.08;

/// Size, in standard deviations, from which a pulse is tried as a push.
const TRIED_PULSE: f64 = 2.5;

/// Size, in standard deviations, from which a pulse is a push where the model describes the arm.
const LIKELY_PULSE: f64 = 5.0;

/// Size, in standard deviations, from which a pulse is a push where the model leaves errors unexplained and the pulse exceeds the joint's friction.
const ABOVE_REMAINDER: f64 = 3.9;

/// Size, in standard deviations, from which a pulse is a push where the model leaves errors unexplained, whatever the joint's friction.
const CERTAIN_PULSE: f64 = 12.0;

/// Size, in standard deviations, that the largest pulse of a log must have for pushes to be looked for, while the scatter of the residual torque
/// still contains all pulses. In a log without such a pulse there is no push, and there are no pushes that hide each other.
const PROMINENT_PULSE: f64 = 3.6;

/// Least height of a push relative to the joint's friction at rest, where the model leaves errors unexplained.
const ABOVE_FRICTION: f64 = 1.2;

/// Largest number of pushes looked for in one log; so many are no rare events but something that the arm repeats.
pub const MAX_PUSHES: usize = 8;

/// Least time that a joint must move in a log for pushes on it to be looked for, s.
const MOVES: f64 = 0.5;

/// Pushes found in a log, and the size of the largest pulse that is no push.
pub struct Found {
    /// Gaussian pulses that count as pushes, in the order in which they were found.
    pub bells: Vec<Bell>,
    /// Size, in standard deviations, of the largest pulse that is no push.
    pub rest: f64,
}

impl Found {
    /// Removes the pulse with index `bell` and keeps its size as that of a pulse that is no push.
    fn dismiss(&mut self, bell: usize) {
        self.rest = f64::max(self.rest, self.bells.remove(bell).z.min(LIKELY_PULSE));
    }
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
    let bells = search.gather()?;
    let mut found = Found { bells, rest: TRIED_PULSE };
    search.drop_doubtful(&mut found)?;
    if remainder {
        search.drop_aided(&mut found)?;
    }
    Some(found)
}

impl<const N: usize> Search<'_, N> {
    /// Adds the largest pulses one by one, each fitted in time and width; `None` if the linear fit is singular.
    fn gather(&mut self) -> Option<Vec<Bell>> {
        let mut bells: Vec<Bell> = Vec::new();
        loop {
            let fitted = self.linear.settle(&bells)?;
            let largest = self.scan(&fitted);
            if bells.is_empty() && largest.is_none_or(|b| b.z < PROMINENT_PULSE) {
                return Some(bells);
            }
            bells = self.refine(bells)?;
            let Some(next) = largest.filter(|b| b.z > TRIED_PULSE) else { return Some(bells) };
            if bells.len() == MAX_PUSHES {
                return Some(bells);
            }
            bells.push(next);
            bells = self.refine(bells)?;
        }
    }

    /// Removes pulses that are too small to count as pushes when fitted together with the others, the weakest first.
    fn drop_doubtful(&mut self, found: &mut Found) -> Option<()> {
        while !found.bells.is_empty() {
            self.settle(&mut found.bells)?;
            let doubt = |b: &Bell| if self.stands(b) { b.z } else { 0.0 };
            let sizes: Vec<f64> = found.bells.iter().map(doubt).collect();
            let weakest = least(&sizes)?;
            if self.stands(&found.bells[weakest]) {
                break;
            }
            found.dismiss(weakest);
        }
        Some(())
    }

    /// Removes pulses that stand out only while they are fitted, the weakest first: where the model leaves errors unexplained, a pulse takes up
    /// errors around it, lowers the scatter there and so appears to stand out.
    fn drop_aided(&mut self, found: &mut Found) -> Option<()> {
        while !found.bells.is_empty() {
            let bells = &found.bells;
            let unaided = |i| if self.stands(&bells[i]) { self.unaided(bells, i) } else { Some(0.0) };
            let sizes: Vec<f64> = (0..bells.len()).map(unaided).collect::<Option<_>>()?;
            let weakest = least(&sizes)?;
            if sizes[weakest] > PROMINENT_PULSE {
                break;
            }
            found.dismiss(weakest);
            self.settle(&mut found.bells)?;
        }
        Some(())
    }

    /// Refines the times and widths of all pulses in a common fit, with sizes in standard deviations of the residual torque that the fit leaves.
    fn settle(&mut self, bells: &mut Vec<Bell>) -> Option<()> {
        let fitted = self.linear.settle(bells)?;
        self.scan(&fitted);
        *bells = self.refine(std::mem::take(bells))?;
        Some(())
    }

    /// Whether a pulse is large enough to count as a push.
    fn stands(&self, bell: &Bell) -> bool {
        let above = bell.height.abs() > ABOVE_FRICTION * self.linear.residual.joints[bell.joint].holding;
        if self.remainder {
            bell.z > CERTAIN_PULSE || (bell.z > ABOVE_REMAINDER && above)
        } else {
            bell.z > LIKELY_PULSE
        }
    }

    /// Size, in standard deviations, of the pulse with index `i` in a fit of the other pulses alone, so that its own torque enlarges the standard
    /// deviation.
    fn unaided(&mut self, bells: &[Bell], i: usize) -> Option<f64> {
        let others = all_but(bells, i);
        let fitted = self.linear.settle(&others)?;
        self.scan(&fitted);
        Some(self.best_near(&fitted, &bells[i], true).z)
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
        let count = ((to - from) / COARSE).floor().max(0.0) as usize;
        let tried: Vec<Bell> = (0..count)
            .map(|i| from + i as f64 * COARSE)
            .map(|time| Bell { joint, time, width, height: 0.0, sigma: 0.0, z: 0.0 })
            .map(|bell| self.linear.weigh(fitted, &bell))
            .collect();
        let chance = self.typical(joint, &tried);
        let apart = |b: &Bell| fitted.bells.iter().all(|o| !b.touches(o));
        let best = tried.into_iter().filter(apart).max_by(|a, b| a.z.total_cmp(&b.z));
        (chance, best.map(|best| Bell { z: best.z / chance, ..best }))
    }

    /// Typical size, in standard deviations, of chance pulses of one width while the joint moves; at least one.
    fn typical(&self, joint: usize, tried: &[Bell]) -> f64 {
        let t = &self.linear.residual.t;
        let moves =
            |b: &&Bell| self.linear.moving[joint][t.partition_point(|t| *t < b.time).min(t.len() - 1)] > 0.5;
        let mut sizes: Vec<f64> = tried.iter().filter(moves).map(|b| b.z).collect();
        if sizes.len() < 20 {
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

/// Index of the smallest number.
fn least(sizes: &[f64]) -> Option<usize> {
    (0..sizes.len()).min_by(|&a, &b| sizes[a].total_cmp(&sizes[b]))
}
