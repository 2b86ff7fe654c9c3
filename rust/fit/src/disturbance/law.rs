//! Effects in the place of pushes: a saturated drive delivers too little torque at a few instants, and a joint that reaches a stop is driven back a
//! few times; both look like pushes.
//!
//! The model search finds effects that act in typical windows; a torque limit or a stop that one log reaches once or twice is not found, and training
//! logs that do not reach it cannot locate it. So the pushes of a joint are compared with an effect that could have caused them, on equal terms: the
//! model is fitted with either to all windows of all logs, both are judged by one Student-t likelihood, and both are penalised for their free values
//! (Bayesian information criterion, Schwarz 1978). Each push has three values, an effect a fixed number however often it acts.
//! Torques that are certain and too light to be named as pushes take part: a limit that is hardly exceeded leaves no more.

use super::push::Disturbance;
use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::solve::{Effort, Fit};
use crate::likelihood::weighting::Weighting;
use crate::log::track::Track;
use crate::model::hypothesis::EffectInstance;
use crate::predict::window::Window;
use crate::search::acceptance::Ground;
use crate::search::belief::Cause;
use crate::search::evidence::Evidence;
use crate::search::model_search::Attribution;
use armgap_core::arm::Arm;
use armgap_core::effect::{MAX_PARAMETERS, find};
use rayon::prelude::*;

/// Effects that act like pushes, each on one joint, with functions for their initial guess from a push and for the test of the fitted effect.
const LAWS: [LawGuess; 2] = [
    LawGuess { name: "torque_saturation", from_push: limit_guess, acts_as_named: |_, _| true },
    LawGuess { name: "contact", from_push: stop_guess, acts_as_named: is_elastic },
];

/// Bisection steps that find the torque limit from one push.
const HALVINGS: usize = 40;

/// Number of rounds in which initial states and weights of the windows are recomputed around the model with an effect in the place of pushes.
const LAW_ROUNDS: usize = 2;

/// Ratio of the cost with an effect, fitted roughly, to the cost with the pushes, up to which the effect is fitted in full: of effects that then took
/// the place of pushes none was above 1.02, of 12 others 11 were above 10.
const MAX_ROUGH_COST_RATIO: f64 = 3.0;

/// Ratio of duration, and of peak, of a contact's half-sine pulse of torque to the rectangular pulse of torque that fits it best.
const HALF_SINE: f64 = 1.3;

/// First guess of the damping of a stop (joint limit): damping torque at the push's mean speed relative to the mean torque.
const DAMPED: f64 = 0.1;

/// Least ratio of a stop's largest elastic torque to its largest damping torque: a free mass that meets a stop of the damping ratio `z` has `1 / (2
/// z)`.
const ELASTIC: f64 = 0.2;

/// Effect of the library whose action can be mistaken for a push.
struct LawGuess {
    name: &'static str,
    /// Parameters of the effect that acts like the push at the push's time; `None` if the effect cannot.
    from_push: fn(&PushedMotion<'_>) -> Option<[f64; MAX_PARAMETERS]>,
    /// Whether the effect with fitted parameters acts during the push as its name says (a contact: elastically).
    acts_as_named: fn(&[f64; MAX_PARAMETERS], &PushedMotion<'_>) -> bool,
}

/// Measured motion and commanded torque of a joint during a push.
struct PushedMotion<'a> {
    /// Impulse, N m s (N s), time of the centre, s, and duration, s, of the push.
    push: [f64; 3],
    /// Sample times, s, from about one duration of the push before its centre to one after.
    t: &'a [f64],
    /// Positions of the joint at the sample times around the push, rad or m.
    q: &'a [f64],
    /// Mean commanded torque of the joint from each sample around the push to the next, N m or N.
    torque: &'a [f64],
}

/// An effect on a joint that may replace some of the pushes.
struct Trial {
    law: &'static LawGuess,
    /// The effect `law` on one joint with first guesses of its parameters: one guess from each push in `theirs`.
    guesses: Vec<EffectInstance>,
    /// Pushes that the effect may replace.
    theirs: Vec<Disturbance>,
    /// Pushes that stay in the logs together with the effect.
    others: Vec<Disturbance>,
}

/// A model fitted with some of the pushes to all windows of all logs, and its likelihood.
struct Explanation<const N: usize, const P: usize> {
    fit: Fit<P>,
    /// Deviance up to a common constant: Student-t costs of the windows plus prior cost.
    cost: f64,
    /// Student-t cost of every window.
    costs: Vec<f64>,
    /// Sum of the windows' costs without robust weights.
    raw: f64,
    weighting: Weighting<N>,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// The effect on a joint that explains the logs no worse, by the Bayesian information criterion, than the pushes on this joint do; `None` if
    /// there is none.
    pub(super) fn law_in_place(
        &mut self,
        alone: &Attribution<N, P>,
        disturbances: &[Disturbance],
    ) -> Option<Cause> {
        let scale = alone.nodes.last()?.weights.training.scale;
        let effects = &alone.model.hypothesis.effects;
        let taken = |e: &EffectInstance| effects.iter().any(|known| known.same_place(e));
        let tried: Vec<Trial> = (0..N)
            .flat_map(|joint| LAWS.iter().map(move |law| (joint, law)))
            .flat_map(|(joint, law)| self.trials(joint, law, disturbances))
            .filter(|trial| !trial.guesses.iter().any(taken))
            .collect();
        if tried.is_empty() {
            return None;
        }
        self.set_pushes(disturbances);
        let (settled, weights) = self.of_all_windows().settle(&alone.model.hypothesis, scale);
        let pushed = self.of_all_windows().explanation(settled, &weights.training, LAW_ROUNDS);
        let found = tried.into_iter().filter_map(|trial| {
            self.set_pushes(&trial.others);
            self.law_of(&trial, &pushed)
        });
        let best = found.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, law)| law);
        self.set_pushes(&[]);
        best
    }

    /// Trials of the effect `law` on a joint in the place of pushes that it could have caused; one trial per side of a stop, or sign of
    /// another effect's first parameter.
    fn trials(&self, joint: usize, law: &'static LawGuess, disturbances: &[Disturbance]) -> Vec<Trial> {
        let Some(effect) = find::<f64>(law.name) else { return Vec::new() };
        let guess = |e: &Disturbance| {
            let here = (e.push.joint == joint).then(|| pushed_motion(self.track(e.place()), &e.push))?;
            let [t, q, torque] = &here;
            let values = (law.from_push)(&PushedMotion { push: e.push.p, t, q, torque })?;
            Some(EffectInstance::new(effect, joint, values))
        };
        let guessed: Vec<Option<EffectInstance>> = disturbances.iter().map(guess).collect();
        let of_side = |side: f64| {
            let own = |e: EffectInstance| e.law.edge(&e.p).map_or(e.p[0], |edge| edge.side);
            let ours = |e: &Option<EffectInstance>| e.is_some_and(|e| own(e) * side > 0.0);
            let guesses: Vec<EffectInstance> =
                guessed.iter().filter(|e| ours(e)).flatten().copied().collect();
            let pushes = disturbances.iter().cloned().zip(&guessed);
            let (theirs, others): (Vec<_>, Vec<_>) = pushes.partition(|(_, guess)| ours(guess));
            let only = |pairs: Vec<(Disturbance, _)>| pairs.into_iter().map(|(e, _)| e).collect();
            Trial { law, guesses, theirs: only(theirs), others: only(others) }
        };
        [1.0, -1.0].map(of_side).into_iter().filter(|trial| !trial.guesses.is_empty()).collect()
    }

    /// The effect that explains the logs as well as the external pushes that `trial` would replace, and by how much it lowers the Bayesian
    /// information criterion; `None` if it does not. All other pushes stay in both models.
    fn law_of(&self, trial: &Trial, pushed: &Explanation<N, P>) -> Option<(f64, Cause)> {
        let all = self.of_all_windows();
        let model = &pushed.fit.hypothesis;
        let bare = all.explanation(pushed.fit.clone(), &pushed.weighting, 0).raw;
        // Window weights are those of the model with the pushes: without pushes and without the effect, the windows that pushes touch would count as
        // outliers.
        let problem = all.problem(&pushed.weighting);
        let fitted: Vec<Fit<P>> =
            trial.guesses.par_iter().map(|guess| problem.solve(&model.with(*guess), Effort::ROUGH)).collect();
        let score = |fit: &Fit<P>| pushed.weighting.total(&fit.costs) + fit.prior_cost;
        let rough = fitted.into_iter().min_by(|a, b| score(a).total_cmp(&score(b)))?;
        if score(&rough) > MAX_ROUGH_COST_RATIO * score(&pushed.fit) {
            return None;
        }
        let found = all.explanation(rough, &pushed.weighting, LAW_ROUNDS);
        let effect = *found.fit.hypothesis.effects.last()?;
        let acts = trial.theirs.iter().any(|e| {
            let [t, q, torque] = &pushed_motion(self.track(e.place()), &e.push);
            (trial.law.acts_as_named)(&effect.p, &PushedMotion { push: e.push.p, t, q, torque })
        });
        if !acts {
            return None;
        }
        let windows = all.training.data.windows.len() as f64;
        let free = |values: usize| values as f64 * windows.ln();
        let of_pushes: usize = trial.theirs.iter().map(|e| e.push.len()).sum();
        let saved = free(of_pushes) - free(effect.len());
        // A decrease of the cost in windows without a push is no reason to put the effect in the place of a push.
        let touched = self.touched(&trial.theirs);
        let there = |of: &Explanation<N, P>| touched.iter().map(|w| of.costs[*w]).sum::<f64>();
        let advantage = (pushed.cost - found.cost).min(there(pushed) - there(&found)) + saved;
        if advantage < 0.0 {
            return None;
        }
        let first = found.fit.hypothesis.values().len() - effect.len();
        let sigma = (first..first + effect.len()).map(|i| found.fit.sigma(i)).collect();
        let likely = trial.theirs.iter().map(|e| e.probability).fold(0.0, f64::max);
        let probability = likely / (1.0 + (-0.5 * advantage).exp());
        let cause = Cause {
            effect,
            sigma,
            probability,
            share: (1.0 - found.raw / bare).clamp(0.0, 1.0),
            relevance: 0.0,
            look_alikes: Vec::new(),
            evidence: Evidence { selected: probability, ..Evidence::default() },
            ground: Ground::Motion,
        };
        Some((advantage, cause))
    }

    /// A diagnosis context with the windows of all logs as training and as holdout windows, under their current pushes.
    fn of_all_windows(&self) -> Self {
        self.on_windows(self.training.data.clone().and(self.holdout.data.clone()))
    }

    /// Indices of the windows, among those of the training logs and then of the holdout, in which `pushes` act.
    fn touched(&self, pushes: &[Disturbance]) -> Vec<usize> {
        let acts = |set: usize, window: &Window<N>, push: &Disturbance| {
            let (t, [_, time, duration]) = (&self.track((set, window.track)).t, push.push.p);
            push.place() == (set, window.track)
                && t[window.first] < time + 0.5 * duration
                && t[window.last] > time - 0.5 * duration
        };
        let of = |(set, sample): (usize, &WindowSet<N>)| -> Vec<bool> {
            let touches = |w: &Window<N>| pushes.iter().any(|push| acts(set, w, push));
            sample.data.windows.iter().map(touches).collect()
        };
        let touched = [&self.training, &self.holdout].into_iter().enumerate().flat_map(of);
        touched.enumerate().filter_map(|(i, touched)| touched.then_some(i)).collect()
    }

    /// The model refitted to the training windows, and its cost; initial states and weights are recomputed `rounds` times, at the scales and the
    /// typical cost of the weighting `given`.
    fn explanation(&self, fit: Fit<P>, given: &Weighting<N>, rounds: usize) -> Explanation<N, P> {
        let mut fit = fit;
        for _ in 0..rounds {
            let around = self.weighting(&self.training, &fit.hypothesis, given.scale, &given.zeros);
            fit = self.problem(&around).solve(&fit.hypothesis, Effort::FULL);
        }
        let mut weighting = self.weighting(&self.training, &fit.hypothesis, given.scale, &given.zeros);
        weighting.typical = given.typical;
        let costs = self.problem(&weighting).raw_costs(&fit.hypothesis);
        let raw = costs.iter().sum();
        let costs: Vec<f64> = costs.into_iter().map(|c| weighting.student_t_cost(c)).collect();
        let cost = costs.iter().sum::<f64>() + fit.prior_cost;
        Explanation { fit, cost, costs, raw, weighting }
    }
}

/// Times (s), positions (rad or m) and mean commanded torques (N m or N) of a pushed joint, from one duration before the push to one after.
fn pushed_motion<const N: usize>(track: &Track<N>, push: &EffectInstance) -> [Vec<f64>; 3] {
    let [_, time, duration] = push.p;
    let first = track.t.partition_point(|t| *t < time - duration);
    let last = track.t.partition_point(|t| *t <= time + duration).min(track.len());
    let samples = || first..last;
    [
        samples().map(|k| track.t[k]).collect(),
        samples().map(|k| track.q[k][push.joint]).collect(),
        samples().map(|k| track.held[k.min(track.held.len() - 1)][push.joint].mean()).collect(),
    ]
}

/// First guess of a drive's torque limit: level at which the commanded torque beyond it, integrated around the push, equals the push's impulse.
fn limit_guess(motion: &PushedMotion<'_>) -> Option<[f64; MAX_PARAMETERS]> {
    let impulse = motion.push[0];
    let against = |torque: &f64| -impulse.signum() * torque;
    let beyond = |level: f64| -> f64 {
        let steps = motion.t.windows(2).map(|pair| pair[1] - pair[0]);
        motion.torque.iter().zip(steps).map(|(torque, step)| (against(torque) - level).max(0.0) * step).sum()
    };
    let (mut low, mut high) = (0.0, motion.torque.iter().map(against).fold(0.0, f64::max));
    if beyond(low) < impulse.abs() {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if beyond(middle) > impulse.abs() { low = middle } else { high = middle }
    }
    Some([low, 0.0, 0.0])
}

/// First guess (position, stiffness, damping) of a stop that could have caused a push towards zero position, or away from it where the joint stays on
/// one side of zero: entered when the push begins, left when it ends, with the stiffness that the greatest depth requires.
fn stop_guess(motion: &PushedMotion<'_>) -> Option<[f64; MAX_PARAMETERS]> {
    let [impulse, time, duration] = motion.push;
    let side = -impulse.signum();
    let half = 0.5 * HALF_SINE * duration;
    let at = |t: f64| side * motion.q[motion.t.partition_point(|x| *x < t).min(motion.q.len() - 1)];
    if motion.q.is_empty() {
        return None;
    }
    let inside = motion.t.iter().zip(motion.q).filter(|(t, _)| (*t - time).abs() <= half);
    let deepest = inside.map(|(_, q)| side * q).fold(f64::NEG_INFINITY, f64::max);
    let position = 0.5 * (at(time - half) + at(time + half));
    let depth = deepest - position;
    let is_one_sided = motion.q.iter().all(|q| side * q < 0.0);
    if !((position > 0.0 || is_one_sided) && depth > 0.0) {
        return None;
    }
    let torque = impulse.abs() / duration;
    let stiffness = HALF_SINE * torque / depth;
    let signed = if position > 0.0 { stiffness } else { -stiffness };
    Some([side * position, signed, DAMPED * torque * half / depth])
}

/// Whether a fitted stop acts elastically during a push: its largest elastic torque is a considerable part of its largest damping torque. An effect
/// that only brakes a joint beyond a position is no stop.
fn is_elastic(
    &[position, stiffness, damping, ..]: &[f64; MAX_PARAMETERS],
    motion: &PushedMotion<'_>,
) -> bool {
    let side = position.signum() * stiffness.signum();
    let depth = |q: &f64| side * (q - position);
    let deepest = motion.q.iter().map(depth).fold(0.0, f64::max);
    let rates = motion.t.windows(2).zip(motion.q.windows(2)).filter(|(_, q)| depth(&q[1]) > 0.0);
    let fastest = rates.map(|(t, q)| (q[1] - q[0]).abs() / (t[1] - t[0]).max(1e-9)).fold(0.0, f64::max);
    stiffness.abs() * deepest > ELASTIC * damping * fastest
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const STEP: f64 = 1e-3;
    const TIME: f64 = 0.2;

    fn times() -> Vec<f64> {
        (0..400).map(|k| STEP * f64::from(k)).collect()
    }

    #[test]
    fn a_limit_cuts_off_the_impulse_of_the_push() {
        let t = times();
        let torque: Vec<f64> = t.iter().map(|t| 10.0 - 200.0 * (t - TIME).powi(2)).collect();
        let level = 9.5;
        let cut: f64 = torque.iter().map(|x| (x - level).max(0.0) * STEP).sum();
        let q = vec![0.0; t.len()];
        let found = |impulse| {
            limit_guess(&PushedMotion { push: [impulse, TIME, 0.1], t: &t, q: &q, torque: &torque })
        };
        assert!((found(-cut).unwrap()[0] / level - 1.0).abs() < 1e-6);
        assert!(found(cut).is_none(), "a push along the command");
    }

    #[test]
    fn a_stop_stands_where_the_push_begins_and_ends() {
        let (rate, speed, position) = (40.0, 2.0, 0.5);
        let lasts = PI / rate;
        let t = times();
        let outward: Vec<f64> = t
            .iter()
            .map(|t| match (t - TIME) / lasts {
                x if x.abs() < 0.5 => position + speed / rate * (PI * x).cos(),
                x => position - speed * lasts * (x.abs() - 0.5),
            })
            .collect();
        let torque = vec![0.0; t.len()];
        for side in [1.0, -1.0] {
            let q: Vec<f64> = outward.iter().map(|q| side * q).collect();
            let found = |impulse: f64| {
                let push = [impulse, TIME, lasts / HALF_SINE];
                stop_guess(&PushedMotion { push, t: &t, q: &q, torque: &torque })
            };
            // A unit mass leaves the stop as fast as it came, and oscillates at the square root of the stiffness.
            let [at, stiffness, damping] = found(-side * 2.0 * speed).unwrap();
            assert!((at / (side * position) - 1.0).abs() < 0.02, "{at}");
            assert!((stiffness / rate.powi(2) - 1.0).abs() < 0.2, "{stiffness}");
            assert!(damping > 0.0);
            assert!(found(side * 2.0 * speed).is_none(), "a push outwards");
        }
    }

    #[test]
    fn what_only_brakes_is_no_stop() {
        let t = times();
        let q: Vec<f64> = t.iter().map(|t| 0.5 + 0.1 * (20.0 * (t - TIME)).cos()).collect();
        let torque = vec![0.0; t.len()];
        let motion = PushedMotion { push: [-0.1, TIME, 0.1], t: &t, q: &q, torque: &torque };
        assert!(is_elastic(&[0.5, 100.0, 0.5], &motion));
        assert!(!is_elastic(&[0.7, -0.01, 0.1], &motion), "towards zero");
        assert!(!is_elastic(&[0.5, 0.01, 0.1], &motion));
        assert!(!is_elastic(&[0.7, 100.0, 0.5], &motion), "a position that is never reached");
    }
}
