//! Python functions `regression_rows`, `filtered_torques`, `bounded_least_squares` and `velocity`.

use crate::convert::{description, matrix, vector};
use armgap_fit::identify::regression_rows::{RegressionRows, filtered_torques as filtered};
use armgap_fit::log::velocity::Velocity;
use armgap_fit::numeric::bounded;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

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

/// Right sides of the rows of the filtered dynamic model for the torques of one joint, one per sample; NaN at the first two samples.
#[pyfunction]
pub fn filtered_torques<'py>(
    py: Python<'py>,
    t: PyReadonlyArray1<'py, f64>,
    tau: PyReadonlyArray1<'py, f64>,
    cutoff: f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (t, tau) = (vector(&t, "t")?, vector(&tau, "tau")?);
    if t.len() != tau.len() {
        return Err(PyValueError::new_err("`tau` has to be as long as `t`"));
    }
    Ok(PyArray1::from_vec(py, filtered(t, tau, cutoff)))
}

/// Minimum of `x' gram x / 2 - right' x` between bounds, by active sets; NaN where there is no finite solution.
#[pyfunction]
pub fn bounded_least_squares<'py>(
    py: Python<'py>,
    gram: PyReadonlyArray2<'py, f64>,
    right: PyReadonlyArray1<'py, f64>,
    low: PyReadonlyArray1<'py, f64>,
    high: PyReadonlyArray1<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let right = vector(&right, "right")?;
    let n = right.len();
    let (low, high) = (vector(&low, "low")?, vector(&high, "high")?);
    if low.len() != n || high.len() != n {
        return Err(PyValueError::new_err("`low` and `high` have to be as long as `right`"));
    }
    let x = bounded::bounded_least_squares(matrix(&gram, "gram", n, n)?, right, low, high);
    Ok(PyArray1::from_vec(py, x.unwrap_or_else(|| vec![f64::NAN; n])))
}

/// Joint velocities from positions by the named method: backward, central or local-cubic.
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
