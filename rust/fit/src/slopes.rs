//! How predictions change with the free values, at a point of a search.

use crate::metric::Gram;
use crate::model::Hypothesis;
use crate::solve::{Problem, scaled_inverse};
use armgap_core::arm::Arm;

/// A value of whose sensitivity the others leave less than this part needs theirs from where it stands itself.
const APART: f64 = 0.05;

/// Sensitivities of the free values, the first of them perhaps on loan from a neighbour, and their inner products.
pub(crate) struct Slopes<'a> {
    lent: &'a [Vec<f64>],
    own: Vec<Vec<f64>>,
    pub(crate) gram: Gram,
    /// Whether they are those of an earlier point.
    pub(crate) followed: bool,
}

impl<'a> Slopes<'a> {
    /// Of all values where they stand.
    pub(crate) fn new<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        problem: &Problem<A, N, P>,
        at: &Point<P>,
    ) -> Self {
        Self::with(problem, at, &[])
    }

    /// With those of the first values on loan, if they can be told from the others by them.
    pub(crate) fn beside<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        problem: &Problem<A, N, P>,
        at: &Point<P>,
        known: &'a [Vec<f64>],
    ) -> Self {
        let slopes = Self::with(problem, at, known);
        let apart = slopes.lent() == 0 || slopes.are_apart();
        if apart { slopes } else { Self::new(problem, at) }
    }

    fn with<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        problem: &Problem<A, N, P>,
        at: &Point<P>,
        lent: &'a [Vec<f64>],
    ) -> Self {
        let rest: Vec<usize> = (lent.len()..at.hypothesis.values().len()).collect();
        let own = problem.sensitivities(&at.hypothesis, &at.residual, &rest);
        let gram = Gram::default();
        let mut slopes = Self { lent, own, gram, followed: false };
        slopes.follow(problem, at);
        slopes.followed = false;
        slopes
    }

    /// Whether the others leave enough of each of those that are not on loan.
    fn are_apart(&self) -> bool {
        let count = self.lent() + self.own.len();
        let normal = self.gram.total.view((0, 0), (count, count)).into_owned();
        scaled_inverse(&normal).is_some_and(|inverse| {
            let left = |i: usize| 1.0 / (inverse[(i, i)] * normal[(i, i)]);
            (self.lent()..count).all(|i| normal[(i, i)] <= 0.0 || left(i) > APART)
        })
    }

    /// Whether all are those of the point they are used at.
    pub(crate) fn are_own(&self) -> bool {
        self.lent() == 0 && !self.followed
    }

    /// How many are on loan.
    pub(crate) fn lent(&self) -> usize {
        self.lent.len()
    }

    /// Goes on to serve at another point.
    pub(crate) fn follow<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        &mut self,
        problem: &Problem<A, N, P>,
        at: &Point<P>,
    ) {
        let columns: Vec<&[f64]> = self.lent.iter().chain(&self.own).map(Vec::as_slice).collect();
        self.gram = problem.metric.gram(problem.data, &columns, &at.residual);
        self.followed = true;
    }
}

/// A hypothesis with its residual and cost.
pub(crate) struct Point<const P: usize> {
    pub(crate) hypothesis: Hypothesis<P>,
    pub(crate) residual: Vec<f64>,
    pub(crate) costs: Vec<f64>,
    pub(crate) data_cost: f64,
    pub(crate) prior_cost: f64,
}

impl<const P: usize> Point<P> {
    pub(crate) fn new<A: Arm<f64, N, P>, const N: usize>(
        problem: &Problem<A, N, P>,
        hypothesis: Hypothesis<P>,
    ) -> Self {
        let residual = problem.residual(&hypothesis);
        let costs = problem.metric.costs(problem.data, &residual);
        let data_cost = problem.metric.total(&costs);
        let prior_cost = problem.prior.cost(&hypothesis.theta);
        Self { hypothesis, residual, costs, data_cost, prior_cost }
    }

    pub(crate) fn cost(&self) -> f64 {
        self.data_cost + self.prior_cost
    }
}
