//! Dead zone of a drive: commands below a level give no torque. Of larger commands it delivers the excess over the level, `sgn(tau) max(|tau| - level, 0)`,
//! as a valve with overlap; or more, up to the whole command, as a drive that is not enabled below a threshold.

use super::{Effect, EffectParameter, Hooks, InputSegment, MAX_PARAMETERS, Quantity, Spec, Trial};
use crate::real::{Real, lit};

/// Range of commands above the level over which the torque jumps, relative to the level: predictions then have a derivative by the level.
const JUMP_WIDTH: f64 = 0.05;

/// Dead zone of a drive, which gives no torque for commands below a level.
#[derive(Debug)]
pub struct TorqueDeadZone {
    /// Whether the torque jumps at the level.
    pub jumps: bool,
}

static SPEC: Spec = Spec {
    name: "torque_dead_zone",
    title: "torque dead zone",
    equation: "tau_joint = sgn(tau) max(|tau| - level, 0), or with jump: sgn(tau) (|tau| - (1 - jump) level) while |tau| > level, 0 otherwise",
    source: "valves and amplifiers with overlap; drives that are not enabled below a threshold",
    excited_by: "torque that changes sign",
    parameters: &[EffectParameter::bounded("level", Quantity::Torque, 0.0, f64::INFINITY)],
    initial_guesses: &[[0.05, 0.0, 0.0], [0.3, 0.0, 0.0]],
    hooks: Hooks::COMMAND,
    ..Spec::OF_JOINT
};

static WITH_JUMP: Spec = Spec {
    title: "torque dead zone with a jump",
    parameters: &[
        EffectParameter::bounded("level", Quantity::Torque, 0.0, f64::INFINITY),
        EffectParameter::shape("jump", Quantity::Ratio, 0.0, 1.0),
    ],
    initial_guesses: &[],
    trial: Trial::Whole,
    ..SPEC
};

/// The effect `torque_dead_zone` whose torque jumps at the level, by the share `jump` of the level.
pub fn with_jump<T: Real>() -> &'static dyn Effect<T> {
    &TorqueDeadZone { jumps: true }
}

impl<T: Real> Effect<T> for TorqueDeadZone {
    fn spec(&self) -> &'static Spec {
        if self.jumps { &WITH_JUMP } else { &SPEC }
    }

    fn command(&self, p: &[T; MAX_PARAMETERS], _t: &[T], torque: &mut [InputSegment<T>]) {
        let width = lit::<T>(JUMP_WIDTH) * p[0];
        for segment in torque {
            *segment = segment.map(|tau| {
                let taken = tau.max(-p[0]).min(p[0]);
                if !self.jumps {
                    return tau - taken;
                }
                let beyond = (tau.abs() - p[0]) / width.max(lit(f64::MIN_POSITIVE));
                tau - taken * (T::one() - p[1] * beyond.max(T::zero()).min(T::one()))
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_commands_beyond_the_level_the_excess_is_delivered_or_with_a_jump_the_whole() {
        let delivered = |law: &dyn Effect<f64>, p: [f64; 3], tau: f64| {
            let mut torque = [InputSegment::held(tau)];
            law.command(&p, &[0.0, 1.0], &mut torque);
            torque[0].mean()
        };
        let (excess, jump) = (&TorqueDeadZone { jumps: false }, with_jump::<f64>());
        for sign in [1.0, -1.0] {
            assert_eq!(delivered(excess, [0.5, 0.0, 0.0], 0.4 * sign), 0.0);
            assert!((delivered(excess, [0.5, 0.0, 0.0], 2.0 * sign) - 1.5 * sign).abs() < 1e-12);
            assert_eq!(delivered(jump, [0.5, 1.0, 0.0], 0.49 * sign), 0.0);
            assert!((delivered(jump, [0.5, 1.0, 0.0], 0.53 * sign) - 0.53 * sign).abs() < 1e-12);
            assert!((delivered(jump, [0.5, 0.4, 0.0], 2.0 * sign) - 1.7 * sign).abs() < 1e-12);
            assert_eq!(delivered(jump, [0.0, 1.0, 0.0], 2.0 * sign), 2.0 * sign);
        }
    }
}
