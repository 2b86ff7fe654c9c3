//! A joint limit: beyond a position a spring and damper push back and never pull. With a positive stiffness the stop lies on the position's side away
//! from zero, with a negative one on its side towards zero, as the upper stop of a joint that moves at negative positions only.

use super::{Edge, Effect, EffectParameter, Hooks, JointPoint, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::Real;

/// Contact with a joint limit: a spring and damper beyond a position.
#[derive(Debug)]
pub struct Contact;

static SPEC: Spec = Spec {
    name: "contact",
    title: "contact with a stop",
    equation: "tau_joint = tau - max(|stiffness| depth + damping speed, 0) beyond position; stiffness < 0: towards zero",
    source: "soft limits of common simulators",
    excited_by: "motion up to the stop",
    parameters: &[
        EffectParameter::threshold("position", Quantity::Reach, f64::NEG_INFINITY),
        EffectParameter::signed("stiffness", Quantity::ContactStiffness),
        EffectParameter::bounded("damping", Quantity::ContactDamping, 0.0, f64::INFINITY),
    ],
    // Positions as shares of the farthest position reached on either side of zero.
    initial_guesses: &[
        [0.99, 150.0, 0.5],
        [-0.99, 150.0, 0.5],
        [0.95, 30.0, 0.2],
        [-0.95, 30.0, 0.2],
        [0.88, 12.0, 0.1],
        [-0.88, 12.0, 0.1],
        [0.75, 6.0, 0.1],
        [-0.75, 6.0, 0.1],
        [0.50, 3.0, 0.1],
        [-0.50, 3.0, 0.1],
    ],
    trial: Trial::Whole,
    hooks: Hooks::FORCE,
    ..Spec::OF_JOINT
};

/// Direction in which the joint moves into the stop, -1 or 1.
fn side<T: Real>(p: &[T; MAX_PARAMETERS]) -> T {
    if (p[0] < T::zero()) == (p[1] < T::zero()) { T::one() } else { -T::one() }
}

impl<T: Real> Effect<T> for Contact {
    fn spec(&self) -> &'static Spec {
        &SPEC
    }

    fn edge(&self, p: &[T; MAX_PARAMETERS]) -> Option<Edge<T>> {
        Some(Edge { position: p[0], side: side(p), stiffness: p[1].abs(), damping: p[2] })
    }

    fn force(&self, p: &[T; MAX_PARAMETERS], x: &JointPoint<T>) -> T {
        let side = side(p);
        let depth = side * (x.q - p[0]);
        if depth <= T::zero() {
            return T::zero();
        }
        -side * (p[1].abs() * depth + p[2] * side * x.dq).max(T::zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_of_the_stiffness_says_on_which_side_of_the_position_the_stop_lies() {
        for (position, stiffness, side) in
            [(0.4, 50.0, 1.0), (-0.4, 50.0, -1.0), (-0.4, -50.0, 1.0), (0.4, -50.0, -1.0)]
        {
            let p = [position, stiffness, 2.0];
            let at = |depth: f64, speed: f64| {
                let (q, dq) = (position + side * depth, side * speed);
                JointPoint { t: 0.0, q, dq, tau: 0.0, load: 0.0, friction: 0.0, other: 0.0, memory: 0.0 }
            };
            let push = |depth, speed| Contact.force(&p, &at(depth, speed)) * side;
            assert_eq!([push(-0.01, 0.5), push(0.01, -0.3)], [0.0, 0.0], "outside, and never a pull");
            assert!((push(0.01, 0.1) + 0.7).abs() < 1e-12, "{}", push(0.01, 0.1));
            let edge = Contact.edge(&p).unwrap();
            assert_eq!((edge.side, edge.stiffness), (side, 50.0));
            assert!(edge.is_behind(position + 0.01 * side) && !edge.is_behind(position - 0.01 * side));
        }
    }
}
