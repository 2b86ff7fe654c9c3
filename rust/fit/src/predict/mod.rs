//! Predictions of a hypothesis: rollouts of short windows and whole logs, and the torque that the measured motion needs.
//!
//! * `latent_states`: states that no encoder measures, simulated along the measured motion to each window's start.
//! * `log_inputs`: torques at the joints and latent states of whole logs, shared by hypotheses that differ in neither.
//! * `residual_torque`: residual torque by inverse dynamics, sample by sample.
//! * `rollouts`: many rollouts at once, in vector lanes or one at a time.
//! * `simulate`: simulation of whole logs with the integrator of armgap-core.
//! * `window`: short windows and their rollouts.

pub(crate) mod latent_states;
pub mod log_inputs;
pub(crate) mod residual_torque;
pub(crate) mod rollouts;
pub mod simulate;
pub mod window;
