//! Score tests: expected decrease of the cost by each candidate, to first order, from one shared Jacobian.
//!
//! With `H` the inner products of the sensitivities of the free values (prior precision included) and `s` their products with the residual, a
//! further parameter with sensitivity `c` reduces the cost by `(s_c - H_c H^-1 s)^2 / (H_cc - H_c H^-1 H_c')` (Rao 1948).

use crate::candidates::pair_test::Projected;
use crate::likelihood::jacobian::Sensitivities;
use crate::likelihood::scale::Scales;
use crate::likelihood::solve::{FitProblem, inverse_of_seen, neutral};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use armgap_core::arm::Arm;
use armgap_core::effect::{Scope, Trial, catalogue, further_forms};
use armgap_core::transmission::Sides;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Displacement of a candidate's tested parameter for derivatives by forward differences, relative to the parameter's initial guess.
const TRIAL: f64 = 1e-3;

/// One in this many initial guesses of a transmission is tried with encoder or friction on the motor's side where the model already has effects: the
/// latent states before a window take as long to simulate as the window itself.
const MOTOR_GUESSES: usize = 3;

/// One in this many initial guesses of a transmission is tried with its encoder on one side and its friction on the other while the model has no effects:
/// fits with both on one side may not come near, as friction at the motor of an elastic joint winds up the shaft, which an encoder at the link reads.
const MIXED_GUESSES: usize = 2;

/// One in this many initial guesses of an elastic joint is tried with a rotor that rides on the link before, while the model has no effects and the gear ratio
/// is unknown: fits with a geared rotor may not come near where the rotor is as heavy as the link.
const RIDING_GUESSES: usize = 3;

/// Least share of an effect with a threshold that a score test suggests: below it the initial guess is too far from the effect for its trace to say more
/// than that the effect is smaller.
const MIN_SUGGESTED_SHARE: f64 = 0.02;

/// Share of an effect with a threshold below which the size that a score test suggests is an initial guess of its own; initial guesses of shafts of
/// equal rotors are a factor of three to four apart in stiffness.
const FAR_SHARE: f64 = 0.25;

/// Score test of a candidate at one initial guess.
#[derive(Debug, Clone)]
pub struct ScoreTest {
    /// The candidate effect, its tested parameter at the value that the score test suggests.
    pub effect: EffectInstance,
    /// Expected decrease of the cost when the candidate is added to the model.
    pub gain: f64,
    /// Estimated deviation of the tested parameter from its neutral value, in the parameter's unit.
    pub estimate: f64,
    /// Standard deviation of the estimated deviation of the tested parameter, from the scatter between windows.
    pub sigma: f64,
    /// Standard deviation of the tested parameter if the residual were white with the weighting's scale: the smallest that the logs allow.
    pub information_sigma: f64,
    /// Changes of the model's free values that compensate the candidate, to first order, per unit of the tested parameter.
    pub imitation: Vec<f64>,
    /// Deviation of the tested parameter from neutral that the score test suggests, within the parameter's bounds.
    pub size: f64,
    /// Share, 0 to 1, of the whole change of the predictions by an effect with a threshold that the residual shows; 1 for other effects, and where the
    /// whole change removes more of the cost.
    pub share: f64,
    /// Index of the candidate's parameter that the score test displaces.
    pub tested: usize,
    /// Share, 0 to 1, of the candidate's squared sensitivity that the model's free values cannot imitate.
    pub distinct: f64,
}

/// Every effect of the library on every joint it can act on, at each initial guess; a transmission with encoder and friction on the sides
/// that `sides` allows.
pub fn effect_instances<const N: usize>(
    scales: &Scales<N>,
    sides: &[Vec<Sides>; N],
    all_guesses: bool,
) -> Vec<EffectInstance> {
    let mut all = Vec::new();
    let laws = catalogue::<f64>().iter().chain(further_forms::<f64>());
    for law in laws.filter(|law| law.spec().least_joints <= N) {
        let spec = law.spec();
        let joints = if spec.scope == Scope::Joint { N } else { 1 };
        for joint in 0..joints {
            for (guess, initial_guess) in spec.initial_guesses.iter().enumerate() {
                let mut effect = EffectInstance::new(*law, joint, *initial_guess);
                let mut reached = true;
                for (value, parameter) in effect.p.iter_mut().zip(spec.parameters) {
                    match scales.initial_guess(parameter.quantity, joint, *value) {
                        Some(guess) => {
                            let lower = parameter.lower.max(scales.fewest_cycles(parameter.quantity, joint));
                            *value = guess.clamp(lower, parameter.upper);
                        }
                        None => reached = false,
                    }
                }
                if effect.is_contact() {
                    let towards_zero = scales.stop_towards_zero(joint, initial_guess[0]);
                    all.extend(towards_zero.map(|p| EffectInstance { p, ..effect }));
                }
                if !reached {
                    continue;
                }
                if !law.has_transmission() {
                    all.push(effect);
                    continue;
                }
                let tried = tried(&sides[joint], all_guesses && !effect.is_backlash());
                let is_geared = tried.iter().any(|s| !s.rotor_rides);
                for sides in &tried {
                    let mixed = tried.len() > 1 && sides.encoder_at_motor != sides.friction_at_motor;
                    let one_in = match all_guesses {
                        _ if **sides == Sides::LINK => 1,
                        true if is_geared && sides.rotor_rides => RIDING_GUESSES,
                        true if mixed => MIXED_GUESSES,
                        true => 1,
                        false => MOTOR_GUESSES,
                    };
                    if guess % one_in == one_in / 2 {
                        all.push(effect.with_sides(**sides));
                    }
                }
            }
        }
    }
    all
}

/// Sides of encoder and friction with which a transmission is tried: those with a geared rotor, or all given sides if there are none of this kind or those
/// with `rotors_that_ride` are asked for.
fn tried(sides: &[Sides], rotors_that_ride: bool) -> Vec<&Sides> {
    let geared: Vec<&Sides> = sides.iter().filter(|s| !s.rotor_rides).collect();
    if rotors_that_ride || geared.is_empty() { sides.iter().collect() } else { geared }
}

/// Score tests of all candidates around the fitted hypothesis `base`, with the Jacobian `jacobian` there.
pub fn screen<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    problem: &FitProblem<A, N, P>,
    base: &Hypothesis<P>,
    jacobian: &Sensitivities<N>,
    candidates: &[EffectInstance],
) -> Vec<ScoreTest> {
    let point = TestPoint::new(problem, base, jacobian);
    point.tests(candidates, &point.traces(candidates))
}

/// A fitted hypothesis around which candidates are tested, with its residual and Jacobian.
pub(crate) struct TestPoint<'a, A, const N: usize, const P: usize> {
    problem: &'a FitProblem<'a, A, N, P>,
    base: &'a Hypothesis<P>,
    jacobian: &'a Sensitivities<N>,
    /// Whitened residual of the hypothesis.
    residual: Vec<f64>,
}

impl<'a, A: Arm<f64, N, P>, const N: usize, const P: usize> TestPoint<'a, A, N, P> {
    /// The point of the hypothesis `base`, with its Jacobian.
    pub(crate) fn new(
        problem: &'a FitProblem<'a, A, N, P>,
        base: &'a Hypothesis<P>,
        jacobian: &'a Sensitivities<N>,
    ) -> Self {
        let (residual, _) = problem.residual_beside(base, jacobian.inputs.as_ref());
        Self { problem, base, jacobian, residual }
    }

    /// Traces of candidates: derivative of the whitened prediction by each candidate's tested parameter at its neutral value; for an effect with a
    /// threshold the whole change of the prediction by the effect instead.
    pub(crate) fn traces(&self, candidates: &[EffectInstance]) -> Vec<Vec<f64>> {
        let mut order: Vec<usize> = (0..candidates.len()).collect();
        order.sort_by_key(|i| candidates[*i].place());
        let alike: Vec<&[usize]> =
            order.chunk_by(|a, b| candidates[*a].place() == candidates[*b].place()).collect();
        let traced = alike.par_iter().flat_map_iter(|alike| {
            let own: Vec<EffectInstance> = alike.iter().map(|i| candidates[*i]).collect();
            alike.iter().copied().zip(self.traces_at_one_place(&own))
        });
        let mut traces = vec![Vec::new(); candidates.len()];
        for (i, trace) in traced.collect::<Vec<_>>() {
            traces[i] = trace;
        }
        traces
    }

    /// Traces of candidates, those that are known from `earlier` taken over, and whether each was.
    pub(crate) fn traces_beside(
        &self,
        candidates: &[EffectInstance],
        earlier: impl Fn(&EffectInstance) -> Option<Vec<f64>>,
    ) -> (Vec<Vec<f64>>, Vec<bool>) {
        let known: Vec<Option<Vec<f64>>> = candidates.iter().map(earlier).collect();
        let is_earlier: Vec<bool> = known.iter().map(Option::is_some).collect();
        let open: Vec<EffectInstance> =
            candidates.iter().zip(&is_earlier).filter(|(_, earlier)| !**earlier).map(|(c, _)| *c).collect();
        let mut computed = self.traces(&open).into_iter();
        let traces = known.into_iter().map(|trace| trace.or_else(|| computed.next()).unwrap_or_default());
        (traces.collect(), is_earlier)
    }

    /// Traces of candidates that are one effect on one joint, with different values.
    fn traces_at_one_place(&self, candidates: &[EffectInstance]) -> Vec<Vec<f64>> {
        let (moved, steps): (Vec<Hypothesis<P>>, Vec<f64>) = candidates
            .iter()
            .map(|candidate| {
                let (moved, step) = displaced(candidate);
                (self.base.with(moved), step)
            })
            .unzip();
        let known = vec![self.jacobian.inputs.as_ref(); moved.len()];
        let residuals = self.problem.residuals_beside(&moved, &known);
        residuals
            .into_iter()
            .zip(steps)
            .map(|(there, step)| {
                self.problem.progress.unit();
                self.residual.iter().zip(&there).map(|(here, there)| (here - there) / step).collect()
            })
            .collect()
    }

    /// Score tests of candidates with the given traces.
    pub(crate) fn tests(&self, candidates: &[EffectInstance], traces: &[Vec<f64>]) -> Vec<ScoreTest> {
        let problem = self.problem;
        let k = self.jacobian.columns.len();
        let columns: Vec<&[f64]> = self.jacobian.columns.iter().chain(traces).map(Vec::as_slice).collect();
        let gram = problem.weighting.gram_with(k, problem.data, &columns, &self.residual);
        let last = gram.total.nrows() - 1;
        let (own, own_score) = problem.normal_equations(&gram, k, self.base);
        let inverse = inverse_of_seen(&own).unwrap_or_else(|| DMatrix::zeros(k, k));
        let before = self.student_t_total(&self.residual);
        let test = |(i, (effect, trace)): (usize, (&EffectInstance, &Vec<f64>))| {
            let c = k + i;
            let cross: DVector<f64> = gram.total.column(c).rows(0, k).into_owned();
            let weights = &inverse * &cross;
            let raw = gram.total[(c, c)];
            let information = (raw - weights.dot(&cross)).max(1e-12 * raw);
            let slope = gram.total[(c, last)] - weights.dot(&own_score);
            let scatter: f64 = gram.scores.iter().map(|s| (s[c] - weights.dot(&s.rows(0, k))).powi(2)).sum();
            let mut test = scored(effect, raw, information, slope, scatter);
            test.imitation = weights.iter().map(|w| -w).collect();
            test.size = test.admissible(effect);
            // An effect with a threshold may act in few windows, whose robust weights are nearly zero until the effect explains their residuals.
            if effect.law.spec().trial == Trial::Whole {
                let there: Vec<f64> = self.residual.iter().zip(trace).map(|(here, t)| here - t).collect();
                let whole = before - self.student_t_total(&there);
                test.share =
                    if test.gain > whole { test.estimate.clamp(MIN_SUGGESTED_SHARE, 1.0) } else { 1.0 };
                test.gain = test.gain.max(whole);
            }
            test
        };
        candidates.par_iter().zip(traces).enumerate().map(test).collect()
    }

    /// Inner products of traces and of these with the residual, without what the model's free values imitate.
    pub(crate) fn projected(&self, traces: &[Vec<f64>]) -> Projected {
        let problem = self.problem;
        let (k, count) = (self.jacobian.columns.len(), traces.len());
        let columns: Vec<&[f64]> = self.jacobian.columns.iter().chain(traces).map(Vec::as_slice).collect();
        let gram = problem.weighting.gram(problem.data, &columns, &self.residual);
        let (own, own_score) = problem.normal_equations(&gram, k, self.base);
        let inverse = inverse_of_seen(&own).unwrap_or_else(|| DMatrix::zeros(k, k));
        let cross = gram.total.view((0, k), (k, count)).into_owned();
        let imitated = cross.transpose() * &inverse;
        Projected {
            normal: gram.total.view((k, k), (count, count)) - &imitated * &cross,
            gradient: gram.total.view((k, k + count), (count, 1)).column(0) - &imitated * &own_score,
        }
    }

    /// Student-t cost of a whitened residual, summed over the windows.
    fn student_t_total(&self, residual: &[f64]) -> f64 {
        let weighting = self.problem.weighting;
        let costs = weighting.costs(self.problem.data, residual);
        costs.into_iter().map(|cost| weighting.student_t_cost(cost)).sum()
    }
}

/// A candidate with its tested parameter displaced from its neutral value, and the displacement; for an effect with a threshold the whole effect.
fn displaced(candidate: &EffectInstance) -> (EffectInstance, f64) {
    match candidate.law.spec().trial {
        Trial::Amplitudes(_) => {
            let (i, mut moved) = (tested(candidate), neutral(candidate));
            let step = TRIAL * (candidate.p[i] - moved.p[i]);
            moved.p[i] += step;
            (moved, step)
        }
        Trial::Ray => (EffectInstance { p: candidate.p.map(|x| TRIAL * x), ..*candidate }, TRIAL),
        Trial::Whole | Trial::Disturbance => (*candidate, 1.0),
    }
}

/// Index of the parameter that the score test displaces: the first amplitude of the candidate whose trial value is not neutral.
pub(crate) fn tested(candidate: &EffectInstance) -> usize {
    let off = neutral(candidate);
    (0..candidate.len()).find(|&i| candidate.p[i] != off.p[i]).unwrap_or(0)
}

/// Score test of one candidate from the squared length `raw` of its sensitivity, and information, slope and scatter after projection on the model's
/// free values; a parameter that would have to cross its bound has no gain.
fn scored(effect: &EffectInstance, raw: f64, information: f64, slope: f64, scatter: f64) -> ScoreTest {
    let estimate = slope / information;
    let mut suggested = *effect;
    let admissible = match effect.law.spec().trial {
        Trial::Amplitudes(_) => {
            let i = tested(effect);
            let parameter = &effect.law.spec().parameters[i];
            let initial_guess = (effect.p[i] - parameter.neutral).abs();
            let most =
                (parameter.neutral + estimate).clamp(parameter.lower, parameter.upper) - parameter.neutral;
            suggested.p[i] = parameter.neutral + most.clamp(-20.0 * initial_guess, 20.0 * initial_guess);
            most
        }
        Trial::Ray => {
            let share = estimate.clamp(0.0, 20.0);
            suggested.p = effect.p.map(|x| x * share);
            share
        }
        // The estimate is a share of the effect's whole change of the predictions, 0 to 1.
        Trial::Whole | Trial::Disturbance => estimate.clamp(0.0, 1.0),
    };
    let gain = if raw > 0.0 { (2.0 * slope - information * admissible) * admissible } else { 0.0 };
    ScoreTest {
        effect: suggested,
        gain: if gain.is_finite() { gain.max(0.0) } else { 0.0 },
        estimate,
        sigma: scatter.sqrt() / information,
        information_sigma: 1.0 / information.sqrt(),
        imitation: Vec::new(),
        size: 0.0,
        share: 1.0,
        tested: tested(effect),
        distinct: if raw > 0.0 { information / raw } else { 0.0 },
    }
}

impl ScoreTest {
    /// The effect of the size that the score test suggests, if that is far from the initial guess and known.
    pub(crate) fn suggested(&self) -> Option<EffectInstance> {
        let p = self.effect.law.at_share(&self.effect.p, self.share);
        (self.share < FAR_SHARE && p != self.effect.p).then_some(EffectInstance { p, ..self.effect })
    }

    /// Deviation of the suggested tested parameter from neutral, in the unit of the score test.
    fn admissible(&self, candidate: &EffectInstance) -> f64 {
        let i = tested(candidate);
        match candidate.law.spec().trial {
            Trial::Amplitudes(_) => self.effect.p[i] - candidate.law.spec().parameters[i].neutral,
            Trial::Ray => self.effect.p[i] / candidate.p[i],
            Trial::Whole | Trial::Disturbance => 1.0,
        }
    }
}

#[cfg(test)]
impl ScoreTest {
    /// A score test with its effect, gain and distinct share alone.
    pub(crate) fn of(effect: EffectInstance, gain: f64, distinct: f64) -> Self {
        let mut test = scored(&effect, 1.0, 1.0, 0.0, 0.0);
        (test.effect, test.gain, test.distinct) = (effect, gain, distinct);
        test
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often an effect is tried on the first of two joints with encoder and friction both at the link, both at the motor, and on different sides, of
    /// the arrangements that `sides` allows.
    fn arrangements(name: &str, sides: &[Sides], all_guesses: bool) -> [usize; 3] {
        let scales = Scales {
            torque: [1.0; 2],
            speed: [1.0; 2],
            position: [0.5; 2],
            travel: [[-1.0, 1.0]; 2],
            inertia: [0.1; 2],
            period: 0.002,
            length: 0.3,
            gravity: 9.81,
        };
        let all = effect_instances(&scales, &[sides.to_vec(), sides.to_vec()], all_guesses);
        let own: Vec<Sides> =
            all.iter().filter(|e| e.law.spec().name == name && e.joint == 0).map(|e| e.sides).collect();
        let count = |wanted: Sides| own.iter().filter(|s| **s == wanted).count();
        let [link, motor] = [Sides::LINK, Sides::MOTOR].map(count);
        [link, motor, own.len() - link - motor]
    }

    /// A score test of a transmission of which the residual shows a part suggests a stiffer shaft, or a narrower backlash; other effects have no share.
    #[test]
    fn a_share_of_a_transmission_is_a_share_of_its_compliance_or_width() {
        let suggested = |name: &str, p: [f64; 3], share: f64| {
            let law = armgap_core::effect::find::<f64>(name).expect("known");
            let mut test = scored(&EffectInstance::new(law, 1, p), 1.0, 1.0, 0.25, 1.0);
            test.share = share;
            test.suggested().map(|effect| effect.p)
        };
        assert_eq!(suggested("joint_elasticity", [20.0, 0.1, 0.003], 0.125), Some([160.0, 0.8, 0.003]));
        assert_eq!(suggested("backlash", [0.04, 0.1, 0.5], 0.125), Some([0.005, 0.1, 0.5]));
        assert_eq!(suggested("contact", [0.4, 50.0, 1.0], 0.125), None);
        assert_eq!(suggested("joint_elasticity", [20.0, 0.1, 0.003], 0.5), None);
    }

    #[test]
    fn transmissions_are_tried_with_mixed_sides_from_the_start() {
        let [mixed, other] = [true, false].map(|encoder_at_motor| Sides {
            encoder_at_motor,
            friction_at_motor: !encoder_at_motor,
            ..Sides::LINK
        });
        let all = [Sides::LINK, Sides::MOTOR, mixed, other];
        assert_eq!(arrangements("backlash", &all, true), [6, 6, 6]);
        assert_eq!(arrangements("backlash", &all, false), [6, 2, 4]);
        assert_eq!(arrangements("joint_elasticity", &all, true), [17, 17, 16]);
        assert_eq!(arrangements("joint_elasticity", &all, false), [17, 6, 12]);
        // Sides that the arm file states are tried with every guess.
        assert_eq!(arrangements("backlash", &[mixed], true), [0, 0, 6]);
        assert_eq!(arrangements("backlash", &[other], true), [0, 0, 6]);
        assert_eq!(arrangements("joint_elasticity", &[other], true), [0, 0, 17]);
        let rotor_rides = all.map(|sides| Sides { rotor_rides: true, ..sides });
        assert_eq!(arrangements("joint_elasticity", &rotor_rides, true), [0, 0, 50]);
        // Where the gear ratio is unknown, riding rotors are tried too while the model has no effects; the coupling of backlash is a parameter.
        let both = [all, rotor_rides].concat();
        assert_eq!(arrangements("joint_elasticity", &both, true), [17, 17, 40]);
        assert_eq!(arrangements("joint_elasticity", &both, false), [17, 6, 12]);
        assert_eq!(arrangements("backlash", &both, true), [6, 6, 6]);
    }
}
