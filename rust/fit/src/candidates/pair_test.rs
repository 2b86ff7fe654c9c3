//! Score tests of pairs of candidates: expected decrease of the cost by two effects together, to first order.
//!
//! Where an arm lacks two effects, each of them alone is fitted with a wrong size, because it takes up what the other one would explain, and may then
//! predict another motion no better. Together they do. With the traces of all candidates at one node, every pair costs the solution of two equations.

use crate::candidates::screen::{ScoreTest, tested};
use crate::model::hypothesis::EffectInstance;
use armgap_core::effect::Trial;
use nalgebra::{DMatrix, DVector};

/// Share of a candidate's squared trace that another candidate cannot imitate, both without what the model's free values imitate, below which the two are
/// not tested as a pair: one of them is as good as both.
const NOT_IMITATED: f64 = 0.1;

/// Largest share of an effect's initial guess along a ray that a test suggests.
const LONGEST_RAY: f64 = 20.0;

/// Inner products of candidates' traces, and of these with the residual, without what the model's free values imitate.
pub(crate) struct Projected {
    /// Inner products of the traces.
    pub(crate) normal: DMatrix<f64>,
    /// Inner products of the traces and the residual.
    pub(crate) gradient: DVector<f64>,
}

/// Score test of two candidates together.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PairTest {
    /// Indices of the two candidates, the lower one first.
    pub(crate) of: [usize; 2],
    /// Expected decrease of the cost when both are added to the model.
    pub(crate) gain: f64,
    /// Deviations of the two tested parameters from their neutral values that the test suggests, in the units of the score tests.
    pub(crate) sizes: [f64; 2],
}

impl Projected {
    /// Score tests of all pairs of candidates whose deviations stay within `bounds`, the largest gain first.
    pub(crate) fn pair_tests(&self, bounds: &[[f64; 2]]) -> Vec<PairTest> {
        let pairs = (0..bounds.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
        let mut tests: Vec<PairTest> = pairs.filter_map(|of| self.pair_test(bounds, of)).collect();
        tests.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        tests
    }

    /// Whether two candidates have nearly the same trace, or its opposite.
    pub(crate) fn are_alike(&self, a: usize, b: usize) -> bool {
        a == b || self.determinant(a, b) <= NOT_IMITATED * self.normal[(a, a)] * self.normal[(b, b)]
    }

    fn determinant(&self, a: usize, b: usize) -> f64 {
        self.normal[(a, a)] * self.normal[(b, b)] - self.normal[(a, b)].powi(2)
    }

    /// Score test of the candidates `of`; none where one imitates the other, or a deviation would leave its bounds.
    fn pair_test(&self, bounds: &[[f64; 2]], of: [usize; 2]) -> Option<PairTest> {
        let [a, b] = of;
        if self.are_alike(a, b) {
            return None;
        }
        let (normal, gradient) = (&self.normal, &self.gradient);
        let determinant = self.determinant(a, b);
        let size = |own: usize, other: usize| {
            (normal[(other, other)] * gradient[own] - normal[(own, other)] * gradient[other]) / determinant
        };
        let sizes = [size(a, b), size(b, a)];
        let gain = sizes[0] * gradient[a] + sizes[1] * gradient[b];
        let within = sizes.iter().zip(of).all(|(size, i)| (bounds[i][0]..=bounds[i][1]).contains(size));
        (within && gain > 0.0).then_some(PairTest { of, gain, sizes })
    }
}

/// Range of the deviation of a candidate's tested parameter from its neutral value, in the unit of the score tests; none for an effect with a threshold,
/// whose test is not exact to first order.
pub(crate) fn bounds(candidate: &EffectInstance) -> Option<[f64; 2]> {
    match candidate.law.spec().trial {
        Trial::Amplitudes(_) => {
            let parameter = &candidate.law.spec().parameters[tested(candidate)];
            Some([parameter.lower, parameter.upper].map(|bound| bound - parameter.neutral))
        }
        Trial::Ray => Some([0.0, LONGEST_RAY]),
        Trial::Whole | Trial::Disturbance => None,
    }
}

/// A candidate with the deviation `size` of its tested parameter from the neutral value, in the unit of the score tests; one with a threshold unchanged.
pub(crate) fn of_size(candidate: &EffectInstance, size: f64) -> EffectInstance {
    let mut effect = *candidate;
    match candidate.law.spec().trial {
        Trial::Amplitudes(_) => {
            let i = tested(candidate);
            effect.p[i] = candidate.law.spec().parameters[i].neutral + size;
        }
        Trial::Ray => effect.p = candidate.p.map(|value| size * value),
        Trial::Whole | Trial::Disturbance => {}
    }
    effect
}

/// Best test of every effect and joint, as indices into `tests`, without those that the arm's parameters imitate.
pub(crate) fn best_of_each(tests: &[ScoreTest], absorbed: f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..tests.len()).filter(|i| tests[*i].distinct >= absorbed).collect();
    order.sort_by(|a, b| tests[*b].gain.total_cmp(&tests[*a].gain));
    let mut best: Vec<usize> = Vec::new();
    for i in order {
        if !best.iter().any(|k| tests[*k].effect.same_place(&tests[i].effect)) {
            best.push(i);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use armgap_core::effect::find;

    const FREE: [f64; 2] = [-10.0, 10.0];

    fn projected(normal: [f64; 9], gradient: [f64; 3]) -> Projected {
        Projected {
            normal: DMatrix::from_row_slice(3, 3, &normal),
            gradient: DVector::from_row_slice(&gradient),
        }
    }

    #[test]
    fn two_effects_that_hide_each_other_gain_more_together_than_alone() {
        // Traces (1, 0), (0.8, 0.6) and a third one apart; the residual is the first minus the second.
        let opposed = projected([1.0, 0.8, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, 1.0], [0.2, -0.2, 0.3]);
        let tests = opposed.pair_tests(&[FREE; 3]);
        assert_eq!(tests[0].of, [0, 1]);
        assert!((tests[0].gain - 0.4).abs() < 1e-12, "alone they gain 0.04 each");
        assert!(tests[0].sizes.iter().zip([1.0, -1.0]).all(|(a, b)| (a - b).abs() < 1e-12));
        assert!(tests[1..].iter().all(|test| (test.gain - 0.13).abs() < 1e-12));
    }

    #[test]
    fn a_pair_beyond_a_bound_or_of_one_trace_is_no_pair() {
        let opposed = projected([1.0, 0.8, 0.0, 0.8, 1.0, 0.0, 0.0, 0.0, 1.0], [0.2, -0.2, 0.3]);
        let tests = opposed.pair_tests(&[FREE, [0.0, 10.0], FREE]);
        assert_eq!(tests.iter().map(|test| test.of).collect::<Vec<_>>(), [[0, 2]]);
        let twins = projected([1.0, 0.99, 0.0, 0.99, 1.0, 0.0, 0.0, 0.0, 1.0], [0.2, 0.1, 0.3]);
        assert!(twins.are_alike(0, 1) && !twins.are_alike(0, 2));
        assert!(twins.pair_tests(&[FREE; 3]).iter().all(|test| test.of != [0, 1]));
    }

    #[test]
    fn a_size_counts_from_the_neutral_value_or_along_a_ray() {
        let effect = |name: &str, p| EffectInstance::new(find::<f64>(name).expect("known"), 0, p);
        let gain = effect("torque_gain", [1.1, 0.0, 0.0]);
        assert_eq!(of_size(&gain, -0.2).p[0], 0.8);
        let [lower, upper] = bounds(&gain).expect("exact to first order");
        assert!(lower < -0.2 && upper > 0.2);
        assert_eq!(bounds(&effect("backlash", [0.01, 0.1, 0.5])), None);
    }

    #[test]
    fn one_test_stands_for_every_effect_on_a_joint() {
        let lag = |joint| EffectInstance::new(find::<f64>("actuator_lag").expect("known"), joint, [0.0; 3]);
        let test = |joint: usize, gain: f64, distinct: f64| ScoreTest::of(lag(joint), gain, distinct);
        let tests = [test(0, 1.0, 1.0), test(1, 2.0, 1.0), test(0, 5.0, 1.0), test(2, 9.0, 0.01)];
        assert_eq!(best_of_each(&tests, 0.03), [2, 1]);
    }
}
