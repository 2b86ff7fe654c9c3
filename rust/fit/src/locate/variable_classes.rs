//! Basis of a table: hat functions of a variable of the motion, or products of those of two, and their means over the time around a point.

use crate::locate::log_residual::LogResidual;
use crate::locate::table_form::{Place, TableForm};
use crate::numeric::low_pass::LowPass;

/// Number of classes of a variable: a torque with two periods over the travel is resolved, and each class holds some hundred samples of a log of ten
/// seconds.
pub const CLASSES: usize = 16;

/// Number of classes of each of two variables: a torque with a period and a half over the travel of either is resolved. Many cells hold no sample of a log
/// of ten seconds and take their values from those around them.
const SIDE: usize = 10;

/// A variable of the motion cut into classes of equal count, at whose means hat functions have their peaks, or two variables with the products of
/// their hat functions.
#[derive(Debug, Clone)]
pub struct Classes {
    /// Variables that are cut into classes, with the factor of the table.
    pub form: TableForm,
    /// Mean of the first and of the second variable in each of its classes, ascending, in its SI unit; empty for a second variable that there is not. The
    /// product of the hat functions `i` of the first and `k` of the second variable has the index `i * nodes[1].len() + k`.
    pub nodes: [Vec<f64>; 2],
    /// For each point that is kept, the mean of every hat function, or product, times the factor, weighted by the low-pass filter around the point.
    pub share: Vec<Vec<f64>>,
    /// Mean square of the factor over all samples, the factor's unit squared.
    pub factor_square: f64,
}

impl Classes {
    /// Classes of a form's variables over all logs, and their shares around the points `kept` of each log, for the low-pass filters `lows` of the logs.
    pub fn new<const N: usize>(
        form: TableForm,
        logs: &[LogResidual<N>],
        lows: &[LowPass],
        kept: &[Vec<usize>],
    ) -> Self {
        let along: Vec<Vec<Place>> = logs.iter().map(|log| log.along(form)).collect();
        let all = |of: fn(&Place) -> f64| along.iter().flatten().map(of).collect::<Vec<f64>>();
        let nodes = match form.second {
            None => [means(&all(|place| place.x), CLASSES), Vec::new()],
            Some(_) => [means(&all(|place| place.x), SIDE), means(&all(|place| place.y), SIDE)],
        };
        let side = nodes[1].len().max(1);
        let count = nodes[0].len() * side;
        let mut share = Vec::new();
        for ((low, points), along) in lows.iter().zip(kept).zip(&along) {
            let products = |place: &Place| {
                let second = hats(&nodes[1], place.y);
                hats(&nodes[0], place.x)
                    .map(|(i, a)| second.map(|(k, b)| (side * i + k, place.factor * a * b)))
                    .concat()
            };
            let at: Vec<Vec<(usize, f64)>> = along.iter().map(products).collect();
            for (start, weights) in points.iter().map(|i| &low.kernels[*i]) {
                let mut around = vec![0.0; count];
                for (weight, products) in weights.iter().zip(&at[*start..]) {
                    for (index, value) in products {
                        around[*index] += weight * value;
                    }
                }
                share.push(around);
            }
        }
        let factors = all(|place| place.factor * place.factor);
        let factor_square = factors.iter().sum::<f64>() / factors.len().max(1) as f64;
        Self { form, nodes, share, factor_square }
    }

    /// Number of hat functions, or products.
    pub fn count(&self) -> usize {
        self.nodes[0].len() * self.side()
    }

    /// Number of classes of the second variable; one where there is none.
    fn side(&self) -> usize {
        self.nodes[1].len().max(1)
    }

    /// Differences of the torque at a node from the line through its two neighbours along a variable, as three indices with their weights: zero for
    /// torques that are linear in either variable, a product of both among them.
    pub fn bends(&self) -> Vec<[(usize, f64); 3]> {
        let side = self.side();
        let along = |nodes: &[f64], start: usize, step: usize| -> Vec<[(usize, f64); 3]> {
            let bend = |(i, w): (usize, &[f64])| {
                let part = (w[1] - w[0]) / (w[2] - w[0]);
                [(i, part - 1.0), (i + 1, 1.0), (i + 2, -part)].map(|(i, weight)| (start + step * i, weight))
            };
            nodes.windows(3).enumerate().map(bend).collect()
        };
        let first = (0..side).flat_map(|k| along(&self.nodes[0], k, side));
        let second = (0..self.nodes[0].len()).flat_map(|i| along(&self.nodes[1], side * i, 1));
        first.chain(second).collect()
    }
}

/// Indices and values of the two hat functions with peaks at the ascending `nodes` that are not zero at `x`; beyond the outermost nodes, theirs is 1. One
/// function of value 1 where there are no nodes.
pub fn hats(nodes: &[f64], x: f64) -> [(usize, f64); 2] {
    let above = nodes.partition_point(|node| *node <= x);
    if above == 0 || above == nodes.len() {
        return [(above.saturating_sub(1), 1.0), (0, 0.0)];
    }
    let part = (x - nodes[above - 1]) / (nodes[above] - nodes[above - 1]);
    [(above - 1, 1.0 - part), (above, part)]
}

/// Means of values in classes of equal count, ascending, of which those without values are left out.
fn means(values: &[f64], classes: usize) -> Vec<f64> {
    let edges = edges(values.to_vec(), classes);
    let (mut sum, mut count) = (vec![0.0; classes], vec![0.0; classes]);
    for x in values {
        let class = edges.partition_point(|edge| edge <= x);
        sum[class] += x;
        count[class] += 1.0;
    }
    sum.into_iter().zip(count).filter(|(_, count)| *count > 0.0).map(|(sum, count)| sum / count).collect()
}

/// Edges between `classes` classes: quantiles of the values; equal values fall into one class.
pub fn edges(mut values: Vec<f64>, classes: usize) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let mut edges: Vec<f64> = (1..classes).map(|k| values[k * values.len() / classes]).collect();
    edges.dedup();
    edges
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::dependence::MotionVariable;

    fn classes(first: &[f64], second: &[f64]) -> Classes {
        let form = TableForm::over(MotionVariable::Time);
        Classes { form, nodes: [first.to_vec(), second.to_vec()], share: Vec::new(), factor_square: 1.0 }
    }

    #[test]
    fn torques_linear_in_each_variable_have_no_bends() {
        let (x, y) = ([-1.0, 0.0, 2.5, 3.0], [0.0, 0.5, 4.0]);
        let grid = classes(&x, &y);
        let cells: Vec<[f64; 2]> = x.iter().flat_map(|x| y.map(|y| [*x, y])).collect();
        assert_eq!(grid.count(), cells.len());
        let bent = |torque: &dyn Fn([f64; 2]) -> f64| -> Vec<f64> {
            let bend = |bend: [(usize, f64); 3]| bend.iter().map(|(c, w)| w * torque(cells[*c])).sum();
            grid.bends().into_iter().map(bend).collect()
        };
        // Two along each of the three columns, one along each of the four rows.
        assert_eq!(grid.bends().len(), 2 * 3 + 4);
        assert!(bent(&|[x, y]| 3.0 + x - 2.0 * y + 0.5 * x * y).iter().all(|b| b.abs() < 1e-12));
        assert_eq!(bent(&|[x, _]| x * x).iter().filter(|b| b.abs() > 1e-12).count(), 6);
        assert_eq!(bent(&|[_, y]| y * y).iter().filter(|b| b.abs() > 1e-12).count(), 4);
        assert_eq!(classes(&x, &[]).bends().len(), 2);
    }

    #[test]
    fn hat_functions_interpolate_and_their_sum_is_one() {
        let nodes = [-1.0, 0.5, 2.0];
        for x in [-3.0, -1.0, -0.2, 0.5, 1.9, 2.0, 8.0] {
            let values = hats(&nodes, x);
            assert!((values.iter().map(|v| v.1).sum::<f64>() - 1.0).abs() < 1e-12);
            let interpolated: f64 = values.iter().map(|(i, v)| nodes[*i] * v).sum();
            assert!((interpolated - x.clamp(-1.0, 2.0)).abs() < 1e-12, "{x}");
        }
        assert_eq!(hats(&[], 3.0)[0], (0, 1.0));
    }

    #[test]
    fn classes_are_of_equal_count_and_those_without_values_are_left_out() {
        let values: Vec<f64> = (0..400).map(f64::from).collect();
        assert_eq!(means(&values, 4), [49.5, 149.5, 249.5, 349.5]);
        let with_many_equal: Vec<f64> = (0..400).map(|k| f64::from((k - 300).max(0))).collect();
        let found = means(&with_many_equal, 8);
        assert!(found.len() < 8 && found.windows(2).all(|w| w[0] < w[1]), "{found:?}");
    }
}
