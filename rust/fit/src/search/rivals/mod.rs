//! Rivals of a cause.
//!
//! * `duel`: pairwise comparison of close rivals, re-weighted.
//! * `equivalent`: pairs of effects that no log of motion alone tells apart.
//! * `rival_law`: a table over a variable of the motion as the rival of a named cause.

pub(crate) mod duel;
pub mod equivalent;
pub(crate) mod rival_law;
