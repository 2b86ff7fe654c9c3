//! The equation of motion in its weak form: intervals (log) -> equation (torques of terms) -> rows (regression on the arm's parameters).

pub(super) mod equation;
pub(super) mod intervals;
pub(super) mod regularisation;
pub(super) mod rows;
