//! Conversion of arms, effects and arrays between Python and Rust.

use armgap_core::arm::{ArmKind, LinkParameters, TwoLink};
use armgap_core::chain::{ChainJoint, JointKind};
use armgap_core::effect::{PulseShape, Scope, catalogue, dead_zone_with_jump, find, find_form};
use armgap_core::transmission::Sides;
use armgap_fit::model::arm::ArmDescription;
use armgap_fit::model::chain::ChainDescription;
use armgap_fit::model::hypothesis::EffectInstance;
use armgap_fit::serial::SerialArm;
use armgap_fit::serial::controller::{JointController, PositionController};
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::BTreeMap;

/// Key in the values of an external push: 1 where its torque is bell-shaped, 0 where it is constant.
const BELL: &str = "bell";

/// Keys in the values of effects that are 1 where the law has this further form: load-dependent friction of the actuator's torque, and friction that
/// varies twice per turn.
const FORMS: [(&str, &str); 2] = [("of_torque", "torque"), ("twice", "twice_per_turn")];

/// Key in the values of an effect with a transmission: 1 where the encoder is at the motor, 0 where it is at the link.
const ENCODER_SIDE: &str = "encoder_at_motor";

/// Key in the values of an effect with a transmission: 1 where friction acts on the motor, 0 where it acts on the link.
const FRICTION_SIDE: &str = "friction_at_motor";

/// Key in the values of an effect with a transmission: 1 where the rotor moves with inner joints, else 0.
const ROTOR: &str = "rotor_rides";

/// Kinds of arm with dynamics in closed form, as a list of dicts: name, joints, parameter names and units.
#[pyfunction]
pub fn arm_kinds(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for kind in ArmKind::ALL {
        let entry = PyDict::new(py);
        entry.set_item("kind", kind.name())?;
        entry.set_item("n_joints", kind.joints())?;
        entry.set_item("n_inertial", kind.inertial())?;
        entry.set_item("rotary", kind.rotary())?;
        let names: Vec<&str> = kind.parameters().iter().map(|p| p.name).collect();
        let units: Vec<&str> = kind.parameters().iter().map(|p| p.unit).collect();
        entry.set_item("parameter_names", names)?;
        entry.set_item("parameter_units", units)?;
        list.append(entry)?;
    }
    Ok(list)
}

/// Effects of the library, as a list of dicts: name, equation, source, parameters and further description.
#[pyfunction]
pub fn effects(py: Python<'_>) -> PyResult<Bound<'_, PyList>> {
    let list = PyList::empty(py);
    for law in catalogue::<f64>() {
        let spec = law.spec();
        let entry = PyDict::new(py);
        entry.set_item("name", spec.name)?;
        entry.set_item("title", spec.title)?;
        entry.set_item("equation", spec.equation)?;
        entry.set_item("source", spec.source)?;
        entry.set_item("excited_by", spec.excited_by)?;
        entry.set_item("scope", if spec.scope == Scope::Joint { "joint" } else { "arm" })?;
        let parameters = PyList::empty(py);
        for parameter in spec.parameters {
            let p = PyDict::new(py);
            p.set_item("name", parameter.name)?;
            p.set_item("unit", parameter.quantity.unit(true))?;
            p.set_item("unit_linear", parameter.quantity.unit(false))?;
            p.set_item("lower", parameter.lower)?;
            p.set_item("upper", parameter.upper)?;
            p.set_item("neutral", parameter.neutral)?;
            parameters.append(p)?;
        }
        entry.set_item("parameters", parameters)?;
        list.append(entry)?;
    }
    Ok(list)
}

/// Inertial base parameters from masses, kg, lengths, m, distances of the centres of mass from the joints, m, and inertias about them, kg m^2, of the
/// links.
#[pyfunction]
pub fn theta_from_links<'py>(
    py: Python<'py>,
    kind: &str,
    gravity: f64,
    mass: Vec<f64>,
    length: Vec<f64>,
    com: Vec<f64>,
    inertia: Vec<f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let kind = kind_of(kind)?;
    let wrong = || PyValueError::new_err(format!("links of a {} need one entry per joint", kind.name()));
    let theta = match kind {
        ArmKind::Axis => vec![one(&mass).ok_or_else(wrong)?, 0.0],
        ArmKind::Pendulum => {
            let (m, c) = (one(&mass).ok_or_else(wrong)?, one(&com).ok_or_else(wrong)?);
            vec![m * c * c + one(&inertia).ok_or_else(wrong)?, m * gravity * c]
        }
        ArmKind::TwoLink => {
            let two = |x: Vec<f64>| <[f64; 2]>::try_from(x).map_err(|_| wrong());
            let links = LinkParameters {
                mass: two(mass)?,
                length: two(length)?,
                com: two(com)?,
                inertia: two(inertia)?,
            };
            TwoLink::inertial_from_links(&links, gravity).to_vec()
        }
    };
    Ok(PyArray1::from_vec(py, theta))
}

fn one(x: &[f64]) -> Option<f64> {
    if let [value] = x { Some(*value) } else { None }
}

/// Kind of arm by its name in arm files.
pub fn kind_of(name: &str) -> PyResult<ArmKind> {
    let known: Vec<&str> = ArmKind::ALL.iter().map(|k| k.name()).collect();
    ArmKind::from_name(name).ok_or_else(|| {
        PyValueError::new_err(format!("unknown kind of arm `{name}`; known: {}", known.join(", ")))
    })
}

/// Checked effects, given as `(name, joint from 1 or None, {parameter: value})`, on an arm with this number of joints.
pub fn effect_instances(
    joints: usize,
    effects: Vec<(String, Option<usize>, BTreeMap<String, f64>)>,
) -> PyResult<Vec<EffectInstance>> {
    effects
        .into_iter()
        .map(|(name, joint, values)| {
            let law = find::<f64>(&name).ok_or_else(|| {
                let known: Vec<&str> = catalogue::<f64>().iter().map(|l| l.spec().name).collect();
                PyValueError::new_err(format!("unknown effect `{name}`; known: {}", known.join(", ")))
            })?;
            let joint = match (law.spec().scope, joint) {
                (Scope::Arm, None) => 0,
                (Scope::Joint, Some(j)) if (1..=joints).contains(&j) => j - 1,
                (Scope::Arm, Some(_)) => {
                    return Err(PyValueError::new_err(format!(
                        "`{name}` is of the whole arm; leave its joint empty"
                    )));
                }
                _ => {
                    return Err(PyValueError::new_err(format!("`{name}` needs a joint from 1 to {joints}")));
                }
            };
            let mut values = values;
            let is_bell = law.pulse_shape().is_some() && values.remove(BELL).is_some_and(|x| x != 0.0);
            let law = if is_bell { PulseShape::Bell.law() } else { law };
            let jumps = dead_zone_with_jump::<f64>().spec();
            let law = if name == jumps.name && values.contains_key(jumps.parameters[1].name) {
                dead_zone_with_jump()
            } else {
                law
            };
            // Of an effect without this form the key stays, and is refused below.
            let asked =
                |(key, form)| find_form::<f64>(&name, form).filter(|_| values.remove(key) > Some(0.0));
            let law = FORMS.into_iter().find_map(asked).unwrap_or(law);
            let mut at_motor =
                |name: &str| law.has_transmission() && values.remove(name).is_some_and(|x| x != 0.0);
            let (encoder_at_motor, friction_at_motor, rotor_rides) =
                (at_motor(ENCODER_SIDE), at_motor(FRICTION_SIDE), at_motor(ROTOR));
            let sides = Sides { encoder_at_motor, friction_at_motor, rotor_rides };
            let spec = law.spec();
            let mut p = [0.0; 3];
            for (slot, parameter) in p.iter_mut().zip(spec.parameters) {
                let value = *values.get(parameter.name).ok_or_else(|| {
                    PyValueError::new_err(format!("`{name}` needs its parameter `{}`", parameter.name))
                })?;
                if !(value >= parameter.lower && value <= parameter.upper) {
                    return Err(PyValueError::new_err(format!(
                        "`{name}`: {} = {value} is outside [{}, {}]",
                        parameter.name, parameter.lower, parameter.upper
                    )));
                }
                *slot = value;
            }
            if let Some(extra) = values.keys().find(|k| !spec.parameters.iter().any(|p| p.name == k.as_str()))
            {
                return Err(PyValueError::new_err(format!("`{name}` has no parameter `{extra}`")));
            }
            Ok(EffectInstance::new(law, joint, p).with_sides(sides))
        })
        .collect()
}

/// Contiguous view of a vector of float64.
pub fn vector<'a>(x: &'a PyReadonlyArray1<'_, f64>, name: &str) -> PyResult<&'a [f64]> {
    x.as_slice().map_err(|_| PyValueError::new_err(format!("`{name}` must be a contiguous array of float64")))
}

/// Contiguous view of a float64 matrix with `rows` rows and `columns` columns.
pub fn matrix<'a>(
    x: &'a PyReadonlyArray2<'_, f64>,
    name: &str,
    rows: usize,
    columns: usize,
) -> PyResult<&'a [f64]> {
    let shape = numpy::PyUntypedArrayMethods::shape(&**x);
    if shape != [rows, columns] {
        return Err(PyValueError::new_err(format!(
            "`{name}` has shape {shape:?}, expected [{rows}, {columns}]"
        )));
    }
    x.as_slice()
        .map_err(|_| PyValueError::new_err(format!("`{name}` must be a C-contiguous array of float64")))
}

/// Value of `key` in an `arm` dict; `None` if it is missing or None.
fn get<'py, T: for<'a> FromPyObject<'a, 'py>>(arm: &Bound<'py, PyDict>, key: &str) -> PyResult<Option<T>> {
    match arm.get_item(key)? {
        Some(value) if !value.is_none() => Ok(Some(
            value.extract().map_err(|_| PyValueError::new_err(format!("arm: `{key}` has the wrong type")))?,
        )),
        _ => Ok(None),
    }
}

/// Value of `key` in an `arm` dict; an error if it is missing or None.
fn needed<'py, T: for<'a> FromPyObject<'a, 'py>>(arm: &Bound<'py, PyDict>, key: &str) -> PyResult<T> {
    get(arm, key)?.ok_or_else(|| PyValueError::new_err(format!("arm: `{key}` is missing")))
}

/// Arm with dynamics in closed form from an `arm` dict.
pub fn description(arm: &Bound<'_, PyDict>) -> PyResult<ArmDescription> {
    let kind: String = needed(arm, "kind")?;
    let description = ArmDescription {
        kind: kind_of(&kind)?,
        gravity: needed(arm, "gravity")?,
        theta: needed(arm, "theta")?,
        sigma: needed(arm, "sigma")?,
        counts_per_rev: get(arm, "counts_per_rev")?,
        torque_limit: get(arm, "torque_limit")?,
        link_length: get(arm, "link_length")?,
        encoder_at_motor: get(arm, "encoder_at_motor")?,
        friction_at_motor: get(arm, "friction_at_motor")?,
        gear_ratio: get(arm, "gear_ratio")?,
    };
    let (p, n) = (description.kind.parameters().len(), description.kind.joints());
    let lists = [
        ("theta", Some(&description.theta), p),
        ("sigma", Some(&description.sigma), p),
        ("counts_per_rev", description.counts_per_rev.as_ref(), n),
        ("torque_limit", description.torque_limit.as_ref(), n),
        ("link_length", description.link_length.as_ref(), n),
    ];
    for (key, list, length) in lists {
        if list.is_some_and(|l| l.len() != length) {
            return Err(PyValueError::new_err(format!("arm: `{key}` needs {length} values")));
        }
    }
    Ok(description)
}

/// Serial arm from an `arm` dict, whose `chain` has lists of `kinds`, `rotation`, `translation` and `axis`, and `gravity`.
pub fn serial_arm(arm: &Bound<'_, PyDict>) -> PyResult<SerialArm> {
    let chain: Bound<'_, PyDict> = needed(arm, "chain")?;
    let kinds: Vec<String> = needed(&chain, "kinds")?;
    let rotation: Vec<[[f64; 3]; 3]> = needed(&chain, "rotation")?;
    let translation: Vec<[f64; 3]> = needed(&chain, "translation")?;
    let axis: Vec<[f64; 3]> = needed(&chain, "axis")?;
    let n = kinds.len();
    if [rotation.len(), translation.len(), axis.len()].iter().any(|length| *length != n) {
        return Err(PyValueError::new_err(format!("arm: `chain` needs {n} entries in each of its lists")));
    }
    let mut joints = Vec::with_capacity(n);
    for (((name, rotation), translation), axis) in kinds.iter().zip(rotation).zip(translation).zip(axis) {
        let kind = match name.as_str() {
            "revolute" => JointKind::Revolute,
            "prismatic" => JointKind::Prismatic,
            other => return Err(PyValueError::new_err(format!("arm: `{other}` is no kind of joint"))),
        };
        joints.push(ChainJoint { kind, rotation, translation, axis });
    }
    let (theta, sigma): (Vec<f64>, Vec<f64>) = (needed(arm, "theta")?, needed(arm, "sigma")?);
    let counts: Option<Vec<f64>> = get(arm, "counts_per_rev")?;
    if counts.as_ref().is_some_and(|c| c.len() != n) {
        return Err(PyValueError::new_err(format!("arm: `counts_per_rev` needs {n} values")));
    }
    let step = |(joint, count): (&ChainJoint<f64>, &f64)| match joint.kind {
        JointKind::Revolute => std::f64::consts::TAU / count,
        JointKind::Prismatic => 1.0 / count,
    };
    let steps = counts.map(|counts| joints.iter().zip(&counts).map(step).collect());
    let chain = ChainDescription { joints, gravity: needed(&chain, "gravity")? };
    let controller = get::<Bound<'_, PyDict>>(arm, "controller")?;
    let limits: Option<Vec<f64>> = get(arm, "torque_limit")?;
    let controller = controller.map(|table| position_controller(&table, limits, n)).transpose()?;
    let (encoder_at_motor, friction_at_motor) = (get(arm, ENCODER_SIDE)?, get(arm, FRICTION_SIDE)?);
    Ok(SerialArm { chain, theta, sigma, steps, encoder_at_motor, friction_at_motor, controller })
}

/// Position controller of `n` joints from a dict of lists; a list that is missing has no effect.
fn position_controller(
    table: &Bound<'_, PyDict>,
    limits: Option<Vec<f64>>,
    n: usize,
) -> PyResult<PositionController> {
    let of = |given: Option<Vec<f64>>, key: &str, without: f64| match given {
        Some(values) if values.len() != n => {
            Err(PyValueError::new_err(format!("arm: `{key}` needs {n} values")))
        }
        values => Ok(values.unwrap_or_else(|| vec![without; n])),
    };
    let list = |key: &str, without: f64| of(get(table, key)?, key, without);
    let [kp, kd, ki] = [list("kp", 0.0)?, list("kd", 0.0)?, list("ki", 0.0)?];
    let (delay, deadband) = (list("delay", 0.0)?, list("deadband", 0.0)?);
    let speed_limit = list("speed_limit", f64::INFINITY)?;
    let torque_limit = of(limits, "torque_limit", f64::INFINITY)?;
    let rate_of_error: bool = needed(table, "rate_of_error")?;
    let joint = |j: usize| JointController {
        gains: [kp[j], kd[j], ki[j]],
        rate_of_error,
        reference_delay: 0.0,
        delay: delay[j],
        deadband: deadband[j],
        speed_limit: speed_limit[j],
        torque_limit: torque_limit[j],
    };
    Ok(PositionController {
        joints: (0..n).map(joint).collect(),
        sigma: [list("sigma_kp", 0.0)?, list("sigma_kd", 0.0)?, list("sigma_ki", 0.0)?],
    })
}
