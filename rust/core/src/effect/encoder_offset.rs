//! Offset of the encoder's zero: where the joint is at `q`, the encoder shows `q + offset`.

use super::{Effect, EffectParameter, Hooks, MAX_PARAMETERS, Quantity, Spec};
use crate::real::Real;

/// Offset of the encoder's zero, rad or m: the encoder shows `q + offset`.
#[derive(Debug)]
pub struct EncoderOffset;

static SPEC: Spec = Spec {
    name: "encoder_offset",
    title: "encoder offset",
    equation: "q_measured = q + offset",
    source: "zeroing error",
    excited_by: "gravity or coupling that depends on the position",
    parameters: &[EffectParameter::signed("offset", Quantity::Position)],
    initial_guesses: &[[0.02, 0.0, 0.0]],
    hooks: Hooks::MEASURED,
    ..Spec::OF_JOINT
};

impl<T: Real> Effect<T> for EncoderOffset {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn measured(&self, p: &[T; MAX_PARAMETERS], q: T) -> T {
        q + p[0]
    }
}
