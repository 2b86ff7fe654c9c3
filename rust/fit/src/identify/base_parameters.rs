//! Base parameters of a serial arm: which of its parameters are estimated, and what the others add to them.
//!
//! The regressor of the torques over all parameters has dependent columns, so motion determines only sums of parameters. With independent
//! columns `Y_b` that span all, `Y = Y_b [I K]`, the torques are `Y_b (theta_b + K theta_d)` (Gautier 1991, *Numerical calculation of
//! the base inertial parameters of robots*, Journal of Robotic Systems 8, 485-506). `Y` is stacked over random states and factorized by
//! `Q R`; a column is dependent if nothing but rounding of the arm's geometry is left of it. Columns are taken from the base outwards, and in a link in an
//! order in which, with joints about z axes, those left over are the ones that Khalil and Dombre (2002, section 9.4) eliminate.

use crate::model::chain::{ChainDescription, WithChain};
use crate::numeric::random::Random;
use armgap_core::chain::{Chain, LINK_PARAMETERS, PARAMETERS_PER_JOINT};
use armgap_core::real::sgn;

/// Share of a column's length below which what is independent of it is rounding. Right angles typed as 1.5708 leave 5e-6, a millimetre of an
/// arm's geometry 1e-3 and more.
const INDEPENDENT: f64 = 1e-4;
/// Share of the longest column below which a column shows nothing but rounding.
const VISIBLE: f64 = 1e-9;
/// Share of the largest factor of a combination below which a factor is rounding of double precision.
const ROUNDING: f64 = 1e-12;
/// States per parameter of one joint.
const STATES: usize = 4;
/// A link's parameters in the order in which columns are taken.
const ORDER: [usize; LINK_PARAMETERS] = [9, 1, 2, 4, 5, 7, 8, 3, 6, 0];

/// Base parameters among some of the `13 n` parameters and, at `13 n + j`, constant torques of the joints.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BaseParameters {
    /// Estimated parameters, ascending.
    pub columns: Vec<usize>,
    /// The other ones, ascending.
    pub dependent: Vec<usize>,
    /// `K`, by rows: what each dependent parameter adds to each estimated one.
    pub combination: Vec<f64>,
}

/// The base parameters among these.
#[derive(Debug, Clone, Copy)]
pub struct AmongParameters<'a>(pub &'a [usize]);

impl AmongParameters<'_> {
    /// Those of a chain; `None` unless it has one to [`armgap_core::chain::MAX_JOINTS`] joints.
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

/// Place in the order in which columns are taken: links from the base, then rotors and friction.
fn rank<const N: usize>(column: usize) -> usize {
    if column >= LINK_PARAMETERS * N {
        return column;
    }
    let place = ORDER.iter().position(|c| *c == column % LINK_PARAMETERS).unwrap_or(0);
    column / LINK_PARAMETERS * LINK_PARAMETERS + place
}

/// Columns of the torques' regressor over random states, one per parameter.
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

/// `Q R` of the columns taken so far.
#[derive(Debug, Default)]
struct Basis {
    /// Length below which a column counts as zero.
    least: f64,
    /// Orthonormal columns.
    q: Vec<Vec<f64>>,
    /// Columns of `R` of the independent parameters.
    r: Vec<(usize, Vec<f64>)>,
    /// `Q'` times the columns of the dependent ones.
    dependent: Vec<(usize, Vec<f64>)>,
}

impl Basis {
    /// Takes the regressor's next column: as an independent one, or with its shares of those before it.
    fn take(&mut self, parameter: usize, column: &[f64]) {
        let (length, mut rest) = (norm(column), column.to_vec());
        let mut along = vec![0.0; self.q.len()];
        // Twice: what rounding left of the first time is removed by the second.
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

    /// Back substitution: `R K = Q' Y_d`.
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

    /// Shares of the independent columns in a dependent one.
    fn solved(&self, along: &[f64]) -> Vec<f64> {
        let mut x = along.to_vec();
        x.resize(self.r.len(), 0.0);
        for i in (0..self.r.len()).rev() {
            let column = &self.r[i].1;
            let share = x[i] / column[i];
            x.iter_mut().zip(column).for_each(|(x, r)| *x -= share * r);
            x[i] = share;
        }
        // Rounding is not a share.
        let largest = x.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        x.iter().map(|x| if x.abs() <= ROUNDING * largest.max(1.0) { 0.0 } else { *x }).collect()
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}
