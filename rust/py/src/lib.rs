//! Python module `armgap._native`: takes views of arrays, checks them, releases the GIL, and returns arrays; other crates compute.

mod bench;
mod chain;
mod convert;
mod diagnose;
mod estimator;
mod fit;
mod progress;
mod regression;
mod simulate;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::bench::bench;
    #[pymodule_export]
    use crate::chain::Chain;
    #[pymodule_export]
    use crate::convert::{arm_kinds, effects, theta_from_links};
    #[pymodule_export]
    use crate::diagnose::{diagnose, diagnosis_schema, refit};
    #[pymodule_export]
    use crate::estimator::Estimator;
    #[pymodule_export]
    use crate::fit::fit;
    #[pymodule_export]
    use crate::regression::{bounded_least_squares, filtered_torques, regression_rows, velocity};
    #[pymodule_export]
    use crate::simulate::{inertia, simulate, simulate_windows};

    use super::{Bound, PyModule, PyModuleMethods, PyResult};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
