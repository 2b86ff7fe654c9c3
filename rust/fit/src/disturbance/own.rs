//! The model fitted to one recording alone, with and without pushes.

use super::push::{Disturbance, Place, PushState};
use crate::likelihood::context::DiagnosisContext;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::window::Dataset;
use armgap_core::arm::Arm;
use std::cell::OnceCell;

/// A recording, and the model refitted to this recording alone.
pub(super) struct Own<'a, A, const N: usize, const P: usize> {
    whole: &'a DiagnosisContext<A, N, P>,
    places: &'a [Place],
    state: &'a PushState<'a, N, P>,
    bare: OnceCell<Hypothesis<P>>,
}

impl<'a, A: Arm<f64, N, P>, const N: usize, const P: usize> Own<'a, A, N, P> {
    /// The recording whose stretches are the logs at `places` of the diagnosis context `whole`.
    pub fn new(
        whole: &'a DiagnosisContext<A, N, P>,
        places: &'a [Place],
        state: &'a PushState<'a, N, P>,
    ) -> Self {
        Self { whole, places, state, bare: OnceCell::new() }
    }

    /// The model fitted to the recording without any push.
    pub fn bare(&self) -> &Hypothesis<P> {
        self.bare.get_or_init(|| self.beside(&[]))
    }

    /// The model fitted to the recording with the pushes `disturbances` acting in their logs.
    pub fn beside(&self, disturbances: &[&Disturbance]) -> Hypothesis<P> {
        let piece = |place: &Place| {
            let mut data =
                [&self.whole.training, &self.whole.holdout][place.0].data.of_track(place.1, |_| true);
            let here = disturbances.iter().filter(|e| e.place() == *place);
            data.tracks[0].pushes = here.map(|e| e.push).collect::<Vec<EffectInstance>>();
            data
        };
        let Some(data) = self.places.iter().map(piece).reduce(Dataset::and) else {
            return self.state.model.clone();
        };
        let context = self.whole.on_windows(data);
        context.settle(self.state.model, self.state.scale).0.hypothesis
    }
}
