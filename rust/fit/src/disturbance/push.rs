//! External pushes: torques at one time of one log that are no part of the logged torque, judged within this log.
//!
//! `residual` is the residual torque of a log, with possible model errors; `search` finds pulses in it that occur once and do not depend on the
//! state; `outlying` finds pushes too light for `search`; `fit` sizes pushes by output error (`touched`), where the model is good enough; `law` tells pushes from
//! the action of a torque limit or a stop.

use super::bell::Bell;
use super::own::Own;
use super::residual::Residual;
use super::search::{MAX_PUSHES, search};
use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::log::track::Track;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::progress::Phase;
use crate::search::acceptance::{FAINTEST, min_relevance};
use crate::search::belief::{belief_beside, left_beside};
use crate::search::model_search::Attribution;
use armgap_core::arm::Arm;
use armgap_core::effect::find;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Shortest push that is reported, s.
pub(super) const SHORTEST: f64 = 0.005;

/// Largest time between successive pieces of one recording, in sample periods.
const FOLLOWS: f64 = 8.0;

/// Part of a joint's travel next to either limit that counts as its end.
const NEAR_END: f64 = 0.12;

/// Factor on the probability of a push, and so its largest value, where the model leaves the whole gap unexplained.
const REMAINDER_DOUBT: f64 = 0.5;

/// Complement of a push's probability from which a gap that the model leaves unexplained casts its whole doubt on the push; in proportion less below.
/// The pulses of such a gap are those that the log has elsewhere, and the push is five times the largest of them at this value. Of 29 pushes that nobody
/// gave, on 90 simulated arms with effects outside the library, one was at 0.027 and all others above 0.05; of 14 that were given and stand beside such a
/// gap, one was at 0.028 and all others at 0.006 or less (docs/decisions/021-pushes-beside-a-remainder.md).
const UNCLEAR: f64 = 0.02;

/// Least impulse of a push, in standard deviations of the impulse, for it to differ significantly from zero.
const SIGNIFICANT_IMPULSE: f64 = 2.0;

/// Shortest recording in which pushes are looked for, s.
const SHORTEST_LOG: f64 = 1.5;

/// A push found in a log, with its uncertainty and probability.
#[derive(Debug, Clone)]
pub struct Disturbance {
    /// Whether the push lies in a holdout log rather than a training log.
    pub holdout: bool,
    /// Index of the log among the training or holdout logs.
    pub track: usize,
    /// The push as an effect on a joint: impulse, time and duration.
    pub push: EffectInstance,
    /// Standard deviations of the push's impulse, N m s (N s), time, s, and duration, s.
    pub sigma: [f64; 3],
    /// Share, 0 to 1, that the push explains of the cost of the windows which it touches.
    pub share: f64,
    /// Probability, 0 to 1, of a push rather than some other model error.
    pub probability: f64,
    /// Whether the torque is certain and yet too light for a push beside the scatter of friction: a first guess for `law_in_place`, never named.
    pub light: bool,
}

/// Result of a model search (attribution of the gap to causes), and the external disturbances found in the logs.
pub struct Conclusion<const N: usize, const P: usize> {
    /// Result of the model search with the external disturbances acting in their logs.
    pub attribution: Attribution<N, P>,
    /// Result of the model search without external disturbances in the logs; none if no disturbance was found.
    pub alone: Option<Attribution<N, P>>,
    /// External disturbances found in the logs.
    pub disturbances: Vec<Disturbance>,
}

impl<const N: usize, const P: usize> Conclusion<N, P> {
    /// Result of the model search without external disturbances in the logs.
    pub fn without_disturbances(&self) -> &Attribution<N, P> {
        self.alone.as_ref().unwrap_or(&self.attribution)
    }

    fn without(attribution: Attribution<N, P>) -> Self {
        Self { attribution, alone: None, disturbances: Vec::new() }
    }
}

/// The model and scales against which pushes are judged.
pub(super) struct PushState<'a, const N: usize, const P: usize> {
    /// The model with all causes that the model search has found.
    pub(super) model: &'a Hypothesis<P>,
    /// Covariance of the model's free values.
    pub(super) covariance: &'a DMatrix<f64>,
    /// Scale of each joint's residual under the model, rad or m.
    pub(super) scale: [f64; N],
    /// Zeros of the encoders of each recording.
    pub(super) zeros: &'a EncoderZeros<N>,
    /// Whether the model leaves more error unexplained than noise.
    pub(super) remainder: bool,
    /// Least RMS improvement of the predictions, relative to the motion within a window, for an effect or push to be named.
    pub(super) min_relevance: f64,
    /// Least RMS improvement of the predictions, relative to the motion within a window, for a push in a window far above the noise to be named.
    pub(super) faintest: f64,
}

/// Index of a log: 0 for the training set or 1 for the holdout, then the index within the set.
pub(super) type Place = (usize, usize);

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Conclusion of a diagnosis from the attribution `alone`, made without pushes: the attribution repeated without the windows in which the pushes act
    /// that `alone` leaves unexplained, and the pushes that the repeated one leaves; where that leaves errors unexplained too, the pushes that `alone` leaves,
    /// as neither model tells them better.
    ///
    /// The windows of the second attribution stay those of the context, where it is part of the conclusion. An effect that replaces some pushes, or
    /// torques too light for pushes, stays in the model together with the remaining pushes.
    pub fn conclude(
        &mut self,
        mut alone: Attribution<N, P>,
        max_causes: usize,
        seed: u64,
    ) -> Conclusion<N, P> {
        let faint = alone.causes.is_empty();
        let mut disturbances = self.pushes_and_lighter(&alone, faint);
        let law = if max_causes > 0 { self.law_in_place(&alone, &disturbances) } else { None };
        disturbances.retain(|e| !e.light);
        if law.is_some() {
            alone = self.attribute(max_causes, seed, law.clone());
            disturbances = self.pushes(&alone, faint);
        }
        if disturbances.is_empty() {
            return Conclusion::without(alone);
        }
        self.set_pushes(&disturbances);
        self.leave_out_pushes();
        let beside = self.attribute(max_causes, seed, law);
        let clear = self.take_all_windows();
        if !beside.leaves_a_remainder() {
            disturbances = self.pushes(&beside, faint);
        }
        self.set_pushes(&disturbances);
        if disturbances.is_empty() {
            return Conclusion::without(alone);
        }
        [self.training, self.holdout] = clear;
        self.set_pushes(&disturbances);
        // A push is less probable where the gap that it was to explain remains, not where the arm lacks effects besides.
        let belief = belief_beside(left_beside(&alone.nodes, &beside.nodes), REMAINDER_DOUBT);
        for disturbance in &mut disturbances {
            disturbance.probability = beside_remainder(disturbance.probability, belief);
        }
        Conclusion { attribution: beside, alone: Some(alone), disturbances }
    }

    /// Pushes in all recordings that the final model of a model search leaves unexplained; if `faint`, also faint pushes in outlying windows.
    fn pushes(&self, attribution: &Attribution<N, P>, faint: bool) -> Vec<Disturbance> {
        let found = self.pushes_and_lighter(attribution, faint);
        found.into_iter().filter(|e| !e.light).collect()
    }

    /// Pushes as [`Self::pushes`] finds them, and torques that are too light for pushes.
    fn pushes_and_lighter(&self, attribution: &Attribution<N, P>, faint: bool) -> Vec<Disturbance> {
        let (first, last) = (&attribution.nodes[0], &attribution.nodes[attribution.nodes.len() - 1]);
        let state = PushState {
            model: &attribution.model.hypothesis,
            covariance: &attribution.model.covariance.matrix,
            scale: last.weights.training.scale,
            zeros: &last.weights.holdout.zeros,
            remainder: attribution.leaves_a_remainder(),
            min_relevance: min_relevance(first.relative_error()),
            faintest: if faint { FAINTEST } else { min_relevance(first.relative_error()) },
        };
        let recordings = self.recordings();
        self.progress.begin(Phase::Pushes, recordings.len());
        let found: Vec<Vec<Disturbance>> = recordings
            .par_iter()
            .map(|places| {
                self.progress.unit();
                self.in_recording(places, &state)
            })
            .collect();
        found.into_iter().flatten().collect()
    }

    /// Pushes in one recording, which consists of the logs at `places`, and lighter torques; no pushes if there are `MAX_PUSHES` or more.
    fn in_recording(&self, places: &[Place], state: &PushState<'_, N, P>) -> Vec<Disturbance> {
        let own = Own::new(self, places, state);
        let mut disturbances = Vec::new();
        if places.iter().any(|place| self.could_hold_a_push(*place, state)) {
            disturbances = self.of_bells(places, state, &own);
        }
        if !state.remainder {
            for place in places {
                self.in_outlying_windows(*place, state, &own, &mut disturbances);
            }
            let all: Vec<Bell> = disturbances.iter().map(Disturbance::as_bell).collect();
            disturbances.retain(|e| !self.meets_an_end(e, &all));
        }
        // `MAX_PUSHES` or more are no rare events, but something that the arm does again and again.
        if disturbances.iter().filter(|e| !e.light).count() >= MAX_PUSHES {
            disturbances.retain(|e| e.light);
        }
        disturbances
    }

    /// Pushes, and lighter torques, that stand out of a recording's residual torque as Gaussian pulses, with sizes by output error.
    fn of_bells(
        &self,
        places: &[Place],
        state: &PushState<'_, N, P>,
        own: &Own<'_, A, N, P>,
    ) -> Vec<Disturbance> {
        let pieces: Vec<&Track<N>> = places.iter().map(|p| self.track(*p)).collect();
        let whole = Track::joined(&pieces).filter(|t| t.t[t.len() - 1] - t.t[0] > SHORTEST_LOG);
        let residual = whole.and_then(|track| Residual::new(&self.arm, &track, state.model, &self.prior));
        let Some(found) = residual.and_then(|r| search(&r, state.remainder)) else { return Vec::new() };
        let of = |bells: &[Bell], light: bool| -> Vec<Disturbance> {
            let rough = |bell| Some(Disturbance { light, ..self.rough(places, bell, found.rest)? });
            bells.iter().filter_map(rough).collect()
        };
        let seen = [of(&found.bells, false), of(&found.light, true)].concat();
        let mut disturbances: Vec<Disturbance> = Vec::new();
        for near in near_each_other(seen, self.horizon) {
            let sized = self.sized_together(near, state, own, &disturbances);
            disturbances.extend(sized);
        }
        let all = [found.bells, found.light].concat();
        disturbances.retain(|e| e.is_known() && !self.meets_an_end(e, &all));
        disturbances
    }

    /// Whether a push and a further one on its joint both drive the joint back from one end of the joint's travel, as contact with a stop does.
    fn meets_an_end(&self, disturbance: &Disturbance, bells: &[Bell]) -> bool {
        let joint = disturbance.push.joint;
        let [from, to] = self.scales.travel[joint];
        let end = |q: f64, height: f64| -> i8 {
            let depth = (q - from) / (to - from);
            i8::from(depth > 1.0 - NEAR_END && height < 0.0) - i8::from(depth < NEAR_END && height > 0.0)
        };
        let track = self.track(disturbance.place());
        let at = |t: f64| track.q[track.t.partition_point(|x| *x < t).min(track.len() - 1)][joint];
        let own = end(at(disturbance.push.p[1]), disturbance.push.p[0]);
        let inside =
            |b: &&Bell| b.joint == joint && (track.t[0]..=track.t[track.len() - 1]).contains(&b.time);
        own != 0 && bells.iter().filter(inside).filter(|b| end(at(b.time), b.height) == own).count() > 1
    }

    /// First estimate of a push from a Gaussian pulse in the residual torque; `rest` is the size of the largest pulse that is no push.
    fn rough(&self, places: &[Place], bell: &Bell, rest: f64) -> Option<Disturbance> {
        let covers = |p: &&Place| self.track(**p).t[0] <= bell.time;
        let &(set, track) = places.iter().rfind(covers)?;
        let law = find::<f64>("external_pulse")?;
        let duration = bell.duration().max(SHORTEST);
        let impulse = bell.impulse();
        let sigma = bell.sigma / bell.height.abs().max(1e-300);
        Some(Disturbance {
            holdout: set == 1,
            track,
            push: EffectInstance::new(law, bell.joint, [impulse, bell.time, duration]),
            sigma: [sigma * impulse.abs(), sigma * bell.width, sigma * duration],
            share: 0.0,
            probability: 1.0 - 0.5 * (rest / bell.z).powi(2).min(1.0),
            light: false,
        })
    }

    /// Logs grouped by recording: consecutive pieces of one log belong together.
    fn recordings(&self) -> Vec<Vec<Place>> {
        let all = [&self.training, &self.holdout];
        let mut places: Vec<Place> =
            (0..2).flat_map(|s| (0..all[s].data.tracks.len()).map(move |i| (s, i))).collect();
        places.sort_by(|a, b| self.track(*a).t[0].total_cmp(&self.track(*b).t[0]));
        let mut recordings: Vec<Vec<Place>> = Vec::new();
        for place in places {
            let open = recordings.iter_mut().find(|r| r.last().is_some_and(|l| self.follows(*l, place)));
            match open {
                Some(recording) => recording.push(place),
                None => recordings.push(vec![place]),
            }
        }
        recordings
    }

    /// Whether log `after` continues log `before` as a piece of the same recording.
    fn follows(&self, before: Place, after: Place) -> bool {
        let (a, b) = (self.track(before), self.track(after));
        let gap = b.t[0] - a.t[a.len() - 1];
        stem(&a.name) == stem(&b.name) && gap > 0.0 && gap < FOLLOWS * a.period()
    }

    pub(super) fn track(&self, (set, index): Place) -> &Track<N> {
        &[&self.training, &self.holdout][set].data.tracks[index]
    }

    /// Leaves out the windows of training logs and holdout in which the known pushes act.
    fn leave_out_pushes(&mut self) {
        for sample in [&mut self.training, &mut self.holdout] {
            *sample = WindowSet::new(sample.data.clone().clear_of_pushes());
        }
    }

    /// Takes all windows of training logs and holdout again; returns the windows that were taken before.
    pub fn take_all_windows(&mut self) -> [WindowSet<N>; 2] {
        let [training, holdout] = [&self.training, &self.holdout].map(|sample| self.all_windows(sample));
        [std::mem::replace(&mut self.training, training), std::mem::replace(&mut self.holdout, holdout)]
    }

    /// Replaces the known pushes of all logs by `disturbances`.
    pub fn set_pushes(&mut self, disturbances: &[Disturbance]) {
        for (set, sample) in [&mut self.training, &mut self.holdout].into_iter().enumerate() {
            for (index, track) in sample.data.tracks.iter_mut().enumerate() {
                track.pushes =
                    disturbances.iter().filter(|e| e.place() == (set, index)).map(|e| e.push).collect();
            }
        }
    }
}

impl Disturbance {
    /// Whether the push's impulse is significantly different from zero.
    pub(super) fn is_known(&self) -> bool {
        self.clarity() > SIGNIFICANT_IMPULSE
    }

    /// Impulse of the push in standard deviations.
    pub fn clarity(&self) -> f64 {
        self.push.p[0].abs() / self.sigma[0]
    }

    /// Casts doubt on the push beside a model that leaves the share `left`, 0 to 1, of the gap unexplained.
    pub(crate) fn doubt_beside(&mut self, left: f64) {
        self.probability = beside_remainder(self.probability, belief_beside(left, REMAINDER_DOUBT));
    }

    /// Gaussian pulse with the joint, time and sign of the push.
    fn as_bell(&self) -> Bell {
        let [height, time, width] = self.push.p;
        Bell { joint: self.push.joint, time, width, height, sigma: self.sigma[0], z: 0.0 }
    }

    /// Index of the log in which the push acts: 0 for the training set or 1 for the holdout, then the index within the set.
    pub(super) fn place(&self) -> Place {
        (usize::from(self.holdout), self.track)
    }
}

#[cfg(test)]
impl Disturbance {
    /// A push of known impulse, time and duration on a joint of the first training log.
    pub(super) fn certain(joint: usize, p: [f64; 3]) -> Self {
        let push = EffectInstance::new(find::<f64>("external_pulse").expect("known"), joint, p);
        let (sigma, share, probability) = ([0.0; 3], 1.0, 1.0);
        Self { holdout: false, track: 0, push, sigma, share, probability, light: false }
    }
}

/// Probability of a push, of the probability `alone` beside the other pulses of its log, where the model leaves a gap unexplained that leaves the belief
/// `belief` in any push.
fn beside_remainder(alone: f64, belief: f64) -> f64 {
    alone * (1.0 - (1.0 - belief) * ((1.0 - alone) / UNCLEAR).min(1.0))
}

/// Pushes in groups, each of those that are near each other in time or near one of the group, in the order of the first of each group. A push near another
/// one explains the motion beside it alone, as one at the tip does that acts on all joints.
fn near_each_other(pushes: Vec<Disturbance>, window: f64) -> Vec<Vec<Disturbance>> {
    let mut groups: Vec<Vec<Disturbance>> = Vec::new();
    for push in pushes {
        let is_near = |group: &Vec<Disturbance>| group.iter().any(|other| other.is_near(&push, window));
        let Some(first) = groups.iter().position(is_near) else {
            groups.push(vec![push]);
            continue;
        };
        for k in (first + 1..groups.len()).rev() {
            if is_near(&groups[k]) {
                let joined = groups.remove(k);
                groups[first].extend(joined);
            }
        }
        groups[first].push(push);
    }
    groups
}

/// Name of a log up to the bracket that tells which part of the recording it is.
fn stem(name: &str) -> &str {
    name.split(" (").next().unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pushes_that_a_third_links_are_of_one_group() {
        let at = |time: f64| Disturbance::certain(0, [1.0, time, 0.1]);
        let times = |pushes: &[f64]| -> Vec<Vec<f64>> {
            let groups = near_each_other(pushes.iter().map(|t| at(*t)).collect(), 0.25);
            groups.iter().map(|group| group.iter().map(|e| e.push.p[1]).collect()).collect()
        };
        assert_eq!(times(&[1.0, 5.0, 2.0]), [vec![1.0], vec![5.0], vec![2.0]]);
        assert_eq!(times(&[1.0, 2.0, 1.5, 5.0]), [vec![1.0, 2.0, 1.5], vec![5.0]]);
    }

    #[test]
    fn a_remainder_casts_doubt_on_pushes_that_hardly_exceed_the_other_pulses_of_their_log() {
        for (alone, belief, expected) in
            [(0.9, 0.5, 0.45), (0.7, 0.6, 0.42), (0.9, 1.0, 0.9), (1.0, 0.5, 1.0)]
        {
            assert!((beside_remainder(alone, belief) - expected).abs() < 1e-12, "{alone} {belief}");
        }
        let alone = 1.0 - 0.5 * UNCLEAR;
        assert!((beside_remainder(alone, 0.5) - 0.75 * alone).abs() < 1e-12, "half of the doubt");
    }
}
