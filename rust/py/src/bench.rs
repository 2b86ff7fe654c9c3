//! Python function `bench`: time of one sample of an online estimator on this machine.

use armgap_bench::cost::{Cost, noise, online};
use armgap_core::regression::{Scheme, Variant};
use armgap_core::rls::Form;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Typical, median, 99 %, 99.99 % and longest time of one sample of an online estimator, ns; without a scheme, of fixed arithmetic: the machine's
/// noise.
#[pyfunction]
pub fn bench(
    py: Python<'_>,
    scheme: Option<&str>,
    paper: bool,
    plain: bool,
    single: bool,
    samples: usize,
) -> PyResult<(f64, f64, f64, f64, f64)> {
    let variant = if paper { Variant::Paper } else { Variant::Exact };
    let form = if plain { Form::Plain } else { Form::Factorized };
    let scheme = scheme
        .map(|name| {
            Scheme::from_name(name).ok_or_else(|| PyValueError::new_err(format!("unknown scheme `{name}`")))
        })
        .transpose()?;
    let Cost { typical, median, p99, p9999, max } = py.detach(|| match scheme {
        None => noise(samples),
        Some(scheme) if single => online::<f32>(scheme, variant, form, samples),
        Some(scheme) => online::<f64>(scheme, variant, form, samples),
    });
    Ok((typical, median, p99, p9999, max))
}
