//! Parameters estimated without a diagnosis.
//!
//! * `base_parameters`: independent columns of a serial arm's regressor, and what the others add to them.
//! * `output_error`: all parameters of an arm from one log by output error.
//! * `refit`: the arm's parameters estimated again from the logs of a diagnosis, without any effect.
//! * `regression_rows`: rows of the filtered dynamic model over a whole log.

pub mod base_parameters;
pub mod output_error;
pub mod refit;
pub mod regression_rows;
