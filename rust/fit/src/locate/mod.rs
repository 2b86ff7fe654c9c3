//! Where the gap lies: on which joint, in which regime of its motion, and on which variables its residual torque depends.
//!
//! * `dependence`: a torque as a table over one or two variables of the motion.
//! * `energy`: energy balance of the residual torque.
//! * `log_residual`: residual torque of a log, and the torque of a cause as the difference of two.
//! * `regimes`: residual torque in windows, by regime.
//! * `table_form`: what a table's variables and factor are.
//! * `table_regression`: tables fitted beside the arm's parameters, and what they predict.
//! * `unnamed`: torques that depend on one or two variables without a named effect, as tables validated on left-out logs.
//! * `variable_classes`: variables cut into classes of equal count.

pub mod dependence;
pub mod energy;
pub mod log_residual;
pub mod regimes;
pub mod table_form;
pub mod table_regression;
pub mod unnamed;
pub mod variable_classes;
