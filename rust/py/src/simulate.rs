//! `simulate` and `inertia`.

use crate::convert::{effect_instances, kind_of, matrix, vector};
use crate::progress::with_progress;
use armgap_fit::arm::ArmDescription;
use armgap_fit::progress::{Observer, ProgressReporter, guarded};
use armgap_fit::simulate::{InertiaMatrices, Simulation};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// Positions and velocities of an arm under held torques.
#[pyfunction]
#[pyo3(signature = (kind, gravity, link_length, theta, t, tau, q0, dq0, effects, tolerance=1e-9, smoothing=0.0, progress=None))]
pub fn simulate<'py>(
    py: Python<'py>,
    kind: &str,
    gravity: f64,
    link_length: Option<Vec<f64>>,
    theta: Vec<f64>,
    t: PyReadonlyArray1<'py, f64>,
    tau: PyReadonlyArray2<'py, f64>,
    q0: PyReadonlyArray1<'py, f64>,
    dq0: PyReadonlyArray1<'py, f64>,
    effects: Vec<(String, Option<usize>, BTreeMap<String, f64>)>,
    tolerance: f64,
    smoothing: f64,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
    let kind = kind_of(kind)?;
    let n = kind.joints();
    let t = vector(&t, "t")?;
    let tau = matrix(&tau, "tau", t.len(), n)?;
    let (q0, dq0) = (vector(&q0, "q0")?, vector(&dq0, "dq0")?);
    if q0.len() != n || dq0.len() != n {
        return Err(PyValueError::new_err(format!("`q0` and `dq0` need {n} values")));
    }
    let effects = effect_instances(kind.joints(), effects)?;
    let arm = ArmDescription::plain(kind, gravity, theta, link_length);
    let rows = t.len();
    let (t, tau, q0, dq0) = (t.to_vec(), tau.to_vec(), q0.to_vec(), dq0.to_vec());
    let ended = with_progress(py, progress.as_ref(), move |observer| {
        let reporter = ProgressReporter::new(Observer::clone(observer));
        let work = Simulation {
            t: &t,
            tau: &tau,
            q0: &q0,
            dq0: &dq0,
            effects: &effects,
            tolerance,
            smoothing,
            progress: &reporter,
        };
        guarded(|| arm.dispatch(work))
    })?;
    // Stopped only when this thread has left already.
    let trajectory = ended
        .flatten()
        .ok_or_else(|| PyValueError::new_err(format!("`theta` needs {} values", kind.parameters().len())))?
        .map_err(|e| PyValueError::new_err(e.to_string()))?;
    let shape = |x: Vec<f64>| PyArray1::from_vec(py, x).reshape([rows, n]);
    Ok((shape(trajectory.q)?, shape(trajectory.dq)?))
}

/// Inertia matrices at some positions, effects included.
#[pyfunction]
pub fn inertia<'py>(
    py: Python<'py>,
    kind: &str,
    gravity: f64,
    link_length: Option<Vec<f64>>,
    theta: Vec<f64>,
    q: PyReadonlyArray2<'py, f64>,
    effects: Vec<(String, Option<usize>, BTreeMap<String, f64>)>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let kind = kind_of(kind)?;
    let (n, rows) = (kind.joints(), numpy::PyUntypedArrayMethods::shape(&*q)[0]);
    let q = matrix(&q, "q", rows, n)?;
    let effects = effect_instances(kind.joints(), effects)?;
    let arm = ArmDescription::plain(kind, gravity, theta, link_length);
    let found = arm.dispatch(InertiaMatrices { q, effects: &effects }).flatten().ok_or_else(|| {
        PyValueError::new_err("`theta` has the wrong length for this arm, or there are too many effects")
    })?;
    PyArray1::from_vec(py, found).reshape([rows, n, n])
}
