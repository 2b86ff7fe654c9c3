//! Pushes in the lacking torque of one log: bells that stand out once everything the model could be wrong by has been allowed for.
//!
//! Parameters, unknown laws and pushes are fitted together, linearly; what a bell at one time, of one width, on one joint would gain is
//! weighed against the scatter there and against how much of the bell the other columns could imitate (a generalised likelihood ratio).
//! The largest are added one by one, for one push hides another by raising the scatter, and then the doubtful are taken out again; beside a
//! remainder also those that stand out only as long as they are fitted.

use super::residual::{LOW_PASS, Residual};
use super::scatter::scatter;
use crate::products::{cross, product};
use crate::solve::scaled_inverse;
use crate::track::median;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Standard deviations of bells that are looked for, as they appear behind the low-pass, s.
const WIDTHS: [f64; 7] = [0.045, 0.055, 0.07, 0.09, 0.115, 0.145, 0.18];

/// Distance of centres that are tried, s, coarse and fine, and how far a fine search goes.
const COARSE: f64 = 0.02;
const FINE: f64 = 0.01;
const REFINED: f64 = 0.08;

/// Correlation time of what a model lacks, s, where its columns are fitted and where pushes are judged.
const MODEL_TIME: f64 = 0.25;
const JUDGED_TIME: f64 = 0.06;

/// Scatter relative to the typical torque below which the columns are not fitted more closely: a joint that is hardly driven could
/// otherwise be explained by parameters of next to nothing.
const MODEL_SCATTER: f64 = 0.05;

/// A bell of which less is left by the other columns cannot be told from them.
const DISTINCT: f64 = 0.15;

/// Size, in standard deviations, from which a bell is tried, and from which it is a push: on an arm that the model describes; on one
/// that it does not, if the bell also exceeds the joint's friction; on any.
const TRIED: f64 = 2.5;
const LIKELY: f64 = 5.0;
const ABOVE_REMAINDER: f64 = 3.9;
const CERTAIN: f64 = 12.0;

/// Size that a bell has to have while what it consists of still counts as scatter. A log whose largest bell is smaller holds no push, not
/// even ones that hide each other.
const STANDS_OUT: f64 = 3.6;

/// Height, relative to the joint's friction at rest, from which a push exceeds it.
const ABOVE_FRICTION: f64 = 1.2;

/// Pushes that are looked for in one log; as many are no rare events.
pub const MOST: usize = 8;

/// A joint that moves for less than this, s, is not judged.
const MOVES: f64 = 0.5;

/// Two bells on the same joint are apart by this, s.
const APART: f64 = 0.3;

/// First guess of the scatter relative to the typical torque, and rounds until it follows the residual.
const FIRST_SCATTER: f64 = 0.15;
const ROUNDS: usize = 4;

/// Largest amplitude of a push relative to the typical torque of its joint.
const LARGEST: f64 = 20.0;

/// A bell on one joint.
#[derive(Debug, Clone, Copy)]
pub struct Bell {
    /// 0-based joint.
    pub joint: usize,
    /// Time of the centre, s.
    pub time: f64,
    /// Standard deviation as it appears behind the low-pass, s.
    pub width: f64,
    /// Height, N m.
    pub height: f64,
    /// Standard deviation of the height.
    pub sigma: f64,
    /// Size in standard deviations of what bells of its kind have elsewhere in the log.
    pub z: f64,
}

impl Bell {
    /// Impulse, N m s.
    pub fn impulse(&self) -> f64 {
        self.height * self.width * std::f64::consts::TAU.sqrt()
    }

    /// Length of the rectangle that is spread as far as the bell before the low-pass, s.
    pub fn duration(&self) -> f64 {
        12.0_f64.sqrt() * (self.width.powi(2) - LOW_PASS.powi(2)).max(0.0).sqrt()
    }

    fn at(&self, t: f64) -> f64 {
        let x = (t - self.time) / self.width;
        if x.abs() > 5.0 { 0.0 } else { (-0.5 * x * x).exp() }
    }
}

/// The pushes of a log and the largest of what is left.
pub struct Found {
    /// Pushes, in the order in which they were found.
    pub bells: Vec<Bell>,
    /// Size of the largest bell that is none.
    pub rest: f64,
}

/// A linear fit of all columns and of some bells.
struct Fitted {
    /// What is left, per joint.
    left: Vec<Vec<f64>>,
    /// Inverse of the normal matrix.
    inverse: DMatrix<f64>,
    /// Bells in the fit.
    bells: Vec<Bell>,
    /// Weights per joint and point: those that bells are judged with, and those that the columns are fitted with.
    weights: Vec<[Vec<f64>; 2]>,
}

struct Search<'a, const N: usize> {
    residual: &'a Residual<N>,
    /// Whether the model leaves more unexplained than noise.
    remainder: bool,
    /// Share of the time that each joint moves at each point.
    moving: Vec<Vec<f64>>,
    /// Standard deviation per joint and point.
    scatter: Vec<Vec<f64>>,
    /// Size of chance bells per joint and width, at least one.
    chance: Vec<Vec<f64>>,
}

/// Looks for pushes in a log; `remainder` tells whether the model leaves more unexplained than noise.
pub fn search<const N: usize>(residual: &Residual<N>, remainder: bool) -> Option<Found> {
    let moving: Vec<Vec<f64>> =
        residual.joints.iter().map(|x| x.rest.iter().map(|r| (1.0 - r).clamp(0.0, 1.0)).collect()).collect();
    let first = |x: &super::residual::Joint| vec![FIRST_SCATTER * x.typical.max(1e-9); residual.t.len()];
    let scatter = residual.joints.iter().map(first).collect();
    let chance = vec![vec![1.0; WIDTHS.len()]; N];
    let mut search = Search { residual, remainder, moving, scatter, chance };
    let mut bells: Vec<Bell> = Vec::new();
    loop {
        let fitted = search.settle(&bells)?;
        let largest = search.scan(&fitted);
        if bells.is_empty() && largest.is_none_or(|b| b.z < STANDS_OUT) {
            return Some(Found { bells, rest: TRIED });
        }
        bells = search.refine(bells)?;
        let Some(next) = largest.filter(|b| b.z > TRIED) else { break };
        if bells.len() == MOST {
            break;
        }
        bells.push(next);
        bells = search.refine(bells)?;
    }
    let mut rest = TRIED;
    while !bells.is_empty() {
        let fitted = search.settle(&bells)?;
        search.scan(&fitted);
        bells = search.refine(bells)?;
        let doubt = |b: &Bell| if search.stands(b) { b.z } else { 0.0 };
        let weakest = (0..bells.len()).min_by(|&a, &b| doubt(&bells[a]).total_cmp(&doubt(&bells[b])))?;
        if search.stands(&bells[weakest]) {
            break;
        }
        rest = f64::max(rest, bells.remove(weakest).z.min(LIKELY));
    }
    // Beside a remainder a bell that is fitted takes what the model lacks there for its own, and so seems to stand in a calm place.
    while remainder && !bells.is_empty() {
        let unaided = |i| if search.stands(&bells[i]) { search.unaided(&bells, i) } else { Some(0.0) };
        let unaided: Vec<f64> = (0..bells.len()).map(unaided).collect::<Option<_>>()?;
        let weakest = (0..bells.len()).min_by(|&a, &b| unaided[a].total_cmp(&unaided[b]))?;
        if unaided[weakest] > STANDS_OUT {
            break;
        }
        rest = f64::max(rest, bells.remove(weakest).z.min(LIKELY));
        let fitted = search.settle(&bells)?;
        search.scan(&fitted);
        bells = search.refine(bells)?;
    }
    Some(Found { bells, rest })
}

impl<const N: usize> Search<'_, N> {
    /// Whether a bell is a push.
    fn stands(&self, bell: &Bell) -> bool {
        let above = bell.height.abs() > ABOVE_FRICTION * self.residual.joints[bell.joint].holding;
        if self.remainder { bell.z > CERTAIN || (bell.z > ABOVE_REMAINDER && above) } else { bell.z > LIKELY }
    }

    /// Size of a bell beside the others where it has to stand out of a scatter that it raises itself.
    fn unaided(&mut self, bells: &[Bell], i: usize) -> Option<f64> {
        let others = all_but(bells, i);
        let fitted = self.settle(&others)?;
        self.scan(&fitted);
        Some(self.best_near(&fitted, &bells[i], true).z)
    }

    /// All columns and bells fitted, with the scatter that follows from what is left.
    fn settle(&mut self, bells: &[Bell]) -> Option<Fitted> {
        let mut fitted = self.fit(bells)?;
        for _ in 0..ROUNDS {
            self.scatter =
                (0..N).into_par_iter().map(|j| scatter(self.residual, j, &fitted.left[j])).collect();
            fitted = self.fit(bells)?;
        }
        Some(fitted)
    }

    fn fit(&self, bells: &[Bell]) -> Option<Fitted> {
        let residual = self.residual;
        let (c, k) = (residual.prior.len(), residual.prior.len() + bells.len());
        let (mut normal, mut right) = (DMatrix::<f64>::zeros(k, k), DVector::<f64>::zeros(k));
        for (i, (expected, sigma)) in residual.prior.iter().enumerate() {
            let precision = sigma.powi(-2).min(1e24);
            normal[(i, i)] += precision;
            right[i] += precision * expected;
        }
        for (i, bell) in bells.iter().enumerate() {
            normal[(c + i, c + i)] += (LARGEST * residual.joints[bell.joint].typical.max(1e-9)).powi(-2);
        }
        let rows: Vec<DMatrix<f64>> = (0..N).map(|j| self.rows(j, bells)).collect();
        let weights: Vec<[Vec<f64>; 2]> = (0..N).map(|j| self.weights(j)).collect();
        for j in 0..N {
            let count = residual.t.len();
            let columns: Vec<&[f64]> = rows[j].as_slice().chunks_exact(count).collect();
            let mut weighted = rows[j].clone();
            for column in weighted.as_mut_slice().chunks_exact_mut(count) {
                column.iter_mut().zip(&weights[j][1]).for_each(|(x, weight)| *x *= weight);
            }
            let weighted: Vec<&[f64]> = weighted.as_slice().chunks_exact(count).collect();
            normal += DMatrix::from_column_slice(k, k, &cross(&weighted, &columns));
            right -= DVector::from_column_slice(&cross(&weighted, &[&residual.joints[j].lack]));
        }
        let inverse = scaled_inverse(&normal)?;
        let values = &inverse * right;
        let left = (0..N).map(|j| {
            let joint = &residual.joints[j];
            let change = &rows[j] * &values;
            let held = joint.rest.iter().map(|rest| joint.holding * rest);
            let lack = joint.lack.iter().zip(change.iter()).map(|(r, d)| r + d);
            lack.zip(held).map(|(r, held)| r.signum() * (r.abs() - held).max(0.0)).collect()
        });
        let left = left.collect();
        Some(Fitted { left, inverse, bells: bells.to_vec(), weights })
    }

    /// Weights of joint `j`'s points where bells are judged, and where the columns are fitted.
    fn weights(&self, j: usize) -> [Vec<f64>; 2] {
        let tempering = self.residual.step / MODEL_TIME;
        let least = MODEL_SCATTER * self.residual.joints[j].typical;
        [0.0, least].map(|least| {
            let points = self.moving[j].iter().zip(&self.scatter[j]);
            points.map(|(moving, scatter)| tempering * moving / scatter.max(least).powi(2)).collect()
        })
    }

    /// Torque of joint `j` per unit of every column, then of every bell, which the model does not have.
    fn rows(&self, j: usize, bells: &[Bell]) -> DMatrix<f64> {
        let joint = &self.residual.joints[j];
        let c = joint.columns.len();
        DMatrix::from_fn(self.residual.t.len(), c + bells.len(), |i, k| match k.checked_sub(c) {
            None => joint.columns[k][i],
            Some(b) if bells[b].joint == j => -bells[b].at(self.residual.t[i]),
            Some(_) => 0.0,
        })
    }

    /// Size of a bell beside those of a fit, in standard deviations of a calm log, with its best height; zero where it is not distinct.
    fn weigh(&self, fitted: &Fitted, bell: &Bell) -> Bell {
        let (residual, j) = (self.residual, bell.joint);
        let (first, last) = self.reach(bell);
        let shape = bell.over(&residual.t[first..last], residual.step);
        let weighted = |weights: &Vec<f64>| -> Vec<f64> {
            shape.iter().zip(&weights[first..last]).map(|(shape, weight)| shape * weight).collect()
        };
        let [judged, heeded] = [0, 1].map(|w| weighted(&fitted.weights[j][w]));
        let columns = &residual.joints[j].columns;
        let parts: Vec<&[f64]> = columns.iter().chain([&fitted.left[j]]).map(|x| &x[first..last]).collect();
        let (c, k) = (columns.len(), columns.len() + fitted.bells.len());
        // What the bell shares with the columns, by the weights it is judged with and by those they are fitted with.
        let products = cross(&[&judged, &heeded], &parts);
        let mut shared = DMatrix::<f64>::zeros(k, 2);
        for (s, weighted) in [&judged, &heeded].into_iter().enumerate() {
            shared.column_mut(s).rows_mut(0, c).copy_from_slice(&products[s * (c + 1)..][..c]);
            for (b, other) in fitted.bells.iter().enumerate().filter(|(_, b)| b.joint == j) {
                let times = residual.t[first..last].iter();
                shared[(c + b, s)] = -times.zip(weighted).map(|(t, w)| w * other.at(*t)).sum::<f64>();
            }
        }
        let (along, full) = (products[c], product(&judged, &shape));
        let imitated = shared.column(0).dot(&(&fitted.inverse * shared.column(1)));
        let own = (full - imitated).max(0.02 * full).max(1e-300);
        let size = along / own.sqrt() * (MODEL_TIME / JUDGED_TIME).sqrt();
        let distinct = own > DISTINCT * full;
        let sigma = (JUDGED_TIME / MODEL_TIME / own).sqrt();
        Bell { height: along / own, sigma, z: if distinct { size.abs() } else { 0.0 }, ..*bell }
    }

    /// Times at which a bell lies within the log.
    fn span(&self, width: f64) -> (f64, f64) {
        let t = &self.residual.t;
        (t[0] + 2.0 * width, t[t.len() - 1] - 2.0 * width)
    }

    /// Grid points that a bell reaches.
    fn reach(&self, bell: &Bell) -> (usize, usize) {
        let t = &self.residual.t;
        let from = bell.time - 4.0 * bell.width;
        let to = bell.time + 4.0 * bell.width;
        (t.partition_point(|t| *t < from), t.partition_point(|t| *t <= to))
    }

    /// Bells of all widths over the log; keeps what their sizes typically are, and gives the largest.
    fn scan(&mut self, fitted: &Fitted) -> Option<Bell> {
        let moves = |j: usize| self.moving[j].iter().sum::<f64>() * self.residual.step > MOVES;
        let kinds: Vec<(usize, usize)> =
            (0..N).filter(|&j| moves(j)).flat_map(|j| (0..WIDTHS.len()).map(move |w| (j, w))).collect();
        let scanned: Vec<(f64, Option<Bell>)> =
            kinds.par_iter().map(|(joint, w)| self.scan_kind(fitted, *joint, WIDTHS[*w])).collect();
        let mut largest: Option<Bell> = None;
        for ((joint, w), (chance, best)) in kinds.into_iter().zip(scanned) {
            self.chance[joint][w] = chance;
            largest = largest.filter(|l| best.is_none_or(|b| l.z >= b.z)).or(best);
        }
        largest
    }

    /// Bells of one width on one joint: what their sizes typically are, and the largest in units of that.
    fn scan_kind(&self, fitted: &Fitted, joint: usize, width: f64) -> (f64, Option<Bell>) {
        let (from, to) = self.span(width);
        let count = ((to - from) / COARSE).floor().max(0.0) as usize;
        let tried: Vec<Bell> = (0..count)
            .map(|i| from + i as f64 * COARSE)
            .map(|time| Bell { joint, time, width, height: 0.0, sigma: 0.0, z: 0.0 })
            .map(|bell| self.weigh(fitted, &bell))
            .collect();
        let chance = self.typical(joint, &tried);
        let apart = |b: &Bell| fitted.bells.iter().all(|o| !b.touches(o));
        let best = tried.into_iter().filter(apart).max_by(|a, b| a.z.total_cmp(&b.z));
        (chance, best.map(|best| Bell { z: best.z / chance, ..best }))
    }

    /// Size that bells of one kind have by chance in this log, where the joint moves; at least one.
    fn typical(&self, joint: usize, tried: &[Bell]) -> f64 {
        let t = &self.residual.t;
        let moves = |b: &&Bell| self.moving[joint][t.partition_point(|t| *t < b.time).min(t.len() - 1)] > 0.5;
        let mut sizes: Vec<f64> = tried.iter().filter(moves).map(|b| b.z).collect();
        if sizes.len() < 20 {
            return 1.0;
        }
        sizes.sort_by(f64::total_cmp);
        let middle = 1.4826 * median(sizes.clone());
        middle.max(sizes[sizes.len() * 9 / 10] / 1.645).max(1.0)
    }

    /// Times and widths that fit each bell best beside the others.
    fn refine(&self, bells: Vec<Bell>) -> Option<Vec<Bell>> {
        let mut bells = bells;
        for i in 0..bells.len() {
            let fitted = self.fit(&all_but(&bells, i))?;
            bells[i] = self.best_near(&fitted, &bells[i], false);
        }
        Some(bells)
    }

    /// The bell that fits best near one that the fit leaves out, or the one that stands out most.
    fn best_near(&self, fitted: &Fitted, bell: &Bell, stands_out: bool) -> Bell {
        let mut best = Bell { z: -1.0, ..*bell };
        let mut largest = -1.0;
        let steps = (REFINED / FINE).round() as i32;
        for (w, &width) in WIDTHS.iter().enumerate() {
            let (from, to) = self.span(width);
            let chance = self.chance[bell.joint][w];
            for step in -steps..=steps {
                let time = (bell.time + f64::from(step) * FINE).max(from).min(to);
                let tried = self.weigh(fitted, &Bell { time, width, ..*bell });
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

/// All bells but one.
fn all_but(bells: &[Bell], i: usize) -> Vec<Bell> {
    bells.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, b)| *b).collect()
}

impl Bell {
    /// The bell at points of a regular grid, each from the one before: its logarithm is a parabola.
    fn over(&self, t: &[f64], step: f64) -> Vec<f64> {
        let step = step / self.width;
        let from = t.first().map_or(0.0, |t| (t - self.time) / self.width);
        let (mut value, bend) = ((-0.5 * from * from).exp(), (-step * step).exp());
        let mut ratio = (-step * (from + 0.5 * step)).exp();
        let next = |_| {
            let here = value;
            value *= ratio;
            ratio *= bend;
            here
        };
        t.iter().map(next).collect()
    }

    fn touches(&self, other: &Self) -> bool {
        self.joint == other.joint && (self.time - other.time).abs() < APART
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bell_over_a_grid_is_the_bell_at_its_points() {
        for (time, width) in [(3.004, 0.045), (2.7, 0.18)] {
            let bell = Bell { joint: 0, time, width, height: 0.0, sigma: 0.0, z: 0.0 };
            let t: Vec<f64> = (0..144).map(|i| time - 4.0 * width + 0.01 * f64::from(i)).collect();
            let near: Vec<f64> = t.into_iter().filter(|t| (t - time).abs() < 4.0 * width).collect();
            for (t, value) in near.iter().zip(bell.over(&near, 0.01)) {
                assert!((value / bell.at(*t) - 1.0).abs() < 1e-11, "{t}: {value}");
            }
        }
    }
}
