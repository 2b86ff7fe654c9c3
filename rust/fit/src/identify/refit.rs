//! The arm's parameters estimated again without any effect, under the arm file's sigmas as prior.
//!
//! What the plausibility checks of the input compare: a log read as it stands, and read with a defect corrected.

use crate::diagnose::Request;
use crate::log::input::{DiagnoseError, LogData, Options, validate};
use crate::model::arm::{ArmDescription, WithArm};
use crate::model::hypothesis::Hypothesis;
use crate::progress::{Observer, guarded};
use crate::result::gap::rms;
use armgap_core::arm::Arm;

/// An arm without effects, fitted to training logs and judged on the holdout.
#[derive(Debug, Clone)]
pub struct Refit {
    /// Parameters.
    pub theta: Vec<f64>,
    /// Their standard deviations.
    pub sigma: Vec<f64>,
    /// RMS prediction error on the holdout per joint, the arm file as it is, rad or m.
    pub before: Vec<f64>,
    /// The RMS prediction error with the parameters estimated again.
    pub refit: Vec<f64>,
    /// RMS displacement within a window per joint: what predicting no motion would leave.
    pub motion: Vec<f64>,
}

/// Estimates the arm's parameters again.
///
/// # Errors
///
/// As `diagnose`.
pub fn refit(
    arm: &ArmDescription,
    training: &[LogData<'_>],
    holdout: &[LogData<'_>],
    options: &Options,
    observer: &Observer,
) -> Result<Refit, DiagnoseError> {
    validate(arm.kind.joints(), training, holdout, options)?;
    let work = RigidFit(Request { arm, training, holdout, options, observer });
    let ended = guarded(|| arm.dispatch(work)).ok_or(DiagnoseError::Stopped)?;
    ended.ok_or(DiagnoseError::Parameters(arm.kind))?
}

struct RigidFit<'a>(Request<'a>);

impl WithArm for RigidFit<'_> {
    type Output = Result<Refit, DiagnoseError>;

    fn call<A: Arm<f64, N, P>, const N: usize, const P: usize, const R: usize>(
        self,
        arm: A,
        theta: [f64; P],
    ) -> Self::Output {
        let Self(request) = self;
        let context = request.context::<A, N, P>(arm, theta, request.training, request.holdout)?;
        let nominal = Hypothesis::rigid(theta);
        let (fit, _) = context.settle(&nominal, context.rough_scale(&nominal));
        let (data, measured) = (&context.holdout.data, &context.holdout.measured);
        let missed = |hypothesis: &Hypothesis<P>| {
            rms::<N>(measured, &data.predict(&context.arm, hypothesis, &data.zero_offsets()))
        };
        Ok(Refit {
            theta: fit.hypothesis.theta.to_vec(),
            sigma: (0..P).map(|i| fit.sigma(i)).collect(),
            before: missed(&nominal),
            refit: missed(&fit.hypothesis),
            motion: rms::<N>(measured, &context.holdout.still()),
        })
    }
}
