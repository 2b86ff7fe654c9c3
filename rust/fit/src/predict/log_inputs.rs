//! What the predictions of all windows of a log have in common under a hypothesis: the torques that reach the joints, and latent states.
//!
//! Both are computed for whole logs. Most hypotheses that are simulated one after another, such as those of a Jacobian's columns, differ in
//! values on which neither depends, and share them.

use crate::log::track::Track;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::latent_states::{LatentRun, latent_states};
use crate::predict::rollouts::Rollouts;
use crate::predict::window::Dataset;
use armgap_core::arm::Arm;
use armgap_core::effect::{Hooks, InputSegment};
use armgap_core::plant::Plant;
use armgap_core::transmission::{LatentState, Sides, Transmission};
use rayon::prelude::*;
use std::sync::Arc;

/// Torques of one log that reach the joints, sample by sample.
type Torques<const N: usize> = Vec<[InputSegment<f64>; N]>;

/// A plant, and the torques of all logs that reach its joints.
type UnderTorques<'a, A, const N: usize, const P: usize> =
    (&'a Plant<f64, A, N, P>, &'a [Option<Torques<N>>]);

/// Latent states of all logs, sample by sample.
type LatentStates<const N: usize> = Vec<Option<Vec<LatentState<f64, N>>>>;

/// Torques that reach the joints, and latent states, of all logs of a dataset under one hypothesis, with all on which they depend besides the logs.
#[derive(Clone)]
pub struct LogInputs<const N: usize> {
    /// Effects that act on commands.
    on_commands: Vec<EffectInstance>,
    /// Effects with a hysteresis state.
    with_memory: Vec<EffectInstance>,
    /// What the latent states depend on besides.
    source: LatentSource<N>,
    /// Whether hypotheses with the same torques take over the latent states, whatever else differs.
    is_held: bool,
    torques: Arc<Vec<Option<Torques<N>>>>,
    latent: Arc<LatentStates<N>>,
}

/// What the latent states of a log depend on besides the torques that reach the joints and hysteresis.
#[derive(Clone, PartialEq)]
enum LatentSource<const N: usize> {
    /// Transmission of each joint, if any, where encoders and friction of all joints are on their links.
    Transmissions([Option<Transmission<f64>>; N]),
    /// All values of the hypothesis, with the width of friction regularisation of each joint and the place of each effect.
    Hypothesis { values: Vec<f64>, rounding: Vec<f64>, places: Vec<(&'static str, usize, Sides)> },
}

impl<const N: usize> LatentSource<N> {
    fn new<A: Arm<f64, N, P>, const P: usize>(
        hypothesis: &Hypothesis<P>,
        plant: &Plant<f64, A, N, P>,
    ) -> Self {
        let drivetrain = plant.drivetrain();
        if (0..N).all(|j| drivetrain.sides(j) == Sides::LINK) {
            return Self::Transmissions(std::array::from_fn(|j| drivetrain.get(j).copied()));
        }
        Self::Hypothesis {
            values: hypothesis.values(),
            rounding: hypothesis.rounding.to_vec(),
            places: hypothesis.effects.iter().map(|e| (e.law.spec().name, e.joint, e.sides)).collect(),
        }
    }
}

impl<const N: usize> LogInputs<N> {
    /// Inputs of the logs of `data` under a hypothesis with the simulator `plant`; what does not differ from the inputs `known` of the same dataset
    /// under another hypothesis is shared with them.
    pub(crate) fn new<R: Rollouts, A: Arm<f64, N, P>, const P: usize>(
        data: &Dataset<N>,
        hypothesis: &Hypothesis<P>,
        plant: &Plant<f64, A, N, P>,
        known: Option<&Self>,
    ) -> Self {
        Self::of_all::<R, A, P>(data, &[(hypothesis, plant, known)]).swap_remove(0)
    }

    /// Inputs of the logs of `data` under hypotheses that differ in values alone, each with its simulator and the inputs known of another hypothesis, as
    /// [`LogInputs::new`] has them.
    pub(crate) fn of_all<R: Rollouts, A: Arm<f64, N, P>, const P: usize>(
        data: &Dataset<N>,
        hypotheses: &[(&Hypothesis<P>, &Plant<f64, A, N, P>, Option<&Self>)],
    ) -> Vec<Self> {
        let mut all: Vec<Self> = hypotheses
            .par_iter()
            .map(|(hypothesis, plant, known)| Self::without_latent_states(data, hypothesis, plant, *known))
            .collect();
        let own: Vec<usize> =
            (0..all.len()).filter(|&i| !all[i].shares_latent_states(hypotheses[i].2)).collect();
        let simulated: Vec<_> = own.iter().map(|&i| (hypotheses[i].1, all[i].torques.as_slice())).collect();
        let latent = latent::<R, A, N, P>(data, &simulated);
        for (i, latent) in own.into_iter().zip(latent) {
            all[i].latent = Arc::new(latent);
        }
        all
    }

    /// Inputs of the logs under a hypothesis, with the latent states of the inputs `known`, if any.
    fn without_latent_states<A: Arm<f64, N, P>, const P: usize>(
        data: &Dataset<N>,
        hypothesis: &Hypothesis<P>,
        plant: &Plant<f64, A, N, P>,
        known: Option<&Self>,
    ) -> Self {
        let with = |hook: fn(&Hooks) -> bool| -> Vec<EffectInstance> {
            hypothesis.effects.iter().filter(|e| hook(&e.law.spec().hooks)).copied().collect()
        };
        let (on_commands, with_memory) = (with(|hooks| hooks.command), with(|hooks| hooks.memory));
        let torques = known
            .filter(|known| are_equal(&known.on_commands, &on_commands))
            .map_or_else(|| Arc::new(torques(&data.tracks, hypothesis)), |known| Arc::clone(&known.torques));
        let source = LatentSource::new(hypothesis, plant);
        let latent = known.map_or_else(Arc::default, |known| Arc::clone(&known.latent));
        Self { on_commands, with_memory, source, is_held: false, torques, latent }
    }

    /// Whether the latent states are those of the inputs `known` of another hypothesis.
    fn shares_latent_states(&self, known: Option<&Self>) -> bool {
        known.is_some_and(|known| {
            let same_latent = known.is_held
                || (are_equal(&known.with_memory, &self.with_memory) && known.source == self.source);
            Arc::ptr_eq(&known.torques, &self.torques) && same_latent
        })
    }

    /// The inputs, whose latent states hypotheses with the same torques take over, whatever else differs.
    pub(crate) fn with_latent_states_held(&self) -> Self {
        Self { is_held: true, ..self.clone() }
    }

    /// Torques that reach the joints at every sample of the log `track` with the index `index`.
    pub(crate) fn torques<'a>(&'a self, index: usize, track: &'a Track<N>) -> &'a [[InputSegment<f64>; N]] {
        self.torques[index].as_deref().unwrap_or(&track.held)
    }

    /// Latent states of the log with the index `index` at its samples, up to the start of its last window; none for a plant without latent states.
    pub(crate) fn latent(&self, index: usize) -> Option<&[LatentState<f64, N>]> {
        self.latent[index].as_deref()
    }
}

/// Whether two lists hold the same effects in the same order, on the same joints and with the same values.
fn are_equal(one: &[EffectInstance], other: &[EffectInstance]) -> bool {
    let equal = |(a, b): (&EffectInstance, &EffectInstance)| a.same_place(b) && a.p == b.p;
    one.len() == other.len() && one.iter().zip(other).all(equal)
}

/// Torques of every log that reach the joints; `None` where nothing acts on the commands.
fn torques<const N: usize, const P: usize>(
    tracks: &[Track<N>],
    hypothesis: &Hypothesis<P>,
) -> Vec<Option<Torques<N>>> {
    let of = |track: &Track<N>| hypothesis.command(&track.t, &track.held, &track.pushes, &track.tables);
    tracks.iter().map(of).collect()
}

/// Latent states at every log's samples, up to the start of its last window, of plants that differ in values alone, each under its torques; `None` for
/// logs without windows, and for plants without latent states.
fn latent<R: Rollouts, A: Arm<f64, N, P>, const N: usize, const P: usize>(
    data: &Dataset<N>,
    simulated: &[UnderTorques<'_, A, N, P>],
) -> Vec<LatentStates<N>> {
    let mut all = vec![vec![None; data.tracks.len()]; simulated.len()];
    let (mut places, mut runs) = (Vec::new(), Vec::new());
    for (i, (plant, torques)) in
        simulated.iter().enumerate().filter(|(_, (plant, _))| plant.has_latent_states())
    {
        for (index, track) in data.tracks.iter().enumerate() {
            let first_samples = data.windows.iter().filter(|w| w.track == index).map(|w| w.first);
            if let Some(last) = first_samples.max() {
                let torque = torques[index].as_deref().unwrap_or(&track.held);
                places.push((i, index));
                runs.push(LatentRun { track, plant, torque, last });
            }
        }
    }
    for ((i, index), states) in places.into_iter().zip(latent_states::<R, A, N, P>(&runs)) {
        all[i][index] = Some(states);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::predict::rollouts::SideBySide;
    use armgap_core::arm::Pendulum;
    use armgap_core::effect::find;
    use armgap_core::integrate::{Interval, State, StepLimits, advance_in_stable_steps};
    use nalgebra::SVector;

    const PENDULUM: Pendulum<f64> = Pendulum { gravity: 9.81 };

    /// A pendulum of inertia 0.1 kg m^2 behind an elastic shaft or backlash, with encoder and friction on the motor.
    fn hidden(name: &str, p: [f64; 3]) -> Hypothesis<4> {
        let effect = EffectInstance::new(find(name).expect("known"), 0, p).with_sides(Sides::MOTOR);
        Hypothesis::rigid([0.1, 1.0, 0.05, 0.1]).with(effect)
    }

    /// Four seconds of its motion under a torque of two sines, as the encoder on its motor shows it.
    fn log(hypothesis: &Hypothesis<4>) -> Dataset<1> {
        let plant = hypothesis.plant(&PENDULUM).expect("one effect");
        let h = 0.002;
        let t: Vec<f64> = (0..2000).map(|k| h * f64::from(k)).collect();
        let tau: Vec<f64> = t.iter().map(|t| 1.2 * (5.0 * t).sin() + 0.8 * (13.0 * t).sin()).collect();
        let mut state = State::new(SVector::zeros(), SVector::zeros());
        let limits = StepLimits { near_standstill: 16, elsewhere: 8 };
        let mut q = Vec::new();
        for (t, tau) in t.iter().zip(&tau) {
            q.push(state.q[0] + state.latent.deflection[0]);
            let interval = Interval { t: *t, h, torque: &[InputSegment::held(*tau)] };
            let rates = plant.step_rates(&state.q);
            advance_in_stable_steps(&plant, &mut state, &interval, &rates, limits);
        }
        Dataset::new(vec![Track::new("", &t, &q, &tau, Some([1e-5]))], 0.25)
    }

    fn inputs(data: &Dataset<1>, of: &Hypothesis<4>, known: Option<&LogInputs<1>>) -> LogInputs<1> {
        LogInputs::new::<SideBySide, _, 4>(data, of, &of.plant(&PENDULUM).expect("one effect"), known)
    }

    #[test]
    fn latent_states_are_shared_by_equal_hypotheses_alone_unless_they_are_held() {
        let here = hidden("joint_elasticity", [60.0, 0.05, 0.02]);
        let data = log(&here);
        let known = inputs(&data, &here, None);
        let is_shared = |of: &Hypothesis<4>, known: &LogInputs<1>| {
            Arc::ptr_eq(&inputs(&data, of, Some(known)).latent, &known.latent)
        };
        assert!(known.latent(0).is_some() && is_shared(&here, &known));
        let mut heavier = here.clone();
        heavier.theta[0] *= 1.01;
        let at_link = Hypothesis { effects: vec![here.effects[0].with_sides(Sides::LINK)], ..here.clone() };
        for other in [&heavier, &hidden("joint_elasticity", [61.0, 0.05, 0.02]), &at_link] {
            assert!(!is_shared(other, &known));
        }
        assert!(is_shared(&heavier, &known.with_latent_states_held()));
    }

    #[test]
    fn sensitivities_to_the_arm_are_nearly_those_with_latent_states_held() {
        for (name, p) in [("joint_elasticity", [200.0, 0.05, 0.02]), ("backlash", [0.03, 0.1, 0.0])] {
            let here = hidden(name, p);
            let data = log(&here);
            let offsets = data.zero_offsets();
            let (before, known) = data.predict_beside(&PENDULUM, &here, &offsets, None);
            let held = known.expect("one effect").with_latent_states_held();
            for i in 0..4 {
                let mut values = here.values();
                let step = 1e-6 * values[i];
                values[i] += step;
                let column = |known: Option<&LogInputs<1>>| -> Vec<f64> {
                    let moved = here.with_values(&values);
                    let (after, _) = data.predict_beside(&PENDULUM, &moved, &offsets, known);
                    after.iter().zip(&before).map(|(a, b)| (a - b) / step).collect()
                };
                let (exact, held) = (column(None), column(Some(&held)));
                let length = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
                let apart: Vec<f64> = exact.iter().zip(&held).map(|(a, b)| a - b).collect();
                assert!(length(&apart) < 0.1 * length(&exact));
            }
        }
    }
}
