//! Logs as given and as measured: noise, smoothed motion, measured initial states.
//!
//! * `cut`: windows that begin and end at states that are measured well.
//! * `input`: logs and options as given to a diagnosis, and errors for input that cannot be used.
//! * `noise`: standard deviation of a position measurement.
//! * `track`: one log: times, positions, held torques, smoothed motion.
//! * `velocity`: velocities from positions.

pub(crate) mod cut;
pub mod input;
pub(crate) mod noise;
pub mod track;
pub mod velocity;
