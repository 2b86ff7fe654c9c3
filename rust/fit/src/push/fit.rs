//! Sizes of a push by output error over the windows it touches: the push under which their predictions miss least.

use super::{Event, SHORTEST, State};
use crate::metric::Metric;
use crate::model::{Hypothesis, Placed};
use crate::solve::scaled_inverse;
use crate::study::{Sample, Study};
use crate::window::{Dataset, Shift, Window};
use armgap_core::arm::Arm;
use nalgebra::{DMatrix, DVector, Vector3};

/// Windows this far from a push are left out, s.
const AROUND: f64 = 0.25;

/// Longest push, s.
const LONGEST: f64 = 2.5;

/// A push that lowers the cost of the windows it touches by less than this share is not seen there.
const HELPS: f64 = 0.01;

/// Least share of the cost of the windows it touches that a push must explain before its size by output error is believed.
const EXPLAINS: f64 = 0.5;

/// How far, in its own durations and at least s, output error may move a push, and by what factor change its impulse.
const MOVED: f64 = 0.3;
const MOVED_LEAST: f64 = 0.1;
const CHANGED: f64 = 1.5;

/// Steps of the fit, attempts at each, and the relative decrease of the cost that ends it.
const ITERATIONS: usize = 12;
const ATTEMPTS: usize = 6;
const SETTLED: f64 = 1e-4;

/// The windows that a push touches, and the residual they have under any push.
struct Touched<'a, A, const N: usize, const P: usize> {
    arm: &'a A,
    model: &'a Hypothesis<P>,
    sample: Sample<N>,
    metric: Metric<N>,
    known: &'a [Placed],
    push: Placed,
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Study<A, N, P> {
    /// The push with the values that output error gives it, and what it explains.
    ///
    /// Beside a remainder it stays as it was where output error explains too little to be believed, if it helps at all; without one, it
    /// then is none.
    pub(super) fn sized(&self, rough: Event, state: &State<'_, N, P>, known: &[Placed]) -> Option<Event> {
        let whole = if rough.holdout { &self.holdout } else { &self.training };
        let sample = Sample { data: whole.data.without_pushes(), measured: whole.measured.clone() };
        let data = around(&sample, &rough);
        if data.windows.is_empty() {
            return state.remainder.then_some(rough);
        }
        let least = state.noticeable.powi(2) * sample.motion(&state.scale);
        let usual = self.metric(&sample, state.model, state.scale).typical * data.windows.len() as f64;
        let starts = vec![Shift::none(); data.windows.len()];
        let predicted = data.predict(&self.arm, state.model, &starts);
        let metric = Metric::new(&data, &self.arm, state.model, state.scale, starts, &predicted);
        let sample = Sample::new(data);
        let touched = Touched { arm: &self.arm, model: state.model, sample, metric, known, push: rough.push };
        let p = Vector3::from(rough.push.p);
        let bare = touched.cost(&touched.residual_of(&Vector3::new(0.0, p[1], p[2])));
        let seen = touched.cost(&touched.residual_of(&p));
        let (fitted, inverse, left) = touched.minimise(p);
        let share = |left: f64| (bare - left) / (bare - usual.min(0.5 * bare)).max(1e-300);
        let noise = (left / (touched.sample.data.rows * N) as f64).max(1.0);
        let believed = share(left) > EXPLAINS && bare - left > least;
        if believed && close(&fitted, &p, state.remainder) {
            let push = Placed { p: fitted.into(), ..rough.push };
            let sigma = std::array::from_fn(|i| (inverse[(i, i)] * noise).sqrt());
            return Some(Event { push, sigma, share: share(left), ..rough });
        }
        (state.remainder && share(seen) > HELPS).then(|| Event { share: share(seen), ..rough })
    }
}

/// Whether output error has found the same push; beside a remainder also its size must be much the same, for the remainder may have
/// gone into it.
fn close(fitted: &Vector3<f64>, seen: &Vector3<f64>, remainder: bool) -> bool {
    let ratio = fitted[0] / seen[0];
    let near = (fitted[1] - seen[1]).abs() < (MOVED * seen[2]).max(MOVED_LEAST);
    near && if remainder { ratio > 1.0 / CHANGED && ratio < CHANGED } else { ratio > 0.0 }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Touched<'_, A, N, P> {
    /// Whitened residual under a push of these values.
    fn residual_of(&self, p: &Vector3<f64>) -> Vec<f64> {
        let push = Placed { p: (*p).into(), ..self.push };
        let mut data = self.sample.data.clone();
        data.tracks[0].pushes = self.known.iter().copied().chain([push]).collect();
        let predicted = data.predict(self.arm, self.model, &self.metric.starts);
        self.metric.residual(&self.sample.measured, &predicted)
    }

    fn cost(&self, r: &[f64]) -> f64 {
        self.metric.costs(&self.sample.data, r).iter().sum()
    }

    /// Levenberg and Marquardt's method from a first guess: values, inverse of the last normal matrix, cost.
    fn minimise(&self, p: Vector3<f64>) -> (Vector3<f64>, DMatrix<f64>, f64) {
        let (mut p, mut r) = (p, self.residual_of(&p));
        let (mut cost, mut damping, mut inverse) = (self.cost(&r), 1e-2, DMatrix::zeros(3, 3));
        for _ in 0..ITERATIONS {
            let slopes = self.slopes(&p, &r);
            let gram = self.metric.gram(&self.sample.data, &slopes.each_ref().map(Vec::as_slice), &r).total;
            let before = cost;
            for _ in 0..ATTEMPTS {
                let Some((next, shape)) = damped_step(&p, &gram, damping) else { return (p, inverse, cost) };
                inverse = shape;
                let there = self.residual_of(&next);
                let lower = self.cost(&there);
                if lower < cost {
                    (p, r, cost) = (next, there, lower);
                    damping = f64::max(damping * 0.2, 1e-9);
                    break;
                }
                damping *= 8.0;
            }
            if before - cost <= SETTLED * before {
                break;
            }
        }
        (p, inverse, cost)
    }

    /// Derivatives of the prediction by impulse, time and duration.
    fn slopes(&self, p: &Vector3<f64>, r: &[f64]) -> [Vec<f64>; 3] {
        let steps = [1e-4 * p[0].abs().max(1e-12), 1e-5, 1e-5];
        let slope = |i: usize| {
            let mut moved = *p;
            moved[i] += steps[i];
            r.iter().zip(&self.residual_of(&moved)).map(|(a, b)| (a - b) / steps[i]).collect()
        };
        std::array::from_fn(slope)
    }
}

/// One damped step and the inverse of its normal matrix.
fn damped_step(p: &Vector3<f64>, gram: &DMatrix<f64>, damping: f64) -> Option<(Vector3<f64>, DMatrix<f64>)> {
    let mut normal = gram.view((0, 0), (3, 3)).into_owned();
    for i in 0..3 {
        normal[(i, i)] *= 1.0 + damping;
    }
    let inverse = scaled_inverse(&normal)?;
    let change = &inverse * DVector::from_fn(3, |i, _| gram[(i, 3)]);
    let duration = (p[2] + change[2]).clamp(SHORTEST, LONGEST);
    Some((Vector3::new(p[0] + change[0], p[1] + change[1], duration), inverse))
}

/// Windows of a push's log that it touches, as a dataset of that log alone.
fn around<const N: usize>(sample: &Sample<N>, event: &Event) -> Dataset<N> {
    let track = &sample.data.tracks[event.track];
    let [_, time, duration] = event.push.p;
    let reach = 0.75 * duration + AROUND;
    let touches = |w: &&Window<N>| {
        w.track == event.track && track.t[w.first] < time + reach && track.t[w.last] > time - reach
    };
    let (mut windows, mut rows) = (Vec::new(), 0);
    for window in sample.data.windows.iter().filter(touches) {
        windows.push(Window { track: 0, offset: rows, ..*window });
        rows += window.rows();
    }
    Dataset { tracks: vec![track.clone()], windows, rows }
}
