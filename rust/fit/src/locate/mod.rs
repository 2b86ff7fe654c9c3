//! Where the gap lies: on which joint, in which regime of its motion, and on which variables its residual torque depends.
//!
//! * `dependence`: a torque as a table over one variable of the motion.
//! * `energy`: energy balance of the residual torque.
//! * `regimes`: residual torque in windows, by regime.
//! * `table_form`: what a table's variable and factor are.
//! * `unnamed`: torques that depend on one variable without a named effect, as tables validated on left-out logs.
//! * `variable_classes`: a variable cut into classes of equal count.

pub mod dependence;
pub mod energy;
pub mod regimes;
pub mod table_form;
pub mod unnamed;
pub mod variable_classes;
