//! Python functions `simulate` and `inertia`.

use crate::convert::{effect_instances, kind_of, matrix, vector};
use crate::progress::{guarded_from_panics, with_progress};
use armgap_fit::model::arm::ArmDescription;
use armgap_fit::model::hypothesis::EffectInstance;
use armgap_fit::predict::simulate::{
    InertiaMatrices, MAX_SUBSTEPS, Simulation, SimulationError, Trajectory, Window,
};
use armgap_fit::progress::{Control, Observer, ProgressReporter, guarded};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Simulates an arm with effects under held torques: positions, rad or m, and velocities, (samples, joints).
#[pyfunction]
#[pyo3(signature = (kind, gravity, link_length, theta, t, tau, q0, dq0, effects, tolerance=1e-9, smoothing=Vec::new(), progress=None))]
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
    smoothing: Vec<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Motion<'py>> {
    let kind = kind_of(kind)?;
    let effects = effect_instances(kind.joints(), effects)?;
    let wrong = format!("`theta` needs {} values", kind.parameters().len());
    let arm = ArmDescription::plain(kind, gravity, theta, link_length);
    let inputs = Inputs { t: &t, tau: &tau, start: [&q0, &dq0], effects, tolerance, smoothing };
    let run = move |work: Simulation<'_>| arm.dispatch(work);
    inputs.run(py, kind.joints(), progress, run)?.ok_or_else(|| PyValueError::new_err(wrong))
}

/// Simulates windows of a motion on all threads, each from an initial state of its own, as `simulate` does: positions, rad or m, and velocities at
/// the last `samples` of each window, (windows, samples, joints), and sub-steps per sample that met the tolerance, (windows,). With `substeps`, windows
/// are simulated with those and no tolerance is checked; an arm that needs more than `max_substeps` is an error.
#[pyfunction]
#[pyo3(signature = (kind, gravity, link_length, theta, t, tau, rows, samples, q0, dq0, effects, tolerance=1e-9, smoothing=Vec::new(), substeps=None, max_substeps=MAX_SUBSTEPS))]
pub fn simulate_windows<'py>(
    py: Python<'py>,
    kind: &str,
    gravity: f64,
    link_length: Option<Vec<f64>>,
    theta: Vec<f64>,
    t: PyReadonlyArray1<'py, f64>,
    tau: PyReadonlyArray2<'py, f64>,
    rows: Vec<(usize, usize)>,
    samples: usize,
    q0: PyReadonlyArray2<'py, f64>,
    dq0: PyReadonlyArray2<'py, f64>,
    effects: Vec<(String, Option<usize>, BTreeMap<String, f64>)>,
    tolerance: f64,
    smoothing: Vec<f64>,
    substeps: Option<Vec<usize>>,
    max_substeps: usize,
) -> PyResult<WindowMotion<'py>> {
    let kind = kind_of(kind)?;
    let n = kind.joints();
    let effects = effect_instances(n, effects)?;
    let wrong = format!("`theta` needs {} values", kind.parameters().len());
    let arm = ArmDescription::plain(kind, gravity, theta, link_length);
    let t = vector(&t, "t")?;
    let tau = matrix(&tau, "tau", t.len(), n)?;
    let (q0, dq0) = (matrix(&q0, "q0", rows.len(), n)?, matrix(&dq0, "dq0", rows.len(), n)?);
    if rows.iter().any(|&(begin, end)| begin > end || end > t.len() || end - begin < samples) {
        let text = format!("`rows` needs windows of {samples} or more samples among {}", t.len());
        return Err(PyValueError::new_err(text));
    }
    if substeps.as_ref().is_some_and(|all| all.len() != rows.len()) {
        return Err(PyValueError::new_err(format!("`substeps` needs {} values", rows.len())));
    }
    let window = |w: usize| {
        let (begin, end) = rows[w];
        let start = n * w..n * (w + 1);
        Window {
            rows: begin..end,
            q0: &q0[start.clone()],
            dq0: &dq0[start],
            substeps: substeps.as_ref().map(|all| all[w]),
        }
    };
    let windows: Vec<Window<'_>> = (0..rows.len()).map(window).collect();
    let nobody: Observer = Arc::new(|_| Control::Go);
    let (rest, progress) = (vec![0.0; n], ProgressReporter::new(nobody));
    let (effects, smoothing) = (&effects, &smoothing);
    let work = Simulation {
        t,
        tau,
        q0: &rest,
        dq0: &rest,
        effects,
        tolerance,
        max_substeps,
        smoothing,
        progress: &progress,
    };
    let ended = py.detach(|| guarded_from_panics(|| work.windows(&arm, &windows)))?;
    let found = ended
        .ok_or_else(|| PyValueError::new_err(wrong))?
        .map_err(|e| PyValueError::new_err(e.to_string()))?;
    let last = |of: fn(&Trajectory) -> &Vec<f64>| {
        let all = found.iter().flat_map(|x| &of(x)[of(x).len() - samples * n..]).copied();
        PyArray1::from_vec(py, all.collect()).reshape([rows.len(), samples, n])
    };
    Ok((last(|x| &x.q)?, last(|x| &x.dq)?, found.iter().map(|x| x.substeps).collect()))
}

/// Positions and velocities of windows, (windows, samples, joints), and sub-steps per sample, (windows,).
type WindowMotion<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray3<f64>>, Vec<usize>);

/// Arguments of a simulation of any arm.
pub(crate) struct Inputs<'a, 'py> {
    pub(crate) t: &'a PyReadonlyArray1<'py, f64>,
    pub(crate) tau: &'a PyReadonlyArray2<'py, f64>,
    /// Joint positions and velocities at the first sample.
    pub(crate) start: [&'a PyReadonlyArray1<'py, f64>; 2],
    pub(crate) effects: Vec<EffectInstance>,
    pub(crate) tolerance: f64,
    /// Width of the smoothed sign in each joint's friction, rad/s or m/s; empty for exact dry friction.
    pub(crate) smoothing: Vec<f64>,
}

/// Joint positions, rad or m, and velocities, (samples, joints).
pub(crate) type Motion<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

impl Inputs<'_, '_> {
    /// Simulates an arm of `n` joints by `run`; `None` if `run` does not take the arm.
    pub(crate) fn run(
        self,
        py: Python<'_>,
        n: usize,
        progress: Option<Py<PyAny>>,
        run: impl FnOnce(Simulation<'_>) -> Option<Result<Trajectory, SimulationError>> + Send + 'static,
    ) -> PyResult<Option<Motion<'_>>> {
        let t = vector(self.t, "t")?;
        let tau = matrix(self.tau, "tau", t.len(), n)?;
        let (q0, dq0) = (vector(self.start[0], "q0")?, vector(self.start[1], "dq0")?);
        if q0.len() != n || dq0.len() != n {
            return Err(PyValueError::new_err(format!("`q0` and `dq0` need {n} values")));
        }
        let Self { effects, tolerance, smoothing, .. } = self;
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
                max_substeps: MAX_SUBSTEPS,
                smoothing: &smoothing,
                progress: &reporter,
            };
            guarded(|| run(work))
        })?;
        // The work is cancelled only after an interrupt, when `with_progress` has returned an error.
        let Some(result) = ended.flatten() else { return Ok(None) };
        let trajectory = result.map_err(|e| PyValueError::new_err(e.to_string()))?;
        let shape = |x: Vec<f64>| PyArray1::from_vec(py, x).reshape([rows, n]);
        Ok(Some((shape(trajectory.q)?, shape(trajectory.dq)?)))
    }
}

/// Inertia matrices of an arm with effects at the positions `q`: (positions, joints, joints).
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
