//! Inner products of long columns, with the vector unit of the processor at hand.

use armgap_core::cpu::{Cpu, Level, Work};

/// Entries taken together.
const LANES: usize = 8;

/// `x . y`.
#[inline(always)]
fn dot<C: Cpu>(x: &[f64], y: &[f64]) -> f64 {
    let ((x_lead, x_tail), (y_lead, y_tail)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (a, b) in x_lead.iter().zip(y_lead) {
        for l in 0..LANES {
            sums[l] = C::fused(a[l], b[l], sums[l]);
        }
    }
    let rest: f64 = x_tail.iter().zip(y_tail).map(|(a, b)| a * b).sum();
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + rest
}

/// Every product of a column of `left` with a column of `right`; row by row of `left`.
struct Cross<'a> {
    left: &'a [&'a [f64]],
    right: &'a [&'a [f64]],
}

impl Work for Cross<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<C: Cpu>(self) -> Vec<f64> {
        let mut products = Vec::with_capacity(self.left.len() * self.right.len());
        for x in self.left {
            for y in self.right {
                products.push(dot::<C>(x, y));
            }
        }
        products
    }
}

/// Every product of a column of `left` with a column of `right`; row by row of `left`.
pub fn cross(left: &[&[f64]], right: &[&[f64]]) -> Vec<f64> {
    Level::detect().run(Cross { left, right })
}

/// The squared length of every column.
pub fn squares(columns: &[&[f64]]) -> Vec<f64> {
    columns.iter().map(|column| cross(&[*column], &[*column])[0]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_sums_of_products() {
        let column = |n: usize, a: f64| -> Vec<f64> { (0..n).map(|i| (a * i as f64).sin()).collect() };
        for n in [0, 1, 7, 8, 9, 200] {
            let (x, y, z) = (column(n, 0.3), column(n, 1.1), column(n, 2.3));
            let products = cross(&[&x, &y], &[&x, &y, &z]);
            let plain = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let expected = [&x, &y].map(|a| [&x, &y, &z].map(|b| plain(a, b))).concat();
            for (got, expected) in products.iter().zip(expected) {
                assert!((got - expected).abs() < 1e-13 * (1.0 + n as f64), "{n}: {got} {expected}");
            }
            assert!((squares(&[&z])[0] - plain(&z, &z)).abs() < 1e-13 * (1.0 + n as f64));
        }
    }
}
