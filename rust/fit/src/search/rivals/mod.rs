//! Rivals of a cause.
//!
//! * `duel`: pairwise comparison of close candidates, under window weights made from either.
//! * `equivalent`: pairs of effects that no log of motion alone distinguishes.
//! * `rival_law`: a table of torque over one variable of the motion as the rival of a named cause.
//! * `same_torque`: whether two effects need the same torque in every state, so that no motion distinguishes them.

pub(crate) mod duel;
pub mod equivalent;
pub(crate) mod rival_law;
pub(crate) mod same_torque;
