//! Encoder disc mounted off its centre: the encoder shows `q + a sin q + b cos q`.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::Real;

/// Eccentricity of an encoder disc: the encoder shows `q + a sin q + b cos q`.
#[derive(Debug)]
pub struct EncoderEccentricity;

static SPEC: Spec = Spec {
    name: "encoder_eccentricity",
    title: "encoder eccentricity",
    equation: "q_measured = q + a sin q + b cos q",
    source: "Gawronski 2008, angle encoder errors",
    excited_by: "fast motion over a good part of a turn",
    parameters: &[
        EffectParameter::bounded("a", Quantity::Angle, -0.5, 0.5),
        EffectParameter::bounded("b", Quantity::Angle, -0.5, 0.5),
    ],
    initial_guesses: &[[0.01, 0.0, 0.0], [0.0, 0.01, 0.0]],
    trial: Trial::Amplitudes(2),
    hooks: Hooks::MEASURED,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for EncoderEccentricity {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn measured(&self, p: &[T; MAX_PARAMETERS], q: T) -> T {
        let (s, c) = q.sin_cos();
        q + p[0] * s + p[1] * c
    }
}
