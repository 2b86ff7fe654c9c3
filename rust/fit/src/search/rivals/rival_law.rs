//! The rival of every named cause: an unnamed torque, as a table over the one or two variables of the motion that best predict the residual torque
//! without the cause.
//!
//! An effect that is not in the arm is named where it imitates the unmodelled torque better than the other effects do. A table can take any form over
//! its variables: where it explains much more of the holdout than the named effect, the form of the named effect is wrong. Further forms than results
//! list stand for friction, gains and hysteresis that the library does not have (`TableForm::rivals`), and for the named effect with a size that is not
//! constant (`TableForm::varied`).

use crate::likelihood::context::{DiagnosisContext, SplitWeighting, WindowSet};
use crate::likelihood::solve::{Effort, Fit};
use crate::locate::dependence::Dependence;
use crate::locate::log_residual::LogResidual;
use crate::locate::table_form::{MotionPoint, TableForm};
use crate::locate::unnamed::{MAX_TABLES, Wanted, dependences};
use crate::log::track::Track;
use crate::model::custom_effect::{self, UNNAMED};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::residual_torque::{measured_motion, rms_speeds, slow_speeds};
use crate::predict::window::Dataset;
use crate::search::acceptance::MATTERS;
use armgap_core::arm::Arm;
use armgap_core::effect::Scope;
use nalgebra::SVector;

/// Torques of a cause on all joints, by log and sample, N m or N.
type CauseTorques<const N: usize> = Vec<Vec<SVector<f64, N>>>;

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
        let no_cause = [Vec::new(), Vec::new()];
        let predicts = |law: &Dependence| {
            full - self.cost_beside(&model.hypothesis, law, &no_cause, weights) > MATTERS * rest
        };
        let forms = |torques: &[f64], own| with_two(TableForm::listed(torques, own), own, torques.len());
        let mut laws =
            self.dependences(&model.hypothesis, Wanted { most: MAX_TABLES, rotary, forms: &forms });
        laws.retain(predicts);
        laws
    }

    /// Tables of a model's residual torque by inverse dynamics, strongest first, fitted to the training logs.
    fn dependences(&self, model: &Hypothesis<P>, wanted: Wanted<'_>) -> Vec<Dependence> {
        let of = |set, in_training| self.residuals(set, model, in_training).into_iter().flatten();
        let logs: Vec<LogResidual<N>> = of(&self.training, true).chain(of(&self.holdout, false)).collect();
        dependences(&self.arm, &model.theta, &self.prior, &logs, wanted)
    }

    /// Residual torque of a model in every log of a set of windows; tables are fitted to those `in_training`.
    fn residuals(
        &self,
        set: &WindowSet<N>,
        model: &Hypothesis<P>,
        in_training: bool,
    ) -> Vec<Option<LogResidual<N>>> {
        set.data.tracks.iter().map(|track| LogResidual::new(&self.arm, track, model, in_training)).collect()
    }

    /// Least cost on the holdout of the model `without` a cause and with a table of torque added, on each joint the one that best predicts the model's
    /// residual torque, of all forms that a rival may have; none where no table predicts it.
    pub(crate) fn rival_cost(
        &self,
        without: &Hypothesis<P>,
        cause: &EffectInstance,
        weights: &SplitWeighting<N>,
    ) -> Option<f64> {
        let with = without.with(*cause);
        let beside = |set, in_training| -> Vec<Option<LogResidual<N>>> {
            let both = self.residuals(set, without, in_training).into_iter().zip(self.residuals(
                set,
                &with,
                in_training,
            ));
            both.map(|(rest, with)| Some(rest?.beside_cause(&with?))).collect()
        };
        let along = |set: &WindowSet<N>, logs: &[Option<LogResidual<N>>]| -> CauseTorques<N> {
            let of = |(track, log): (&Track<N>, &Option<LogResidual<N>>)| {
                Some(log.as_ref()?.cause_along(track.len()))
            };
            set.data.tracks.iter().zip(logs).map(|pair| of(pair).unwrap_or_default()).collect()
        };
        let (training, holdout) = (beside(&self.training, true), beside(&self.holdout, false));
        let torques = [along(&self.training, &training), along(&self.holdout, &holdout)];
        let forms = |torques: &[f64], joint: usize| {
            let mut forms = with_two(TableForm::rivals(torques, joint), joint, torques.len());
            if is_varied(cause) && joint == cause.joint {
                forms.extend(TableForm::varied(torques.len(), joint));
            }
            forms
        };
        let logs: Vec<LogResidual<N>> = training.into_iter().chain(holdout).flatten().collect();
        let wanted = Wanted { most: 1, rotary: true, forms: &forms };
        let rivals = dependences(&self.arm, &without.theta, &self.prior, &logs, wanted);
        let cost = |rival: &Dependence| self.cost_beside(without, rival, &torques, weights);
        rivals.iter().map(cost).min_by(f64::total_cmp)
    }

    /// Cost on the holdout of a model with the torques of the table `law` added, everything fitted again to the training logs; `causes`: torques in the
    /// training logs and in the holdout of the cause in whose place the table stands, none where it stands in no cause's.
    fn cost_beside(
        &self,
        model: &Hypothesis<P>,
        law: &Dependence,
        [training, holdout]: &[CauseTorques<N>; 2],
        weights: &SplitWeighting<N>,
    ) -> f64 {
        let beside = Self {
            training: WindowSet::new(with_torques(&self.training.data, law, training)),
            holdout: WindowSet::new(with_torques(&self.holdout.data, law, holdout)),
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

/// Whether the size of a cause may be a table: it acts on one joint, and needs no latent states, whose torque the measured motion does not give.
fn is_varied(cause: &EffectInstance) -> bool {
    cause.law.spec().scope == Scope::Joint && !cause.law.has_transmission()
}

/// The same windows of data, with the torques of `law` along the measured motion added as a table to their logs, for the torques `causes` of the cause
/// in whose place the table stands.
fn with_torques<const N: usize>(data: &Dataset<N>, law: &Dependence, causes: &CauseTorques<N>) -> Dataset<N> {
    let mut data = data.clone();
    for (index, track) in data.tracks.iter_mut().enumerate() {
        let cause = |k: usize| causes.get(index).and_then(|torques| torques.get(k)).copied();
        let point = |k: usize| MotionPoint {
            t: track.t[k] - track.t[0],
            motion: measured_motion(track, k),
            tau: SVector::from_fn(|j, _| track.held[k][j].mean()),
            cause: cause(k).unwrap_or_else(SVector::zeros),
        };
        let points: Vec<MotionPoint<N>> = (0..track.len()).map(point).collect();
        let slow = slow_speeds(track, &rms_speeds(track));
        let torques = law.form.along(&points, &slow).into_iter().map(|place| law.at(place)).collect();
        track.tables.resize(UNNAMED, Vec::new());
        track.tables.push(torques);
    }
    data
}
