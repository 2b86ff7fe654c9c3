//! Python function `fit`.

use crate::convert::{description, matrix, vector};
use armgap_fit::identify::output_error::OutputError;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Fits all parameters of an arm to one log by output error over windows of `horizon` seconds; None for a log with too few windows.
#[pyfunction]
pub fn fit<'py>(
    py: Python<'py>,
    arm: &Bound<'py, PyDict>,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    tau: PyReadonlyArray2<'py, f64>,
    horizon: f64,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let arm = description(arm)?;
    let n = arm.kind.joints();
    let t = vector(&t, "t")?;
    let (q, tau) = (matrix(&q, "q", t.len(), n)?, matrix(&tau, "tau", t.len(), n)?);
    let steps = arm.steps();
    let work = OutputError { t, q, tau, horizon, steps: steps.as_deref() };
    let found = py
        .detach(|| arm.dispatch(work))
        .ok_or_else(|| PyValueError::new_err("`theta` has the wrong length for this arm"))?;
    let Some(estimate) = found else { return Ok(None) };
    let result = PyDict::new(py);
    result.set_item("theta", estimate.theta)?;
    result.set_item("sigma", estimate.sigma)?;
    result.set_item("rms", estimate.rms)?;
    result.set_item("iterations", estimate.iterations)?;
    result.set_item("settled", estimate.settled)?;
    Ok(Some(result))
}
