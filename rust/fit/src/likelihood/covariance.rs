//! Covariance of fitted values, by the jackknife over blocks of windows.
//!
//! Blocks of consecutive windows are the independent observations (Künsch 1989): torques that no model describes are correlated from one window to the
//! next. Leaving block `b` out changes the fitted values, to first order, by
//!
//! ```text
//! d_b = (H - H_b)^-1 g_b,
//! ```
//!
//! with `H` the curvature of the cost, `H_b` the block's part of it and `g_b` its score. The sum of `d_b d_b'` is the jackknife's
//! covariance (Efron and Stein 1981; CR3 of Bell and `McCaffrey` 2002): unlike the scatter of scores it allows for a block that alone determines
//! a value and so fits it too well. The number of blocks that determine a value sets the Student distribution of its error: with
//! `a_b = H^-1 H_b H^-1`,
//!
//! ```text
//! freedom = (sum of a_b)^2 / sum of a_b^2        (diagonal elements; Satterthwaite 1946)
//! ```

use crate::likelihood::weighting::Gram;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::ops::Range;

/// Factor by which the variance of a fitted value grows when one block is left out, from which the block counts as indispensable to the value.
const INDISPENSABLE: f64 = 1e3;

/// Addition to the unit diagonal of a scaled curvature matrix that keeps it invertible.
const JITTER: f64 = 1e-12;

/// Degrees of freedom beyond which a Student distribution is taken as normal.
const NORMAL_DEGREES_OF_FREEDOM: f64 = 1e3;

/// Quantile of the standard normal distribution for a two-sided 95 % interval.
pub const NORMAL_95: f64 = 1.96;

/// Covariance of fitted values with the degrees of freedom of their variances.
#[derive(Debug, Clone)]
pub struct ParameterCovariance {
    /// Covariance matrix, with each block of windows as one independent observation.
    pub matrix: DMatrix<f64>,
    /// Degrees of freedom of each fitted value's variance.
    pub degrees_of_freedom: Vec<f64>,
}

impl ParameterCovariance {
    /// Covariance with infinite variances of `k` values.
    fn unknown(k: usize) -> Self {
        Self {
            matrix: DMatrix::from_diagonal_element(k, k, f64::INFINITY),
            degrees_of_freedom: vec![NORMAL_DEGREES_OF_FREEDOM; k],
        }
    }

    /// Covariance of values fitted with the inner products `gram`, with windows in `blocks`, under a prior of the precisions `prior_precision`. A value
    /// that changes no prediction is taken as uniformly distributed over the width `range`, one per value.
    pub fn new(gram: &Gram, blocks: &[Range<usize>], prior_precision: &[f64], range: &[f64]) -> Self {
        let k = prior_precision.len();
        let precision = |i: usize| gram.total[(i, i)] + prior_precision[i];
        let (seen, unseen): (Vec<usize>, Vec<usize>) = (0..k).partition(|&i| precision(i) > 0.0);
        let Some(known) = Determined::new(gram, blocks, prior_precision, &seen) else {
            return Self::unknown(k);
        };
        let mut spread =
            Self { matrix: DMatrix::zeros(k, k), degrees_of_freedom: vec![NORMAL_DEGREES_OF_FREEDOM; k] };
        for (a, &i) in seen.iter().enumerate() {
            for (b, &j) in seen.iter().enumerate() {
                spread.matrix[(i, j)] = known.covariance[(a, b)] / (precision(i) * precision(j)).sqrt();
            }
            spread.degrees_of_freedom[i] = known.degrees_of_freedom[a];
        }
        for i in unseen {
            spread.matrix[(i, i)] = range[i].powi(2) / 12.0;
        }
        spread
    }

    /// Factor by which the 95 % interval of value `i` is wider than that of a normal error.
    pub fn student_t_factor(&self, i: usize) -> f64 {
        StudentsT::new(0.0, 1.0, self.degrees_of_freedom[i])
            .map_or(1.0, |t| (t.inverse_cdf(0.975) / NORMAL_95).max(1.0))
    }
}

/// Covariance and degrees of freedom of the values on which predictions depend, each in units of its standard deviation given all other values.
struct Determined {
    covariance: DMatrix<f64>,
    degrees_of_freedom: Vec<f64>,
}

impl Determined {
    fn new(gram: &Gram, blocks: &[Range<usize>], prior_precision: &[f64], seen: &[usize]) -> Option<Self> {
        let k = seen.len();
        let unit: Vec<f64> =
            seen.iter().map(|&i| (gram.total[(i, i)] + prior_precision[i]).sqrt().recip()).collect();
        let trusted = DVector::from_fn(k, |a, _| prior_precision[seen[a]] * unit[a].powi(2));
        let mut curvature = DMatrix::from_fn(k, k, |a, b| gram.total[(seen[a], seen[b])] * unit[a] * unit[b]);
        curvature.set_diagonal(&(curvature.diagonal() + &trusted).add_scalar(JITTER));
        let whole = curvature.clone().cholesky()?;
        let inverse = whole.inverse();
        let mut covariance = &inverse * DMatrix::from_diagonal(&trusted) * &inverse;
        let mut sums: Vec<[f64; 2]> = covariance.diagonal().iter().map(|prior| [*prior, 0.0]).collect();
        let mut left = blocks.to_vec();
        while let Some(block) = left.pop() {
            let nothing = DMatrix::zeros(k, k);
            let within = block.clone().fold(nothing, |sum, w| sum + gram.within(w, seen, &unit));
            let score = |a: usize| block.clone().map(|w| gram.scores[w][seen[a]]).sum::<f64>() * unit[a];
            let product = &within * &inverse;
            let parts = (0..k).map(|a| inverse.column(a).dot(&product.column(a)));
            let rest = (&curvature - within).cholesky().filter(|rest| determines(rest, &whole));
            if rest.is_none() && block.len() > 1 {
                // Its windows may be dispensable one by one.
                left.extend(block.map(|w| w..w + 1));
                continue;
            }
            for (sum, part) in sums.iter_mut().zip(parts) {
                sum[0] += part;
                sum[1] += if rest.is_some() { part * part } else { 0.0 };
            }
            if let Some(rest) = rest {
                let mut moved = DVector::from_fn(k, |a, _| score(a));
                rest.solve_mut(&mut moved);
                covariance.ger(1.0, &moved, &moved, 1.0);
            } else {
                covariance += &inverse * product * relative_cost(gram, block.start);
            }
        }
        let degrees_of_freedom = sums
            .iter()
            .map(|[all, squares]| (all * all / squares).clamp(1.0, NORMAL_DEGREES_OF_FREEDOM))
            .collect();
        Some(Self { covariance, degrees_of_freedom })
    }
}

/// Cost of a window relative to the mean cost of all windows, at least one.
fn relative_cost(gram: &Gram, window: usize) -> f64 {
    let left = |score: &DVector<f64>| score[score.len() - 1];
    let average = gram.scores.iter().map(left).sum::<f64>() / gram.scores.len() as f64;
    if average > 0.0 { (left(&gram.scores[window]) / average).max(1.0) } else { 1.0 }
}

/// Whether the curvature of the cost over all blocks but one, with Cholesky factor `rest`, still determines every value given the values before it,
/// compared with the curvature over all windows, with Cholesky factor `whole`.
fn determines(rest: &Cholesky<f64, Dyn>, whole: &Cholesky<f64, Dyn>) -> bool {
    let (rest, whole) = (rest.l_dirty(), whole.l_dirty());
    (0..rest.nrows()).all(|i| rest[(i, i)].powi(2) * INDISPENSABLE > whole[(i, i)].powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::random::Random;

    /// Every one of `count` windows as a block of its own.
    fn alone(count: usize) -> Vec<Range<usize>> {
        (0..count).map(|w| w..w + 1).collect()
    }

    /// Two values fitted to noise, with regressor columns of the standard deviations `sizes` in each window: the values and their covariance.
    fn fitted(sizes: &[[f64; 2]], random: &mut Random) -> ([f64; 2], ParameterCovariance) {
        let (value, gram) = fitted_gram(sizes, random);
        (value, ParameterCovariance::new(&gram, &alone(sizes.len()), &[0.0; 2], &[1.0; 2]))
    }

    fn fitted_gram(sizes: &[[f64; 2]], random: &mut Random) -> ([f64; 2], Gram) {
        let mut rows: Vec<Vec<[f64; 3]>> = sizes
            .iter()
            .map(|size| {
                let loud = 1.0 + 0.5 * random.normal().abs();
                (0..20)
                    .map(|_| [size[0] * random.normal(), size[1] * random.normal(), loud * random.normal()])
                    .collect()
            })
            .collect();
        let size =
            (rows.iter().flatten().map(|r| r[2] * r[2]).sum::<f64>() / (20 * sizes.len()) as f64).sqrt();
        rows.iter_mut().flatten().for_each(|r| r[2] /= size);
        let products = |rows: &Vec<[f64; 3]>| -> Vec<f64> {
            (0..9).map(|i| rows.iter().map(|r| r[i / 3] * r[i % 3]).sum()).collect()
        };
        let total = Gram::of(rows.iter().map(products).collect(), 2).total;
        let seen = total.view((0, 0), (2, 2)) + DMatrix::from_diagonal_element(2, 2, JITTER);
        let value = seen.cholesky().unwrap().solve(&total.view((0, 2), (2, 1)));
        let left = |rows: &Vec<[f64; 3]>| {
            rows.iter().map(|r| [r[0], r[1], r[2] - r[0] * value[0] - r[1] * value[1]]).collect()
        };
        let gram = Gram::of(rows.iter().map(left).map(|r| products(&r)).collect(), 2);
        ([value[0], value[1]], gram)
    }

    #[test]
    fn intervals_hold_also_where_few_windows_bear_a_value() {
        let mut random = Random(7);
        let cases = 1000;
        let shares = |sizes: &[[f64; 2]], random: &mut Random| -> [f64; 2] {
            let mut held = [0.0; 2];
            for _ in 0..cases {
                let (value, spread) = fitted(sizes, random);
                for i in 0..2 {
                    let sigma = spread.matrix[(i, i)].sqrt() * spread.student_t_factor(i);
                    held[i] += f64::from(u8::from(value[i].abs() < NORMAL_95 * sigma)) / f64::from(cases);
                }
            }
            held
        };
        for few in [vec![1.0; 24], vec![1.0, 1.0, 1.0], vec![1.0, 0.5, 0.2], vec![1.0, 0.05], vec![1.0]] {
            let sizes: Vec<[f64; 2]> = (0..24).map(|w| [1.0, few.get(w).copied().unwrap_or(0.0)]).collect();
            for held in shares(&sizes, &mut random) {
                assert!((0.93..0.999).contains(&held), "{few:?}: {held}");
            }
        }
    }

    #[test]
    fn blocks_count_what_their_windows_share() {
        let mut random = Random(11);
        let (cases, blocks, each) = (400, 10, 4);
        let together: Vec<Range<usize>> = (0..blocks).map(|b| b * each..(b + 1) * each).collect();
        let mut held = [0.0; 2];
        for _ in 0..cases {
            let mut rows: Vec<[f64; 2]> = Vec::new();
            for _ in 0..blocks {
                let shared = random.normal();
                rows.extend((0..each).map(|_| [1.0, shared + 0.3 * random.normal()]));
            }
            let products =
                |row: &[f64; 2]| vec![row[0] * row[0], row[0] * row[1], row[0] * row[1], row[1] * row[1]];
            let mean = rows.iter().map(|row| row[1]).sum::<f64>() / rows.len() as f64;
            let left: Vec<Vec<f64>> = rows.iter().map(|row| products(&[row[0], row[1] - mean])).collect();
            let gram = Gram::of(left, 1);
            for (share, blocks) in held.iter_mut().zip([&together, &alone(rows.len())]) {
                let spread = ParameterCovariance::new(&gram, blocks, &[0.0], &[1.0]);
                let sigma = spread.matrix[(0, 0)].sqrt() * spread.student_t_factor(0);
                *share += f64::from(u8::from(mean.abs() < NORMAL_95 * sigma)) / f64::from(cases);
            }
        }
        assert!((0.92..0.98).contains(&held[0]) && held[1] < 0.8, "{held:?}");
    }

    #[test]
    fn a_block_that_alone_bears_a_value_is_taken_window_by_window() {
        let sizes: Vec<[f64; 2]> = (0..40).map(|w| [1.0, f64::from(u8::from((4..8).contains(&w)))]).collect();
        let (_, gram) = fitted_gram(&sizes, &mut Random(2));
        let blocks: Vec<Range<usize>> = (0..10).map(|b| 4 * b..4 * b + 4).collect();
        let spread = ParameterCovariance::new(&gram, &blocks, &[0.0; 2], &[1.0; 2]);
        assert!((2.0..4.5).contains(&spread.degrees_of_freedom[1]), "{:?}", spread.degrees_of_freedom);
    }

    #[test]
    fn freedom_counts_the_windows_that_bear_a_value() {
        let sizes: Vec<[f64; 2]> = (0..30).map(|w| [1.0, f64::from(u8::from(w < 3))]).collect();
        let (_, spread) = fitted(&sizes, &mut Random(1));
        assert!((20.0..30.0).contains(&spread.degrees_of_freedom[0]), "{}", spread.degrees_of_freedom[0]);
        assert!((2.0..3.01).contains(&spread.degrees_of_freedom[1]), "{}", spread.degrees_of_freedom[1]);
        assert!(spread.student_t_factor(0) < 1.07 && spread.student_t_factor(1) > 1.6);
    }

    #[test]
    fn a_value_no_prediction_depends_on_is_anywhere_in_its_range() {
        let (_, spread) = fitted(&[[1.0, 0.0]; 5], &mut Random(3));
        assert!((spread.matrix[(1, 1)] - 1.0 / 12.0).abs() < 1e-15);
    }

    #[test]
    fn a_trusted_value_keeps_its_trust() {
        let gram = Gram::of(vec![vec![1.0, 0.0, 0.5, 0.0, 1e-9, 0.0, 0.5, 0.0, 1.0]; 4], 2);
        let spread = ParameterCovariance::new(&gram, &alone(4), &[0.0, 25.0], &[1.0; 2]);
        assert!((spread.matrix[(1, 1)].sqrt() - 0.2).abs() < 1e-6);
        assert!(spread.student_t_factor(1) < 1.01);
    }
}
