//! The rival of every named cause: an unnamed torque, as a table over the one or two variables of the motion that best predict the residual torque
//! without the cause.
//!
//! An effect that is not in the arm is named where it imitates the unmodelled torque better than the other effects do. A table can take any form over
//! its variables: where it explains much more of the holdout than the named effect, the form of the named effect is wrong. Further forms than results
//! list stand for friction, gains and hysteresis that the library does not have (`TableForm::rivals`).

use crate::likelihood::context::{DiagnosisContext, SplitWeighting, WindowSet};
use crate::likelihood::solve::{Effort, Fit};
use crate::locate::dependence::Dependence;
use crate::locate::table_form::{MotionPoint, TableForm};
use crate::locate::unnamed::{LogResidual, MAX_TABLES, Wanted, dependences};
use crate::model::custom_effect::{self, UNNAMED};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::residual_torque::{measured_motion, rms_speeds, slow_speeds};
use crate::predict::window::Dataset;
use crate::search::acceptance::MATTERS;
use armgap_core::arm::Arm;
use nalgebra::SVector;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Tables of a model's residual torque over one or two variables of the motion each, strongest first, fitted to the training logs: those that remove a
    /// considerable share of the holdout's gap, each added to the model with everything fitted again.
    pub(crate) fn laws_beside(
        &self,
        model: &Fit<P>,
        weights: &SplitWeighting<N>,
        rotary: bool,
    ) -> Vec<Dependence> {
        let full = self.holdout_cost(weights, model);
        let rest = full - self.floor(weights);
        let predicts =
            |law: &Dependence| full - self.cost_beside(&model.hypothesis, law, weights) > MATTERS * rest;
        let forms = |torques: &[f64], own| with_two(TableForm::listed(torques, own), own, torques.len());
        let mut laws =
            self.dependences(&model.hypothesis, Wanted { most: MAX_TABLES, rotary, forms: &forms });
        laws.retain(predicts);
        laws
    }

    /// Tables of a model's residual torque by inverse dynamics, strongest first, fitted to the training logs.
    fn dependences(&self, model: &Hypothesis<P>, wanted: Wanted<'_>) -> Vec<Dependence> {
        let of = |set: &WindowSet<N>, teaches| -> Vec<LogResidual<N>> {
            let tracks = &set.data.tracks;
            tracks.iter().filter_map(|track| LogResidual::new(&self.arm, track, model, teaches)).collect()
        };
        let mut logs = of(&self.training, true);
        logs.extend(of(&self.holdout, false));
        dependences(&self.arm, &model.theta, &self.prior, &logs, wanted)
    }

    /// Cost on the holdout of a model with the table of torque added that best predicts the model's residual torque, of all forms that a rival may
    /// have; none where no table predicts it.
    pub(crate) fn rival_cost(&self, model: &Hypothesis<P>, weights: &SplitWeighting<N>) -> Option<f64> {
        let forms = |torques: &[f64], own| with_two(TableForm::rivals(torques, own), own, torques.len());
        let rival =
            self.dependences(model, Wanted { most: 1, rotary: true, forms: &forms }).into_iter().next()?;
        Some(self.cost_beside(model, &rival, weights))
    }

    /// Cost on the holdout of a model with the torques of the table `law` added, everything fitted again to the training logs.
    fn cost_beside(&self, model: &Hypothesis<P>, law: &Dependence, weights: &SplitWeighting<N>) -> f64 {
        let beside = Self {
            training: WindowSet::new(with_torques(&self.training.data, law)),
            holdout: WindowSet::new(with_torques(&self.holdout.data, law)),
            ..self.on_windows(Dataset::new(Vec::new(), 1.0))
        };
        let effect = EffectInstance::new(custom_effect::law(UNNAMED), law.joint - 1, [1.0, 0.0, 0.0]);
        let fit = beside.problem(&weights.training).solve(&model.with(effect), Effort::FULL);
        beside.holdout_cost(weights, &fit)
    }
}

/// Forms of tables over one variable on joint `own` (from 0) of `n`, and those over two.
fn with_two(mut forms: Vec<TableForm>, own: usize, n: usize) -> Vec<TableForm> {
    forms.extend(TableForm::over_two(n, own));
    forms
}

/// The same windows of data, with the torques of `law` along the measured motion added as a table to their logs.
fn with_torques<const N: usize>(data: &Dataset<N>, law: &Dependence) -> Dataset<N> {
    let mut data = data.clone();
    for track in &mut data.tracks {
        let point = |k: usize| MotionPoint {
            t: track.t[k] - track.t[0],
            motion: measured_motion(track, k),
            tau: SVector::from_fn(|j, _| track.held[k][j].mean()),
        };
        let points: Vec<MotionPoint<N>> = (0..track.len()).map(point).collect();
        let slow = slow_speeds(track, &rms_speeds(track));
        let torques = law.form.along(&points, &slow).into_iter().map(|place| law.at(place)).collect();
        track.tables.resize(UNNAMED, Vec::new());
        track.tables.push(torques);
    }
    data
}
