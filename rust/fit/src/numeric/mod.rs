//! Numerical methods that know nothing of arms.
//!
//! * `low_pass`: a Gaussian low-pass from uneven samples onto a regular grid.
//! * `minimum`: minimum of a function of one variable.
//! * `products`: inner products of long columns.
//! * `random`: random numbers that are the same everywhere.
//! * `smooth`: local cubic least squares with uneven sample times.

pub(crate) mod low_pass;
pub(crate) mod minimum;
pub(crate) mod products;
pub(crate) mod random;
pub mod smooth;
