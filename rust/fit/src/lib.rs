//! armgap-fit: from logs and a nominal arm to a diagnosis.
//!
//! The way of the data: `track` (log) -> `window` (short rollouts) -> `weighting` (weights of residuals) -> `solve` (output error)
//! -> `attribute` (which effect) and `locate` (where) -> `report` (the result as data).

#![forbid(unsafe_code)]

pub mod acceptance;
pub mod arm;
pub mod assemble;
pub mod attribute;
pub mod base_parameters;
pub mod belief;
pub mod chain;
mod contact_guess;
pub mod context;
pub mod covariance;
mod crosswise;
pub mod custom_effect;
mod cut;
pub mod dependence;
pub mod diagnose;
mod dispersion;
mod disturbance;
mod duel;
pub mod energy;
pub mod equivalent;
pub mod evidence;
mod friction_regularisation;
mod gap;
mod headline;
mod initial_guess;
mod jacobian;
mod latent_states;
pub mod locate;
mod low_pass;
mod minimum;
pub mod model;
pub mod model_search;
mod noise;
pub mod output_error;
mod periodogram;
mod products;
pub mod progress;
pub mod push;
mod random;
mod reconsider;
pub mod refit;
pub mod regression_rows;
pub mod report;
mod residual_torque;
mod rival_law;
mod ruled_out;
mod sanity;
pub mod scale;
pub mod screen;
pub mod serial;
pub mod simulate;
pub mod smooth;
pub mod solve;
mod together;
pub mod track;
pub mod unnamed;
pub mod variable_classes;
pub mod velocity;
pub mod verdict;
pub mod weighting;
pub mod window;
