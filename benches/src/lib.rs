//! Baselines: plain C that computes the same as the core.

pub mod baseline;
pub mod baseline_chain;
pub mod baseline_rollout;
