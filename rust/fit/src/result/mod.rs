//! The diagnosis as data.
//!
//! * `assemble`: from the end of a search to the diagnosis.
//! * `floor`: by how much a perfect model would miss.
//! * `gap`: prediction errors and their resampled intervals.
//! * `headline`: the causes that are named.
//! * `report`: types of the result (`armgap.diagnosis/1`), which are its JSON Schema.
//! * `ruled_out`: what was looked for and not found.
//! * `sanity`: whether re-estimated parameters are such as this arm can have.
//! * `verdict`: the verdict, as a function of plain evidence.

pub mod assemble;
mod floor;
pub(crate) mod gap;
pub(crate) mod headline;
pub mod report;
pub(crate) mod ruled_out;
pub(crate) mod sanity;
pub mod verdict;
