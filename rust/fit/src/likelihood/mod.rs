//! Likelihood of the windows under a hypothesis, and the hypothesis's values of largest likelihood.
//!
//! * `context`: arm, prior, scales, training and holdout windows, and their weighting.
//! * `covariance`: covariance of fitted values by the jackknife over blocks of windows.
//! * `dispersion`: dispersion factor between fits to different motions.
//! * `holdout`: cost of a fit on the holdout, compared with the cost of noise alone and of predicting no motion.
//! * `horizon`: standard deviations widened by the bias that the change of values with the horizon tells.
//! * `jacobian`: Jacobian of the predictions, with columns reused between neighbouring points.
//! * `scale`: typical sizes of quantities on an arm and its logs.
//! * `settle`: re-weighting until the scales are those of the residual.
//! * `solve`: damped Gauss-Newton over the arm's parameters and effects together.
//! * `weighting`: weights of residuals: initial states projected out, robust weights of windows.

pub mod context;
pub mod covariance;
pub(crate) mod dispersion;
pub mod encoder_zero;
pub mod holdout;
pub(crate) mod horizon;
pub(crate) mod jacobian;
pub mod scale;
pub(crate) mod settle;
pub mod solve;
pub mod weighting;
