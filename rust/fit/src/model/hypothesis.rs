//! Hypothesis about the arm: parameter values, widths of the friction regularisation, and effects on joints.

use crate::model::custom_effect;
use armgap_core::arm::Arm;
use armgap_core::chain::MAX_JOINTS;
use armgap_core::effect::{Active, Effect, InputSegment, MAX_PARAMETERS, Quantity, Scope, Trial};
use armgap_core::integrate::State;
use armgap_core::plant::Plant;
use armgap_core::transmission::Sides;
use nalgebra::SVector;

/// Effect on a joint, with values for its parameters.
#[derive(Clone, Copy)]
pub struct EffectInstance {
    /// Effect of the library or custom effect.
    pub law: &'static dyn Effect<f64>,
    /// Joint that the effect acts on, counted from 0; 0 for effects of the whole arm.
    pub joint: usize,
    /// Values of the effect's parameters, SI.
    pub p: [f64; MAX_PARAMETERS],
    /// Sides of the transmission that encoder and friction are on; for effects with a transmission.
    pub sides: Sides,
}

impl std::fmt::Debug for EffectInstance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}:{:?}", self.law.spec().name, self.joint + 1, &self.p[..self.len()])
    }
}

impl EffectInstance {
    /// An effect with encoder and friction on the link's side of the transmission.
    pub fn new(law: &'static dyn Effect<f64>, joint: usize, p: [f64; MAX_PARAMETERS]) -> Self {
        Self { law, joint, p, sides: Sides::LINK }
    }

    /// An effect with unchanged values and encoder and friction on the given sides of the transmission.
    pub fn with_sides(self, sides: Sides) -> Self {
        Self { sides, ..self }
    }

    /// Number of the effect's parameters.
    pub fn len(&self) -> usize {
        self.law.spec().parameters.len()
    }

    /// Always false: every effect has parameters.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Number of leading parameters that together switch the effect off at their neutral values.
    pub fn amplitudes(&self) -> usize {
        match self.law.spec().trial {
            Trial::Amplitudes(count) => count,
            Trial::Ray => self.len(),
            Trial::Whole | Trial::Disturbance => 1,
        }
    }

    /// Title of the effect, joint, and sides of encoder and friction and whether the rotor rides: equal for effects that differ in values alone.
    pub fn place(&self) -> (&'static str, usize, [bool; 3]) {
        let Sides { encoder_at_motor, friction_at_motor, rotor_rides } = self.sides;
        (self.law.spec().title, self.joint, [encoder_at_motor, friction_at_motor, rotor_rides])
    }

    /// Whether `other` is the same effect on the same joint, at any parameter values.
    pub fn same_place(&self, other: &Self) -> bool {
        self.law.spec().name == other.law.spec().name && self.joint == other.joint
    }

    /// Whether `other` is the same effect on the same joint with the same form of its law, at any parameter values.
    pub fn same_law(&self, other: &Self) -> bool {
        self.law.spec().title == other.law.spec().title && self.joint == other.joint
    }

    /// Whether the effect is a contact, acting beyond a position: its parameters are position, stiffness and damping.
    pub fn is_contact(&self) -> bool {
        self.law.spec().parameters.first().is_some_and(|p| p.quantity == Quantity::Reach)
    }

    /// Lower and upper bound of parameter `i` in a fit, SI: those of the library; the sign of a stop's stiffness, which tells its side, is kept.
    pub fn bounds(&self, i: usize) -> [f64; 2] {
        let parameter = &self.law.spec().parameters[i];
        let [lower, upper] = [parameter.lower, parameter.upper];
        match parameter.quantity {
            Quantity::ContactStiffness if self.p[i] < 0.0 => [lower, upper.min(-f64::MIN_POSITIVE)],
            Quantity::ContactStiffness => [lower.max(0.0), upper],
            _ => [lower, upper],
        }
    }

    /// Whether the effect is periodic in position: its parameters are amplitude, cycles per turn and phase.
    pub fn is_periodic(&self) -> bool {
        self.law.spec().parameters.iter().any(|p| p.quantity == Quantity::Cycles)
    }

    /// Whether the effect is backlash: a transmission with a coupling ratio.
    pub fn is_backlash(&self) -> bool {
        self.law.has_transmission()
            && self.law.spec().parameters.iter().any(|p| p.quantity == Quantity::Ratio)
    }

    /// Joint that the effect acts on, counted from 1; `None` for effects of the whole arm.
    pub fn joint_number(&self) -> Option<usize> {
        (self.law.spec().scope == Scope::Joint).then_some(self.joint + 1)
    }
}

/// Hypothesis about the arm: everything that a simulation needs besides the log.
#[derive(Debug, Clone)]
pub struct Hypothesis<const P: usize> {
    /// Parameters of the arm, SI.
    pub theta: [f64; P],
    /// Width of the friction regularisation of each joint, rad/s (m/s); zero for exact dry friction.
    pub rounding: [f64; MAX_JOINTS],
    /// Effects with the values of their parameters.
    pub effects: Vec<EffectInstance>,
}

impl<const P: usize> Hypothesis<P> {
    /// Hypothesis of an arm with parameters `theta`, without effects and with exact dry friction.
    pub fn rigid(theta: [f64; P]) -> Self {
        Self { theta, rounding: [0.0; MAX_JOINTS], effects: Vec::new() }
    }

    /// Whether the friction of any joint is regularised.
    pub fn is_rounded(&self) -> bool {
        self.rounding.iter().any(|width| *width > 0.0)
    }

    /// The hypothesis with friction regularised over the widths `widths`, rad/s (m/s) per joint.
    pub fn rounded_over<const N: usize>(&self, widths: [f64; N]) -> Self {
        let mut other = self.clone();
        for (slot, width) in other.rounding.iter_mut().zip(widths) {
            *slot = width;
        }
        other
    }

    /// The hypothesis with one more effect.
    pub fn with(&self, effect: EffectInstance) -> Self {
        let mut more = self.clone();
        more.effects.push(effect);
        more
    }

    /// Free values of the hypothesis: `theta`, then the effects' parameters.
    pub fn values(&self) -> Vec<f64> {
        let effects = self.effects.iter().flat_map(|e| e.p[..e.len()].iter().copied());
        self.theta.iter().copied().chain(effects).collect()
    }

    /// The hypothesis with other values of `theta` and of the effects' parameters.
    pub fn with_values(&self, values: &[f64]) -> Self {
        let mut other = self.clone();
        let mut rest = values.iter().copied();
        for (slot, value) in other.theta.iter_mut().zip(rest.by_ref()) {
            *slot = value;
        }
        for effect in &mut other.effects {
            let n = effect.len();
            for (slot, value) in effect.p[..n].iter_mut().zip(rest.by_ref()) {
                *slot = value;
            }
        }
        other
    }

    /// Simulator of the hypothesis; `None` if it has more effects than a plant carries.
    pub fn plant<A: Arm<f64, N, P>, const N: usize>(&self, arm: &A) -> Option<Plant<f64, A, N, P>> {
        let widths = std::array::from_fn(|j| self.rounding.get(j).copied().unwrap_or(0.0));
        let plant = Plant::new(arm.clone(), self.theta).with_rounding(widths);
        self.effects.iter().try_fold(plant, |plant, e| {
            let plant = plant.with_effect(Active { law: e.law, joint: e.joint, p: e.p })?;
            // Of two transmissions on one joint the later one counts, with its own sides.
            if e.law.has_transmission() { plant.with_sides(e.joint, e.sides) } else { Some(plant) }
        })
    }

    /// Torques that reach the joints when effects act on the commanded torques `held` of a log; the disturbances `pushes` act last, `tables` hold the
    /// torques of the custom effects; `None` if no effect acts on commands.
    pub fn command<const N: usize>(
        &self,
        t: &[f64],
        held: &[[InputSegment<f64>; N]],
        pushes: &[EffectInstance],
        tables: &[Vec<f64>],
    ) -> Option<Vec<[InputSegment<f64>; N]>> {
        let laws = || self.effects.iter().chain(pushes).filter(|e| e.law.spec().hooks.command);
        laws().next()?;
        let mut torque = held.to_vec();
        let mut column = Vec::with_capacity(torque.len());
        for effect in laws() {
            column.clear();
            column.extend(torque.iter().map(|row| row[effect.joint]));
            custom_effect::command(effect.law, &effect.p, t, tables, &mut column);
            for (row, segment) in torque.iter_mut().zip(&column) {
                row[effect.joint] = *segment;
            }
        }
        Some(torque)
    }

    /// Positions and velocities of the joints, given the positions `q`, rad or m, and velocities `dq` that their encoders show.
    pub fn initial_state<const N: usize>(&self, q: SVector<f64, N>, dq: SVector<f64, N>) -> State<f64, N> {
        if !self.distorts() {
            return State::new(q, dq);
        }
        let at = SVector::from_fn(|j, _| self.actual(j, q[j]));
        State::new(at, SVector::from_fn(|j, _| dq[j] / self.stretch(j, at[j])))
    }

    /// Position that joint `j`'s encoder shows when the joint is at `q`, rad or m.
    pub fn measured(&self, j: usize, q: f64) -> f64 {
        let on_joint = self.effects.iter().filter(|e| e.law.spec().hooks.measured && e.joint == j);
        on_joint.fold(q, |q, e| e.law.measured(&e.p, q))
    }

    /// Position of joint `j` at which its encoder shows `reading`, rad or m, by fixed-point iteration.
    pub fn actual(&self, j: usize, reading: f64) -> f64 {
        let mut q = reading;
        for _ in 0..4 {
            q += reading - self.measured(j, q);
        }
        q
    }

    /// Ratio of the velocity that joint `j`'s encoder shows to the joint's own velocity at `q`, by central difference.
    pub fn stretch(&self, j: usize, q: f64) -> f64 {
        let step = 1e-5;
        (self.measured(j, q + step) - self.measured(j, q - step)) / (2.0 * step)
    }

    /// Whether any effect of the hypothesis changes what the encoders show.
    pub fn distorts(&self) -> bool {
        self.effects.iter().any(|e| e.law.spec().hooks.measured)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::arm::Pendulum;
    use armgap_core::effect::find;

    #[test]
    fn the_later_of_two_transmissions_on_a_joint_has_its_own_sides() {
        let effect = |name: &str, p: [f64; 3], sides: Sides| {
            EffectInstance::new(find(name).expect("known"), 0, p).with_sides(sides)
        };
        let slack = effect("backlash", [0.02, 0.1, 0.5], Sides::MOTOR);
        for sides in [Sides::LINK, Sides::MOTOR] {
            let shaft = effect("joint_elasticity", [60.0, 0.05, 0.02], sides);
            let both = Hypothesis::rigid([0.1, 1.0, 0.05, 0.1]).with(slack).with(shaft);
            let plant = both.plant::<_, 1>(&Pendulum { gravity: 9.81 }).expect("two effects");
            assert_eq!(plant.drivetrain().sides(0), sides);
        }
    }
}
