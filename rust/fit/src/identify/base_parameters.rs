//! Base parameters of a serial arm: which parameters are estimated, and which combinations of dependent parameters they absorb.
//!
//! The regressor of the torques over all parameters has dependent columns, so motion determines only sums of parameters. With independent
//! columns `Y_b` that span all, `Y = Y_b [I K]`, the torques are `Y_b (theta_b + K theta_d)` (Gautier 1991, *Numerical calculation of
//! the base inertial parameters of robots*, Journal of Robotic Systems 8, 485-506). `Y` is stacked over random states and factorised by
//! `Q R`; a column is dependent if only rounding of the arm's geometry is left of it. Columns are taken from the base outwards, within a link in an
//! order in which, with joints about z axes, the dependent columns are those that Khalil and Dombre (2002, section 9.4) eliminate.

use crate::model::chain::{ChainDescription, WithChain};
use crate::numeric::random::Random;
use armgap_core::chain::{Chain, LINK_PARAMETERS, PARAMETERS_PER_JOINT};
use armgap_core::real::sgn;

/// Part of a regressor column's length below which its component independent of earlier columns counts as rounding. Right angles typed as 1.5708
/// leave 5e-6, a millimetre of an arm's geometry 1e-3 and more.
const INDEPENDENT: f64 = 1e-4;
/// Part of the longest regressor column's length below which a column counts as rounding.
const VISIBLE: f64 = 1e-9;
/// Share of the largest factor of a combination of parameters below which a factor is rounding of double precision.
const FACTOR_ROUNDING: f64 = 1e-12;
/// Random states per parameter of one joint in the stacked regressor.
const STATES: usize = 4;
/// Order in which the ten inertial parameters of a link are examined for independence.
const ORDER: [usize; LINK_PARAMETERS] = [9, 1, 2, 4, 5, 7, 8, 3, 6, 0];

/// Base parameters of a serial arm, among some of its `13 n` parameters and, at `13 n + j`, the constant torque of joint `j`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BaseParameters {
    /// Indices of the estimated parameters, ascending.
    pub columns: Vec<usize>,
    /// Indices of the dependent parameters, ascending.
    pub dependent: Vec<usize>,
    /// Matrix `K` by rows: what each dependent parameter (column) adds to each estimated one (row).
    pub combination: Vec<f64>,
}

/// Indices of the parameters among which base parameters are determined.
#[derive(Debug, Clone, Copy)]
pub struct AmongParameters<'a>(pub &'a [usize]);

impl AmongParameters<'_> {
    /// Base parameters of a chain; `None` unless it has one to [`armgap_core::chain::MAX_JOINTS`] joints.
    pub fn of(self, chain: &ChainDescription) -> Option<BaseParameters> {
        chain.dispatch(self)
    }
}

impl WithChain for AmongParameters<'_> {
    type Output = BaseParameters;

    fn call<const N: usize>(self, chain: &Chain<f64, N>) -> BaseParameters {
        let regressor = stacked(chain);
        let mut candidates: Vec<usize> = self.0.iter().copied().filter(|c| *c < regressor.len()).collect();
        candidates.sort_by_key(|c| rank::<N>(*c));
        candidates.dedup();
        let longest = regressor.iter().map(|column| norm(column)).fold(0.0, f64::max);
        let mut basis = Basis { least: VISIBLE * longest, ..Basis::default() };
        for column in candidates {
            basis.take(column, &regressor[column]);
        }
        basis.parameters()
    }
}

/// Position of a regressor column in the order of examination: links from the base, then rotors and friction.
fn rank<const N: usize>(column: usize) -> usize {
    if column >= LINK_PARAMETERS * N {
        return column;
    }
    let place = ORDER.iter().position(|c| *c == column % LINK_PARAMETERS).unwrap_or(0);
    column / LINK_PARAMETERS * LINK_PARAMETERS + place
}

/// Columns of the torque regressor, one per parameter, stacked over random states and joints.
fn stacked<const N: usize>(chain: &Chain<f64, N>) -> Vec<Vec<f64>> {
    let states = STATES * (PARAMETERS_PER_JOINT + 1);
    let mut columns = vec![vec![0.0; states * N]; (PARAMETERS_PER_JOINT + 1) * N];
    let mut random = Random(1);
    for state in 0..states {
        let mut vector = |size: f64| -> [f64; N] { std::array::from_fn(|_| size * random.normal()) };
        let (q, dq, ddq) = (vector(2.0), vector(2.0), vector(5.0));
        chain.torque_regressor([&q, &dq, &ddq], |i, k, row| {
            for (c, value) in row.into_iter().enumerate() {
                columns[LINK_PARAMETERS * k + c][state * N + i] = value;
            }
        });
        for j in 0..N {
            for (kind, value) in [ddq[j], dq[j], sgn(dq[j]), 1.0].into_iter().enumerate() {
                columns[(LINK_PARAMETERS + kind) * N + j][state * N + j] = value;
            }
        }
    }
    columns
}

/// `Q R` factorisation of the independent ones among the regressor columns examined so far.
#[derive(Debug, Default)]
struct Basis {
    /// Length of a column's independent component below which the column counts as dependent.
    least: f64,
    /// Orthonormal columns of `Q`.
    q: Vec<Vec<f64>>,
    /// Index of each independent parameter with its column of `R`.
    r: Vec<(usize, Vec<f64>)>,
    /// Index of each dependent parameter with `Q'` times its regressor column.
    dependent: Vec<(usize, Vec<f64>)>,
}

impl Basis {
    /// Adds a regressor column: as an independent column, or as a combination of the earlier ones.
    fn take(&mut self, parameter: usize, column: &[f64]) {
        let (length, mut rest) = (norm(column), column.to_vec());
        let mut along = vec![0.0; self.q.len()];
        // Orthogonalised twice: the second pass removes what rounding left in the first.
        for _ in 0..2 {
            for (direction, along) in self.q.iter().zip(&mut along) {
                let share: f64 = direction.iter().zip(&rest).map(|(a, b)| a * b).sum();
                rest.iter_mut().zip(direction).for_each(|(x, d)| *x -= share * d);
                *along += share;
            }
        }
        let left = norm(&rest);
        if left <= (INDEPENDENT * length).max(self.least) {
            self.dependent.push((parameter, along));
            return;
        }
        along.push(left);
        for x in &mut rest {
            *x /= left;
        }
        self.q.push(rest);
        self.r.push((parameter, along));
    }

    /// Base parameters by back substitution: `R K = Q' Y_d`.
    fn parameters(mut self) -> BaseParameters {
        self.dependent.sort_by_key(|(parameter, _)| *parameter);
        let mut order: Vec<usize> = (0..self.r.len()).collect();
        order.sort_by_key(|i| self.r[*i].0);
        let shares: Vec<Vec<f64>> = self.dependent.iter().map(|(_, along)| self.solved(along)).collect();
        BaseParameters {
            columns: order.iter().map(|i| self.r[*i].0).collect(),
            dependent: self.dependent.iter().map(|(parameter, _)| *parameter).collect(),
            combination: order.iter().flat_map(|i| shares.iter().map(|share| share[*i])).collect(),
        }
    }

    /// Coefficients of the independent regressor columns in a dependent one, from its components `along` the columns of `Q`.
    fn solved(&self, along: &[f64]) -> Vec<f64> {
        let mut x = along.to_vec();
        x.resize(self.r.len(), 0.0);
        for i in (0..self.r.len()).rev() {
            let column = &self.r[i].1;
            let share = x[i] / column[i];
            x.iter_mut().zip(column).for_each(|(x, r)| *x -= share * r);
            x[i] = share;
        }
        // Coefficients as small as rounding errors are set to zero.
        let largest = x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        x.iter().map(|x| if x.abs() <= FACTOR_ROUNDING * largest.max(1.0) { 0.0 } else { *x }).collect()
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}
