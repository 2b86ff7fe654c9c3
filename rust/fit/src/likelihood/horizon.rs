//! Standard deviations widened by the change of a fit's values with the horizon.
//!
//! Where a controller answers to torques that no model describes, commanded and unmodelled torques are correlated, and output error is biased (Ljung 1999,
//! section 13.4): the shorter the windows, the more, because the errors of their initial states, which the unmodelled torques make too, then weigh
//! more. On simulated arms with random torques of 2 to 10 % of the commanded ones the bias at half the horizon is 1.5 to 1.8 times as large, so that the
//! change of a value from there tells the bias that is left (docs/decisions/049-intervals-that-hold.md). An error of the model that is
//! not constant along a window changes the values with the horizon as well.

use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::solve::Fit;
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::predict::window::Dataset;
use armgap_core::arm::Arm;
use armgap_core::effect::Quantity;
use nalgebra::DVector;
use std::f64::consts::{PI, TAU};

/// Length of the windows to which a model is fitted again, relative to the horizon.
const SHORTER: f64 = 0.5;

/// Bias that is left at the horizon, relative to the change of a value from half the horizon: 1.3 to 2.0 for the inertias of simulated arms. With 1.0, 90.6 %
/// of the 95 % intervals on 120 such arms hold.
const BIAS_PER_CHANGE: f64 = 1.5;

/// Number of windows of half the length, relative to those of the horizon, from which they are about half as long: samples may be too far apart.
const ENOUGH_MORE: f64 = 1.5;

/// Bias of a model's free values, estimated from their change when the model is fitted to shorter windows of the same logs.
pub(crate) struct HorizonBias<const P: usize> {
    model: Hypothesis<P>,
    by_value: DVector<f64>,
}

impl<const P: usize> HorizonBias<P> {
    /// Adds the squared biases to the variances of a fit of this model, also beyond the arm file's: a biased fit may be worse than none.
    pub(crate) fn widen(&self, fit: &mut Fit<P>) {
        fit.covariance.matrix.ger(1.0, &self.by_value, &self.by_value, 1.0);
    }

    /// Biases of the parameters of an effect of the model; none for other effects.
    pub(crate) fn of_effect(&self, effect: &EffectInstance) -> Option<&[f64]> {
        let place = self.model.effects.iter().position(|e| e.same_place(effect))?;
        let before: usize = self.model.effects[..place].iter().map(EffectInstance::len).sum();
        self.by_value.as_slice().get(P + before..P + before + effect.len())
    }
}

/// Whether each parameter of an effect is an angle whose full turns mean nothing.
fn is_angle(effect: &EffectInstance) -> impl Iterator<Item = bool> {
    effect.law.spec().parameters.iter().map(|parameter| matches!(parameter.quantity, Quantity::Angle))
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Bias of the values of a fit under the weights `weights`, from their change when it is fitted to windows of half the length; `None` where the logs
    /// hold no such windows.
    pub(crate) fn bias_by_horizon(
        &self,
        fit: &Fit<P>,
        weights: &SplitWeighting<N>,
    ) -> Option<HorizonBias<P>> {
        let horizon = SHORTER * self.horizon;
        let data = Dataset::new(self.training.data.tracks.clone(), horizon).clear_of_pushes();
        if (data.windows.len() as f64) < ENOUGH_MORE * self.training.data.windows.len() as f64 {
            return None;
        }
        let model = fit.hypothesis.clone();
        let beside = Self { horizon, ..self.on_windows(data) };
        let shorter = beside.settled_next_to(&model, &weights.training).hypothesis;
        let angles = vec![false; P].into_iter().chain(model.effects.iter().flat_map(is_angle));
        let (here, there) = (model.values(), shorter.values());
        let change = |((here, there), angle): ((f64, f64), bool)| {
            let change = there - here;
            let change = if angle { (change + PI).rem_euclid(TAU) - PI } else { change };
            if change.is_finite() { change } else { 0.0 }
        };
        let changes = here.into_iter().zip(there).zip(angles).map(change);
        let biases: Vec<f64> = changes.map(|change| BIAS_PER_CHANGE * change).collect();
        Some(HorizonBias { model, by_value: DVector::from_vec(biases) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likelihood::covariance::ParameterCovariance;
    use armgap_core::effect::find;
    use nalgebra::DMatrix;

    #[test]
    fn biases_add_to_variances_and_are_those_of_their_effect() {
        let effect = EffectInstance::new(find::<f64>("stribeck").unwrap(), 0, [0.5, 0.2, 0.0]);
        let model = Hypothesis::rigid([1.0, 2.0]).with(effect);
        let by_value = DVector::from_vec(vec![0.3, 0.0, -0.4, 0.0]);
        let bias = HorizonBias { model: model.clone(), by_value };
        let matrix = DMatrix::from_diagonal_element(4, 4, 0.16);
        let covariance = ParameterCovariance { matrix, degrees_of_freedom: vec![9.0; 4] };
        let mut fit =
            Fit { hypothesis: model, data_cost: 0.0, prior_cost: 0.0, covariance, costs: Vec::new() };
        bias.widen(&mut fit);
        for (i, sigma) in [0.5, 0.4, 0.32_f64.sqrt(), 0.4].into_iter().enumerate() {
            assert!((fit.sigma(i) - sigma).abs() < 1e-12, "{i}: {}", fit.sigma(i));
        }
        assert_eq!(bias.of_effect(&effect), Some(&[-0.4, 0.0][..]));
        let elsewhere = EffectInstance { joint: 1, ..effect };
        assert!(bias.of_effect(&elsewhere).is_none());
    }
}
