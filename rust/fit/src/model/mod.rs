//! What is assumed of an arm: its equation of motion, its parameters, and effects with their values.
//!
//! * `arm`: from a description at run time to an arm of a closed form known at compile time.
//! * `chain`: the same for serial arms of one to seven joints, and their dynamics row by row.
//! * `custom_effect`: torques per unit of size that the user gives beside the logs.
//! * `hypothesis`: parameters, width of the friction regularisation, and effects on joints.

pub mod arm;
pub mod chain;
pub mod custom_effect;
pub mod hypothesis;
