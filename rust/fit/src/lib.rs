//! armgap-fit: diagnosis of the gap between a nominal arm model and recorded logs.
//!
//! Folders stand in the order of the data flow; each may use the folders before it and none after it. [`numeric`] and [`model`] (used by every other
//! folder) -> [`log`] -> [`predict`] (rollouts of short windows) -> [`likelihood`] (weighted residuals and their best fit) -> [`locate`] (where the
//! gap lies) -> [`candidates`] (which effects to fit) -> [`search`] (which effects are causes) -> [`disturbance`] (external torques) -> [`result`]
//! (the diagnosis as data). [`diagnose`] runs these folders for arms of a closed form, [`serial`] diagnoses any chain of joints. [`identify`]
//! estimates parameters without a diagnosis.

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
