//! Result of a diagnosis as data.
//!
//! * `assemble`: the result, assembled from the end of a model search.
//! * `floor`: noise floor of a gap, the prediction error that a perfect model would have.
//! * `gap`: prediction errors and their resampled intervals.
//! * `headline`: choice of the causes that a diagnosis names.
//! * `nameable`: whether what was found may be named, and why not.
//! * `report`: types of the result (`armgap.diagnosis/1`), which are its JSON Schema.
//! * `ruled_out`: status of every effect that was looked for and not found.
//! * `sanity`: checks of re-estimated parameters against what the arm file allows.
//! * `training_gap`: gap that only the training logs show.
//! * `verdict`: the verdict of a diagnosis, as a function of prediction errors.

pub mod assemble;
mod floor;
pub(crate) mod gap;
pub(crate) mod headline;
pub(crate) mod nameable;
pub mod report;
pub(crate) mod ruled_out;
pub(crate) mod sanity;
pub(crate) mod training_gap;
pub mod verdict;
