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
use crate::locate::table_form::{Factor, MotionPoint, TableForm};
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

/// A table of torque beside all causes of a model.
#[derive(Debug, Clone)]
pub(crate) struct LawBeside {
    /// The table.
    pub law: Dependence,
    /// Cost on the holdout of the model with the table added.
    pub cost: f64,
}

/// Largest share of the mean square of a cause's torque that neighbours in the order of a variable do not have in common, for the torque to be a function
/// of this variable: a smooth function has 1e-4 or less, one with a jump about the inverse of the number of samples, and a torque that is no function
/// of the variable about one.
const NOT_IN_COMMON: f64 = 0.05;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Tables of a model's residual torque over one or two variables of the motion each, strongest first, fitted to the training logs: those that remove a
    /// considerable share of the holdout's gap, each added to the model with everything fitted again.
    pub(crate) fn laws_beside(
        &self,
        model: &Fit<P>,
        weights: &SplitWeighting<N>,
        rotary: bool,
    ) -> Vec<LawBeside> {
        let full = self.holdout_cost(weights, model);
        let rest = full - self.floor(weights);
        let forms = |torques: &[f64], own| with_two(TableForm::listed(torques, own), own, torques.len());
        let found = self.dependences(&model.hypothesis, Wanted { most: MAX_TABLES, rotary, forms: &forms });
        let fitted = found.into_iter().map(|law| {
            let cost = self.cost_with(&model.hypothesis, &law, weights);
            LawBeside { law, cost }
        });
        fitted.filter(|beside| full - beside.cost > MATTERS * rest).collect()
    }

    /// Cost on the holdout of a model with the torques of the table `law` added, everything fitted again to the training logs.
    pub(crate) fn cost_with(
        &self,
        model: &Hypothesis<P>,
        law: &Dependence,
        weights: &SplitWeighting<N>,
    ) -> f64 {
        self.cost_beside(model, law, &[Vec::new(), Vec::new()], weights)
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

    /// Least cost on the holdout of the model `without` some causes and with a table of torque added, on each joint the one that best predicts the model's
    /// residual torque, of all forms that a rival may have; none where no table predicts it.
    ///
    /// A table over the variable of which the causes' torque is a function is such a rival also where it stands `beside` them: all together are a
    /// table over this variable, of which the causes' forms give what the table's classes do not resolve.
    pub(crate) fn rival_cost(
        &self,
        without: &Hypothesis<P>,
        causes: &[EffectInstance],
        besides: &[LawBeside],
        weights: &SplitWeighting<N>,
    ) -> Option<f64> {
        let with = causes.iter().fold(without.clone(), |model, cause| model.with(*cause));
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
            if let [cause] = causes
                && is_varied(cause)
                && joint == cause.joint
            {
                forms.extend(TableForm::varied(torques.len(), joint));
            }
            forms
        };
        let logs: Vec<LogResidual<N>> = training.into_iter().chain(holdout).flatten().collect();
        let wanted = Wanted { most: 1, rotary: true, forms: &forms };
        let rivals = dependences(&self.arm, &without.theta, &self.prior, &logs, wanted);
        let cost = |rival: &Dependence| self.cost_beside(without, rival, &torques, weights);
        let finer =
            besides.iter().filter(|beside| is_over_the_same(&beside.law, &logs)).map(|beside| beside.cost);
        rivals.iter().map(cost).chain(finer).min_by(f64::total_cmp)
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

/// Whether the torque of the cause in `logs` is a function of the one variable of the table `law`, on the joint of the table.
fn is_over_the_same<const N: usize>(law: &Dependence, logs: &[LogResidual<N>]) -> bool {
    if law.form.second.is_some() || law.form.factor != Factor::One {
        return false;
    }
    let of_log = |log: &LogResidual<N>| {
        let torque = |k: usize| log.cause_of(law.joint - 1, k);
        log.along(law.form).into_iter().enumerate().map(|(k, place)| (place.x, torque(k))).collect::<Vec<_>>()
    };
    is_function_of(logs.iter().flat_map(of_log).collect())
}

/// Whether the second values of pairs are a function of the first, from the mean square difference of neighbours in their order (von Neumann, Ann. Math.
/// Stat. 12, 1941); values that do not vary are functions of nothing in particular.
fn is_function_of(mut pairs: Vec<(f64, f64)>) -> bool {
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = pairs.iter().map(|pair| pair.1).sum::<f64>() / pairs.len().max(1) as f64;
    let variance: f64 = pairs.iter().map(|pair| (pair.1 - mean).powi(2)).sum();
    let successive: f64 = pairs.windows(2).map(|two| 0.5 * (two[1].1 - two[0].1).powi(2)).sum();
    variance > NOT_IN_COMMON * mean * mean * pairs.len() as f64 && successive < NOT_IN_COMMON * variance
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torque_is_a_function_of_the_variable_that_orders_it() {
        let x = |k: u32| (0.7 * f64::from(k)).sin();
        let pairs = |of: &dyn Fn(u32) -> f64| (0..500).map(|k| (x(k), of(k))).collect::<Vec<_>>();
        assert!(is_function_of(pairs(&|k| x(k) * x(k).abs())));
        assert!(is_function_of(pairs(&|k| x(k).signum())));
        assert!(!is_function_of(pairs(&|k| f64::from(k % 7))));
        assert!(!is_function_of(pairs(&|k| x(k) * (0.7 * f64::from(k)).cos().signum())));
        // A constant torque is a function of every variable, and no table over one of them is its rival.
        assert!(!is_function_of(pairs(&|_| 2.0)));
        assert!(!is_function_of(Vec::new()));
    }
}
