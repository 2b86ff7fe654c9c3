//! Which effects are worth a full fit, and their initial guesses.
//!
//! * `contact_guess`: initial guesses of contacts from the residual torque.
//! * `dead_zone_guess`: initial guess of a dead zone whose torque jumps at its level.
//! * `initial_guess`: candidates that pass the score test, at their initial guesses.
//! * `pair_test`: score tests of two candidates together.
//! * `periodogram`: initial guesses of ripple from the residual's periodogram over position.
//! * `screen`: score tests of all candidates from one Jacobian.
//! * `traces`: traces of candidates that are kept from one search node to the next.

pub(crate) mod contact_guess;
pub(crate) mod dead_zone_guess;
pub(crate) mod initial_guess;
pub(crate) mod pair_test;
pub(crate) mod periodogram;
pub mod screen;
pub(crate) mod traces;
