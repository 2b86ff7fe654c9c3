//! `identify` and `velocity`.

use crate::convert::{description, kind_of, matrix, vector};
use armgap_core::regression::{Scheme, Variant};
use armgap_fit::arm::ArmDescription;
use armgap_fit::identify::{Identification, Velocity};
use armgap_fit::regression_rows::RegressionRows;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// History of an estimate over a log.
#[pyfunction]
pub fn identify<'py>(
    py: Python<'py>,
    kind: &str,
    gravity: f64,
    link_length: Option<Vec<f64>>,
    theta: Vec<f64>,
    scheme: &str,
    paper: bool,
    cutoff: f64,
    forgetting: f64,
    p0: f64,
    theta0: Vec<f64>,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    tau: PyReadonlyArray2<'py, f64>,
    dq: Option<PyReadonlyArray2<'py, f64>>,
) -> PyResult<Bound<'py, PyDict>> {
    let kind = kind_of(kind)?;
    let n = kind.joints();
    let known: Vec<&str> = Scheme::ALL.iter().map(|s| s.name()).collect();
    let scheme = Scheme::from_name(scheme).ok_or_else(|| {
        PyValueError::new_err(format!("unknown scheme `{scheme}`; known: {}", known.join(", ")))
    })?;
    let t = vector(&t, "t")?;
    let (q, tau) = (matrix(&q, "q", t.len(), n)?, matrix(&tau, "tau", t.len(), n)?);
    let dq = dq.as_ref().map(|dq| matrix(dq, "dq", t.len(), n)).transpose()?;
    let variant = if paper { Variant::Paper } else { Variant::Exact };
    let arm = ArmDescription::plain(kind, gravity, theta, link_length);
    let work = Identification { scheme, variant, cutoff, forgetting, p0, theta0: &theta0, t, q, tau, dq };
    let history = py
        .detach(|| arm.dispatch(work))
        .flatten()
        .ok_or_else(|| PyValueError::new_err("`theta` or `theta0` has the wrong length for this arm"))?;
    let result = PyDict::new(py);
    let r = history.parameters;
    result.set_item("theta", table(py, history.theta, t.len(), r)?)?;
    result.set_item("errors", table(py, history.errors, t.len(), history.outputs)?)?;
    result.set_item("covariance", table(py, history.covariance, r, r)?)?;
    result.set_item("updates", history.updates)?;
    result.set_item("rejected", history.rejected)?;
    Ok(result)
}

fn table(py: Python<'_>, x: Vec<f64>, rows: usize, columns: usize) -> PyResult<Bound<'_, PyArray2<f64>>> {
    PyArray1::from_vec(py, x).reshape([rows, columns])
}

/// Rows of the filtered dynamic model: regressor (samples, joints, parameters) and filtered torques (samples, joints); NaN at the
/// first two samples.
#[pyfunction]
pub fn regression_rows<'py>(
    py: Python<'py>,
    arm: &Bound<'py, PyDict>,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    tau: PyReadonlyArray2<'py, f64>,
    cutoff: f64,
) -> PyResult<(Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>)> {
    let arm = description(arm)?;
    let (n, p) = (arm.kind.joints(), arm.kind.parameters().len());
    let t = vector(&t, "t")?;
    let (q, tau) = (matrix(&q, "q", t.len(), n)?, matrix(&tau, "tau", t.len(), n)?);
    let work = RegressionRows { cutoff, t, q, tau };
    let rows = py
        .detach(|| arm.dispatch(work))
        .ok_or_else(|| PyValueError::new_err("`theta` has the wrong length for this arm"))?;
    Ok((PyArray1::from_vec(py, rows.psi).reshape([t.len(), n, p])?, table(py, rows.y, t.len(), n)?))
}

/// Velocities from positions.
#[pyfunction]
#[pyo3(signature = (t, q, method, half_width=3))]
pub fn velocity<'py>(
    py: Python<'py>,
    t: PyReadonlyArray1<'py, f64>,
    q: PyReadonlyArray2<'py, f64>,
    method: &str,
    half_width: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let method = Velocity::from_name(method)
        .ok_or_else(|| PyValueError::new_err("`method` is one of backward, central, local-cubic"))?;
    let t = vector(&t, "t")?;
    let n = numpy::PyUntypedArrayMethods::shape(&*q)[1];
    let q = matrix(&q, "q", t.len(), n)?;
    let mut dq = vec![0.0; q.len()];
    for j in 0..n {
        let column: Vec<f64> = q.iter().skip(j).step_by(n).copied().collect();
        for (k, value) in method.of(t, &column, half_width.max(2)).into_iter().enumerate() {
            dq[k * n + j] = value;
        }
    }
    table(py, dq, t.len(), n)
}
