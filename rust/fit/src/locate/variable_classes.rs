//! Variable of the motion cut into classes of equal count, and the share of the time around a point that each class takes.

use crate::locate::table_form::TableForm;
use crate::locate::unnamed::LogResidual;
use crate::numeric::low_pass::LowPass;

/// Number of classes of a variable: a torque with two periods over the travel is resolved, and each class holds some hundred samples of a log of ten
/// seconds.
pub const CLASSES: usize = 16;

/// Variable of the motion cut into classes of equal count.
#[derive(Debug, Clone)]
pub struct Classes {
    /// Variable that is cut into classes, with the factor of the table.
    pub form: TableForm,
    /// Mean of the variable in each class, in its SI unit; `None` for an empty class.
    pub mean: [Option<f64>; CLASSES],
    /// For each point that is kept, the share of the low-pass filter's weights around the point that falls on samples in each class of the variable,
    /// each sample times its factor.
    pub share: Vec<[f64; CLASSES]>,
    /// Mean square of the factor over all samples, the factor's unit squared.
    pub factor_square: f64,
}

impl Classes {
    /// Classes of a variable over all logs, and their shares around the points `kept` of each log, for the low-pass filters `lows` of the logs.
    pub fn new<const N: usize>(
        form: TableForm,
        logs: &[LogResidual<N>],
        lows: &[LowPass],
        kept: &[Vec<usize>],
    ) -> Self {
        let along: Vec<Vec<[f64; 2]>> = logs.iter().map(|log| log.along(form)).collect();
        let values: Vec<Vec<f64>> = along.iter().map(|log| log.iter().map(|x| x[1]).collect()).collect();
        let edges = edges(values.concat());
        let class = |x: f64| edges.partition_point(|edge| *edge <= x);
        let (mut sum, mut count) = ([0.0; CLASSES], [0.0; CLASSES]);
        for x in values.iter().flatten() {
            sum[class(*x)] += x;
            count[class(*x)] += 1.0;
        }
        let mut share = Vec::new();
        for ((low, points), along) in lows.iter().zip(kept).zip(&along) {
            let classes: Vec<(f64, usize)> = along.iter().map(|[factor, x]| (*factor, class(*x))).collect();
            for (first, weights) in points.iter().map(|i| &low.kernels[*i]) {
                let mut around = [0.0; CLASSES];
                for (weight, (factor, class)) in weights.iter().zip(&classes[*first..]) {
                    around[*class] += weight * factor;
                }
                share.push(around);
            }
        }
        let mean = std::array::from_fn(|c| (count[c] > 0.0).then(|| sum[c] / count[c]));
        let factors: Vec<f64> = along.iter().flatten().map(|x| x[0] * x[0]).collect();
        let factor_square = factors.iter().sum::<f64>() / factors.len().max(1) as f64;
        Self { form, mean, share, factor_square }
    }
}

/// Edges between classes: quantiles of the values; equal values fall into one class.
pub fn edges(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let mut edges: Vec<f64> = (1..CLASSES).map(|k| values[k * values.len() / CLASSES]).collect();
    edges.dedup();
    edges
}
