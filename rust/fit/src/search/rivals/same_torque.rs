//! Whether two effects need the same torque in every state of the arm, so that no motion distinguishes them.
//!
//! A cause fixes the torque of every motion. If another effect, at some values of its own and of the arm's parameters, gives the same torque in states
//! drawn at random, the two models are not distinguishable by any experiment on the joints' positions and torques (structural identifiability: Bellman
//! and Astrom 1970); only a measured value of a parameter tells them apart. Effects with a memory have no such function and are not compared.

use crate::likelihood::context::DiagnosisContext;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::numeric::random::Random;
use armgap_core::arm::Arm;
use armgap_core::effect::{InputSegment, Quantity, Trial, find};
use armgap_core::transmission::LatentState;
use nalgebra::{DMatrix, DVector, SVector};

/// Number of states in which torques are compared: several times as many as there are values to fit.
const COMPARED_STATES: usize = 80;
/// Largest RMS difference of the torques, as a part of the RMS torque of the cause, at which they count as the same. Of 33 look-alikes of causes on
/// simulated arms the fit leaves at most 0.02 for the 15 that are the same, or become so as a spring's rest position moves away, and at least 0.05 for
/// the others.
const SAME_TORQUE: f64 = 0.03;
/// Change of a parameter of the arm, in standard deviations of its prior, from which it is named as what a measurement has to determine.
const NOTICEABLY_MOVED: f64 = 0.5;
/// Smallest speed of a state, as a part of the largest: friction is smoothed near rest.
const LEAST_SPEED: f64 = 0.1;
/// Half the range of positions of a linear joint, in travels of the logs.
const TRAVELS: f64 = 2.0;
/// Largest number of steps of the fit, and of the fixed-point iteration for the command.
const MAX_FIT_STEPS: usize = 100;
/// Step of finite differences, as a part of a value's scale.
const STEP: f64 = 1e-5;
/// Displacement for the second derivative of an encoder's reading, rad or m.
const READING_STEP: f64 = 1e-4;

/// Readings of the encoders, their rates and accelerations.
type Reading<const N: usize> = [SVector<f64, N>; 3];

/// Comparison of two effects on one arm by the torques that they need.
pub struct SameTorque<'a, A, const N: usize, const P: usize> {
    /// Model of the arm without effects.
    pub arm: &'a A,
    /// Reported model, with the cause.
    pub model: &'a Hypothesis<P>,
    /// Standard deviations of the arm's parameters in the arm file, SI.
    pub sigma: &'a [f64; P],
    /// Typical speed and torque per joint, SI.
    pub speed: [f64; N],
    /// Typical torque per joint, N m or N.
    pub torque: [f64; N],
    /// Range of positions per joint, rad or m.
    pub range: [[f64; 2]; N],
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> SameTorque<'_, A, N, P> {
    /// Indices of the arm's parameters at whose other values `other` needs the torques of `cause` in every state; `None` if it does not, or if a
    /// torque depends on more than the state.
    pub fn moved(&self, cause: &EffectInstance, other: &EffectInstance) -> Option<Vec<usize>> {
        if !is_static(cause) || !is_static(other) {
            return None;
        }
        let at = self.model.effects.iter().position(|e| e.same_place(cause))?;
        let rest: Vec<EffectInstance> = self.model.effects.iter().filter(|e| is_static(e)).copied().collect();
        let with = Hypothesis { effects: rest, ..self.model.clone() };
        let mut without = with.clone();
        without.effects.retain(|e| !e.same_place(&self.model.effects[at]));
        let states = self.states();
        let commands: Vec<SVector<f64, N>> =
            states.iter().map(|state| self.command(&with, state)).collect::<Option<_>>()?;
        let own = self.residuals(&without, &states, &commands)?.norm();
        if own <= 0.0 {
            return None;
        }
        let start = without.with(*other);
        let found = self.fitted(&start, &states, &commands, SAME_TORQUE * own)?;
        let moved = |i: &usize| (found.theta[*i] - with.theta[*i]).abs() > NOTICEABLY_MOVED * self.sigma[*i];
        Some((0..P).filter(moved).collect())
    }

    /// States drawn over the range of positions and twice the typical speeds, with the accelerations of twice the typical torques.
    fn states(&self) -> Vec<Reading<N>> {
        let mut random = Random(COMPARED_STATES as u64);
        let mut uniform = || 2.0 * random.below(1 << 30) as f64 / f64::from(1 << 30) - 1.0;
        let inertia = self.arm.inertia(&self.model.theta, &SVector::zeros());
        let mut one = || {
            let q = SVector::from_fn(|j, _| {
                let [low, high] = self.range[j];
                0.5 * (low + high + (high - low) * uniform())
            });
            let dq = SVector::from_fn(|j, _| {
                let x = uniform();
                2.0 * self.speed[j] * (x + LEAST_SPEED * x.signum())
            });
            let ddq = SVector::from_fn(|j, _| 2.0 * self.torque[j] / inertia[(j, j)] * uniform());
            [q, dq, ddq]
        };
        (0..COMPARED_STATES).map(|_| one()).collect()
    }

    /// Commanded torque under which `model` moves as the encoders read; `None` if no command does.
    fn command(&self, model: &Hypothesis<P>, reading: &Reading<N>) -> Option<SVector<f64, N>> {
        let mut tau = SVector::zeros();
        for _ in 0..MAX_FIT_STEPS {
            let missing = self.residual(model, reading, &tau)?;
            tau += missing;
            if missing.norm() < 1e-9 * (1.0 + tau.norm()) {
                return Some(tau);
            }
        }
        None
    }

    /// Torque that a motion needs under `model` beyond what the command `tau` delivers.
    fn residual(
        &self,
        model: &Hypothesis<P>,
        reading: &Reading<N>,
        tau: &SVector<f64, N>,
    ) -> Option<SVector<f64, N>> {
        let [mut q, mut dq, mut ddq] = *reading;
        if model.distorts() {
            for j in 0..N {
                let at = model.actual(j, q[j]);
                let slope = model.stretch(j, at);
                let bend = (model.stretch(j, at + READING_STEP) - model.stretch(j, at - READING_STEP))
                    / (2.0 * READING_STEP);
                dq[j] /= slope;
                ddq[j] = (ddq[j] - bend * dq[j] * dq[j]) / slope;
                q[j] = at;
            }
        }
        let held: [[InputSegment<f64>; N]; 1] = [std::array::from_fn(|j| InputSegment::held(tau[j]))];
        let delivered = model.command(&[0.0], &held, &[], &[]).map_or(held[0], |rows| rows[0]);
        let delivered = SVector::from_fn(|j, _| delivered[j].mean());
        let plant = model.plant(self.arm)?;
        Some(plant.residual_torque(0.0, [&q, &dq, &ddq], &delivered, &LatentState::none(q)))
    }

    /// Residual torques in all states under their commands, each relative to the joint's typical torque.
    fn residuals(
        &self,
        model: &Hypothesis<P>,
        states: &[Reading<N>],
        commands: &[SVector<f64, N>],
    ) -> Option<DVector<f64>> {
        let mut all = Vec::with_capacity(N * states.len());
        for (state, tau) in states.iter().zip(commands) {
            let residual = self.residual(model, state, tau)?;
            all.extend((0..N).map(|j| residual[j] / self.torque[j]));
        }
        Some(DVector::from_vec(all)).filter(|all| all.iter().all(|x| x.is_finite()))
    }

    /// The model with the arm's parameters and its last effect fitted to the commands (Levenberg 1944, Marquardt 1963); `None` if residual torques
    /// larger than `enough` remain.
    fn fitted(
        &self,
        start: &Hypothesis<P>,
        states: &[Reading<N>],
        commands: &[SVector<f64, N>],
        enough: f64,
    ) -> Option<Hypothesis<P>> {
        let all = start.values();
        let free: Vec<usize> = (0..P)
            .chain(all.len() - start.effects.last().map_or(0, EffectInstance::len)..all.len())
            .collect();
        let scale: Vec<f64> = free.iter().map(|&i| self.scale(i, &all)).collect();
        let (mut values, mut damping) = (all, 1e-3);
        let mut left = self.residuals(start, states, commands)?;
        for _ in 0..MAX_FIT_STEPS {
            if left.norm() <= enough {
                return Some(start.with_values(&values));
            }
            let mut jacobian = DMatrix::zeros(left.len(), free.len());
            for (k, (&i, scale)) in free.iter().zip(&scale).enumerate() {
                let mut beside = values.clone();
                beside[i] += STEP * scale;
                let there = self.residuals(&start.with_values(&beside), states, commands)?;
                jacobian.set_column(k, &((there - &left) / STEP));
            }
            let (gram, slope) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&left));
            let ridge = DMatrix::from_diagonal(&gram.diagonal().map(|x| x.max(1e-12)));
            let tried = loop {
                let step = (&gram + &ridge * damping).cholesky()?.solve(&slope);
                let mut moved = values.clone();
                for ((&i, scale), step) in free.iter().zip(&scale).zip(step.iter()) {
                    moved[i] = Self::admissible(i, values[i] - scale * step, start);
                }
                let there = self.residuals(&start.with_values(&moved), states, commands);
                match there {
                    Some(there) if there.norm() < left.norm() => break Some((moved, there)),
                    _ if damping > 1e8 => break None,
                    _ => damping *= 10.0,
                }
            };
            let (moved, there) = tried?;
            (values, left, damping) = (moved, there, damping / 10.0);
        }
        None
    }

    /// Typical size of free value `i`: standard deviation of a parameter of the arm, present size of an effect's value.
    fn scale(&self, i: usize, values: &[f64]) -> f64 {
        let size = values[i].abs();
        if i < P { self.sigma[i].max(0.01 * size).max(1e-9) } else { (0.1 * size).max(1e-6) }
    }

    /// The value `x` of free value `i` kept within its bounds: positive parameters of the arm stay positive.
    fn admissible(i: usize, x: f64, start: &Hypothesis<P>) -> f64 {
        if i < P {
            return if start.theta[i] > 0.0 { x.max(1e-3 * start.theta[i]) } else { x };
        }
        let first = start.values().len() - start.effects.last().map_or(0, EffectInstance::len);
        let Some(effect) = start.effects.last() else { return x };
        let [low, high] = effect.bounds(i - first);
        x.clamp(low, high)
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Comparison of effects beside the model `model`, over a turn of every rotary joint and several times the travel of a linear one.
    pub(crate) fn same_torque<'a>(
        &'a self,
        model: &'a Hypothesis<P>,
        rotary: bool,
    ) -> SameTorque<'a, A, N, P> {
        let range = std::array::from_fn(|j| {
            let [low, high] = self.scales.travel[j];
            let half = if rotary { std::f64::consts::PI } else { TRAVELS * (high - low) };
            [0.5 * (low + high) - half, 0.5 * (low + high) + half]
        });
        SameTorque {
            arm: &self.arm,
            model,
            sigma: &self.prior.sigma,
            speed: std::array::from_fn(|j| self.scales.size(Quantity::Speed, j)),
            torque: std::array::from_fn(|j| self.scales.size(Quantity::Torque, j)),
            range,
        }
    }
}

/// Whether the torque of an effect of the library is a function of the joints' state and the command alone.
fn is_static(effect: &EffectInstance) -> bool {
    let spec = effect.law.spec();
    let in_time = |quantity| matches!(quantity, Quantity::Time | Quantity::Duration | Quantity::Impulse);
    find::<f64>(spec.name).is_some()
        && spec.trial != Trial::Disturbance
        && !spec.hooks.memory
        && !effect.law.has_transmission()
        && !spec.parameters.iter().any(|p| in_time(p.quantity))
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::arm::Pendulum;

    const THETA: [f64; 4] = [0.3, 5.0, 0.1, 0.4];
    const SIGMA: [f64; 4] = [0.015, 0.25, 0.02, 0.05];

    fn effect(name: &str, p: [f64; 3]) -> EffectInstance {
        EffectInstance::new(find::<f64>(name).expect("in the catalogue"), 0, p)
    }

    /// Names of the pendulum's parameters at whose other values `other` needs the torques of `cause`.
    fn moved(cause: EffectInstance, other: EffectInstance) -> Option<Vec<&'static str>> {
        let arm = Pendulum { gravity: 9.81 };
        let model = Hypothesis::rigid(THETA).with(cause);
        let range = [[-std::f64::consts::PI, std::f64::consts::PI]];
        let compared =
            SameTorque { arm: &arm, model: &model, sigma: &SIGMA, speed: [2.0], torque: [4.0], range };
        let names = <Pendulum<f64> as Arm<f64, 1, 4>>::PARAMETERS;
        Some(compared.moved(&cause, &other)?.into_iter().map(|i| names[i].name).collect())
    }

    #[test]
    fn gravity_turned_by_an_angle_is_a_ripple_of_one_cycle_and_an_encoder_zero() {
        let tilt = effect("base_tilt", [0.12, 0.0, 0.0]);
        assert_eq!(moved(tilt, effect("torque_ripple", [-0.5, 1.02, 1.6])), Some(Vec::new()));
        assert_eq!(moved(tilt, effect("encoder_offset", [-0.1, 0.0, 0.0])), Some(Vec::new()));
        assert_eq!(moved(tilt, effect("torque_offset", [0.5, 0.0, 0.0])), None);
    }

    #[test]
    fn a_distant_spring_contains_an_offset_and_not_the_other_way_round() {
        let (offset, spring) =
            (effect("torque_offset", [0.5, 0.0, 0.0]), effect("joint_spring", [0.01, 50.0, 0.0]));
        assert_eq!(moved(offset, spring), Some(Vec::new()));
        assert_eq!(moved(effect("joint_spring", [0.3, 0.5, 0.0]), offset), None);
    }

    #[test]
    fn effects_that_move_parameters_are_told_apart_by_the_other_parameters_alone() {
        let gain = effect("torque_gain", [0.5, 0.0, 0.0]);
        let found = moved(gain, effect("payload", [1.5, 0.4, 0.0])).expect("a payload with other friction");
        assert!(found.contains(&"viscous1") && found.contains(&"coulomb1"), "{found:?}");
    }

    #[test]
    fn effects_with_a_memory_and_another_dependence_are_not_the_same() {
        let stribeck = effect("stribeck", [0.2, 0.3, 0.0]);
        assert_eq!(moved(stribeck, effect("torque_ripple", [0.1, 3.0, 0.0])), None);
        assert_eq!(moved(stribeck, effect("presliding", [0.2, 300.0, 0.0])), None);
        assert_eq!(
            moved(effect("actuator_lag", [0.01, 0.0, 0.0]), effect("actuator_delay", [0.01, 0.0, 0.0])),
            None
        );
    }
}
