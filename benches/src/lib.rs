//! What others cost that do the same as the core.

pub mod peer;
pub mod peer_rollout;
