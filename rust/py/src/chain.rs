//! Python class `Chain`: dynamics of a serial arm of one to seven joints over arrays of states.

use crate::convert::{effect_instances, matrix, vector};
use crate::progress::with_progress;
use crate::simulate::{Inputs, Motion};
use armgap_core::chain::{ChainJoint, JointKind, MAX_JOINTS, PARAMETERS_PER_JOINT};
use armgap_fit::identify::base_parameters::AmongParameters;
use armgap_fit::model::chain::{ChainDescription, ChainRows, Quantity};
use armgap_fit::predict::simulate::Simulation;
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// Largest accepted departure of a joint's rotation matrix from orthogonality, and of a joint axis from unit length.
const ORTHOGONAL: f64 = 1e-6;

/// Serial arm of one to seven joints, under gravity.
#[pyclass(module = "armgap._native", frozen)]
#[derive(Clone)]
pub struct Chain {
    description: ChainDescription,
}

/// Arguments of a method of [`Chain`]: parameters, positions, velocities, and named accelerations or torques, one row per state.
struct Arguments<'a, 'py> {
    theta: Option<Vec<f64>>,
    q: &'a PyReadonlyArray2<'py, f64>,
    dq: Option<&'a PyReadonlyArray2<'py, f64>>,
    input: Option<(&'a str, &'a PyReadonlyArray2<'py, f64>)>,
}

impl Chain {
    /// Joints and gravity of the chain, as `armgap-fit` takes them.
    pub(crate) fn description(&self) -> &ChainDescription {
        &self.description
    }

    fn joints(&self) -> usize {
        self.description.joints.len()
    }

    /// Checked parameters of the chain, 13 per joint; empty if they are not given.
    fn parameters_of(&self, theta: Option<Vec<f64>>) -> PyResult<Vec<f64>> {
        let needed = PARAMETERS_PER_JOINT * self.joints();
        match theta {
            Some(theta) if theta.len() != needed => {
                Err(PyValueError::new_err(format!("`theta` has {} values, expected {needed}", theta.len())))
            }
            theta => Ok(theta.unwrap_or_default()),
        }
    }

    /// Values of a quantity at every state, row after row, and the number of states.
    fn rows(
        &self,
        py: Python<'_>,
        quantity: Quantity,
        arguments: Arguments<'_, '_>,
    ) -> PyResult<(Vec<f64>, usize)> {
        let theta = self.parameters_of(arguments.theta)?;
        let (n, rows) = (self.joints(), numpy::PyUntypedArrayMethods::shape(&**arguments.q)[0]);
        let of = |x: Option<(&str, &PyReadonlyArray2<'_, f64>)>| {
            x.map_or(Ok(Vec::new()), |(name, x)| matrix(x, name, rows, n).map(<[f64]>::to_vec))
        };
        let q = of(Some(("q", arguments.q)))?;
        let dq = of(arguments.dq.map(|dq| ("dq", dq)))?;
        let input = of(arguments.input)?;
        let description = self.description.clone();
        let found = with_progress(py, None, move |_| {
            description.dispatch(ChainRows { quantity, theta: &theta, q: &q, dq: &dq, input: &input })
        })?;
        Ok((found.ok_or_else(wrong_size)?, rows))
    }

    fn scalars<'py>(
        &self,
        py: Python<'py>,
        quantity: Quantity,
        arguments: Arguments<'_, 'py>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_vec(py, self.rows(py, quantity, arguments)?.0))
    }

    fn vectors<'py>(
        &self,
        py: Python<'py>,
        quantity: Quantity,
        arguments: Arguments<'_, 'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (found, rows) = self.rows(py, quantity, arguments)?;
        PyArray1::from_vec(py, found).reshape([rows, quantity.shape(self.joints())[0]])
    }

    fn matrices<'py>(
        &self,
        py: Python<'py>,
        quantity: Quantity,
        arguments: Arguments<'_, 'py>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let (found, rows) = self.rows(py, quantity, arguments)?;
        let shape = quantity.shape(self.joints());
        PyArray1::from_vec(py, found).reshape([rows, shape[0], shape[1]])
    }
}

/// Error for a number of joints that is not supported, which the constructor rules out.
fn wrong_size() -> PyErr {
    PyValueError::new_err(format!("a chain has one to {MAX_JOINTS} joints"))
}

/// Checked rows of an array of shape `(n, 3)`.
fn vectors_of(x: &PyReadonlyArray2<'_, f64>, name: &str, n: usize) -> PyResult<Vec<[f64; 3]>> {
    Ok(matrix(x, name, n, 3)?.as_chunks().0.to_vec())
}

/// Error if the rotation, translation or axis of joint `j`, from 0, is invalid.
fn check_joint(joint: &ChainJoint<f64>, j: usize) -> PyResult<()> {
    let r = &joint.rotation;
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let off = |i: usize, k: usize| (dot(&r[i], &r[k]) - if i == k { 1.0 } else { 0.0 }).abs();
    let cross = [
        r[0][1] * r[1][2] - r[0][2] * r[1][1],
        r[0][2] * r[1][0] - r[0][0] * r[1][2],
        r[0][0] * r[1][1] - r[0][1] * r[1][0],
    ];
    let orthogonal = (0..3).all(|i| (i..3).all(|k| off(i, k) <= ORTHOGONAL)) && dot(&cross, &r[2]) > 0.0;
    let number = j + 1;
    if !orthogonal {
        return Err(PyValueError::new_err(format!("`rotation` of joint {number} is not a rotation matrix")));
    }
    if !joint.translation.iter().all(|x| x.is_finite()) {
        return Err(PyValueError::new_err(format!("`translation` of joint {number} is not finite")));
    }
    let length = dot(&joint.axis, &joint.axis).sqrt();
    if length.is_nan() || (length - 1.0).abs() > ORTHOGONAL {
        return Err(PyValueError::new_err(format!(
            "`axis` of joint {number} has length {length}, expected 1"
        )));
    }
    Ok(())
}

#[pymethods]
impl Chain {
    #[new]
    fn new(
        kinds: Vec<String>,
        rotation: PyReadonlyArray3<'_, f64>,
        translation: PyReadonlyArray2<'_, f64>,
        axis: PyReadonlyArray2<'_, f64>,
        gravity: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        let n = kinds.len();
        if !(1..=MAX_JOINTS).contains(&n) {
            return Err(PyValueError::new_err(format!("{n} joints: a chain has one to {MAX_JOINTS}")));
        }
        let shape = numpy::PyUntypedArrayMethods::shape(&*rotation);
        if shape != [n, 3, 3] {
            return Err(PyValueError::new_err(format!(
                "`rotation` has shape {shape:?}, expected [{n}, 3, 3]"
            )));
        }
        let rotation = rotation
            .as_slice()
            .map_err(|_| PyValueError::new_err("`rotation` must be a C-contiguous array of float64"))?;
        let (translation, axis) =
            (vectors_of(&translation, "translation", n)?, vectors_of(&axis, "axis", n)?);
        let gravity = vector(&gravity, "gravity")?;
        let gravity: [f64; 3] = gravity
            .try_into()
            .ok()
            .filter(|g: &[f64; 3]| g.iter().all(|x| x.is_finite()))
            .ok_or_else(|| PyValueError::new_err("`gravity` needs 3 finite values"))?;
        let rows = rotation.as_chunks::<3>().0.as_chunks::<3>().0;
        let mut joints = Vec::with_capacity(n);
        for (j, name) in kinds.iter().enumerate() {
            let kind = match name.as_str() {
                "revolute" => JointKind::Revolute,
                "prismatic" => JointKind::Prismatic,
                other => {
                    return Err(PyValueError::new_err(format!(
                        "unknown kind of joint `{other}`; known: revolute, prismatic"
                    )));
                }
            };
            let joint = ChainJoint { kind, rotation: rows[j], translation: translation[j], axis: axis[j] };
            check_joint(&joint, j)?;
            joints.push(joint);
        }
        Ok(Self { description: ChainDescription { joints, gravity } })
    }

    #[getter]
    fn n_joints(&self) -> usize {
        self.joints()
    }

    #[getter]
    fn parameter_names(&self) -> Vec<String> {
        self.description.parameters().into_iter().map(|(name, _)| name).collect()
    }

    #[getter]
    fn parameter_units(&self) -> Vec<&'static str> {
        self.description.parameters().into_iter().map(|(_, unit)| unit).collect()
    }

    /// Base parameters among the candidates, by index, of which `13 n + j` is a constant torque of joint `j`: indices of estimated parameters,
    /// indices of dependent ones, and the factor, (estimated, dependent), by which each dependent parameter adds to each estimated one.
    fn base_parameters<'py>(
        &self,
        py: Python<'py>,
        candidates: Vec<usize>,
    ) -> PyResult<(Vec<usize>, Vec<usize>, Bound<'py, PyArray2<f64>>)> {
        let base = AmongParameters(&candidates).of(&self.description).ok_or_else(wrong_size)?;
        let combination =
            PyArray1::from_vec(py, base.combination).reshape([base.columns.len(), base.dependent.len()])?;
        Ok((base.columns, base.dependent, combination))
    }

    fn inertia<'py>(
        &self,
        py: Python<'py>,
        theta: Vec<f64>,
        q: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let arguments = Arguments { theta: Some(theta), q: &q, dq: None, input: None };
        self.matrices(py, Quantity::Inertia, arguments)
    }

    fn bias<'py>(
        &self,
        py: Python<'py>,
        theta: Vec<f64>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let arguments = Arguments { theta: Some(theta), q: &q, dq: Some(&dq), input: None };
        self.vectors(py, Quantity::Bias, arguments)
    }

    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        theta: Vec<f64>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
        ddq: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let arguments = Arguments { theta: Some(theta), q: &q, dq: Some(&dq), input: Some(("ddq", &ddq)) };
        self.vectors(py, Quantity::InverseDynamics, arguments)
    }

    fn torque_derivatives<'py>(
        &self,
        py: Python<'py>,
        theta: Vec<f64>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
        ddq: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray3<f64>>, Bound<'py, PyArray3<f64>>)> {
        let arguments =
            |theta| Arguments { theta: Some(theta), q: &q, dq: Some(&dq), input: Some(("ddq", &ddq)) };
        let by_position = self.matrices(py, Quantity::TorqueByPosition, arguments(theta.clone()))?;
        Ok((by_position, self.matrices(py, Quantity::TorqueByVelocity, arguments(theta))?))
    }

    fn acceleration<'py>(
        &self,
        py: Python<'py>,
        theta: Vec<f64>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
        tau: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let arguments = Arguments { theta: Some(theta), q: &q, dq: Some(&dq), input: Some(("tau", &tau)) };
        self.vectors(py, Quantity::Acceleration, arguments)
    }

    fn regressor<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
        ddq: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let arguments = Arguments { theta: None, q: &q, dq: Some(&dq), input: Some(("ddq", &ddq)) };
        self.matrices(py, Quantity::Regressor, arguments)
    }

    fn momentum_regressor<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let arguments = Arguments { theta: None, q: &q, dq: Some(&dq), input: None };
        self.matrices(py, Quantity::MomentumRegressor, arguments)
    }

    fn potential_regressor<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let arguments = Arguments { theta: None, q: &q, dq: Some(&dq), input: None };
        self.matrices(py, Quantity::PotentialRegressor, arguments)
    }

    fn energy_regressor<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let arguments = Arguments { theta: None, q: &q, dq: Some(&dq), input: None };
        self.vectors(py, Quantity::EnergyRegressor, arguments)
    }

    fn energies<'py>(
        &self,
        py: Python<'py>,
        theta: Vec<f64>,
        q: PyReadonlyArray2<'py, f64>,
        dq: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)> {
        let arguments = |theta| Arguments { theta: Some(theta), q: &q, dq: Some(&dq), input: None };
        let kinetic = self.scalars(py, Quantity::KineticEnergy, arguments(theta.clone()))?;
        Ok((kinetic, self.scalars(py, Quantity::PotentialEnergy, arguments(theta))?))
    }

    #[pyo3(signature = (theta, t, tau, q0, dq0, effects, tolerance=1e-9, smoothing=Vec::new(), progress=None))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
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
        let (n, theta) = (self.joints(), self.parameters_of(Some(theta))?);
        let effects = effect_instances(n, effects)?;
        if effects.iter().any(|effect| effect.law.tilt(&effect.p) != 0.0) {
            return Err(PyValueError::new_err(
                "`base_tilt` is of arms that move in one vertical plane; turn the `gravity` of a chain instead",
            ));
        }
        let description = self.description.clone();
        let inputs = Inputs { t: &t, tau: &tau, start: [&q0, &dq0], effects, tolerance, smoothing };
        let run = move |work: Simulation<'_>| description.dispatch_arm(&theta, work);
        inputs.run(py, n, progress, run)?.ok_or_else(wrong_size)
    }
}
