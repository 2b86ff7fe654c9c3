//! Widths over which the sign of each joint's dry friction is regularised around standstill: nuisances, fitted and never reported as a cause.
//!
//! Where friction comes from grease, or from a soft constraint as in some simulators, its torque does not jump at a reversal. A model with a jump
//! leaves a residual at reversals that looks like a delay of the torque.

use crate::serial::constants::PRICE;
use crate::serial::weak_form::rows::{Prior, Regression, Rows};

/// Widths of friction regularisation that are tried as alternatives to dry friction, rad/s (m/s).
const REGULARISATION_WIDTHS: [f64; 7] = [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2];

/// Width of friction regularisation by joint, rad/s (m/s), zero for dry friction.
///
/// `coulomb` is the index of the first Coulomb coefficient among the parameters, and `change(j, width)` the change, by row, of the regressor's column
/// of joint `j`'s Coulomb coefficient when the sign is regularised over `width`.
pub fn widths(
    rows: &Rows,
    prior: &Prior,
    coulomb: usize,
    change: impl Fn(usize, f64) -> Vec<f64>,
) -> Vec<f64> {
    let joints = rows.joints.len();
    let none = vec![None; joints];
    let regression = Regression::reweighted(rows, prior, &none);
    let dry = regression.estimate(&none);
    let level = |j: usize| dry.theta[coulomb + j];
    let cost = |j: usize, width: f64| {
        let mut beside = none.clone();
        beside[j] = Some(change(j, width).iter().map(|c| level(j) * c).collect());
        regression.estimate(&beside).cost
    };
    let best = |j: usize| {
        if level(j) <= 0.0 || rows.joints[j].y.is_empty() {
            return 0.0;
        }
        let tried = REGULARISATION_WIDTHS.iter().map(|width| (*width, cost(j, *width)));
        let (width, least) = tried.fold((0.0, dry.cost - PRICE), |a, b| if b.1 < a.1 { b } else { a });
        if least < dry.cost - PRICE { width } else { 0.0 }
    };
    (0..joints).map(best).collect()
}
