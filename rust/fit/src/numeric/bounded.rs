//! Linear least squares between bounds, by active sets.

use nalgebra::{DMatrix, DVector};

/// Relative regularisation of the normal equations: directions without excitation stay solvable.
const RIDGE: f64 = 1e-10;
/// Decrease of the cost per unit of a parameter, as a part of the largest entry of the right side, from which the active set method leaves
/// a bound.
const SETTLED: f64 = 1e-9;
/// Rounds of the active set method per parameter at most.
const MOST_ROUNDS: usize = 6;

/// Minimise `x' G x / 2 - g' x` between bounds by active sets (Stark and Parker 1995, "Bounded-variable least squares").
///
/// `gram` is the symmetric positive semidefinite matrix `G`, n by n, row by row, `right` the vector `g`; `low` and `high` may be infinite. The
/// first active set is that of the minimum without bounds. None where the equations have no finite solution or the lengths disagree.
pub fn bounded_least_squares(gram: &[f64], right: &[f64], low: &[f64], high: &[f64]) -> Option<Vec<f64>> {
    let n = right.len();
    if gram.len() != n * n || low.len() != n || high.len() != n {
        return None;
    }
    if n == 0 {
        return Some(Vec::new());
    }
    let gram = DMatrix::from_row_slice(n, n, gram);
    let size = DVector::from_fn(n, |i, _| if gram[(i, i)] == 0.0 { 1.0 } else { gram[(i, i)].sqrt() });
    let scaled = |values: &[f64]| DVector::from_fn(n, |i, _| values[i] * size[i]);
    let problem = Problem {
        gram: DMatrix::from_fn(n, n, |i, l| {
            gram[(i, l)] / (size[i] * size[l]) + if i == l { RIDGE } else { 0.0 }
        }),
        right: DVector::from_fn(n, |i, _| right[i] / size[i]),
        low: scaled(low),
        high: scaled(high),
    };
    let x = problem.solve()?;
    x.iter().all(|value| value.is_finite()).then(|| x.component_div(&size).as_slice().to_vec())
}

struct Problem {
    gram: DMatrix<f64>,
    right: DVector<f64>,
    low: DVector<f64>,
    high: DVector<f64>,
}

impl Problem {
    fn solve(&self) -> Option<DVector<f64>> {
        let n = self.right.len();
        let least =
            self.gram.clone().lu().solve(&self.right).filter(|x| x.iter().all(|value| value.is_finite()))?;
        let mut x = DVector::from_fn(n, |i, _| least[i].max(self.low[i]).min(self.high[i]));
        let mut free: Vec<bool> = (0..n).map(|i| self.low[i] < x[i] && x[i] < self.high[i]).collect();
        let settled = SETTLED * self.right.amax().max(f64::MIN_POSITIVE);
        for _ in 0..MOST_ROUNDS * n {
            let target = self.minimum_over(&free, &x)?;
            let (step, blocked) = self.step_within(&x, &target, &free);
            x += (&target - &x) * step;
            if let Some(i) = blocked {
                x[i] = if target[i] < self.low[i] { self.low[i] } else { self.high[i] };
                free[i] = false;
                continue;
            }
            let slope = &self.gram * &x - &self.right;
            // A bound is left where the cost falls towards the inside.
            let inward = |i: usize| if x[i] <= self.low[i] { -slope[i] } else { slope[i] };
            let held = (0..n).filter(|&i| !free[i] && self.low[i] < self.high[i]);
            match held.max_by(|&a, &b| inward(a).total_cmp(&inward(b))) {
                Some(best) if inward(best) > settled => free[best] = true,
                _ => break,
            }
        }
        Some(x)
    }

    /// Minimum over the free parameters, the others held at `x`.
    fn minimum_over(&self, free: &[bool], x: &DVector<f64>) -> Option<DVector<f64>> {
        let moving: Vec<usize> = (0..free.len()).filter(|&i| free[i]).collect();
        let mut target = x.clone();
        if moving.is_empty() {
            return Some(target);
        }
        let reduced = DMatrix::from_fn(moving.len(), moving.len(), |a, b| self.gram[(moving[a], moving[b])]);
        let right = DVector::from_fn(moving.len(), |a, _| {
            let held: f64 =
                (0..free.len()).filter(|&l| !free[l]).map(|l| self.gram[(moving[a], l)] * x[l]).sum();
            self.right[moving[a]] - held
        });
        for (&i, &value) in moving.iter().zip(&reduced.lu().solve(&right)?) {
            target[i] = value;
        }
        Some(target)
    }

    /// Largest step towards `target` within the bounds, as a part up to 1, and the parameter whose bound stops it.
    fn step_within(&self, x: &DVector<f64>, target: &DVector<f64>, free: &[bool]) -> (f64, Option<usize>) {
        let (mut step, mut blocked) = (1.0, None);
        for i in (0..free.len()).filter(|&i| free[i]) {
            let bound = if target[i] < self.low[i] {
                self.low[i]
            } else if target[i] > self.high[i] {
                self.high[i]
            } else {
                continue;
            };
            let part = (bound - x[i]) / (target[i] - x[i]);
            if part < step {
                (step, blocked) = (part.max(0.0), Some(i));
            }
        }
        (step, blocked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal equations of two correlated columns; the minimum without bounds is (2, -1).
    const GRAM: [f64; 4] = [4.0, 1.0, 1.0, 9.0];
    const RIGHT: [f64; 2] = [7.0, -7.0];

    #[test]
    fn wide_bounds_leave_the_minimum() {
        let x = bounded_least_squares(&GRAM, &RIGHT, &[-9.0, -9.0], &[9.0, f64::INFINITY]).expect("solvable");
        assert!((x[0] - 2.0).abs() < 1e-8 && (x[1] + 1.0).abs() < 1e-8, "{x:?}");
    }

    #[test]
    fn a_bound_moves_the_other_parameter() {
        let x = bounded_least_squares(&GRAM, &RIGHT, &[-9.0, 0.0], &[9.0, 9.0]).expect("solvable");
        assert_eq!(x[1], 0.0);
        assert!((x[0] - 7.0 / 4.0).abs() < 1e-8, "{x:?}");
    }

    #[test]
    fn equal_bounds_hold_a_parameter() {
        let x = bounded_least_squares(&GRAM, &RIGHT, &[1.0, -9.0], &[1.0, 9.0]).expect("solvable");
        assert!((x[0] - 1.0).abs() < 1e-15 && (x[1] + 8.0 / 9.0).abs() < 1e-8, "{x:?}");
    }

    #[test]
    fn beside_a_parameter_that_is_held_another_leaves_its_bound() {
        // Without bounds the minimum is (4, -5, 3): the first guess clips the second parameter to its bound, which it has to leave once the first
        // one, held at zero, pulls it up; the third is held and would like to grow.
        let gram = [1.0, 0.8, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, 1.0];
        let right = [0.0, -1.8 + 4.0 * 0.8 - 0.4, 3.0];
        let x = bounded_least_squares(&gram, &right, &[0.0, 0.0, 0.0], &[0.0, 9.0, 0.0]).expect("solvable");
        assert!((x[1] - right[1]).abs() < 1e-8 && x[0] == 0.0 && x[2] == 0.0, "{x:?}");
    }

    #[test]
    fn no_parameter_has_an_empty_solution() {
        assert_eq!(bounded_least_squares(&[], &[], &[], &[]), Some(Vec::new()));
    }

    #[test]
    fn a_column_of_zeros_is_held_by_the_regularisation() {
        let x = bounded_least_squares(&[4.0, 0.0, 0.0, 0.0], &[8.0, 0.0], &[0.0, 1.0], &[9.0, 9.0])
            .expect("solvable");
        assert!((x[0] - 2.0).abs() < 1e-8 && (x[1] - 1.0).abs() < 1e-15, "{x:?}");
    }

    #[test]
    fn numbers_that_are_not_finite_have_no_solution() {
        assert_eq!(bounded_least_squares(&GRAM, &[f64::NAN, 0.0], &[0.0; 2], &[1.0; 2]), None);
        assert_eq!(bounded_least_squares(&GRAM, &RIGHT, &[0.0], &[1.0]), None);
    }
}
