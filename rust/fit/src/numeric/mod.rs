//! Numerical methods that are independent of arms.
//!
//! * `bounded`: linear least squares between bounds.
//! * `cache`: last results of a computation by its arguments.
//! * `low_pass`: Gaussian low-pass from uneven samples onto a regular grid.
//! * `minimum`: minimum of a function of one variable.
//! * `products`: inner products of long columns, RMS differences by joint.
//! * `random`: pseudo-random numbers that are reproducible on every machine.
//! * `smooth`: local cubic least squares with uneven sample times.

pub mod bounded;
pub mod cache;
pub(crate) mod low_pass;
pub(crate) mod minimum;
pub(crate) mod products;
pub(crate) mod random;
pub mod smooth;
