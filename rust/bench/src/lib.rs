//! Measurements of the speed of `armgap-core` on the machine at hand.

pub mod cost;
pub mod run;
pub mod scaling;
pub mod serial;

// The example in Rust of the project's README is compiled and run with the documentation tests.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
mod readme {}
