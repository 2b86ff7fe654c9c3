//! armgap-fit: from logs and a nominal arm to a diagnosis.
//!
//! The way of the data: `track` (log) -> `window` (short rollouts) -> `metric` (what a residual weighs) -> `solve` (output error)
//! -> `attribute` (which effect) and `locate` (where) -> `report` (the result as data).

#![forbid(unsafe_code)]

mod agreement;
pub mod arm;
pub mod attribute;
pub mod belief;
pub mod compose;
pub mod course;
mod crosswise;
pub mod decide;
pub mod diagnose;
mod disturbance;
mod duel;
pub mod energy;
pub mod equivalent;
mod gap;
pub mod identify;
mod lacking;
pub mod locate;
pub mod metric;
mod minimum;
pub mod model;
mod observe;
pub mod output_error;
mod products;
pub mod progress;
pub mod push;
mod random;
mod reconsider;
pub mod report;
mod rounding;
mod ruled_out;
pub mod scale;
mod scan;
pub mod screen;
pub mod simulate;
mod slopes;
pub mod smooth;
pub mod solve;
pub mod spread;
mod starts;
mod stops;
pub mod study;
mod together;
pub mod track;
pub mod user;
pub mod window;
