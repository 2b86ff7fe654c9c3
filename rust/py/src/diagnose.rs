//! Python functions `diagnose`, `diagnosis_schema` and `refit`.

use crate::convert::{description, matrix, serial_arm, vector};
use crate::progress::with_progress;
use armgap_fit::diagnose::diagnose as run;
use armgap_fit::identify::refit::refit as rigid_fit;
use armgap_fit::log::input::{LogData, Options, Withheld};
use armgap_fit::model::arm::ArmDescription;
use armgap_fit::result::report::schema;
use armgap_fit::serial::{SerialArm, diagnose as run_serial};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Positions of a position controller's reference, rad or m, one row per sample, and velocities where they are logged.
type PyReference<'py> = (PyReadonlyArray2<'py, f64>, Option<PyReadonlyArray2<'py, f64>>);

/// A log: name, source, times, positions, torques, torques of custom effects, first moments of torques that are means over intervals, and the
/// reference of a position controller where it is logged in place of torques.
type PyLog<'py> = (
    String,
    String,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray2<'py, f64>,
    PyReadonlyArray2<'py, f64>,
    Vec<PyReadonlyArray1<'py, f64>>,
    Option<PyReadonlyArray2<'py, f64>>,
    Option<PyReference<'py>>,
);

/// Copy of a log for a thread that may outlive the Python call.
struct Owned {
    name: String,
    source: String,
    t: Vec<f64>,
    q: Vec<f64>,
    tau: Vec<f64>,
    tables: Vec<Vec<f64>>,
    moment: Option<Vec<f64>>,
    reference: Option<(Vec<f64>, Option<Vec<f64>>)>,
}

/// Re-estimates the arm's parameters without effects, from the arm file's values and from `start`: `theta`, `sigma`, and on the holdout, per joint,
/// the RMS errors `before` and `refit` and the RMS displacement `motion`, rad or m.
#[pyfunction]
pub fn refit<'py>(
    py: Python<'py>,
    arm: &Bound<'py, PyDict>,
    start: Vec<f64>,
    training: Vec<PyLog<'py>>,
    holdout: Vec<PyLog<'py>>,
    horizon: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let arm = description(arm)?;
    let n = arm.kind.joints();
    let training = training.iter().map(|log| copy(log, n)).collect::<PyResult<Vec<_>>>()?;
    let holdout = holdout.iter().map(|log| copy(log, n)).collect::<PyResult<Vec<_>>>()?;
    let options = Options { horizon, ..Options::default() };
    let found = with_progress(py, None, move |observer| {
        rigid_fit(&arm, &start, &views(&training), &views(&holdout), &options, observer)
            .map_err(|e| e.to_string())
    })?
    .map_err(PyValueError::new_err)?;
    let result = PyDict::new(py);
    result.set_item("theta", found.theta)?;
    result.set_item("sigma", found.sigma)?;
    result.set_item("before", found.before)?;
    result.set_item("refit", found.refit)?;
    result.set_item("motion", found.motion)?;
    Ok(result)
}

/// JSON Schema of the JSON that [`diagnose`] returns.
#[pyfunction]
pub fn diagnosis_schema() -> PyResult<String> {
    serde_json::to_string(&schema()).map_err(|e| PyValueError::new_err(e.to_string()))
}

/// Diagnoses training and holdout logs and returns the result as JSON; `progress(title, fraction)` is called several times a second.
#[pyfunction]
#[pyo3(signature = (arm, training, holdout, options, progress=None))]
pub fn diagnose(
    py: Python<'_>,
    arm: &Bound<'_, PyDict>,
    training: Vec<PyLog<'_>>,
    holdout: Vec<PyLog<'_>>,
    options: &Bound<'_, PyDict>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let arm = AnyArm::of(arm)?;
    let n = arm.joints();
    let training = training.iter().map(|log| copy(log, n)).collect::<PyResult<Vec<_>>>()?;
    let holdout = holdout.iter().map(|log| copy(log, n)).collect::<PyResult<Vec<_>>>()?;
    let mut chosen = Options::default();
    if let Some(value) = options.get_item("horizon")? {
        chosen.horizon = value.extract()?;
    }
    if let Some(value) = options.get_item("max_causes")? {
        chosen.max_causes = value.extract()?;
    }
    if let Some(value) = options.get_item("half_width")? {
        chosen.half_width = value.extract()?;
    }
    if let Some(value) = options.get_item("known_units")? {
        chosen.known_units = value.extract()?;
    }
    if let Some(value) = options.get_item("own")? {
        chosen.custom_effects = value.extract()?;
    }
    if let Some(value) = options.get_item("start")? {
        chosen.start = value.extract()?;
    }
    if let Some(value) = options.get_item("seed")? {
        chosen.seed = value.extract()?;
    }
    if let Some(value) = options.get_item("withheld")? {
        let withheld: Vec<(String, Option<usize>, String)> = value.extract()?;
        let of = |(effect, joint, why)| Withheld { effect, joint, why };
        chosen.withheld = withheld.into_iter().map(of).collect();
    }
    let result = with_progress(py, progress.as_ref(), move |observer| {
        let (training, holdout) = (views(&training), views(&holdout));
        let diagnosis = match &arm {
            AnyArm::Planar(arm) => run(arm, &training, &holdout, &chosen, observer),
            AnyArm::Serial(arm) => run_serial(arm, &training, &holdout, &chosen, observer),
        };
        let diagnosis = diagnosis.map_err(|e| e.to_string())?;
        serde_json::to_string(&diagnosis).map_err(|e| e.to_string())
    })?;
    result.map_err(PyValueError::new_err)
}

/// Arm with dynamics in closed form, or a serial arm.
enum AnyArm {
    Planar(ArmDescription),
    Serial(SerialArm),
}

impl AnyArm {
    fn of(arm: &Bound<'_, PyDict>) -> PyResult<Self> {
        if arm.contains("chain")? {
            serial_arm(arm).map(Self::Serial)
        } else {
            description(arm).map(Self::Planar)
        }
    }

    fn joints(&self) -> usize {
        match self {
            Self::Planar(arm) => arm.kind.joints(),
            Self::Serial(arm) => arm.chain.joints.len(),
        }
    }
}

fn copy(log: &PyLog<'_>, n: usize) -> PyResult<Owned> {
    let (name, source, t, q, tau, tables, moment, reference) = log;
    let t = vector(t, "t")?;
    let rows =
        |x: &PyReadonlyArray2<'_, f64>, name: &str| Ok::<_, PyErr>(matrix(x, name, t.len(), n)?.to_vec());
    Ok(Owned {
        name: name.clone(),
        source: source.clone(),
        t: t.to_vec(),
        q: rows(q, "q")?,
        tau: if reference.is_some() { Vec::new() } else { rows(tau, "tau")? },
        tables: tables.iter().map(|x| Ok(vector(x, "effects")?.to_vec())).collect::<PyResult<_>>()?,
        moment: moment.as_ref().map(|x| rows(x, "moment")).transpose()?,
        reference: reference
            .as_ref()
            .map(|(q, dq)| {
                Ok::<_, PyErr>((rows(q, "q_ref")?, dq.as_ref().map(|dq| rows(dq, "dq_ref")).transpose()?))
            })
            .transpose()?,
    })
}

fn views<'a>(logs: &'a [Owned]) -> Vec<LogData<'a>> {
    let view = |log: &'a Owned| LogData {
        name: log.name.clone(),
        source: log.source.clone(),
        t: &log.t,
        q: &log.q,
        tau: &log.tau,
        reference: log.reference.as_ref().map(|(q, dq)| (q.as_slice(), dq.as_deref())),
        moment: log.moment.as_deref(),
        tables: log.tables.iter().map(Vec::as_slice).collect(),
    };
    logs.iter().map(view).collect()
}
