//! Weak form of the equation of motion along logs: `intervals` (sample intervals and test functions) -> `equation` (torques of terms) -> `rows`
//! (regression on the arm's parameters); `tables` are torques over one variable of the motion.

pub(super) mod equation;
pub(super) mod intervals;
pub(super) mod regularisation;
pub(super) mod rows;
pub(super) mod tables;
