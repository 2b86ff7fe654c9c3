//! Whether two effects need the same torque in every state of the arm, so that no motion distinguishes them.
//!
//! A cause fixes the command of every motion. If another effect, at some values of its own and of the arm's parameters, needs the same commands in
//! states drawn at random, no experiment on the joints' positions and torques distinguishes the two (structural identifiability: Bellman and Astrom
//! 1970); only a measured value of a parameter does. Effects with a memory, and drives that limit their torque, are no such functions of the state and
//! are not compared.

use crate::likelihood::context::DiagnosisContext;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::numeric::random::Random;
use armgap_core::arm::Arm;
use armgap_core::effect::{InputSegment, Quantity, Trial, find};
use armgap_core::transmission::LatentState;
use nalgebra::{DMatrix, DVector, SVector};

/// Number of states in which torques are compared: several times as many as there are values to fit.
const COMPARED_STATES: usize = 80;
/// Seed of the states.
const STATES_SEED: u64 = 80;
/// Largest RMS difference of the commands, as a part of the RMS command that the cause needs beyond what the arm's parameters imitate, at which they
/// count as the same. Of 33 look-alikes of causes on simulated arms the fit leaves at most 0.02 for the 15 that are the same, or become so as a
/// spring's rest position moves away, and at least 0.05 for the others.
const SAME_TORQUE: f64 = 0.03;
/// Change of a parameter of the arm, in standard deviations of its prior, from which it is named as what a measurement has to determine.
const NOTICEABLY_MOVED: f64 = 0.5;
/// Weight of a change of the arm's parameters by one standard deviation, as a part of [`SAME_TORQUE`]: of equally good fits the nearest counts.
const HELD_BACK: f64 = 0.01;
/// Speed that is added to every state's, as a part of the largest: friction is smoothed near rest.
const LEAST_SPEED: f64 = 0.1;
/// Half the range of positions of a linear joint, in travels of the logs.
const TRAVELS: f64 = 2.0;
/// Smallest torque scale of a joint, as a part of the largest joint's, and smallest range of positions, rad or m.
const LEAST_TORQUE: f64 = 1e-3;
const LEAST_RANGE: f64 = 1e-2;
/// Largest number of steps of the fit, and of Newton's method for the command.
const MAX_FIT_STEPS: usize = 100;
/// Step of finite differences, as a part of a value's scale.
const STEP: f64 = 1e-5;
/// Displacement for the second derivative of an encoder's reading, rad or m.
const READING_STEP: f64 = 1e-4;

/// Readings of the encoders, their rates and accelerations.
type Reading<const N: usize> = [SVector<f64, N>; 3];

/// States with the commands that the cause needs in them.
type Commanded<const N: usize> = Vec<(Reading<N>, SVector<f64, N>)>;

/// Comparison of two effects on one arm by the commands that they need.
pub struct SameTorque<'a, A, const N: usize, const P: usize> {
    /// Model of the arm without effects.
    pub arm: &'a A,
    /// Reported model.
    pub model: &'a Hypothesis<P>,
    /// Standard deviations of the arm's parameters in the arm file, SI.
    pub sigma: &'a [f64; P],
    /// Typical speed per joint, rad/s or m/s.
    pub speed: [f64; N],
    /// Typical torque per joint, N m or N.
    pub torque: [f64; N],
    /// Range of positions per joint, rad or m.
    pub range: [[f64; 2]; N],
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> SameTorque<'_, A, N, P> {
    /// Indices of the arm's parameters at whose other values `other` needs the commands of `cause` in every state; `None` if it does not, or if a
    /// command depends on more than the state.
    ///
    /// A cause that the arm's parameters alone imitate is the same as `other` if they imitate that as well: what the two change is a parameter.
    pub fn moved(&self, cause: &EffectInstance, other: &EffectInstance) -> Option<Vec<usize>> {
        if !is_static(cause) || !is_static(other) {
            return None;
        }
        let mut without = self.model.clone();
        without.effects.retain(|e| is_static(e) && !e.same_place(cause) && !e.same_place(other));
        let (states, own) = self.commanded(&without, cause)?;
        let arm: Vec<usize> = (0..P).collect();
        let bare = self.fitted(&without, &states, &arm, SAME_TORQUE * own)?;
        let found = if bare.left <= SAME_TORQUE * own {
            let (beside, its_own) = self.commanded(&without, other)?;
            let imitated = self.fitted(&without, &beside, &arm, SAME_TORQUE * its_own)?;
            if imitated.left > SAME_TORQUE * its_own {
                return None;
            }
            self.fitted(&without.with(*other), &states, &arm, 0.0)?
        } else {
            let enough = SAME_TORQUE * bare.left;
            let start = without.with(*other);
            let free: Vec<usize> =
                (0..P).chain(start.values().len() - other.len()..start.values().len()).collect();
            let found = self.fitted(&start, &states, &free, enough)?;
            if found.left > enough {
                return None;
            }
            found
        };
        let moved = |i: &usize| {
            (found.model.theta[*i] - self.model.theta[*i]).abs() > NOTICEABLY_MOVED * self.sigma[*i]
        };
        Some((0..P).filter(moved).collect())
    }

    /// States, with the commands that `effect` beside the model `without` needs in them, and the norm of what `without` leaves of these; `None` if
    /// nothing is left, or if too few states have a command.
    fn commanded(&self, without: &Hypothesis<P>, effect: &EffectInstance) -> Option<(Commanded<N>, f64)> {
        let with = without.with(*effect);
        let needed = |state: Reading<N>| Some((state, self.command(&with, &state)?));
        let states: Commanded<N> = self.states().into_iter().filter_map(needed).collect();
        let own = self.missing(without, &states)?.norm();
        (own > 0.0 && 2 * states.len() > COMPARED_STATES).then_some((states, own))
    }

    /// States drawn over the range of positions and about twice the typical speeds, with the accelerations of twice the typical torques.
    fn states(&self) -> Vec<Reading<N>> {
        let mut random = Random(STATES_SEED);
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
            let missing = self.beyond(model, reading, &tau)?;
            tau += missing;
            if missing.norm() < 1e-9 * (1.0 + tau.norm()) {
                return Some(tau);
            }
        }
        None
    }

    /// Command that a motion needs under `model` beyond `tau`, to first order.
    fn beyond(
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
        let delivered = |tau: SVector<f64, N>| {
            let held: [[InputSegment<f64>; N]; 1] = [std::array::from_fn(|j| InputSegment::held(tau[j]))];
            let rows = model.command(&[0.0], &held, &[], &[]).map_or(held[0], |rows| rows[0]);
            SVector::<f64, N>::from_fn(|j, _| rows[j].mean())
        };
        let reached = delivered(*tau);
        let plant = model.plant(self.arm)?;
        let residual = plant.residual_torque(0.0, [&q, &dq, &ddq], &reached, &LatentState::none(q));
        let step = SVector::from(self.torque);
        let gain = (delivered(tau + step) - reached).component_div(&step);
        let beyond = residual.component_div(&gain);
        beyond.iter().all(|x| x.is_finite()).then_some(beyond)
    }

    /// Commands that `model` needs beyond those of the states, each relative to the joint's typical torque.
    fn missing(&self, model: &Hypothesis<P>, states: &Commanded<N>) -> Option<DVector<f64>> {
        let mut all = Vec::with_capacity(N * states.len());
        for (state, tau) in states {
            let beyond = self.beyond(model, state, tau)?;
            all.extend((0..N).map(|j| beyond[j] / self.torque[j]));
        }
        Some(DVector::from_vec(all))
    }

    /// The model with its `free` values fitted to the states' commands (Levenberg 1944, Marquardt 1963), until at most `enough` is left.
    ///
    /// The arm's parameters are drawn weakly to those of the reported model, so that of equally good fits the nearest is found.
    fn fitted(
        &self,
        start: &Hypothesis<P>,
        states: &Commanded<N>,
        free: &[usize],
        enough: f64,
    ) -> Option<Fitted<P>> {
        let bounds = bounds(start);
        let scale: Vec<f64> = free.iter().map(|&i| self.scale(i, &start.values())).collect();
        let back = HELD_BACK * SAME_TORQUE * self.missing(start, states)?.norm();
        let residual = |values: &[f64]| -> Option<(f64, DVector<f64>)> {
            let missing = self.missing(&start.with_values(values), states)?;
            let held = (0..P).map(|i| back * (values[i] - self.model.theta[i]) / self.sigma[i]);
            Some((
                missing.norm(),
                DVector::from_iterator(missing.len() + P, missing.iter().copied().chain(held)),
            ))
        };
        let (mut values, mut damping) = (start.values(), 1e-3);
        let (mut left, mut rows) = residual(&values)?;
        for _ in 0..MAX_FIT_STEPS {
            if left <= enough {
                break;
            }
            let mut jacobian = DMatrix::zeros(rows.len(), free.len());
            for (k, (&i, scale)) in free.iter().zip(&scale).enumerate() {
                let mut beside = values.clone();
                let step = if beside[i] + STEP * scale > bounds[i][1] { -STEP } else { STEP };
                beside[i] += step * scale;
                jacobian.set_column(k, &((residual(&beside)?.1 - &rows) / step));
            }
            let (gram, slope) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&rows));
            let ridge = DMatrix::from_diagonal(&gram.diagonal().map(|x| x.max(1e-12)));
            let mut fell: Option<f64> = None;
            while fell.is_none() && damping < 1e8 {
                let step = (&gram + &ridge * damping).cholesky().map(|factor| factor.solve(&slope));
                let mut next = values.clone();
                for (k, &i) in free.iter().enumerate() {
                    let step = step.as_ref().map_or(0.0, |step| step[k]);
                    next[i] = (values[i] - scale[k] * step).clamp(bounds[i][0], bounds[i][1]);
                }
                match residual(&next) {
                    Some((there, lower)) if lower.norm() < rows.norm() => {
                        fell = Some(1.0 - lower.norm() / rows.norm());
                        (values, left, rows) = (next, there, lower);
                        damping = (0.1 * damping).max(1e-9);
                    }
                    _ => damping *= 10.0,
                }
            }
            if fell.is_none_or(|fell| fell < STEP) {
                break;
            }
        }
        Some(Fitted { model: start.with_values(&values), left })
    }

    /// Typical size of free value `i`: standard deviation of a parameter of the arm, present size of an effect's value.
    fn scale(&self, i: usize, values: &[f64]) -> f64 {
        let size = values[i].abs();
        if i < P { self.sigma[i].max(0.01 * size).max(1e-9) } else { (0.1 * size).max(1e-6) }
    }
}

/// Result of a fit to commands.
struct Fitted<const P: usize> {
    /// The fitted model.
    model: Hypothesis<P>,
    /// Norm of the commands that it leaves missing.
    left: f64,
}

/// Lower and upper bounds of a model's values: positive parameters of the arm stay positive.
fn bounds<const P: usize>(model: &Hypothesis<P>) -> Vec<[f64; 2]> {
    let arm =
        model.theta.iter().map(|x| [if *x > 0.0 { 1e-3 * x } else { f64::NEG_INFINITY }, f64::INFINITY]);
    let effects = model.effects.iter().flat_map(|e| (0..e.len()).map(|i| e.bounds(i)));
    arm.chain(effects).collect()
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
            let half = if rotary { std::f64::consts::PI } else { (TRAVELS * (high - low)).max(LEAST_RANGE) };
            [0.5 * (low + high) - half, 0.5 * (low + high) + half]
        });
        let torque: [f64; N] = std::array::from_fn(|j| self.scales.torque[j]);
        let most = torque.iter().copied().fold(0.0, f64::max);
        let most = if most > 0.0 { most } else { 1.0 };
        SameTorque {
            arm: &self.arm,
            model,
            sigma: &self.prior.sigma,
            speed: std::array::from_fn(|j| self.scales.size(Quantity::Speed, j)),
            torque: torque.map(|torque| torque.max(LEAST_TORQUE * most)),
            range,
        }
    }
}

/// Whether the command that an effect of the library needs is a function of the joints' state alone.
fn is_static(effect: &EffectInstance) -> bool {
    let spec = effect.law.spec();
    let in_time = |quantity| matches!(quantity, Quantity::Time | Quantity::Duration | Quantity::Impulse);
    let limits_command = spec.hooks.command && spec.trial == Trial::Whole;
    find::<f64>(spec.name).is_some()
        && spec.trial != Trial::Disturbance
        && !limits_command
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
        assert!(!moved(gain, effect("rotor_inertia", [0.02, 0.0, 0.0])).expect("another inertia").is_empty());
    }

    #[test]
    fn a_gain_as_look_alike_is_not_the_same_for_growing_small() {
        let gain = effect("torque_gain", [1.1, 0.0, 0.0]);
        for cause in [
            effect("stribeck", [0.4, 1.0, 0.0]),
            effect("quadratic_drag", [0.1, 0.0, 0.0]),
            effect("cubic_drag", [0.02, 0.0, 0.0]),
        ] {
            assert_eq!(moved(cause, gain), None, "{cause:?}");
        }
    }

    #[test]
    fn a_cause_that_parameters_imitate_is_not_the_same_as_an_effect_that_they_do_not() {
        let gain = effect("torque_gain", [0.9, 0.0, 0.0]);
        assert_eq!(moved(gain, effect("torque_ripple", [0.3, 3.0, 0.5])), None);
        assert_eq!(moved(gain, effect("stribeck", [0.4, 1.0, 0.0])), None);
        assert_eq!(moved(gain, effect("joint_spring", [0.3, 0.5, 0.0])), None);
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
