//! External torques: pushes at one time of one log, and random torques on a joint.
//!
//! * `bell`: Gaussian pulse of a push in the low-passed residual torque.
//! * `fit`: size of a push by output error.
//! * `intensity`: maximum likelihood intensities of random torques, and each joint's share of them.
//! * `law`: effects of the library that explain the logs as well as pushes do.
//! * `linear`: linear fit of possible model errors and Gaussian pulses.
//! * `outlying`: pushes in windows whose prediction errors are far larger than typical.
//! * `own`: the model fitted to one recording alone.
//! * `push`: pushes of all logs, and the conclusion with and without them.
//! * `residual`: residual torque of a whole log under a model.
//! * `scatter`: standard deviation of a joint's residual torque at every point of a log.
//! * `search`: pushes that stand out of the residual torque of one log.
//! * `touched`: windows that pushes touch, and the fit of these pushes together.

pub(crate) mod bell;
pub(crate) mod fit;
pub(crate) mod intensity;
pub(crate) mod law;
pub(crate) mod linear;
pub(crate) mod outlying;
pub(crate) mod own;
pub mod push;
pub(crate) mod residual;
pub(crate) mod scatter;
pub(crate) mod search;
pub(crate) mod touched;
