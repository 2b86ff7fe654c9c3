//! Gap on the training logs, where a diagnosis finds no cause and no gap on the holdout.
//!
//! An effect may act where only the training logs went, as backlash of a joint whose torque reverses in the first part of a log. A gap that only they
//! show is a gap too, although the holdout cannot judge its causes.

use crate::likelihood::context::DiagnosisContext;
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::rms;
use crate::result::floor::floor;
use crate::result::verdict::stands_out;
use armgap_core::arm::Arm;

/// RMS position errors on the training windows by joint, rad or m.
#[derive(Debug, Clone)]
pub struct TrainingGap {
    /// Error of the model without causes, parameters re-estimated from the same logs.
    pub missed: Vec<f64>,
    /// Error of a perfect model: noise of the measurements and of the measured initial states.
    pub floor: Vec<f64>,
}

impl TrainingGap {
    /// Gap that a model without external pushes leaves on the training logs, beside the encoder zeros of their recordings; none where it is within
    /// noise or of no consequence in relation to the motion.
    pub fn of<A: Arm<f64, N, P>, const N: usize, const P: usize>(
        context: &DiagnosisContext<A, N, P>,
        model: &Hypothesis<P>,
        zeros: &EncoderZeros<N>,
        seed: u64,
    ) -> Option<Self> {
        let (data, measured) = (&context.training.data.without_pushes(), &context.training.measured);
        let predicted = data.predict(&context.arm, model, &zeros.offsets(data));
        let floor = floor(context, data, model, &predicted, seed).map(f64::sqrt).to_vec();
        let (missed, motion) =
            (rms::<N>(measured, &predicted), rms::<N>(measured, &context.training.still()));
        stands_out(&missed, &floor, &motion).then_some(Self { missed, floor })
    }

    /// Remark on the gap; `unit` is rad or m.
    pub fn remark(&self, unit: &str) -> String {
        let list = |values: &[f64]| {
            values.iter().map(|x| format!("{:.3}", x * 1e3)).collect::<Vec<_>>().join(" and ")
        };
        format!(
            "the training logs show a gap that the holdout does not: {} m{unit} by joint, where a perfect model would miss by {}; an effect may act \
             where only they went, or a disturbance in them. Exchange training and holdout logs, or let both hold all motions",
            list(&self.missed),
            list(&self.floor)
        )
    }
}
