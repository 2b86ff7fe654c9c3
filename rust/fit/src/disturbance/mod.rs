//! Torques from outside: pushes at one time of one log, and random torques on a joint.
//!
//! * `bell`: a push as the low-passed torque shows it.
//! * `fit`: sizes of a push by output error.
//! * `intensity`: maximum likelihood intensities of random torques, and each joint's share of them.
//! * `law`: laws in the place of pushes.
//! * `linear`: all that a model could be wrong by and some bells, fitted together.
//! * `outlying`: pushes in windows that the model misses by far more than others.
//! * `own`: the model fitted to one recording alone.
//! * `push`: pushes of all logs, and the conclusion with and without them.
//! * `residual`: the torque that a whole log lacks under a model.
//! * `scatter`: how far a joint's residual scatters at every point of a log.
//! * `search`: pushes that stand out of the lacking torque of one log.

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
