//! Pushes from outside: torques that no log shows, at one time of one log, judged inside that log.
//!
//! A push is a stretch of time over which the torque that a joint lacks adds up to an impulse that stands alone: far beyond what the
//! same joint lacks over stretches of the same length anywhere else. What is found is fitted by output error over the windows it
//! touches, and kept if it explains most of what those windows lack.

use crate::decide::{Attribution, noticeable};
use crate::locate::{Lack, lacking_torque};
use crate::metric::Metric;
use crate::model::{Hypothesis, Placed};
use crate::progress::Work;
use crate::solve::scaled_inverse;
use crate::study::{Sample, Study};
use crate::track::Track;
use crate::window::{Dataset, Shift, Window};
use armgap_core::arm::Arm;
use armgap_core::effect::find;
use nalgebra::{DMatrix, DVector};

/// Lengths of stretches that are tried, s.
const DURATIONS: [f64; 6] = [0.03, 0.06, 0.12, 0.25, 0.5, 1.0];

/// Pushes looked for in all logs together.
const MOST: usize = 12;

/// More pushes than this in one log are no rare events, but something that the arm does again and again.
const RARE: usize = 4;

/// Least size of a push in robust standard deviations of all stretches of its length.
const STANDS_OUT: f64 = 10.0;

/// Least size of a push relative to the largest stretch that is not called one.
const STANDS_ALONE: f64 = 2.5;

/// Least share of the cost of the windows it touches that a push must explain.
const EXPLAINS: f64 = 0.5;

/// Time kept free around a push, s: until its window ends, what a joint lacks follows from a state that the push has changed.
const APART: f64 = 0.25;

/// Windows that lacking torque is taken from: this long, s, and this many samples.
const SHORT_S: f64 = 0.06;
const SHORT_SAMPLES: f64 = 20.0;

/// A push ends where the lacking torque falls below this part of its mean.
const TAIL: f64 = 0.3;

/// Iterations of the fit.
const ITERATIONS: usize = 12;

/// Shortest and longest push, s.
const SHORTEST: f64 = 0.005;
const LONGEST: f64 = 2.5;

/// A push that was found.
#[derive(Debug, Clone)]
pub struct Event {
    /// Whether it lies in a holdout log rather than a training log.
    pub holdout: bool,
    /// Index of the log.
    pub track: usize,
    /// The push.
    pub push: Placed,
    /// Standard deviations of its values.
    pub sigma: [f64; 3],
    /// Share of the cost of the windows it touches that it explains.
    pub share: f64,
    /// By how much it lowers the cost of those windows.
    pub gain: f64,
    /// Probability that it is a push rather than the tail of something else.
    pub probability: f64,
}

/// A stretch whose impulse stands out.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    set: usize,
    track: usize,
    joint: usize,
    time: f64,
    duration: f64,
    impulse: f64,
    z: f64,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Study<A, N, P> {
    /// Pushes that a model leaves unexplained; those that lower the error by less than `noticeable`, relative to the motion, do not count.
    pub fn events(&self, model: &Hypothesis<P>, scale: [f64; N], noticeable: f64) -> Vec<Event> {
        self.watch.begin(Work::Pushes, MOST);
        let bare = [without_pushes(&self.training), without_pushes(&self.holdout)];
        let metrics = bare.each_ref().map(|sample| self.metric(sample, model, scale));
        let peaks = self.peaks(&bare, model);
        let Some((chosen, rest)) = standing_alone(&peaks) else { return Vec::new() };
        let mut found: Vec<Event> = Vec::new();
        for stretch in chosen {
            let typical = metrics[stretch.set].typical;
            let known: Vec<Placed> =
                found.iter().filter(|e| e.is_in(stretch.set, stretch.track)).map(|e| e.push).collect();
            self.watch.unit();
            let fitted = self.fit_push(&bare[stretch.set], model, scale, stretch, &known, typical);
            let least = noticeable.powi(2) * bare[stretch.set].motion(&scale);
            if let Some(mut event) = fitted.filter(|e| e.share > EXPLAINS && e.gain > least) {
                event.probability = 1.0 - 0.5 * (rest / stretch.z.abs()).powi(2);
                found.push(event);
            }
        }
        let in_log =
            |e: &Event| found.iter().filter(|o| o.holdout == e.holdout && o.track == e.track).count();
        if found.iter().any(|e| in_log(e) > RARE) {
            return Vec::new();
        }
        found
    }

    /// The attribution with all pushes accounted for.
    pub fn conclude(&mut self, max_causes: usize, seed: u64) -> (Attribution<N, P>, Vec<Event>) {
        let mut attribution = self.attribute(max_causes, seed);
        let mut events = self.events_of(&attribution);
        if !events.is_empty() {
            self.set_pushes(&events);
            attribution = self.attribute(max_causes, seed);
            events = self.fitted_again(&attribution, &events);
            self.set_pushes(&events);
        }
        (attribution, events)
    }

    fn events_of(&self, attribution: &Attribution<N, P>) -> Vec<Event> {
        let first = attribution.stages[0].relative_error();
        self.events(&attribution.model.hypothesis, settled_scale(attribution), noticeable(first))
    }

    /// Pushes fitted again to another model.
    fn fitted_again(&self, attribution: &Attribution<N, P>, events: &[Event]) -> Vec<Event> {
        let (model, scale) = (&attribution.model.hypothesis, settled_scale(attribution));
        let again = |(index, event): (usize, &Event)| {
            let set = usize::from(event.holdout);
            let bare = without_pushes(if event.holdout { &self.holdout } else { &self.training });
            let [impulse, time, duration] = event.push.p;
            let origin = bare.data.tracks[event.track].t[0];
            let (joint, track) = (event.push.joint, event.track);
            let stretch = Stretch { set, track, joint, time: time - origin, duration, impulse, z: 0.0 };
            let others = events.iter().enumerate().filter(|(i, e)| *i != index && e.is_in(set, track));
            let known: Vec<Placed> = others.map(|(_, e)| e.push).collect();
            let typical = self.metric(&bare, model, scale).typical;
            let fitted = self.fit_push(&bare, model, scale, &stretch, &known, typical)?;
            Some(Event { probability: event.probability, ..fitted }).filter(|e| e.share > EXPLAINS)
        };
        events.iter().enumerate().filter_map(again).collect()
    }

    /// Puts pushes into the logs they belong to, in place of those known before.
    pub fn set_pushes(&mut self, events: &[Event]) {
        for (set, sample) in [&mut self.training, &mut self.holdout].into_iter().enumerate() {
            for (index, track) in sample.data.tracks.iter_mut().enumerate() {
                track.pushes = events.iter().filter(|e| e.is_in(set, index)).map(|e| e.push).collect();
            }
        }
    }

    /// The largest impulses that joints lack, none overlapping, largest first.
    fn peaks(&self, samples: &[Sample<N>; 2], model: &Hypothesis<P>) -> Vec<Stretch> {
        let mut all = Vec::new();
        // Short windows: a push that turns a joint round turns its friction too, and that is not lacking.
        let shorter = samples.each_ref().map(|sample| {
            let period = sample.data.tracks.first().map_or(0.0, Track::period);
            Dataset::new(sample.data.tracks.clone(), SHORT_S.max(SHORT_SAMPLES * period))
        });
        let lacks =
            shorter.each_ref().map(|data| lacking_torque(&self.arm, data, &data.measured_starts(), model));
        for joint in 0..N {
            for duration in DURATIONS {
                let mut here = Vec::new();
                for (set, lack) in lacks.iter().enumerate() {
                    for track in 0..samples[set].data.tracks.len() {
                        let of = lack.iter().filter(|l| l.track == track);
                        let points: Vec<(f64, f64)> = of.map(|l| (l.t, l.lack[joint])).collect();
                        let sums = impulses(&points, duration);
                        here.extend(sums.into_iter().map(|(time, impulse)| Stretch {
                            set,
                            track,
                            joint,
                            time,
                            duration,
                            impulse,
                            z: 0.0,
                        }));
                    }
                }
                let typical = crate::track::median(here.iter().map(|s| s.impulse.abs()).collect()) / 0.6745;
                all.extend(here.into_iter().map(|s| Stretch { z: s.impulse / typical.max(1e-300), ..s }));
            }
        }
        all.sort_by(|a, b| b.z.abs().total_cmp(&a.z.abs()));
        let mut peaks: Vec<Stretch> = Vec::new();
        for stretch in all {
            if peaks.len() > MOST {
                break;
            }
            if !peaks.iter().any(|p| p.overlaps(&stretch)) {
                peaks.push(stretch);
            }
        }
        for peak in &mut peaks {
            *peak = grown(peak, &lacks[peak.set]);
        }
        peaks
    }

    /// Time, duration and impulse of one push by output error over the windows it touches.
    fn fit_push(
        &self,
        sample: &Sample<N>,
        model: &Hypothesis<P>,
        scale: [f64; N],
        stretch: &Stretch,
        known: &[Placed],
        typical: f64,
    ) -> Option<Event> {
        let mut part = touched(sample, stretch)?;
        let starts = vec![Shift::none(); part.data.windows.len()];
        let metric = Metric::new(&part.data, &self.arm, model, scale, starts);
        let mut residual = |p: [f64; 3]| -> Option<Vec<f64>> {
            let push = Placed { law: find::<f64>("external_pulse")?, joint: stretch.joint, p };
            part.data.tracks[0].pushes = known.iter().copied().chain([push]).collect();
            let predicted = part.data.predict(&self.arm, model, &metric.starts);
            let mut r: Vec<f64> = part.measured.iter().zip(&predicted).map(|(y, x)| y - x).collect();
            metric.whiten(&mut r);
            Some(r)
        };
        let data = part_windows(sample, stretch);
        let cost = |r: &[f64]| metric.costs(&data, r).iter().sum::<f64>();
        let time = stretch.time + sample.data.tracks[stretch.track].t[0];
        let bare = cost(&residual([0.0, time, stretch.duration])?);
        let mut p = [stretch.impulse, time, stretch.duration];
        let mut r = residual(p)?;
        let mut damping = 1e-2;
        let mut inverse = DMatrix::zeros(3, 3);
        for _ in 0..ITERATIONS {
            let steps = [1e-4 * stretch.impulse.abs(), 1e-5, 1e-5];
            let mut columns = Vec::new();
            for i in 0..3 {
                let mut moved = p;
                moved[i] += steps[i];
                let there = residual(moved)?;
                columns.push(r.iter().zip(&there).map(|(a, b)| (a - b) / steps[i]).collect::<Vec<f64>>());
            }
            let gram = metric.gram(&data, &columns, &r).total;
            let here = cost(&r);
            let mut better = false;
            for _ in 0..6 {
                let mut normal = gram.view((0, 0), (3, 3)).into_owned();
                for i in 0..3 {
                    normal[(i, i)] *= 1.0 + damping;
                }
                inverse = scaled_inverse(&normal)?;
                let change = &inverse * DVector::from_fn(3, |i, _| gram[(i, 3)]);
                let mut next = [p[0] + change[0], p[1] + change[1], p[2] + change[2]];
                next[2] = next[2].clamp(SHORTEST, LONGEST);
                let there = residual(next)?;
                if cost(&there) < here {
                    better = here - cost(&there) > 1e-4 * here;
                    (p, r) = (next, there);
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
                damping *= 8.0;
            }
            if !better {
                break;
            }
        }
        let (left, count) = (cost(&r), data.windows.len() as f64);
        let noise = (left / (data.rows * N) as f64).max(1.0);
        let law = find::<f64>("external_pulse")?;
        Some(Event {
            holdout: stretch.set == 1,
            track: stretch.track,
            push: Placed { law, joint: stretch.joint, p },
            sigma: std::array::from_fn(|i| (inverse[(i, i)] * noise).sqrt()),
            share: (bare - left) / (bare - (count * typical).min(0.5 * bare)).max(1e-300),
            gain: bare - left,
            probability: 0.0,
        })
    }
}

/// Scales of the residuals under the final model.
fn settled_scale<const N: usize, const P: usize>(attribution: &Attribution<N, P>) -> [f64; N] {
    attribution.stages[attribution.stages.len() - 1].weights.training.scale
}

impl Event {
    fn is_in(&self, set: usize, track: usize) -> bool {
        usize::from(self.holdout) == set && self.track == track
    }
}

impl Stretch {
    fn overlaps(&self, other: &Self) -> bool {
        let apart = 0.5 * (self.duration + other.duration) + APART;
        self.set == other.set && self.track == other.track && (self.time - other.time).abs() < apart
    }
}

/// The stretch around a peak over which its joint goes on lacking torque in the same direction, with the whole impulse.
fn grown<const N: usize>(peak: &Stretch, lack: &[Lack<N>]) -> Stretch {
    let here: Vec<(f64, f64)> =
        lack.iter().filter(|l| l.track == peak.track).map(|l| (l.t, l.lack[peak.joint])).collect();
    let level = TAIL * peak.impulse / peak.duration;
    let above = |i: usize| here[i].1 * level.signum() > level.abs();
    let centre = here.partition_point(|x| x.0 < peak.time).min(here.len() - 1);
    let (mut first, mut last) = (centre, centre);
    while first > 0 && (above(first - 1) || here[first].0 > peak.time - 0.5 * peak.duration) {
        first -= 1;
    }
    while last + 1 < here.len() && (above(last + 1) || here[last].0 < peak.time + 0.5 * peak.duration) {
        last += 1;
    }
    let (from, to) = (here[first].0, here[last].0);
    let impulse = here[first..=last].windows(2).map(|w| 0.5 * (w[0].1 + w[1].1) * (w[1].0 - w[0].0)).sum();
    Stretch { time: 0.5 * (from + to), duration: (to - from).max(SHORTEST), impulse, ..*peak }
}

/// The stretches that stand out and alone, in order of size, and the size of the largest of the others.
fn standing_alone(peaks: &[Stretch]) -> Option<(&[Stretch], f64)> {
    let alone = |count: &usize| {
        let (last, next) = (peaks[count - 1].z.abs(), peaks[*count].z.abs());
        last > STANDS_OUT && last > STANDS_ALONE * next
    };
    let count = (1..peaks.len()).rev().find(alone)?;
    Some((&peaks[..count], peaks[count].z.abs()))
}

/// Impulses over stretches of this length: their centres and values.
fn impulses(points: &[(f64, f64)], duration: f64) -> Vec<(f64, f64)> {
    let mut sum = vec![0.0];
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        // Nothing is known of a gap.
        let dt = if b.0 - a.0 < 0.05 { b.0 - a.0 } else { 0.0 };
        sum.push(sum[sum.len() - 1] + 0.5 * (a.1 + b.1) * dt);
    }
    let Some(&(first, _)) = points.first() else { return Vec::new() };
    let last = points[points.len() - 1].0;
    let at = |time: f64| sum[points.partition_point(|p| p.0 < time).min(points.len() - 1)];
    let step = duration / 4.0;
    let count = ((last - first - duration) / step).floor().max(0.0) as usize;
    (0..count)
        .map(|i| {
            let from = first + i as f64 * step;
            (from + 0.5 * duration, at(from + duration) - at(from))
        })
        .collect()
}

/// The same windows without any known pushes.
pub fn without_pushes<const N: usize>(sample: &Sample<N>) -> Sample<N> {
    let mut data = sample.data.clone();
    data.tracks.iter_mut().for_each(|track| track.pushes.clear());
    Sample { data, measured: sample.measured.clone() }
}

/// Windows of a stretch's log that it touches, as a dataset of that log alone.
fn part_windows<const N: usize>(sample: &Sample<N>, stretch: &Stretch) -> Dataset<N> {
    let track = &sample.data.tracks[stretch.track];
    let reach = 0.75 * stretch.duration + APART;
    let touches = |w: &&Window<N>| {
        let origin = track.t[0];
        w.track == stretch.track
            && track.t[w.first] - origin < stretch.time + reach
            && track.t[w.last] - origin > stretch.time - reach
    };
    let (mut windows, mut rows) = (Vec::new(), 0);
    for window in sample.data.windows.iter().filter(touches) {
        windows.push(Window { track: 0, offset: rows, ..*window });
        rows += window.rows();
    }
    Dataset { tracks: vec![track.clone()], windows, rows }
}

fn touched<const N: usize>(sample: &Sample<N>, stretch: &Stretch) -> Option<Sample<N>> {
    let data = part_windows(sample, stretch);
    (!data.windows.is_empty()).then(|| Sample::new(data))
}
