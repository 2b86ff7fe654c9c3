//! Inner products of long columns, on the vector unit of the processor in use, and the RMS difference of columns in rows of joints.

use armgap_core::cpu::{Cpu, Kernel, Level};

/// Number of entries of the vectors in which inner products are summed.
const LANES: usize = 8;

/// Number of columns processed in one pass of an inner product: their sums are independent, so no sum waits for another.
const COLUMNS_AT_ONCE: usize = 4;

/// Inner products `x . y` of one column `x` with `K` columns `y` of equal length.
#[inline(always)]
fn dots<C: Cpu, const K: usize>(x: &[f64], y: [&[f64]; K]) -> [f64; K] {
    let (lead, tail) = x.as_chunks::<LANES>();
    let y = y.map(|y| y[..x.len()].as_chunks::<LANES>());
    let mut sums = [[0.0; LANES]; K];
    for (i, a) in lead.iter().enumerate() {
        for k in 0..K {
            let b = &y[k].0[i];
            for l in 0..LANES {
                sums[k][l] = C::fused(a[l], b[l], sums[k][l]);
            }
        }
    }
    std::array::from_fn(|k| {
        let rest = tail.iter().zip(y[k].1).map(|(a, b)| a * b).sum::<f64>();
        total(sums[k]) + rest
    })
}

/// Sum of all lanes of a vector. The function is not inlined, because compilers would then arrange the lanes in pairs for this sum and slow down
/// every step before it; the argument is a copy, because with a reference compilers may keep the lanes in memory throughout.
#[inline(never)]
fn total(sums: [f64; LANES]) -> f64 {
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]))
}

/// Inner product of every column of `left` with every column of `right`; row by row of `left`.
struct Cross<'a> {
    left: &'a [&'a [f64]],
    right: &'a [&'a [f64]],
}

impl Kernel for Cross<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<C: Cpu>(self) -> Vec<f64> {
        let mut products = Vec::with_capacity(self.left.len() * self.right.len());
        for x in self.left {
            let (groups, rest) = self.right.as_chunks::<COLUMNS_AT_ONCE>();
            for group in groups {
                products.extend(dots::<C, COLUMNS_AT_ONCE>(x, *group));
            }
            for y in rest {
                products.extend(dots::<C, 1>(x, [y]));
            }
        }
        products
    }
}

/// Inner product of every column of `left` with every column of `right`; row by row of `left`.
pub fn cross(left: &[&[f64]], right: &[&[f64]]) -> Vec<f64> {
    Level::detect().run(Cross { left, right })
}

/// Inner products of each column from the one with index `first` on with the columns before it and itself; row by row.
struct LowerRows<'a> {
    columns: &'a [&'a [f64]],
    first: usize,
}

impl Kernel for LowerRows<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<C: Cpu>(self) -> Vec<f64> {
        let count = self.columns.len();
        let mut products = Vec::with_capacity(count * (count + 1) / 2);
        for i in self.first..count {
            let (groups, rest) = self.columns[..=i].as_chunks::<COLUMNS_AT_ONCE>();
            for group in groups {
                products.extend(dots::<C, COLUMNS_AT_ONCE>(self.columns[i], *group));
            }
            for y in rest {
                products.extend(dots::<C, 1>(self.columns[i], [y]));
            }
        }
        products
    }
}

/// Inner products of each column from the one with index `first` on with the columns before it and itself; row by row, each one longer than the row
/// before.
pub fn lower_rows(columns: &[&[f64]], first: usize) -> Vec<f64> {
    Level::detect().run(LowerRows { columns, first })
}

/// Two columns whose inner product is computed.
struct Pair<'a>(&'a [f64], &'a [f64]);

impl Kernel for Pair<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<C: Cpu>(self) -> f64 {
        dots::<C, 1>(self.0, [self.1])[0]
    }
}

/// Inner product `x . y` over the length of the shorter column.
pub fn product(x: &[f64], y: &[f64]) -> f64 {
    let count = x.len().min(y.len());
    Level::detect().run(Pair(&x[..count], &y[..count]))
}

/// Squared Euclidean length of every column.
pub fn squares(columns: &[&[f64]]) -> Vec<f64> {
    columns.iter().map(|column| product(column, column)).collect()
}

/// RMS difference by joint of two columns whose rows of `N` joints follow each other, in their unit.
pub(crate) fn rms<const N: usize>(measured: &[f64], predicted: &[f64]) -> Vec<f64> {
    let rows = (measured.len() / N).max(1) as f64;
    let squares = |j: usize| -> f64 {
        measured.iter().zip(predicted).skip(j).step_by(N).map(|(a, b)| (a - b).powi(2)).sum()
    };
    (0..N).map(|j| (squares(j) / rows).sqrt()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_sums_of_products() {
        let column = |n: usize, a: f64| -> Vec<f64> { (0..n).map(|i| (a * i as f64).sin()).collect() };
        for n in [0, 1, 7, 8, 9, 200] {
            let (x, y, z) = (column(n, 0.3), column(n, 1.1), column(n, 2.3));
            let products = cross(&[&x, &y], &[&x, &y, &z, &x, &z]);
            let plain = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let expected = [&x, &y].map(|a| [&x, &y, &z, &x, &z].map(|b| plain(a, b))).concat();
            for (got, expected) in products.iter().zip(expected) {
                assert!((got - expected).abs() < 1e-13 * (1.0 + n as f64), "{n}: {got} {expected}");
            }
            let rows = lower_rows(&[&x, &y, &z], 1);
            assert_eq!(rows, [&cross(&[&y], &[&x, &y])[..], &cross(&[&z], &[&x, &y, &z])].concat());
            assert!((squares(&[&z])[0] - plain(&z, &z)).abs() < 1e-13 * (1.0 + n as f64));
        }
    }
}
