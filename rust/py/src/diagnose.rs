//! `diagnose`.

use crate::convert::{description, matrix, vector};
use armgap_fit::diagnose::{LogData, Options, diagnose as run};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

type PyLog<'py> =
    (String, PyReadonlyArray1<'py, f64>, PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>);

/// The diagnosis of training and holdout logs, as JSON.
#[pyfunction]
pub fn diagnose(
    py: Python<'_>,
    arm: &Bound<'_, PyDict>,
    training: Vec<PyLog<'_>>,
    holdout: Vec<PyLog<'_>>,
    options: &Bound<'_, PyDict>,
) -> PyResult<String> {
    let arm = description(arm)?;
    let n = arm.kind.joints();
    let training = training.iter().map(|log| view(log, n)).collect::<PyResult<Vec<_>>>()?;
    let holdout = holdout.iter().map(|log| view(log, n)).collect::<PyResult<Vec<_>>>()?;
    let mut chosen = Options::default();
    if let Some(value) = options.get_item("horizon")? {
        chosen.horizon = value.extract()?;
    }
    if let Some(value) = options.get_item("max_causes")? {
        chosen.max_causes = value.extract()?;
    }
    if let Some(value) = options.get_item("seed")? {
        chosen.seed = value.extract()?;
    }
    let result = py.detach(|| run(&arm, &training, &holdout, &chosen));
    let diagnosis = result.map_err(|e| PyValueError::new_err(e.to_string()))?;
    serde_json::to_string(&diagnosis).map_err(|e| PyValueError::new_err(e.to_string()))
}

fn view<'a>(log: &'a PyLog<'_>, n: usize) -> PyResult<LogData<'a>> {
    let (name, t, q, tau) = log;
    let t = vector(t, "t")?;
    Ok(LogData {
        name: name.clone(),
        t,
        q: matrix(q, "q", t.len(), n)?,
        tau: matrix(tau, "tau", t.len(), n)?,
    })
}
