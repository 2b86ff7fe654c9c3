//! Baselines of the benchmarks: plain C that computes the results of `armgap-core`.

pub mod baseline;
pub mod baseline_chain;
pub mod baseline_rollout;
