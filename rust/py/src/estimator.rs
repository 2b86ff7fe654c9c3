//! Python class `Estimator`: the online estimator, one sample at a time or over arrays.

use crate::chain::Chain;
use crate::convert::{kind_of, matrix, vector};
use armgap_core::chain::{ChainJoint, MAX_JOINTS};
use armgap_core::monitor::MonitorSettings;
use armgap_core::online::{
    ChainSettings, ChainSize, EstimatorSettings, LargeChain, MediumChain, Online, OnlineError,
    OnlineEstimator, OnlineSettings, SampleStatus, SmallChain, When,
};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use armgap_fit::model::chain::ChainDescription;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Estimates, (samples, parameters), prediction errors, (samples, outputs), and outcome of each sample: 0 updated, 1 starting, 2 rejected.
type Run<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<u8>>);

/// Online estimator of one of the arms in closed form, or of a serial arm in one of three sizes.
#[allow(clippy::large_enum_variant)] // Kept in a box.
#[derive(Clone, Copy)]
enum Running<T: Real> {
    OfKind(Online<T>),
    Small(SmallChain<T>),
    Medium(MediumChain<T>),
    Large(LargeChain<T>),
}

impl<T: Real> Running<T> {
    fn of_chain(settings: &ChainSettings<'_, T>, theta0: &[T]) -> PyResult<Self> {
        let made = match ChainSize::of(settings.joints.len(), settings.columns.len()) {
            Some(ChainSize::Small) => SmallChain::of_chain(settings, theta0).map(Self::Small),
            Some(ChainSize::Medium) => MediumChain::of_chain(settings, theta0).map(Self::Medium),
            Some(ChainSize::Large) => LargeChain::of_chain(settings, theta0).map(Self::Large),
            None => {
                let [joints, parameters] = ChainSize::Large.room();
                return Err(PyValueError::new_err(format!(
                    "{} parameters of {} joints: there is room for {parameters} of {joints}",
                    settings.columns.len(),
                    settings.joints.len()
                )));
            }
        };
        made.map_err(complaint)
    }

    /// Covariance of the estimate for an error of unit variance, row by row.
    fn covariance(&self) -> Vec<T> {
        let mut out = vec![T::zero(); self.estimator().theta().len().pow(2)];
        match self {
            Self::OfKind(online) => online.covariance(&mut out),
            Self::Small(chain) => chain.covariance(&mut out),
            Self::Medium(chain) => chain.covariance(&mut out),
            Self::Large(chain) => chain.covariance(&mut out),
        };
        out
    }

    fn estimator(&self) -> &dyn OnlineEstimator<T> {
        match self {
            Self::OfKind(online) => online.estimator(),
            Self::Small(chain) => chain,
            Self::Medium(chain) => chain,
            Self::Large(chain) => chain,
        }
    }

    fn estimator_mut(&mut self) -> &mut dyn OnlineEstimator<T> {
        match self {
            Self::OfKind(online) => online.estimator_mut(),
            Self::Small(chain) => chain,
            Self::Medium(chain) => chain,
            Self::Large(chain) => chain,
        }
    }
}

/// Online estimator in double or single precision; numbers cross the Python boundary as float64.
#[allow(clippy::large_enum_variant)] // Kept in a box.
#[derive(Clone, Copy)]
enum Any {
    Double(Running<f64>),
    Single(Running<f32>),
}

/// Online estimator of an arm's parameters.
#[pyclass(module = "armgap._native")]
#[derive(Clone)]
pub struct Estimator {
    // In a box, as an estimator takes up to a hundred kilobytes.
    any: Box<Any>,
    joints: usize,
}

/// Settings of an online estimator; `numbers` are cut-off, rad/s, forgetting factor, p0, memory, samples between false alarms and floor, `counts`
/// numbers of samples for settling and learning.
fn settings<T: Real>(
    scheme: &str,
    paper: bool,
    form: Option<&str>,
    numbers: [f64; 6],
    counts: [u32; 2],
) -> PyResult<EstimatorSettings<T>> {
    let scheme = Scheme::from_name(scheme)
        .ok_or_else(|| PyValueError::new_err(format!("unknown scheme `{scheme}`")))?;
    let form = match form {
        None => None,
        Some("plain") => Some(Form::Plain),
        Some("factorized") => Some(Form::Factorized),
        Some(other) => return Err(PyValueError::new_err(format!("unknown form `{other}`"))),
    };
    let [cutoff, forgetting, p0, memory, between, floor] = numbers.map(lit::<T>);
    let monitor = MonitorSettings { memory, settling: counts[0], learning: counts[1], between, floor };
    let variant = if paper { Variant::Paper } else { Variant::Exact };
    Ok(EstimatorSettings { scheme, variant, form, cutoff, forgetting, p0, monitor })
}

/// Online estimator of an arm with dynamics in closed form.
fn of_kind<T: Real>(
    kind: &str,
    asymmetry: bool,
    common: EstimatorSettings<T>,
    theta0: &[f64],
) -> PyResult<Running<T>> {
    let settings = OnlineSettings::of(kind_of(kind)?, asymmetry, common);
    Online::new(settings, &converted(theta0)).map(Running::OfKind).map_err(complaint)
}

/// Online estimator of the parameters `columns` of a serial arm; `known` are values of its other parameters, SI.
fn of_chain<T: Real>(
    chain: &ChainDescription,
    columns: &[usize],
    known: &[f64],
    common: EstimatorSettings<T>,
    theta0: &[f64],
) -> PyResult<Running<T>> {
    let joint = |joint: &ChainJoint<f64>| ChainJoint {
        kind: joint.kind,
        rotation: joint.rotation.map(|row| row.map(lit)),
        translation: joint.translation.map(lit),
        axis: joint.axis.map(lit),
    };
    let (joints, known): (Vec<_>, Vec<T>) = (chain.joints.iter().map(joint).collect(), converted(known));
    let gravity = chain.gravity.map(lit);
    let settings = ChainSettings { common, joints: &joints, gravity, columns, known: &known };
    Running::of_chain(&settings, &converted(theta0))
}

/// Numbers of a list converted to the precision of `T`.
fn converted<T: Real>(x: &[f64]) -> Vec<T> {
    x.iter().map(|x| lit(*x)).collect()
}

/// Code of the outcome of a sample: its index in `armgap.estimator.OUTCOMES`.
fn code(outcome: SampleStatus) -> u8 {
    match outcome {
        SampleStatus::Updated => 0,
        SampleStatus::Starting => 1,
        SampleStatus::Rejected => 2,
    }
}

fn complaint(error: OnlineError) -> PyErr {
    PyValueError::new_err(match error {
        OnlineError::Range(name) => format!("`{name}` is outside its range"),
        OnlineError::Length { name, expected } => format!("`{name}` needs {expected} values"),
    })
}

/// Numbers in single precision, at most one per joint, in fixed memory, and how many they are.
#[allow(clippy::cast_possible_truncation)] // That is the purpose.
fn narrowed(x: &[f64]) -> ([f32; MAX_JOINTS], usize) {
    let mut narrow = [0.0; MAX_JOINTS];
    for (n, x) in narrow.iter_mut().zip(x) {
        *n = *x as f32;
    }
    (narrow, x.len().min(MAX_JOINTS))
}

impl Any {
    fn update(&mut self, when: When<f64>, q: &[f64], dq: Option<&[f64]>, tau: &[f64]) -> SampleStatus {
        let outcome = match self {
            Self::Double(running) => running.estimator_mut().update(when, q, dq, tau),
            Self::Single(running) => {
                let single = |x: f64| narrowed(&[x]).0[0];
                let when = match when {
                    When::At(t) => When::At(single(t)),
                    When::After(h) => When::After(single(h)),
                };
                let ((q, n), (tau, _)) = (narrowed(q), narrowed(tau));
                let dq = dq.map(|dq| narrowed(dq).0);
                running.estimator_mut().update(when, &q[..n], dq.as_ref().map(|dq| &dq[..n]), &tau[..n])
            }
        };
        // Lengths are checked where arrays come in.
        outcome.unwrap_or(SampleStatus::Rejected)
    }

    /// Appends the estimated parameters, SI, to a list.
    fn theta(&self, to: &mut Vec<f64>) {
        match self {
            Self::Double(running) => to.extend_from_slice(running.estimator().theta()),
            Self::Single(running) => to.extend(running.estimator().theta().iter().map(|x| f64::from(*x))),
        }
    }

    /// Appends the standard deviations of the estimated parameters, SI, to a list.
    fn sigma(&self, to: &mut Vec<f64>) {
        match self {
            Self::Double(running) => to.extend(sigma_of(running.estimator())),
            Self::Single(running) => to.extend(sigma_of(running.estimator()).into_iter().map(f64::from)),
        }
    }

    /// Appends the prediction errors of the last sample that was used to a list.
    fn errors(&self, to: &mut Vec<f64>) {
        match self {
            Self::Double(running) => to.extend_from_slice(running.estimator().errors()),
            Self::Single(running) => to.extend(running.estimator().errors().iter().map(|x| f64::from(*x))),
        }
    }
}

/// Standard deviations of the estimated parameters, SI.
fn sigma_of<T: Real>(estimator: &dyn OnlineEstimator<T>) -> Vec<T> {
    let mut sigma = vec![T::zero(); estimator.theta().len()];
    estimator.sigma(&mut sigma);
    sigma
}

#[pymethods]
impl Estimator {
    #[new]
    fn new(
        kind: &str,
        scheme: &str,
        paper: bool,
        form: Option<&str>,
        asymmetry: bool,
        single: bool,
        numbers: [f64; 6],
        counts: [u32; 2],
        theta0: Vec<f64>,
    ) -> PyResult<Self> {
        let any = if single {
            Any::Single(of_kind(kind, asymmetry, settings(scheme, paper, form, numbers, counts)?, &theta0)?)
        } else {
            Any::Double(of_kind(kind, asymmetry, settings(scheme, paper, form, numbers, counts)?, &theta0)?)
        };
        Ok(Self { any: Box::new(any), joints: kind_of(kind)?.joints() })
    }

    /// Online estimator of the parameters `columns` of a serial arm; `known`, 13 values per joint, SI, are used for all other parameters.
    #[staticmethod]
    fn of_chain(
        chain: &Chain,
        columns: Vec<usize>,
        known: Vec<f64>,
        scheme: &str,
        paper: bool,
        form: Option<&str>,
        single: bool,
        numbers: [f64; 6],
        counts: [u32; 2],
        theta0: Vec<f64>,
    ) -> PyResult<Self> {
        let chain = chain.description();
        let any = if single {
            let common = settings(scheme, paper, form, numbers, counts)?;
            Any::Single(of_chain(chain, &columns, &known, common, &theta0)?)
        } else {
            let common = settings(scheme, paper, form, numbers, counts)?;
            Any::Double(of_chain(chain, &columns, &known, common, &theta0)?)
        };
        Ok(Self { any: Box::new(any), joints: chain.joints.len() })
    }

    /// Takes one sample at the time `when`, s, or, with `after`, `when` seconds after the last one; returns 0 for updated, 1 starting, 2 rejected.
    #[pyo3(signature = (when, after, q, dq, tau))]
    fn update(
        &mut self,
        when: f64,
        after: bool,
        q: PyReadonlyArray1<'_, f64>,
        dq: Option<PyReadonlyArray1<'_, f64>>,
        tau: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<u8> {
        let (q, tau) = (vector(&q, "q")?, vector(&tau, "tau")?);
        let dq = dq.as_ref().map(|dq| vector(dq, "dq")).transpose()?;
        for (name, x) in [("q", Some(q)), ("tau", Some(tau)), ("dq", dq)] {
            if x.is_some_and(|x| x.len() != self.joints) {
                return Err(PyValueError::new_err(format!("`{name}` needs {} values", self.joints)));
            }
        }
        let when = if after { When::After(when) } else { When::At(when) };
        Ok(code(self.any.update(when, q, dq, tau)))
    }

    /// Takes many samples without the interpreter's lock; returns estimates and prediction errors after each sample, errors NaN for samples without
    /// an update, and outcomes: 0 updated, 1 starting, 2 rejected.
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        when: PyReadonlyArray1<'py, f64>,
        after: bool,
        q: PyReadonlyArray2<'py, f64>,
        dq: Option<PyReadonlyArray2<'py, f64>>,
        tau: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Run<'py>> {
        let when = vector(&when, "t")?;
        let n = self.joints;
        let (q, tau) = (matrix(&q, "q", when.len(), n)?, matrix(&tau, "tau", when.len(), n)?);
        let dq = dq.as_ref().map(|dq| matrix(dq, "dq", when.len(), n)).transpose()?;
        let any = &mut self.any;
        let (theta, errors, outcomes) = py.detach(|| {
            let (mut theta, mut errors, mut outcomes) =
                (Vec::new(), Vec::new(), Vec::with_capacity(when.len()));
            for (k, t) in when.iter().enumerate() {
                let row = |x: &'_ [f64]| k * n..(k * n + n).min(x.len());
                let moment = if after { When::After(*t) } else { When::At(*t) };
                let dq = dq.map(|dq| &dq[row(dq)]);
                let outcome = any.update(moment, &q[row(q)], dq, &tau[row(tau)]);
                outcomes.push(code(outcome));
                any.theta(&mut theta);
                let before = errors.len();
                any.errors(&mut errors);
                if outcome != SampleStatus::Updated {
                    errors[before..].fill(f64::NAN);
                }
            }
            (theta, errors, outcomes)
        });
        Ok((
            self.table(py, theta, Any::theta)?,
            self.table(py, errors, Any::errors)?,
            PyArray1::from_vec(py, outcomes),
        ))
    }

    /// Copy of the estimator in its present state.
    fn copy(&self) -> Self {
        self.clone()
    }

    #[getter]
    fn theta<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.listed(Any::theta))
    }

    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.listed(Any::sigma))
    }

    /// Covariance of the estimate for an error of unit variance, (parameters, parameters).
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let entries = match &*self.any {
            Any::Double(running) => running.covariance(),
            Any::Single(running) => running.covariance().into_iter().map(f64::from).collect(),
        };
        self.table(py, entries, Any::theta)
    }

    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.listed(Any::errors))
    }

    /// Excitation, from 0 to about 1, and alarm level, above 1 for an alarm.
    #[getter]
    fn signals(&self) -> (f64, f64) {
        match &*self.any {
            Any::Double(running) => (running.estimator().excitation(), running.estimator().alarm_level()),
            Any::Single(running) => {
                let estimator = running.estimator();
                (f64::from(estimator.excitation()), f64::from(estimator.alarm_level()))
            }
        }
    }

    /// Numbers of samples used and rejected.
    #[getter]
    fn counts(&self) -> (u64, u64) {
        match &*self.any {
            Any::Double(running) => (running.estimator().updates(), running.estimator().rejected()),
            Any::Single(running) => (running.estimator().updates(), running.estimator().rejected()),
        }
    }
}

impl Estimator {
    /// Numbers that `append` takes from the estimator's present state.
    fn listed(&self, append: fn(&Any, &mut Vec<f64>)) -> Vec<f64> {
        let mut list = Vec::new();
        append(&self.any, &mut list);
        list
    }

    /// Array of `rows`, each as long as the list that `append` gives.
    fn table<'py>(
        &self,
        py: Python<'py>,
        rows: Vec<f64>,
        append: fn(&Any, &mut Vec<f64>),
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let width = self.listed(append).len();
        let count = rows.len() / width;
        PyArray1::from_vec(py, rows).reshape([count, width])
    }
}
