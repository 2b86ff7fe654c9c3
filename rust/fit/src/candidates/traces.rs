//! Traces of candidates that are kept for later search nodes.
//!
//! A cause that is added to the model changes the traces of other candidates little, but simulating an elastic joint or backlash costs several times
//! as much as the rigid arm. So the traces of earlier nodes rank these candidates, and only the best are simulated again. A transmission (an elastic
//! joint or backlash) in the model changes the traces of all others, which are simulated anew.

use crate::model::hypothesis::{EffectInstance, Hypothesis};

/// Largest number of values that are kept, four bytes each; with more, every node simulates all candidates.
const MOST_VALUES: usize = 1 << 25;

/// Traces of candidates in rad or m per unit of the tested parameter, by window, sample and joint.
#[derive(Debug)]
pub struct Traces<const N: usize> {
    candidates: Vec<EffectInstance>,
    columns: Vec<Vec<f32>>,
    /// Transmissions of the model beside which the candidates were simulated.
    transmissions: Vec<EffectInstance>,
}

impl<const N: usize> Traces<N> {
    /// The whitened traces `whitened` of candidates beside `model`, under residual scales `scale`, rad or m; `None` if they are too many to keep.
    pub(crate) fn keep<const P: usize>(
        model: &Hypothesis<P>,
        candidates: &[EffectInstance],
        whitened: &[Vec<f64>],
        scale: &[f64; N],
    ) -> Option<Self> {
        let count: usize = whitened.iter().map(Vec::len).sum();
        let column = |trace: &Vec<f64>| {
            trace.iter().zip(scale.iter().cycle()).map(|(value, scale)| (value * scale) as f32).collect()
        };
        (count <= MOST_VALUES).then(|| Self {
            candidates: candidates.to_vec(),
            columns: whitened.iter().map(column).collect(),
            transmissions: transmissions(model),
        })
    }

    /// Whether the traces hold beside `model` too, which then has the same transmissions.
    pub(crate) fn hold_beside<const P: usize>(&self, model: &Hypothesis<P>) -> bool {
        let now = transmissions(model);
        now.len() == self.transmissions.len()
            && now.iter().zip(&self.transmissions).all(|(a, b)| a.same_place(b) && a.sides == b.sides)
    }

    /// The candidates whose traces are kept.
    pub(crate) fn candidates(&self) -> &[EffectInstance] {
        &self.candidates
    }

    /// The whitened trace of a candidate under residual scales `scale`, rad or m; `None` if the candidate is unknown at these values, or changed no
    /// prediction, as a contact that the arm did not reach.
    pub(crate) fn whitened(&self, candidate: &EffectInstance, scale: &[f64; N]) -> Option<Vec<f64>> {
        let is_same =
            |c: &EffectInstance| c.same_place(candidate) && c.p == candidate.p && c.sides == candidate.sides;
        let column = &self.columns[self.candidates.iter().position(is_same)?];
        if column.iter().all(|value| *value == 0.0) {
            return None;
        }
        let values = column.iter().zip(scale.iter().cycle());
        Some(values.map(|(value, scale)| f64::from(*value) / scale).collect())
    }
}

/// Transmissions of a model that are elastic or have backlash.
fn transmissions<const P: usize>(model: &Hypothesis<P>) -> Vec<EffectInstance> {
    model.effects.iter().filter(|effect| effect.law.has_transmission()).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;
    use armgap_core::transmission::Sides;

    fn effect(name: &str, joint: usize, first: f64) -> EffectInstance {
        EffectInstance::new(find::<f64>(name).expect("known"), joint, [first, 0.0, 0.0])
    }

    fn lag(joint: usize, time_constant: f64) -> EffectInstance {
        effect("actuator_lag", joint, time_constant)
    }

    fn rigid() -> Hypothesis<3> {
        Hypothesis::rigid([1.0; 3])
    }

    #[test]
    fn a_trace_is_whitened_by_the_scales_of_the_node_that_asks() {
        let whitened = vec![vec![1.0, 2.0, 3.0, 4.0], vec![0.0; 4]];
        let candidates = [lag(0, 0.01), lag(1, 0.01)];
        let traces = Traces::keep(&rigid(), &candidates, &whitened, &[0.5, 2.0]).expect("few values");
        assert_eq!(traces.whitened(&lag(0, 0.01), &[0.25, 1.0]), Some(vec![2.0, 4.0, 6.0, 8.0]));
        // Other values, another joint, other sides, and a trace without any effect.
        for other in [lag(0, 0.02), lag(2, 0.01), lag(0, 0.01).with_sides(Sides::MOTOR), lag(1, 0.01)] {
            assert!(traces.whitened(&other, &[0.25, 1.0]).is_none());
        }
    }

    #[test]
    fn too_many_traces_are_not_kept() {
        let whitened = vec![vec![0.0; MOST_VALUES + 1]];
        assert!(Traces::keep(&rigid(), &[lag(0, 0.01)], &whitened, &[1.0]).is_none());
    }

    #[test]
    fn a_transmission_in_the_model_changes_all_traces() {
        let traces = Traces::keep(&rigid(), &[lag(0, 0.01)], &[vec![1.0]], &[1.0]).expect("few values");
        assert!(traces.hold_beside(&rigid().with(lag(1, 0.02))));
        assert!(!traces.hold_beside(&rigid().with(effect("joint_elasticity", 0, 1.0))));
    }
}
