//! armgap-fit: from logs and a nominal arm to a diagnosis.
//!
//! The folders are in the order of the data; each may use those before it and none after it. [`numeric`] and [`model`] (what all others
//! use) -> [`log`] -> [`predict`] (rollouts of short windows) -> [`likelihood`] (weighted residuals, and what fits them best) ->
//! [`locate`] (where the gap lies) -> [`candidates`] (which effects are worth a fit) -> [`search`] (which of them are causes) ->
//! [`disturbance`] (torques from outside) -> [`result`] (the diagnosis as data). [`diagnose`] runs them for arms of a closed form, [`serial`]
//! for any chain of joints. [`identify`] estimates parameters without a diagnosis.

#![forbid(unsafe_code)]

pub mod progress;

pub mod numeric;

pub mod model;

pub mod log;

pub mod predict;

pub mod likelihood;

pub mod locate;

pub mod candidates;

pub mod search;

pub mod disturbance;

pub mod result;

pub mod serial;

pub mod diagnose;

pub mod identify;
