//! Estimation of an arm's parameters without a diagnosis.
//!
//! * `base_parameters`: independent columns of a serial arm's regressor, and combinations of the dependent ones.
//! * `output_error`: all parameters of an arm from one log by output error.
//! * `refit`: the arm's parameters re-estimated from the logs of a diagnosis, without any effect.
//! * `regression_rows`: rows of the filtered dynamic model over a whole log.

pub mod base_parameters;
pub mod output_error;
pub mod refit;
pub mod regression_rows;
