//! External disturbance of one log: a torque of the given impulse, N m s (N s), around `time`, s, constant for `duration`, s, or bell-shaped.
//!
//! The bell is a period of a raised cosine with the same variance over time as the constant torque of this duration. The torque over each sample
//! interval has the exact mean and first moment, so a mass gains the exact speed and distance whatever the sample times.

use super::{Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::{Real, lit};

/// Course of an external disturbance over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PulseShape {
    /// Constant torque.
    Rectangle,
    /// Period of a raised cosine, close to a Gaussian.
    Bell,
}

impl PulseShape {
    /// All shapes.
    pub const ALL: [Self; 2] = [Self::Rectangle, Self::Bell];

    /// Name of the shape in results.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rectangle => "rectangle",
            Self::Bell => "bell",
        }
    }

    /// The effect `external_pulse` with this shape.
    pub fn law<T: Real>(self) -> &'static dyn Effect<T> {
        match self {
            Self::Rectangle => &ExternalPulse { shape: Self::Rectangle },
            Self::Bell => &ExternalPulse { shape: Self::Bell },
        }
    }
}

/// External disturbance at one time of one log: a torque over a short duration.
#[derive(Debug)]
pub struct ExternalPulse {
    /// Course of the torque over time.
    pub shape: PulseShape,
}

/// Half of the period of the bell, relative to the duration of the constant torque of equal variance: `1 / sqrt(4 - 24 / pi^2)`.
const BELL_HALF_PERIOD: f64 = 0.798_521_461_316_230_1;

static SPEC: Spec = Spec {
    name: "external_pulse",
    title: "external push",
    equation: "tau_joint = tau + impulse / duration while |t - time| < duration / 2, or a raised cosine of this impulse and variance over time",
    source: "collision detection by momentum observers, De Luca and Mattone 2003",
    excited_by: "a push during the log",
    parameters: &[
        EffectParameter::signed("impulse", Quantity::Impulse),
        EffectParameter::shape("time", Quantity::Duration, f64::NEG_INFINITY, f64::INFINITY),
        EffectParameter::shape("duration", Quantity::Duration, 1e-4, f64::INFINITY),
    ],
    initial_guesses: &[],
    trial: Trial::Disturbance,
    hooks: Hooks::COMMAND,
    ..Spec::OF_JOINT
};

/// Half length, s, of a pulse of the given shape and duration.
fn half_length<T: Real>(shape: PulseShape, duration: T) -> T {
    duration
        * match shape {
            PulseShape::Rectangle => lit(0.5),
            PulseShape::Bell => lit(BELL_HALF_PERIOD),
        }
}

/// Integrals of a pulse of unit impulse and of half length `l`, s, and of its first moment about its centre, from the centre to `x`, s, after it.
fn integrals<T: Real>(shape: PulseShape, l: T, x: T) -> [T; 2] {
    let (height, half) = (lit::<T>(0.5) / l, lit::<T>(0.5));
    match shape {
        PulseShape::Rectangle => [height * x, height * half * x * x],
        PulseShape::Bell => {
            let per = l / T::pi();
            let (sin, cos) = (x / per).sin_cos();
            [height * (x + per * sin), height * (half * x * x + per * (x * sin + per * (cos - T::one())))]
        }
    }
}

impl<T: Real> Effect<T> for ExternalPulse {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn pulse_shape(&self) -> Option<PulseShape> {
        Some(self.shape)
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], t: &[T], torque: &mut [InputSegment<T>]) {
        let l = half_length(self.shape, p[2]);
        for (k, (&start, segment)) in t.iter().zip(torque.iter_mut()).enumerate() {
            let h = super::interval(t, k);
            let (begin, end) = ((start - p[1]).max(-l), (start + h - p[1]).min(l));
            if end > begin && h > T::zero() && l > T::zero() {
                let [before, until] = [begin, end].map(|x| integrals(self.shape, l, x));
                let impulse = p[0] * (until[0] - before[0]);
                let middle = start + lit::<T>(0.5) * h - p[1];
                let moment = p[0] * (until[1] - before[1]) - middle * impulse;
                *segment = segment.plus(InputSegment::with_moment(impulse / h, moment, h));
            }
        }
    }
}
