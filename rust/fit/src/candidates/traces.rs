//! Traces of candidates that are kept from one search node to the next.
//!
//! A cause that is added to the model changes the traces of other candidates little, but simulating an elastic joint or a play costs several times as
//! much as the rigid arm. So the traces of an earlier node rank these candidates, and only the best are simulated again (lazy greedy selection,
//! Minoux 1978).

use crate::model::hypothesis::EffectInstance;

/// Largest number of values that are kept, four bytes each; with more, every node simulates all candidates.
const MOST_VALUES: usize = 1 << 25;

/// Traces of candidates in rad or m per unit of the tested parameter, by window, sample and joint.
#[derive(Debug)]
pub struct Traces<const N: usize> {
    candidates: Vec<EffectInstance>,
    columns: Vec<Vec<f32>>,
}

impl<const N: usize> Traces<N> {
    /// The whitened traces `whitened` of candidates, under residual scales `scale`, rad or m; `None` if they are too many to keep.
    pub(crate) fn keep(
        candidates: &[EffectInstance],
        whitened: &[Vec<f64>],
        scale: &[f64; N],
    ) -> Option<Self> {
        let count: usize = whitened.iter().map(Vec::len).sum();
        let column = |trace: &Vec<f64>| {
            trace.iter().zip(scale.iter().cycle()).map(|(value, scale)| (value * scale) as f32).collect()
        };
        (count <= MOST_VALUES)
            .then(|| Self { candidates: candidates.to_vec(), columns: whitened.iter().map(column).collect() })
    }

    /// The whitened trace of a candidate under residual scales `scale`, rad or m; `None` if the candidate is unknown at these values.
    pub(crate) fn whitened(&self, candidate: &EffectInstance, scale: &[f64; N]) -> Option<Vec<f64>> {
        let is_same =
            |c: &EffectInstance| c.same_place(candidate) && c.p == candidate.p && c.sides == candidate.sides;
        let index = self.candidates.iter().position(is_same)?;
        let values = self.columns[index].iter().zip(scale.iter().cycle());
        Some(values.map(|(value, scale)| f64::from(*value) / scale).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    fn lag(joint: usize, time_constant: f64) -> EffectInstance {
        EffectInstance::new(find::<f64>("actuator_lag").expect("known"), joint, [time_constant, 0.0, 0.0])
    }

    #[test]
    fn a_trace_is_whitened_by_the_scales_of_the_node_that_asks() {
        let whitened = vec![vec![1.0, 2.0, 3.0, 4.0], vec![0.0; 4]];
        let traces = Traces::keep(&[lag(0, 0.01), lag(1, 0.01)], &whitened, &[0.5, 2.0]).expect("few values");
        assert_eq!(traces.whitened(&lag(0, 0.01), &[0.25, 1.0]), Some(vec![2.0, 4.0, 6.0, 8.0]));
        for other in [lag(0, 0.02), lag(2, 0.01)] {
            assert!(traces.whitened(&other, &[0.25, 1.0]).is_none());
        }
    }

    #[test]
    fn too_many_traces_are_not_kept() {
        let whitened = vec![vec![0.0; MOST_VALUES + 1]];
        assert!(Traces::keep(&[lag(0, 0.01)], &whitened, &[1.0]).is_none());
    }
}
