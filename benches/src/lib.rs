//! Baselines of the benchmarks: plain C, and Pinocchio in C++, that compute the results of `armgap-core`.

pub mod baseline;
pub mod baseline_chain;
pub mod baseline_rollout;
#[cfg(pinocchio)]
pub mod pinocchio;
