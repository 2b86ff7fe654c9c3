//! Dry friction whose level varies with the joint's position, once per turn, `(a cos q + b sin q) sgn dq`, or, in a second form of the law, twice.

use super::{Effect, EffectParameter, Hooks, JointPoint, JointPoints, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::{Real, lit};
use crate::trig::{for_sines_cosines, sin_cos};

/// Coulomb friction whose level varies with the joint's position, once or twice per turn: `(a cos(n q) + b sin(n q)) sgn dq`.
#[derive(Debug)]
pub struct PositionDependentFriction {
    /// Whether the level varies twice per turn.
    pub twice: bool,
}

static SPEC: Spec = Spec {
    name: "position_dependent_friction",
    title: "friction that varies with position",
    equation: "f = (a cos q + b sin q) sgn dq, or with shape twice_per_turn of 2q",
    source: "Bittencourt and Gunnarsson 2012",
    excited_by: "motion in both directions through different positions",
    parameters: &[
        EffectParameter::signed("a", Quantity::Torque),
        EffectParameter::signed("b", Quantity::Torque),
    ],
    initial_guesses: &[[0.05, 0.0, 0.0], [0.0, 0.05, 0.0]],
    trial: Trial::Amplitudes(2),
    hooks: Hooks::COULOMB,
    ..Spec::OF_JOINT
};

static TWICE: Spec = Spec {
    title: "friction that varies twice per turn",
    equation: "f = (a cos 2q + b sin 2q) sgn dq",
    ..SPEC
};

impl<T: Real> Effect<T> for PositionDependentFriction {
    fn spec(&self) -> &'static Spec {
        if self.twice { &TWICE } else { &SPEC }
    }

    fn form(&self) -> Option<&'static str> {
        self.twice.then_some("twice_per_turn")
    }

    fn coulomb(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>, _direction: T) -> T {
        let (s, c) = sin_cos(if self.twice { x.q + x.q } else { x.q });
        p[0] * c + p[1] * s
    }

    fn add_coulombs(
        &self,
        p: &[T; MAX_PARAMETERS],
        points: &JointPoints<'_, T>,
        _directions: &[T],
        levels: &mut [T],
    ) {
        let level = |i: usize, sine: T, cosine: T| levels[i] += p[0] * cosine + p[1] * sine;
        let cycles = if self.twice { lit(2.0) } else { T::one() };
        for_sines_cosines(points.q.len(), |i| cycles * points.q[i], level);
    }
}
