//! Regression of a residual torque on an arm's parameters and on tables, judged by logs that it was not fitted to.
//!
//! A table's torques are linear parameters, whose second differences are penalised (P-splines, Eilers and Marx, Statistical Science 11, 1996): a torque
//! that is linear in each variable costs nothing, and cells without samples take values from those around them.

use crate::locate::variable_classes::Classes;
use nalgebra::{DMatrix, DVector};

/// Number of points that count as one independent point, because their errors are correlated by the low-pass filter and by the residual torque
/// itself.
const CORRELATED: f64 = 10.0;

/// Part of a further point of zero torque by which a class is held in the table that results show: so little that the arm file's standard deviations
/// decide what of the torque the parameters take, and enough for cells that no sample is near.
const ANCHORED: f64 = 1e-3;

/// Shares of the residual torque's mean square that a regression may leave, with which its prior precisions are multiplied: those of a residual torque
/// of which nothing is explained are too strong for one that is mostly explained.
const LEFT_SHARES: [f64; 3] = [1.0, 0.2, 0.04];

/// Weights of the tables' second differences that are tried, in independent points that have shown each to be zero.
const STIFFNESSES: [f64; 2] = [1.0, 30.0];

/// Weights of the tables' torques that are tried, in points that have shown each to be zero.
const ZEROS: [f64; 2] = [1.0, 0.01];

/// Strength of the priors of a regression.
#[derive(Debug, Clone, Copy)]
pub struct Priors {
    /// Share of the residual torque's mean square that the regression is taken to leave.
    pub left: f64,
    /// Weight of the tables' second differences, in independent points that have shown each to be zero.
    pub stiffness: f64,
    /// Weight of the tables' torques, in points that have shown each to be zero.
    pub zero: f64,
}

impl Priors {
    /// Those of a residual torque of which nothing is explained.
    const FULL: Self = Self { left: 1.0, stiffness: 1.0, zero: 1.0 };

    /// Priors that are tried.
    fn all() -> impl Iterator<Item = Self> {
        let with = |left| STIFFNESSES.map(|stiffness| ZEROS.map(|zero| Self { left, stiffness, zero }));
        LEFT_SHARES.into_iter().flat_map(move |left| with(left).into_iter().flatten())
    }
}

/// What a regression leaves of logs that it was not fitted to.
#[derive(Debug, Clone)]
pub struct LeftOut {
    /// Priors with which the regression leaves least.
    pub priors: Priors,
    /// Residual torque of each point after subtraction of the regression fitted to all logs but the point's own, N m or N.
    pub left: Vec<f64>,
}

/// Low-passed residual torque of one joint over all logs, with all variables that it may depend on.
#[derive(Debug, Clone, Default)]
pub struct Rest {
    /// Variables that the residual torque may depend on, cut into classes.
    pub variables: Vec<Classes>,
    /// Residual torque at each point, N m or N.
    pub torque: Vec<f64>,
    /// Sum of squares, over all points, of the residual torque due to noise of the positions.
    pub noise: f64,
    /// Regressor row at each point without tables: torque on the joint, N m or N, due to one standard deviation (arm file) of each of the arm's
    /// parameters, and last the constant 1.
    pub base: Vec<Vec<f64>>,
    /// Distance of each of the parameters behind the residual torque from the arm file's value, in standard deviations of the arm file.
    pub away: Vec<f64>,
    /// Index of the log that each point belongs to.
    pub log: Vec<usize>,
    /// Whether the torques of the tables are fitted to each log.
    pub in_training: Vec<bool>,
    /// Index of the block of one second that each point belongs to, counted through all logs.
    pub block: Vec<usize>,
}

/// A table as it is fitted.
#[derive(Debug, Clone)]
pub struct Table {
    /// Nodes of the first and of the second variable; the latter are none for a table over one.
    pub nodes: [Vec<f64>; 2],
    /// Torque at each node less the mean torque, N m or N.
    pub torque: Vec<f64>,
    /// Standard deviation of these, N m or N.
    pub sigma: Vec<f64>,
    /// Mean torque of the table, and constant beside the table, N m or N.
    pub constant: [f64; 2],
}

impl Table {
    /// The table with its variables exchanged.
    pub fn transposed(self) -> Self {
        let exchanged = |values: &[f64]| -> Vec<f64> {
            let rows = self.rows(values);
            (0..self.nodes[1].len()).flat_map(|k| rows.iter().map(move |row| row[k])).collect()
        };
        let (torque, sigma) = (exchanged(&self.torque), exchanged(&self.sigma));
        let [first, second] = self.nodes;
        Self { nodes: [second, first], torque, sigma, constant: self.constant }
    }

    /// Values of the cells by class of the first variable.
    pub fn rows(&self, values: &[f64]) -> Vec<Vec<f64>> {
        values.chunks(self.nodes[1].len().max(1)).map(<[f64]>::to_vec).collect()
    }
}

impl Rest {
    /// Number of blocks of one second.
    pub fn blocks(&self) -> usize {
        self.block.last().map_or(0, |b| b + 1)
    }

    /// Number of logs.
    pub fn logs(&self) -> usize {
        self.in_training.len()
    }

    /// Regression of the residual torque on the arm's parameters and on tables over the variables `laws`.
    pub fn regression<'a>(&'a self, laws: Vec<&'a Classes>) -> Regression<'a> {
        let own = self.base.first().map_or(0, Vec::len);
        let ends = ends(own, &laws);
        let k = ends.last().copied().unwrap_or(own);
        let mut normal = vec![NormalEquations::zero(k); self.logs()];
        for (i, y) in self.torque.iter().enumerate() {
            normal[self.log[i]].add(&row(&self.base[i], &laws, i), *y);
        }
        // The prior of the parameters is the arm file's; a class counts as if it had one further point, with a typical factor and zero torque.
        let variance = self.variance();
        let of_class = |i: usize| laws[ends.partition_point(|end| *end <= i)].factor_square;
        let zero = DVector::from_fn(k, |i, _| if i < own { 0.0 } else { of_class(i) });
        let of_parameter = |i: usize| if i + 1 < own { CORRELATED * variance } else { 1.0 };
        let parameters = DVector::from_fn(k, |i, _| if i < own { of_parameter(i) } else { 0.0 });
        // The second differences count as if one independent point had shown each of them to be zero (P-splines, Eilers and Marx 1996).
        let mut bends = DMatrix::zeros(k, k);
        for (law, end) in laws.iter().zip(&ends) {
            let (first, precision) = (end - law.count(), CORRELATED * law.factor_square);
            for bend in law.bends() {
                for ((a, u), (b, v)) in bend.iter().flat_map(|a| bend.iter().map(move |b| (*a, *b))) {
                    bends[(first + a, first + b)] += precision * u * v;
                }
            }
        }
        Regression { rest: self, laws, normal, parameters, bends, zero }
    }

    /// Indices of the points of the logs that tables are fitted to.
    fn taught(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.torque.len()).filter(|i| self.in_training[self.log[*i]])
    }

    /// Mean square of the residual torque, N^2 m^2 or N^2.
    fn variance(&self) -> f64 {
        squares(&self.torque) / self.torque.len().max(1) as f64
    }

    /// Decrease of the sum of squares from residuals `before` to `after`, in standard deviations from its scatter over blocks.
    pub fn certainty(&self, before: &[f64], after: &[f64]) -> f64 {
        let mut gains = vec![0.0; self.blocks()];
        for (block, (a, b)) in self.block.iter().zip(before.iter().zip(after)) {
            gains[*block] += a * a - b * b;
        }
        let n = gains.len() as f64;
        let mean = gains.iter().sum::<f64>() / n;
        let variance = gains.iter().map(|g| (g - mean).powi(2)).sum::<f64>() / (n - 1.0);
        mean * n / (n * variance).sqrt().max(f64::MIN_POSITIVE)
    }
}

/// Regression of a residual torque on parameters and tables, with the normal equations of every log.
pub struct Regression<'a> {
    rest: &'a Rest,
    laws: Vec<&'a Classes>,
    normal: Vec<NormalEquations>,
    /// Prior precision of the parameters.
    parameters: DVector<f64>,
    /// Prior precision of the tables' second differences.
    bends: DMatrix<f64>,
    /// Precision of the expectation that a class has no torque.
    zero: DVector<f64>,
}

/// Normal equations of some points: matrix and right-hand side.
#[derive(Debug, Clone)]
struct NormalEquations {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl NormalEquations {
    /// Those of no point, for `k` values.
    fn zero(k: usize) -> Self {
        Self { matrix: DMatrix::zeros(k, k), right: DVector::zeros(k) }
    }

    /// Adds a point with the regressor `row` and the value `y`.
    fn add(&mut self, row: &[(usize, f64)], y: f64) {
        for (a, u) in row {
            self.right[*a] += y * u;
            for (b, v) in row {
                self.matrix[(*b, *a)] += u * v;
            }
        }
    }
}

/// Regressor row of a point, without its zeros, as indices and values: the row `base` without tables, then the share of every class of each table's
/// variable around the point.
fn row(base: &[f64], laws: &[&Classes], point: usize) -> Vec<(usize, f64)> {
    let shares = laws.iter().flat_map(|law| &law.share[point]);
    base.iter().chain(shares).copied().enumerate().filter(|(_, x)| *x != 0.0).collect()
}

/// Residual torque at a point with the regressor `row` after subtraction of a regression with the coefficients `values`.
fn left(rest: &Rest, point: usize, row: &[(usize, f64)], values: &DVector<f64>) -> f64 {
    rest.torque[point] - row.iter().map(|(i, x)| x * values[*i]).sum::<f64>()
}

/// Indices in a regressor row behind each table's classes, the first of which follow `base` entries.
fn ends(base: usize, laws: &[&Classes]) -> Vec<usize> {
    let behind = |end: &mut usize, law: &&Classes| {
        *end += law.count();
        Some(*end)
    };
    laws.iter().scan(base, behind).collect()
}

impl Regression<'_> {
    /// Sum of the normal equations of the logs selected by `wanted`.
    fn unpenalised(&self, wanted: impl Fn(usize) -> bool) -> NormalEquations {
        let mut whole = NormalEquations::zero(self.zero.len());
        for (_, of_log) in self.normal.iter().enumerate().filter(|(log, _)| wanted(*log)) {
            whole.matrix += &of_log.matrix;
            whole.right += &of_log.right;
        }
        whole
    }

    fn row(&self, point: usize) -> Vec<(usize, f64)> {
        row(&self.rest.base[point], &self.laws, point)
    }

    /// Residual torque at a point after subtraction of the regression with the coefficients `values`.
    fn left(&self, values: &DVector<f64>, point: usize) -> f64 {
        left(self.rest, point, &self.row(point), values)
    }

    /// Prior precision of parameters and tables for a residual torque of which nothing is explained, with the weights `stiffness` of second differences
    /// and `zero` of the tables' torques.
    fn precision(&self, stiffness: f64, zero: f64) -> DMatrix<f64> {
        let mut precision = stiffness * &self.bends;
        precision.set_diagonal(&(precision.diagonal() + &self.parameters + zero * &self.zero));
        precision
    }

    /// What the regression leaves of logs that it was not fitted to, with the priors with which it leaves least, of those no weaker than what is left asks
    /// for. Accelerations and commands answer to every torque, whatever it depends on, and beside free parameters they would explain all of it: tables
    /// over these keep the full priors. `None` if every fit is singular.
    pub fn left_out(&self) -> Option<LeftOut> {
        let others: Vec<NormalEquations> =
            (0..self.rest.logs()).map(|log| self.unpenalised(|other| other != log)).collect();
        let rows: Vec<Vec<(usize, f64)>> = (0..self.rest.torque.len()).map(|i| self.row(i)).collect();
        let whole = squares(&self.rest.torque);
        let with = |priors: Priors| {
            let precision = priors.left * self.precision(priors.stiffness, priors.zero);
            let solved = |normal: &NormalEquations| {
                (&normal.matrix + &precision).cholesky().map(|system| system.solve(&normal.right))
            };
            let values: Vec<DVector<f64>> = others.iter().map(solved).collect::<Option<_>>()?;
            let left =
                |(i, row): (usize, &Vec<(usize, f64)>)| left(self.rest, i, row, &values[self.rest.log[i]]);
            let left: Vec<f64> = rows.iter().enumerate().map(left).collect();
            (priors.left >= 1.0 || squares(&left) < priors.left * whole).then_some(LeftOut { priors, left })
        };
        if self.laws.iter().any(|law| law.form.answers_to_torque()) {
            return with(Priors::FULL);
        }
        Priors::all().filter_map(with).min_by(|a, b| squares(&a.left).total_cmp(&squares(&b.left)))
    }

    /// Last table of the regression, fitted to the training logs, beside parameters expected at the arm file's values. All prior precisions are
    /// those of a residual torque of which the tables explain nothing, times the share of its variance that they leave. What table and parameters can
    /// both take is shared as the arm file's standard deviations say.
    pub fn last_table(&self, stiffness: f64) -> Option<Table> {
        let held = self.precision(stiffness, ANCHORED);
        let whole = self.unpenalised(|log| self.rest.in_training[log]);
        let blocks = self.blocks();
        let share = |fitted: &Fitted| (fitted.left / self.rest.variance()).min(1.0);
        let first = self.fitted(&whole, &blocks, &held)?;
        let second = self.fitted(&whole, &blocks, &(share(&first) * &held))?;
        let prior = share(&second) * held;
        let Fitted { values, without, left } = self.fitted(&whole, &blocks, &prior)?;
        let last = self.laws.last()?;
        let (k, classes) = (values.len(), last.count());
        let first = k - classes;
        let mut weight = vec![0.0; classes];
        for i in self.rest.taught() {
            for (weight, share) in weight.iter_mut().zip(&last.share[i]) {
                *weight += share.abs();
            }
        }
        // Covariance by the jackknife over blocks, and that due to the prior, without which a table would be too sure where the parameters may take
        // its part and where it bends (Nychka, J. Am. Stat. Assoc. 83, 1988).
        let inverse = (whole.matrix + &prior).cholesky()?.inverse();
        let count = without.len() as f64;
        let covariance =
            without.iter().fold(&inverse * (CORRELATED * left * prior) * &inverse, |sum, other| {
                let apart = other - &values;
                sum + (count - 1.0) / count * &apart * apart.transpose()
            });
        let own = covariance.view((first, first), (classes, classes));
        let all: f64 = weight.iter().sum();
        let part = DVector::from_iterator(classes, weight.iter().map(|weight| weight / all));
        let mean = (0..classes).map(|c| part[c] * values[first + c]).sum::<f64>();
        let intercept = values[self.rest.base.first()?.len() - 1];
        // Variance of the difference between a class's torque and the mean over the classes.
        let with_mean = own * &part;
        let of_mean = part.dot(&with_mean);
        let sigma = |c: usize| (own[(c, c)] - 2.0 * with_mean[c] + of_mean).max(0.0).sqrt();
        Some(Table {
            nodes: last.nodes.clone(),
            torque: (0..classes).map(|c| values[first + c] - mean).collect(),
            sigma: (0..classes).map(sigma).collect(),
            constant: [mean, intercept],
        })
    }

    /// Normal equations of every block of the training logs, and the indices of its points.
    fn blocks(&self) -> Vec<Block> {
        let mut blocks: Vec<Block> = Vec::new();
        let mut last = None;
        for i in self.rest.taught() {
            if last != Some(self.rest.block[i]) {
                let normal = NormalEquations::zero(self.zero.len());
                blocks.push(Block { normal, points: Vec::new() });
                last = Some(self.rest.block[i]);
            }
            let Some(Block { normal, points }) = blocks.last_mut() else { continue };
            normal.add(&self.row(i), self.rest.torque[i]);
            points.push(i);
        }
        blocks
    }

    /// Fits to the normal equations `whole` and to these without each of `blocks`, with the precision `prior`; `None` if one is singular or there is no
    /// block.
    fn fitted(&self, whole: &NormalEquations, blocks: &[Block], prior: &DMatrix<f64>) -> Option<Fitted> {
        let away = DVector::from_fn(whole.right.len(), |i, _| self.rest.away.get(i).copied().unwrap_or(0.0));
        let pull = prior * away;
        let solve = |normal: DMatrix<f64>, right: DVector<f64>| {
            (normal + prior).cholesky().map(|system| system.solve(&(right + &pull)))
        };
        let without: Vec<DVector<f64>> = blocks
            .iter()
            .map(|block| solve(&whole.matrix - &block.normal.matrix, &whole.right - &block.normal.right))
            .collect::<Option<_>>()?;
        let left_of = |(block, values): (&Block, &DVector<f64>)| -> f64 {
            block.points.iter().map(|i| self.left(values, *i).powi(2)).sum()
        };
        let left: f64 = blocks.iter().zip(&without).map(left_of).sum();
        let count = blocks.iter().map(|block| block.points.len()).sum::<usize>();
        let values = solve(whole.matrix.clone(), whole.right.clone())?;
        (count > 0).then(|| Fitted { values, without, left: left / count as f64 })
    }
}

/// Part of a regression that rests on the points of one block.
struct Block {
    normal: NormalEquations,
    points: Vec<usize>,
}

/// Coefficients of a regression.
struct Fitted {
    /// Fitted to all training logs.
    values: DVector<f64>,
    /// Fitted without each of their blocks.
    without: Vec<DVector<f64>>,
    /// Mean square of the residual torque of each block under the fit without it, N^2 m^2 or N^2.
    left: f64,
}

/// Sum of squares.
pub fn squares(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::dependence::MotionVariable;
    use crate::locate::table_form::TableForm;
    use crate::locate::variable_classes::hats;
    use crate::numeric::random::Random;

    /// Seven nodes from -1 to 1.
    fn nodes() -> Vec<f64> {
        (0..7).map(|k| f64::from(k) / 3.0 - 1.0).collect()
    }

    /// Hat functions of the nodes at `x`.
    fn shares(nodes: &[f64], x: f64) -> Vec<f64> {
        let mut shares = vec![0.0; nodes.len()];
        for (i, value) in hats(nodes, x) {
            shares[i] += value;
        }
        shares
    }

    /// Table of the torque 2 `x` with noise, beside a parameter of whose standard deviation `x` is the torque, `away` from the arm file's value.
    fn table_beside_parameter(away: f64) -> Table {
        let mut random = Random(3);
        let nodes = nodes();
        let mut rest = Rest { away: vec![away], in_training: vec![true], ..Rest::default() };
        let mut share = Vec::new();
        for k in 0..1200 {
            let x = (0.37 * f64::from(k)).sin();
            share.push(shares(&nodes, x));
            rest.torque.push(2.0 * x + 0.1 * random.normal());
            rest.base.push(vec![x, 1.0]);
            rest.log.push(0);
            rest.block.push(usize::try_from(k / 60).unwrap());
        }
        let form = TableForm::over(MotionVariable::Time);
        let classes = Classes { form, nodes: [nodes, vec![]], share, factor_square: 1.0 };
        rest.regression(vec![&classes]).last_table(1.0).unwrap()
    }

    #[test]
    fn what_parameter_and_table_can_both_take_is_shared_as_the_arm_file_says() {
        for (away, slope) in [(2.0, 0.0), (0.0, 2.0), (-1.0, 3.0)] {
            let table = table_beside_parameter(away);
            let [first, last] = [0, 6].map(|i| table.torque[i]);
            assert!((last - first - 2.0 * slope).abs() < 0.2, "{away}: {:?}", table.torque);
            // The parameter is known to one standard deviation, and so is the table's slope.
            assert!((0.8..1.2).contains(&table.sigma[6]), "{away}: {:?}", table.sigma);
            assert!(table.sigma[3] < 0.1, "{:?}", table.sigma);
        }
    }

    /// Priors chosen for a table over `variable`, of which the residual torque of three logs is the `size`-fold beside noise.
    fn chosen(variable: MotionVariable, size: f64) -> Priors {
        let mut random = Random(7);
        let nodes = nodes();
        let mut rest = Rest { away: vec![0.0], in_training: vec![true; 3], ..Rest::default() };
        let mut share = Vec::new();
        for k in 0..1200_u32 {
            let x = (0.37 * f64::from(k)).sin();
            share.push(shares(&nodes, x));
            rest.torque.push(size * (3.0 * x).sin() + 0.1 * random.normal());
            rest.base.push(vec![random.normal(), 1.0]);
            rest.log.push(usize::try_from(k / 400).unwrap());
            rest.block.push(usize::try_from(k / 60).unwrap());
        }
        let form = TableForm::over(variable);
        let classes = Classes { form, nodes: [nodes, vec![]], share, factor_square: 1.0 };
        rest.regression(vec![&classes]).left_out().unwrap().priors
    }

    #[test]
    fn priors_are_as_weak_as_what_is_left_asks_for_and_no_weaker() {
        let [strong, noise] = [1.0, 0.0].map(|size| chosen(MotionVariable::Position(0), size));
        assert!(strong.left < 1.0 && noise.left >= 1.0, "{strong:?} {noise:?}");
        assert!(strong.zero < noise.zero, "{strong:?} {noise:?}");
    }

    #[test]
    fn tables_over_what_answers_to_the_torque_keep_the_full_priors() {
        let priors = chosen(MotionVariable::Acceleration(0), 1.0);
        assert_eq!((priors.left, priors.stiffness, priors.zero), (1.0, 1.0, 1.0));
    }

    #[test]
    fn a_table_with_its_variables_exchanged_has_the_same_cells() {
        let table = Table {
            nodes: [vec![0.0, 1.0], vec![5.0, 6.0, 7.0]],
            torque: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
            sigma: vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
            constant: [7.0, 8.0],
        };
        let exchanged = table.clone().transposed();
        assert_eq!(exchanged.rows(&exchanged.torque), [vec![1.0, 4.0], vec![2.0, 5.0], vec![3.0, 6.0]]);
        assert_eq!(exchanged.nodes[0], [5.0, 6.0, 7.0]);
        let back = exchanged.transposed();
        assert_eq!((back.nodes, back.torque, back.sigma), (table.nodes, table.torque, table.sigma));
    }
}
