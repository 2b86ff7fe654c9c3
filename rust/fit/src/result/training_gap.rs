//! Gap on the training logs, where a diagnosis finds no cause and no gap on the holdout.
//!
//! An effect may act where only the training logs went, as backlash of a joint whose torque reverses in the first part of a log. A gap that only they
//! show is a gap too, although the holdout cannot judge its causes.

use crate::likelihood::context::{DiagnosisContext, WindowSet};
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::likelihood::holdout::CONSEQUENTIAL_ERROR;
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::rms;
use crate::result::floor::floor;
use crate::result::report::TrainingErrors;
use crate::result::verdict::stands_out;
use armgap_core::arm::Arm;

/// Errors of a model on the training windows `sample` (with or without external pushes), beside the encoder zeros of their recordings; none where they are
/// within noise or of no consequence in relation to the motion.
pub fn training_gap<A: Arm<f64, N, P>, const N: usize, const P: usize>(
    context: &DiagnosisContext<A, N, P>,
    sample: &WindowSet<N>,
    model: &Hypothesis<P>,
    zeros: &EncoderZeros<N>,
    seed: u64,
) -> Option<TrainingErrors> {
    let WindowSet { data, measured } = sample;
    let plain = data.predict(&context.arm, model, &data.zero_offsets());
    let floor = floor(context, data, model, &plain, seed).map(f64::sqrt).to_vec();
    let after = rms::<N>(measured, &data.predict(&context.arm, model, &zeros.offsets(data)));
    let motion = rms::<N>(measured, &sample.still());
    stands_out(&after, &floor, &motion, CONSEQUENTIAL_ERROR).then_some(TrainingErrors { after, floor })
}

/// Remark on a gap of the training logs; `rotary` is whether each joint is rotary.
pub fn remark(found: &TrainingErrors, rotary: &[bool]) -> String {
    let text = |(x, rotary): (&f64, &bool)| format!("{:.3} m{}", x * 1e3, if *rotary { "rad" } else { "m" });
    let list = |values: &[f64]| values.iter().zip(rotary).map(text).collect::<Vec<_>>().join(", ");
    format!(
        "the training logs show a gap that the holdout does not: {} by joint, where a perfect model would miss by {}; an effect may act \
         where only they went, or a disturbance in them. Exchange training and holdout logs, or let both hold all motions",
        list(&found.after),
        list(&found.floor)
    )
}
