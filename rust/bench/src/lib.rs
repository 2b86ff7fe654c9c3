//! What the core costs on the machine it runs on.

pub mod cost;
pub mod run;
pub mod scaling;
