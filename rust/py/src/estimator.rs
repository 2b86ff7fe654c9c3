//! `Estimator`: the online estimator, one sample at a time or over arrays.

use crate::convert::{kind_of, matrix, vector};
use armgap_core::monitor::MonitorSettings;
use armgap_core::online::{MOST_PARAMETERS, Online, OnlineError, OnlineSettings, SampleStatus, When};
use armgap_core::real::{Real, lit};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// An estimator in either precision; numbers cross the boundary as float64.
#[allow(clippy::large_enum_variant)] // Kept in a box.
#[derive(Clone, Copy)]
enum Any {
    Double(Online<f64>),
    Single(Online<f32>),
}

/// The online estimator.
#[pyclass(module = "armgap._native")]
#[derive(Clone)]
pub struct Estimator {
    // In a box: several kilobytes.
    any: Box<Any>,
    joints: usize,
}

/// Settings from arguments in the order of the Python class.
fn settings<T: Real>(
    kind: &str,
    scheme: &str,
    paper: bool,
    form: Option<&str>,
    asymmetry: bool,
    numbers: [f64; 6],
    counts: [u32; 2],
) -> PyResult<OnlineSettings<T>> {
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
    Ok(OnlineSettings {
        kind: kind_of(kind)?,
        scheme,
        variant,
        form,
        asymmetry,
        cutoff,
        forgetting,
        p0,
        monitor,
    })
}

/// Outcomes in the order of `armgap.estimator.OUTCOMES`.
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

/// Numbers of a slice in another precision, in fixed memory.
#[allow(clippy::cast_possible_truncation)] // That is the purpose.
fn narrowed(x: &[f64]) -> ([f32; MOST_PARAMETERS], usize) {
    let mut narrow = [0.0; MOST_PARAMETERS];
    for (n, x) in narrow.iter_mut().zip(x) {
        *n = *x as f32;
    }
    (narrow, x.len().min(MOST_PARAMETERS))
}

impl Any {
    fn update(&mut self, when: When<f64>, q: &[f64], dq: Option<&[f64]>, tau: &[f64]) -> SampleStatus {
        let outcome = match self {
            Self::Double(online) => online.update(when, q, dq, tau),
            Self::Single(online) => {
                let single = |x: f64| narrowed(&[x]).0[0];
                let when = match when {
                    When::At(t) => When::At(single(t)),
                    When::After(h) => When::After(single(h)),
                };
                let ((q, n), (tau, _)) = (narrowed(q), narrowed(tau));
                let dq = dq.map(|dq| narrowed(dq).0);
                online.update(when, &q[..n], dq.as_ref().map(|dq| &dq[..n]), &tau[..n])
            }
        };
        // Lengths are checked where arrays come in.
        outcome.unwrap_or(SampleStatus::Rejected)
    }

    /// Calls with what both precisions have, as doubles.
    fn with<const K: usize>(
        &self,
        double: impl Fn(&Online<f64>) -> [f64; K],
        single: impl Fn(&Online<f32>) -> [f64; K],
    ) -> [f64; K] {
        match self {
            Self::Double(online) => double(online),
            Self::Single(online) => single(online),
        }
    }

    fn parameters(&self) -> usize {
        match self {
            Self::Double(online) => online.theta().len(),
            Self::Single(online) => online.theta().len(),
        }
    }

    fn theta(&self) -> Vec<f64> {
        let mut theta = Vec::with_capacity(self.parameters());
        self.append_theta(&mut theta);
        theta
    }

    fn append_theta(&self, to: &mut Vec<f64>) {
        match self {
            Self::Double(online) => to.extend_from_slice(online.theta()),
            Self::Single(online) => to.extend(online.theta().iter().map(|x| f64::from(*x))),
        }
    }

    fn errors(&self) -> Vec<f64> {
        match self {
            Self::Double(online) => online.errors().to_vec(),
            Self::Single(online) => online.errors().iter().map(|x| f64::from(*x)).collect(),
        }
    }

    fn sigma(&self) -> Vec<f64> {
        match self {
            Self::Double(online) => {
                let mut sigma = [0.0; MOST_PARAMETERS];
                let count = online.sigma(&mut sigma);
                sigma[..count].to_vec()
            }
            Self::Single(online) => {
                let mut sigma = [0.0_f32; MOST_PARAMETERS];
                let count = online.sigma(&mut sigma);
                sigma[..count].iter().map(|x| f64::from(*x)).collect()
            }
        }
    }
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
            let settings = settings::<f32>(kind, scheme, paper, form, asymmetry, numbers, counts)?;
            if theta0.len() > MOST_PARAMETERS {
                return Err(complaint(OnlineError::Length {
                    name: "theta0",
                    expected: settings.parameters(),
                }));
            }
            let (theta0, count) = narrowed(&theta0);
            Any::Single(Online::new(settings, &theta0[..count]).map_err(complaint)?)
        } else {
            let settings = settings::<f64>(kind, scheme, paper, form, asymmetry, numbers, counts)?;
            Any::Double(Online::new(settings, &theta0).map_err(complaint)?)
        };
        Ok(Self { any: Box::new(any), joints: kind_of(kind)?.joints() })
    }

    /// Takes one sample; 0 updated, 1 starting, 2 rejected.
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

    /// Takes many samples without the interpreter's lock; the estimates after each, and what became of each.
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        when: PyReadonlyArray1<'py, f64>,
        after: bool,
        q: PyReadonlyArray2<'py, f64>,
        dq: Option<PyReadonlyArray2<'py, f64>>,
        tau: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<u8>>)> {
        let when = vector(&when, "t")?;
        let n = self.joints;
        let (q, tau) = (matrix(&q, "q", when.len(), n)?, matrix(&tau, "tau", when.len(), n)?);
        let dq = dq.as_ref().map(|dq| matrix(dq, "dq", when.len(), n)).transpose()?;
        let any = &mut self.any;
        let (theta, outcomes) = py.detach(|| {
            let (mut theta, mut outcomes) =
                (Vec::with_capacity(when.len() * any.parameters()), Vec::with_capacity(when.len()));
            for (k, t) in when.iter().enumerate() {
                let row = |x: &'_ [f64]| k * n..(k * n + n).min(x.len());
                let moment = if after { When::After(*t) } else { When::At(*t) };
                let dq = dq.map(|dq| &dq[row(dq)]);
                outcomes.push(code(any.update(moment, &q[row(q)], dq, &tau[row(tau)])));
                any.append_theta(&mut theta);
            }
            (theta, outcomes)
        });
        let parameters = self.any.parameters();
        let theta = PyArray1::from_vec(py, theta).reshape([when.len(), parameters])?;
        Ok((theta, PyArray1::from_vec(py, outcomes)))
    }

    /// A copy with the same state.
    fn copy(&self) -> Self {
        self.clone()
    }

    #[getter]
    fn theta<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.any.theta())
    }

    #[getter]
    fn sigma<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.any.sigma())
    }

    #[getter]
    fn errors<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.any.errors())
    }

    /// Excitation and alarm.
    #[getter]
    fn signals(&self) -> (f64, f64) {
        let [excitation, alarm] = self.any.with(
            |o| [o.excitation(), o.alarm_level()],
            |o| [f64::from(o.excitation()), f64::from(o.alarm_level())],
        );
        (excitation, alarm)
    }

    /// Samples used and rejected.
    #[getter]
    fn counts(&self) -> (u64, u64) {
        match &*self.any {
            Any::Double(o) => (o.updates(), o.rejected()),
            Any::Single(o) => (o.updates(), o.rejected()),
        }
    }
}
