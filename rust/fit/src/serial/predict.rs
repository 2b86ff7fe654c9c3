//! Predictions of a serial arm's model with terms added, over short windows and over whole logs.

use crate::log::track::LARGEST_ERROR;
use crate::model::hypothesis::Hypothesis;
use crate::predict::window::{Dataset, Window};
use crate::serial::controller::closed_loop::ClosedLoop;
use crate::serial::term::row_term::{RowTerm, torques_of_rows, without};
use crate::serial::term::{Term, TermKind, of_load};
use armgap_core::arm::Arm;
use armgap_core::chain::Chain;
use nalgebra::SVector;

/// Model of a serial arm for simulation: the chain, its parameters and effects, position controllers, and terms on coupled joints.
#[derive(Clone)]
pub struct Model<const N: usize, const P: usize> {
    arm: Chain<f64, N>,
    hypothesis: Hypothesis<P>,
    closed_loop: Option<ClosedLoop<N>>,
    rows: Vec<(RowTerm, Vec<f64>)>,
}

impl<const N: usize, const P: usize> Model<N, P> {
    /// Model of the serial arm with parameters `theta`, SI, and with `terms` added.
    pub fn new(arm: &Chain<f64, N>, theta: [f64; P], terms: &[Term]) -> Self {
        let mut model =
            Self { arm: *arm, hypothesis: Hypothesis::rigid(theta), closed_loop: None, rows: Vec::new() };
        let members: Vec<Term> = terms.iter().flat_map(Term::members).collect();
        // Rotors come first, as shafts and backlash take them over.
        for effect in members.iter().filter_map(Term::effect) {
            let rotor = &mut model.hypothesis.theta[10 * N + effect.joint];
            *rotor = (*rotor + effect.law.inertia(&effect.p)).max(0.0);
        }
        for term in members {
            match term.kind {
                TermKind::Law(effect) if effect.law.inertia(&effect.p) != 0.0 => {}
                TermKind::Law(_) => model.hypothesis.effects.extend(term.effect()),
                TermKind::Payload => model.add(N - 1, &of_load(&term.p)),
                TermKind::NominalLink(link) => model.add(link, &std::array::from_fn(|i| term.p[i])),
                // A shaft that does not twist is a rigid joint.
                TermKind::Transmission(law) if term.p[0] > 0.0 => {
                    let j = law.joint;
                    let inertia = arm.inertia(&model.hypothesis.theta, &SVector::zeros())[(j, j)];
                    let (effect, taken) = law.instance(&term.p, model.hypothesis.theta[10 * N + j], inertia);
                    model.hypothesis.theta[10 * N + j] -= taken;
                    model.hypothesis.effects.push(effect);
                }
                TermKind::BaseTilt(axes) => model.arm = turned(&model.arm, axes, [term.p[0], term.p[1]]),
                TermKind::Row(row) => model.rows.push((row, term.p)),
                // Tables are compared with causes in the weak form only, controllers are in the closed loop, and the members of a term on several
                // joints are visited one by one.
                TermKind::Controller(_)
                | TermKind::Joints(_)
                | TermKind::Table(_)
                | TermKind::Transmission(_) => {}
            }
        }
        model
    }

    /// The model with its torques from the position controllers `closed_loop` in place of the logged torques; with `None` the logged torques stay.
    pub fn behind(self, closed_loop: Option<ClosedLoop<N>>) -> Self {
        Self { closed_loop, ..self }
    }

    fn add(&mut self, link: usize, change: &[f64; 10]) {
        for (value, by) in self.hypothesis.theta[10 * link..].iter_mut().zip(change) {
            *value += by;
        }
    }

    /// Predicted positions of all windows of `data`, rad or m, sample by sample and joint by joint.
    pub fn predict(&self, data: &Dataset<N>) -> Vec<f64> {
        if self.rows.is_empty() {
            return self.predict_beside(data, &[]);
        }
        let torques: Vec<Vec<[f64; N]>> =
            data.tracks.iter().map(|track| torques_of_rows(track, &self.rows)).collect();
        let tracks = data.tracks.iter().zip(&torques).map(|(track, by)| without(track, by)).collect();
        self.predict_beside(&Dataset { tracks, windows: data.windows.clone(), rows: data.rows }, &torques)
    }

    /// Predicted positions, like [`Self::predict`], where the logged torques of `data` are already less the torques `rows` of coupled joints, N m or
    /// N, by log and sample interval.
    fn predict_beside(&self, data: &Dataset<N>, rows: &[Vec<[f64; N]>]) -> Vec<f64> {
        match &self.closed_loop {
            Some(closed_loop) => closed_loop.predict(data, &self.arm, &self.hypothesis, rows),
            None => data.predict_singly(&self.arm, &self.hypothesis),
        }
    }
}

/// The two axes of the base frame, 0 for x to 2 for z, that are closest to horizontal under `gravity`: turns about the third hardly change the torques.
pub fn horizontal_axes(gravity: &[f64; 3]) -> [usize; 2] {
    let mut axes = [0, 1, 2];
    axes.sort_by(|a, b| gravity[*a].abs().total_cmp(&gravity[*b].abs()));
    [axes[0].min(axes[1]), axes[0].max(axes[1])]
}

/// The arm with its base turned by `by`, the components, rad, along two `axes` (0 for x to 2 for z) of a rotation vector in the base frame; in the base
/// frame gravity turns the other way.
pub fn turned<const N: usize>(arm: &Chain<f64, N>, axes: [usize; 2], by: [f64; 2]) -> Chain<f64, N> {
    let g = *arm.gravity_vector();
    let angle = by[0].hypot(by[1]);
    if angle == 0.0 {
        return *arm;
    }
    let mut axis = [0.0; 3];
    axes.iter().zip(by).for_each(|(i, by)| axis[*i] = -by / angle);
    let cross =
        [axis[1] * g[2] - axis[2] * g[1], axis[2] * g[0] - axis[0] * g[2], axis[0] * g[1] - axis[1] * g[0]];
    let along: f64 = axis.iter().zip(&g).map(|(a, b)| a * b).sum();
    let (sine, cosine) = angle.sin_cos();
    arm.with_gravity(std::array::from_fn(|i| {
        g[i] * cosine + cross[i] * sine + axis[i] * along * (1.0 - cosine)
    }))
}

/// Noise floor by joint, rad^2 or m^2: mean square position error of a perfect model over the windows of `data`, from the `noise` of the samples
/// (standard deviation, rad or m) and the errors of the measured initial states, carried along the windows.
pub fn floor<const N: usize>(data: &Dataset<N>, noise: &[f64; N]) -> [f64; N] {
    let square = |w: &Window<N>, j: usize| -> f64 {
        let track = &data.tracks[w.track];
        let [vq, c, vdq] = w.initial_state.covariance[j];
        // This floor is not bounded by what a model misses, and one window with a jump must not raise it.
        let [mq, mdq] = w.initial_state.mean_square[j].map(|error| error.min(LARGEST_ERROR));
        let at = |k: usize| {
            let t = track.t[k] - track.t[w.first];
            noise[j].powi(2) + vq * mq + 2.0 * t * c * (mq * mdq).sqrt() + t * t * vdq * mdq
        };
        (w.first + 1..=w.last).map(at).sum()
    };
    std::array::from_fn(|j| data.windows.iter().map(|w| square(w, j)).sum::<f64>() / data.rows.max(1) as f64)
}
