//! What the predictions of all windows of a log have in common under a hypothesis: the torques that reach the joints, and latent states.
//!
//! Both are computed for whole logs. Most hypotheses that are simulated one after another, such as those of a Jacobian's columns, differ in
//! values on which neither depends, and share them.

use crate::log::track::Track;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::latent_states::latent_states;
use crate::predict::window::Dataset;
use armgap_core::arm::Arm;
use armgap_core::effect::{Hooks, InputSegment};
use armgap_core::plant::Plant;
use armgap_core::transmission::{LatentState, Sides, Transmission};
use rayon::prelude::*;
use std::sync::Arc;

/// Torques of one log that reach the joints, sample by sample.
type Torques<const N: usize> = Vec<[InputSegment<f64>; N]>;

/// Torques that reach the joints, and latent states, of all logs of a dataset under one hypothesis, with all on which they depend besides the logs.
#[derive(Clone)]
pub struct LogInputs<const N: usize> {
    /// Effects that act on commands.
    on_commands: Vec<EffectInstance>,
    /// Effects with a hysteresis state.
    with_memory: Vec<EffectInstance>,
    /// Transmission of each joint, if any; none at all where an encoder or friction of some joint is on its motor: latent states then depend on all
    /// values of the hypothesis.
    transmissions: Option<[Option<Transmission<f64>>; N]>,
    torques: Arc<Vec<Option<Torques<N>>>>,
    latent: Arc<Vec<Option<Vec<LatentState<f64, N>>>>>,
}

impl<const N: usize> LogInputs<N> {
    /// Inputs of the logs of `data` under a hypothesis with the simulator `plant`; what does not differ from the inputs `known` of the same dataset
    /// under another hypothesis is shared with them.
    pub(crate) fn new<A: Arm<f64, N, P>, const P: usize>(
        data: &Dataset<N>,
        hypothesis: &Hypothesis<P>,
        plant: &Plant<f64, A, N, P>,
        known: Option<&Self>,
    ) -> Self {
        let with = |hook: fn(&Hooks) -> bool| -> Vec<EffectInstance> {
            hypothesis.effects.iter().filter(|e| hook(&e.law.spec().hooks)).copied().collect()
        };
        let (on_commands, with_memory) = (with(|hooks| hooks.command), with(|hooks| hooks.memory));
        let at_links = (0..N).all(|j| plant.drivetrain().sides(j) == Sides::LINK);
        let transmissions = at_links.then(|| std::array::from_fn(|j| plant.drivetrain().get(j).copied()));
        let same_torques = known.filter(|known| are_equal(&known.on_commands, &on_commands));
        let torques = same_torques
            .map_or_else(|| Arc::new(torques(&data.tracks, hypothesis)), |known| Arc::clone(&known.torques));
        let same_latent = same_torques.filter(|known| {
            are_equal(&known.with_memory, &with_memory)
                && transmissions.is_some()
                && known.transmissions == transmissions
        });
        let latent = same_latent
            .map_or_else(|| Arc::new(latent(data, plant, &torques)), |known| Arc::clone(&known.latent));
        Self { on_commands, with_memory, transmissions, torques, latent }
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

/// Latent states at every log's samples, up to the start of its last window; `None` for a plant without latent states.
fn latent<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    data: &Dataset<N>,
    plant: &Plant<f64, A, N, P>,
    torques: &[Option<Torques<N>>],
) -> Vec<Option<Vec<LatentState<f64, N>>>> {
    if !plant.has_latent_states() {
        return vec![None; data.tracks.len()];
    }
    let of = |(index, track): (usize, &Track<N>)| {
        let last = data.windows.iter().filter(|w| w.track == index).map(|w| w.first).max()?;
        Some(latent_states(track, plant, torques[index].as_deref().unwrap_or(&track.held), last))
    };
    data.tracks.par_iter().enumerate().map(of).collect()
}
