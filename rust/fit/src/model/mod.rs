//! Model of an arm: its equation of motion, its parameters, and effects with their values.
//!
//! * `arm`: arm types of a closed form, from a description at run time.
//! * `chain`: serial arms of one to seven joints, from a description at run time, and their dynamics row by row.
//! * `custom_effect`: torques per unit of size that the user gives together with the logs.
//! * `hypothesis`: parameters, width of the friction regularisation, and effects on joints.

pub mod arm;
pub mod chain;
pub mod custom_effect;
pub mod hypothesis;
