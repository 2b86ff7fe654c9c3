//! What others cost that do the same as the core.

pub mod baseline;
pub mod baseline_rollout;
