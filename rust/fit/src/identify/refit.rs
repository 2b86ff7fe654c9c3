//! The arm's parameters re-estimated without any effect, under the arm file's standard deviations as prior.
//!
//! The plausibility checks of the input compare a log as it stands with the log after correction of a defect. The fit also starts from parameters
//! that a linear regression finds (`DiagnosisContext::settle_rigid`), as an arm with an unknown load or a wrong arm file requires.

use crate::diagnose::Request;
use crate::log::input::{DiagnoseError, LogData, Options, validate};
use crate::model::arm::{ArmDescription, WithArm};
use crate::model::hypothesis::Hypothesis;
use crate::numeric::products::rms;
use crate::progress::{Observer, guarded};
use armgap_core::arm::Arm;

/// Re-estimated parameters of an arm without effects, with prediction errors on the holdout.
#[derive(Debug, Clone)]
pub struct Refit {
    /// Re-estimated parameters of the arm, SI.
    pub theta: Vec<f64>,
    /// Standard deviations of the re-estimated parameters.
    pub sigma: Vec<f64>,
    /// RMS prediction error on the holdout per joint with the arm file as it is, rad or m.
    pub before: Vec<f64>,
    /// RMS prediction error on the holdout per joint with the re-estimated parameters, rad or m.
    pub refit: Vec<f64>,
    /// RMS displacement within a window per joint, rad or m: the error of predicting no motion.
    pub motion: Vec<f64>,
}

/// Re-estimates the arm's parameters twice, with the arm file's values and with `start` as initial values; returns the fit that predicts the training
/// logs better.
///
/// # Errors
///
/// The errors of `diagnose`.
pub fn refit(
    arm: &ArmDescription,
    start: &[f64],
    training: &[LogData<'_>],
    holdout: &[LogData<'_>],
    options: &Options,
    observer: &Observer,
) -> Result<Refit, DiagnoseError> {
    validate(arm.kind.joints(), training, holdout, options)?;
    let options = Options { start: Some(start.to_vec()), ..options.clone() };
    let work = RigidFit(Request { arm, training, holdout, options: &options, observer });
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
        // Not from a fit without robust weights, which explains torques of a wrong unit that are mostly noise.
        let (_, fit) = context.settle_rigid(false);
        let missed = |hypothesis: &Hypothesis<P>| context.holdout.errors(&context.arm, hypothesis);
        Ok(Refit {
            theta: fit.hypothesis.theta.to_vec(),
            sigma: (0..P).map(|i| fit.sigma(i)).collect(),
            before: missed(&Hypothesis::rigid(theta)),
            refit: missed(&fit.hypothesis),
            motion: rms::<N>(&context.holdout.measured, &context.holdout.still()),
        })
    }
}
