//! A log as it comes and as it is measured: noise, smoothed motion, measured initial states.
//!
//! * `cut`: where windows begin: at states that are measured well.
//! * `input`: logs and options as a diagnosis is given them, and what of them cannot be worked with.
//! * `noise`: standard deviation of a position measurement.
//! * `track`: one log: times, positions, held torques, smoothed motion.
//! * `velocity`: velocities from positions.

pub(crate) mod cut;
pub mod input;
pub(crate) mod noise;
pub mod track;
pub mod velocity;
