//! Output-error fit of a push (external disturbance): impulse, time and duration that minimise the prediction errors of the windows that the push
//! touches.

use super::outlying::{OUTLYING, outlying_probability};
use super::own::Own;
use super::push::{Disturbance, Place, PushState};
use super::search::MAX_PUSHES;
use super::touched::Touched;
use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::weighting::Weighting;
use crate::log::track::Track;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::window::{Dataset, Window};
use armgap_core::arm::Arm;
use armgap_core::transmission::LatentState;

/// Largest distance in time, s, from a push's Gaussian pulse to a window that takes part in the fit of the push.
const MAX_WINDOW_DISTANCE: f64 = 0.25;

/// Time from a push's centre up to which it acts, in durations.
const ACTS: f64 = 0.75;

/// Ratio of the costs with and without a further push up to which it belongs to the pushes near it.
const SHRINKS: f64 = 0.5;

/// Number of times that each of several pushes near each other is fitted beside the others.
const TOGETHER_ROUNDS: usize = 2;

/// Impulse up to which a push on an arm whose model has backlash is none, relative to the largest impulse that rotor and link exchange through the
/// backlash in the log: a wrong instant or strength of an impact leaves such an impulse. Pushes that nobody gave had 0.02 to 0.12, those that were given
/// 0.24 and more (docs/decisions/025-knocks.md).
const OF_AN_IMPACT: f64 = 0.2;

/// Least share of the cost of the windows that a push touches which the push must remove to be kept where the model leaves errors unexplained.
const HELPS: f64 = 0.05;

/// Least share of the windows' cost, with the model refitted to the recording, that a push must remove to be kept where the model leaves errors
/// unexplained; the model fitted to the recording with the push is compared with the model fitted without it.
const HELPS_OWN: f64 = 0.02;

/// Least share that a push must explain of the cost of the windows that it touches before its size by output error is believed.
const PUSH_EXPLAINED_SHARE: f64 = 0.5;

/// Largest shift of a push's time by the output-error fit, relative to the push's duration.
const MOVED: f64 = 0.3;

/// Shift of a push's time by the output-error fit that is always allowed, s.
const MOVED_LEAST: f64 = 0.1;

/// Largest factor by which the output-error fit may change the impulse of a push where the model leaves errors unexplained.
const CHANGED: f64 = 1.5;

/// Number of rounds in which initial states and weights of the windows are recomputed with a fitted push in the model.
const PUSH_ROUNDS: usize = 2;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Whether the prediction errors of a log leave room for a push that matters; always true where the model leaves errors unexplained.
    pub(super) fn could_hold_a_push(&self, (set, track): Place, state: &PushState<'_, N, P>) -> bool {
        if state.remainder {
            return true;
        }
        let whole = [&self.training, &self.holdout][set];
        let data = whole.data.of_track(track, |_| true).without_pushes();
        let (weighting, predicted) = self.at_measured_starts(&data, state);
        let residual = weighting.residual(&data.measured(), &predicted);
        weighting.costs(&data, &residual).iter().sum::<f64>() > least_gain(whole, state)
    }

    /// Largest impulse, N m s (N s), that a rotor and its link exchange through backlash in a log under `model`; zero for a model without backlash.
    fn impact_impulse(&self, (set, track): Place, model: &Hypothesis<P>) -> f64 {
        if !model.effects.iter().any(EffectInstance::is_backlash) {
            return 0.0;
        }
        let data = [&self.training, &self.holdout][set].data.of_track(track, |_| true);
        impact_impulse(&data, &self.arm, model)
    }

    /// Weighting around the model and the model's predictions, with every window at its measured initial state.
    fn at_measured_starts(&self, data: &Dataset<N>, state: &PushState<'_, N, P>) -> (Weighting<N>, Vec<f64>) {
        let offsets = state.zeros.offsets(data);
        let predicted = data.predict(&self.arm, state.model, &offsets);
        let weighting = Weighting::new(data, &self.arm, state.model, state.scale, offsets, &predicted);
        (weighting.with_zeros(state.zeros.clone()), predicted)
    }

    /// The pushes `seen` in one log, which are near each other in time, with impulses, times and durations fitted by output error, each beside the others
    /// and the pushes `before`; those that explain too little beside the others are left out.
    pub(super) fn sized_together(
        &self,
        seen: Vec<Disturbance>,
        state: &PushState<'_, N, P>,
        own: &Own<'_, A, N, P>,
        before: &[Disturbance],
    ) -> Vec<Disturbance> {
        let mut open = self.complete(seen, state, before);
        let rounds = if open.len() > 1 { TOGETHER_ROUNDS } else { 1 };
        for _ in 0..rounds {
            self.size_each(&mut open, state, own, before);
        }
        while let Some(part) = part_of_another(&open) {
            open.remove(part);
            self.size_each(&mut open, state, own, before);
        }
        open.into_iter().map(|(_, sized)| sized).collect()
    }

    /// Fits every push of `open`, as seen and as fitted so far, beside the others and the pushes `before`; those that explain too little are taken out.
    fn size_each(
        &self,
        open: &mut Vec<(Disturbance, Disturbance)>,
        state: &PushState<'_, N, P>,
        own: &Own<'_, A, N, P>,
        before: &[Disturbance],
    ) {
        let mut i = 0;
        while i < open.len() {
            let (seen, first) = open.remove(i);
            let others: Vec<Disturbance> =
                before.iter().chain(open.iter().map(|(_, fitted)| fitted)).cloned().collect();
            if let Some(sized) = self.sized(&seen, first.push, state, own, &others) {
                open.insert(i, (seen, sized));
                i += 1;
            }
        }
    }

    /// The pushes `seen` and what they are when fitted together; where the model describes the arm and they leave errors far above the usual ones, with
    /// further pushes in the window of the largest error, as long as these shrink the cost: one push that is not known spoils the fit of those beside it.
    fn complete(
        &self,
        seen: Vec<Disturbance>,
        state: &PushState<'_, N, P>,
        before: &[Disturbance],
    ) -> Vec<(Disturbance, Disturbance)> {
        let place = seen[0].place();
        let mut seen = seen;
        let (mut fitted, mut left) = self.fitted_together(&seen, state, before);
        while !state.remainder && left > OUTLYING && before.len() + seen.len() < MAX_PUSHES {
            let known: Vec<Disturbance> = before.iter().chain(&fitted).cloned().collect();
            let Some(further) = self.in_worst_window(place, state, &known) else { break };
            if !fitted.iter().any(|push| push.is_near(&further, self.horizon)) {
                break;
            }
            let with: Vec<Disturbance> = fitted.iter().cloned().chain([further.clone()]).collect();
            let (together, lower) = self.fitted_together(&with, state, before);
            let (added, others) = together.split_last().expect("the further push is among them");
            if lower > SHRINKS * left || others.iter().any(|push| push.overlaps(added)) {
                break;
            }
            seen.push(further);
            (fitted, left) = (together, lower);
        }
        seen.into_iter().zip(fitted).collect()
    }

    /// The pushes `first` of one log fitted together to the windows that they touch, beside the pushes `before`, and the cost of these windows in units of
    /// their usual cost.
    fn fitted_together(
        &self,
        first: &[Disturbance],
        state: &PushState<'_, N, P>,
        before: &[Disturbance],
    ) -> (Vec<Disturbance>, f64) {
        let place = first[0].place();
        let whole = [&self.training, &self.holdout][place.0];
        let sample = WindowSet { data: whole.data.without_pushes(), measured: whole.measured.clone() };
        let track = &sample.data.tracks[place.1];
        let data = sample.data.of_track(place.1, |w| first.iter().any(|e| e.reaches(track, w)));
        if data.windows.is_empty() {
            return (first.to_vec(), 0.0);
        }
        let usual = self.weighting(&sample, state.model, state.scale, state.zeros).typical
            * data.windows.len() as f64;
        let pushes: Vec<EffectInstance> = first.iter().map(|e| e.push).collect();
        let touched = self.touched_windows(data, place, state, before);
        let (fitted, left) = touched.of_all_shapes(&pushes, Touched::minimise);
        let fitted = first.iter().zip(fitted).map(|(e, push)| Disturbance { push, ..e.clone() });
        (fitted.collect(), left / usual.max(1e-300))
    }

    /// The windows `data` of the log at `place`, with the pushes `known` of this log.
    fn touched_windows<'a>(
        &'a self,
        data: Dataset<N>,
        place: Place,
        state: &PushState<'a, N, P>,
        known: &[Disturbance],
    ) -> Touched<'a, A, N, P> {
        let (weighting, _) = self.at_measured_starts(&data, state);
        let known = known.iter().filter(|e| e.place() == place).map(|e| e.push).collect();
        Touched { arm: &self.arm, model: state.model, sample: WindowSet::new(data), weighting, known }
    }

    /// The push `seen` with the impulse, time and duration fitted by output error from the first guess `first`, and the share of the cost that the push
    /// explains; `None` if the share is too small.
    ///
    /// The share counts from the cost of the model without the push, or of the model refitted to the recording alone if that is less. Where the model
    /// leaves errors unexplained and the output error explains too little to be believed, or leaves the impulse unknown, `seen` is returned unchanged if
    /// the push lowers the cost under the model or under the refitted one. `known` are the recording's further pushes.
    pub(super) fn sized(
        &self,
        seen: &Disturbance,
        first: EffectInstance,
        state: &PushState<'_, N, P>,
        own: &Own<'_, A, N, P>,
        known: &[Disturbance],
    ) -> Option<Disturbance> {
        let whole = if seen.holdout { &self.holdout } else { &self.training };
        let sample = WindowSet { data: whole.data.without_pushes(), measured: whole.measured.clone() };
        let data = around(&sample, seen);
        if data.windows.is_empty() {
            return state.remainder.then_some(seen.clone());
        }
        let least = least_gain(&sample, state);
        let usual = self.weighting(&sample, state.model, state.scale, state.zeros).typical
            * data.windows.len() as f64;
        let mut touched = self.touched_windows(data, seen.place(), state, known);
        let mut bare = touched.cost_of(&[]);
        if !state.remainder {
            bare = touched.cost_under(self, own.bare(), &[]).min(bare);
        }
        // Where the model leaves errors unexplained, a search from other durations would fit these errors instead of the push.
        let (fitted, left) = touched.of_all_shapes(&[first], |touched, first| {
            if state.remainder {
                return touched.minimise(first);
            }
            let (fitted, left) = touched.least(first[0]);
            (vec![fitted], left)
        });
        let mut fitted = fitted[0];
        let share = |left: f64| (bare - left) / (bare - usual.min(0.5 * bare)).max(1e-300);
        let believed = share(left) > PUSH_EXPLAINED_SHARE && bare - left > least;
        if believed && close(&fitted.p, &seen.push.p, state.remainder) {
            for _ in 0..PUSH_ROUNDS {
                touched.sample.data.tracks[0].pushes = touched.with(&[fitted]);
                touched.weighting = self.weighting(&touched.sample, state.model, state.scale, state.zeros);
                fitted = touched.minimise(vec![fitted]).0[0];
            }
            let share = share(left);
            let largest = self.impact_impulse(seen.place(), state.model);
            let sigma = if fitted.p[0].abs() < OF_AN_IMPACT * largest {
                None
            } else {
                touched.sigma(&fitted, state.covariance)
            };
            let sized = sigma.map(|sigma| Disturbance { push: fitted, sigma, share, ..*seen });
            if !state.remainder {
                // Windows far above the typical one show a push that is lost in the scatter of the residual torque.
                let probability = seen.probability.max(outlying_probability(bare, usual));
                return sized.map(|sized| Disturbance { probability, ..sized });
            }
            if sized.as_ref().is_some_and(Disturbance::is_known) {
                return sized;
            }
        }
        if !state.remainder {
            return None;
        }
        let as_seen = share(touched.cost_of(&[seen.push]));
        if as_seen > HELPS {
            return Some(Disturbance { share: as_seen, ..seen.clone() });
        }
        let others: Vec<&Disturbance> = known.iter().collect();
        let with: Vec<&Disturbance> = known.iter().chain([seen]).collect();
        let without = touched.cost_under(self, &own.beside(&others), &[]);
        let share = 1.0 - touched.cost_under(self, &own.beside(&with), &[seen.push]) / without;
        (share > HELPS_OWN).then_some(Disturbance { share, ..seen.clone() })
    }
}

/// Index of a fitted push that overlaps another of a larger impulse; none if no two overlap.
fn part_of_another(open: &[(Disturbance, Disturbance)]) -> Option<usize> {
    let impulse = |i: usize| open[i].1.push.p[0].abs();
    let is_part = |i: &usize| {
        (0..open.len()).any(|k| k != *i && open[k].1.overlaps(&open[*i].1) && impulse(k) >= impulse(*i))
    };
    (0..open.len()).filter(is_part).min_by(|a, b| impulse(*a).total_cmp(&impulse(*b)))
}

/// Least decrease of the windows' cost by a push that is large enough to matter.
fn least_gain<const N: usize, const P: usize>(sample: &WindowSet<N>, state: &PushState<'_, N, P>) -> f64 {
    state.min_relevance.powi(2) * sample.motion(&state.scale)
}

/// Largest momentum of a rotor against its link, N m s (N s), in the first log of `data` under a model.
fn impact_impulse<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    data: &Dataset<N>,
    arm: &A,
    model: &Hypothesis<P>,
) -> f64 {
    let (Some(plant), Some(inputs)) = (model.plant(arm), data.log_inputs(arm, model)) else { return 0.0 };
    let momentum = |latent: &LatentState<f64, N>| {
        let of = |j: usize| Some(plant.drivetrain().get(j)?.inertia * latent.deflection_rate[j].abs());
        (0..N).filter_map(of).fold(0.0, f64::max)
    };
    inputs.latent(0).unwrap_or_default().iter().map(momentum).fold(0.0, f64::max)
}

/// Whether the fitted push (impulse, time, duration) agrees in time and sign with the one seen in the residual torque; where the model leaves errors
/// unexplained (`remainder`) also in size, as the fit may have taken up part of these errors.
fn close(fitted: &[f64; 3], seen: &[f64; 3], remainder: bool) -> bool {
    let ratio = fitted[0] / seen[0];
    let near = (fitted[1] - seen[1]).abs() < (MOVED * seen[2]).max(MOVED_LEAST);
    near && if remainder { ratio > 1.0 / CHANGED && ratio < CHANGED } else { ratio > 0.0 }
}

/// Windows that a push touches, as a dataset of the push's log alone.
fn around<const N: usize>(sample: &WindowSet<N>, disturbance: &Disturbance) -> Dataset<N> {
    let track = &sample.data.tracks[disturbance.track];
    sample.data.of_track(disturbance.track, |w| disturbance.reaches(track, w))
}

impl Disturbance {
    /// Whether a window of the push's log takes part in the fit of the push.
    fn reaches<const N: usize>(&self, track: &Track<N>, window: &Window<N>) -> bool {
        let [_, time, duration] = self.push.p;
        let reach = ACTS * duration + MAX_WINDOW_DISTANCE;
        track.t[window.first] < time + reach && track.t[window.last] > time - reach
    }

    /// Whether two pushes act on one joint of a log at the same time, so that they are one push of another course over time.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        let apart = (self.push.p[1] - other.push.p[1]).abs();
        self.place() == other.place()
            && self.push.joint == other.push.joint
            && apart < ACTS * (self.push.p[2] + other.push.p[2])
    }

    /// Whether one of two pushes of a log acts in windows of the length `window`, s, that take part in the fit of the other.
    pub(super) fn is_near(&self, other: &Self, window: f64) -> bool {
        let acts = ACTS * (self.push.p[2] + other.push.p[2]);
        let apart = (self.push.p[1] - other.push.p[1]).abs();
        self.place() == other.place() && apart < acts + MAX_WINDOW_DISTANCE + window
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::track::Track;
    use armgap_core::arm::Pendulum;
    use armgap_core::effect::find;

    #[test]
    fn of_two_pushes_on_one_joint_at_one_time_the_lesser_is_part_of_the_other() {
        let open =
            |pushes: &[Disturbance]| -> Vec<_> { pushes.iter().map(|p| (p.clone(), p.clone())).collect() };
        let large = Disturbance::certain(0, [2.0, 3.0, 0.2]);
        for (other, part) in [
            (Disturbance::certain(0, [-0.5, 3.2, 0.1]), Some(1)),
            (Disturbance::certain(0, [-0.5, 3.24, 0.1]), None),
            (Disturbance::certain(1, [-0.5, 3.0, 0.1]), None),
            (Disturbance::certain(0, [5.0, 3.0, 0.1]), Some(0)),
        ] {
            assert_eq!(part_of_another(&open(&[large.clone(), other])), part);
        }
    }

    #[test]
    fn pushes_are_near_where_one_acts_in_windows_of_the_other() {
        let first = Disturbance::certain(0, [1.0, 3.0, 0.2]);
        for (time, near) in [(3.3, true), (3.75, true), (3.85, false), (2.0, false)] {
            assert_eq!(first.is_near(&Disturbance::certain(1, [1.0, time, 0.2]), 0.25), near, "{time}");
        }
    }

    /// Rotor behind backlash beside a link that is held: after a reversal of the torque it crosses the whole gap under this torque alone.
    #[test]
    fn the_impulse_of_an_impact_is_that_of_a_rotor_after_free_flight_through_the_gap() {
        let (inertia, gap, share, torque): (f64, f64, f64, f64) = (0.1, 0.01, 0.25, 0.5);
        let t: Vec<f64> = (0..600).map(|k| 1e-3 * f64::from(k)).collect();
        let tau: Vec<f64> = t.iter().map(|t| if *t < 0.3 { torque } else { -torque }).collect();
        let data = Dataset::new(vec![Track::<1>::new("", &t, &vec![0.0; t.len()], &tau, Some([1e-6]))], 0.1);
        let arm = Pendulum { gravity: 9.81 };
        let rigid = Hypothesis::rigid([inertia, 0.0, 0.0, 0.0]);
        let law = find::<f64>("backlash").expect("known");
        let with = rigid.with(EffectInstance::new(law, 0, [gap, share, 0.0]));
        let momentum = (2.0 * torque * gap * share * inertia).sqrt();
        let impulse = impact_impulse(&data, &arm, &with);
        assert!(impulse > 0.95 * momentum && impulse < 1.001 * momentum, "{impulse} for {momentum}");
        assert_eq!(impact_impulse(&data, &arm, &rigid), 0.0);
    }
}
