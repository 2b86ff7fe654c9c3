//! What others cost that do the same as the core.

pub mod peer;
