//! Constants that decide in the diagnosis of a serial arm, each with its unit, its reason, and what other values did.

/// Robust test statistic (squared, sandwich over blocks) that a term needs on training logs and holdout together: five standard deviations on the training logs,
/// which one of 300 candidates exceeds by chance once in 6,000 searches, and three on the holdout. A stop may be met in the holdout only.
pub const SIGNIFICANT: f64 = 34.0;

/// Robust test statistic (squared) that a term needs on the training logs alone: three standard deviations.
pub const NOTICED: f64 = 9.0;

/// Decrease of the training cost, per parameter of a term, from which the term is accepted: twice the logarithm of some hundred candidates.
pub const PRICE: f64 = 12.0;

/// Standard deviations by which the size of a term on the holdout has to differ from zero: one false term in 700 passes by chance, after the training logs let it
/// pass.
pub const HOLDOUT_DEVIATIONS: f64 = 3.0;

/// Share of the residual squares of one joint's holdout rows that a term has to explain.
pub const MATTERS: f64 = 0.1;

/// RMS torque of a term, relative to the torque of the joint it acts on most, below which the term makes no difference to anyone.
pub const CONSEQUENCE: f64 = 0.005;

/// Decrease of the squared distance from the arm file's values above which a term that only restores these values is accepted, besides `RESTORES_EACH` for every
/// parameter of the term. Values as far off as their standard deviations say give a load of four parameters more than the sum once in 2,000 logs.
pub const RESTORES: f64 = 14.0;

/// Further decrease of the squared distance from the arm file's values per parameter of a term that only restores these values, see [`RESTORES`].
pub const RESTORES_EACH: f64 = 1.5;

/// Standard deviations of the arm file within which a term that replaces values of a link keeps what motion does not determine of them.
pub const LOOSE: f64 = 10.0;

/// Two models whose costs differ by less than this part of the cost that the term explains, or by less than `ALIKE_COST`, are look-alikes.
pub const ALIKE: f64 = 0.05;

/// Difference of costs below which two models are look-alikes, see [`ALIKE`]: two standard deviations squared.
pub const ALIKE_COST: f64 = 4.0;

/// Candidates that are fitted after all candidates were tested to first order.
pub const FINALISTS: usize = 8;

/// Iterations of a fit at most; with twelve the answers are the same.
pub const ITERATIONS: usize = 6;

/// Relative decrease of the cost below which a fit ends, see [`ITERATIONS`].
pub const ENOUGH: f64 = 1e-3;

/// Resamples of the blocks from which a probability is taken.
pub const RESAMPLES: usize = 400;

/// Share of the moving joints on which a law has to be found to be one cause of the whole arm.
pub const ARM_WIDE: f64 = 0.5;

/// Laws that are tried on all joints at once, of those that explain most to first order.
pub const ARM_WIDE_FINALISTS: usize = 2;

/// Probability below which a cause is only a candidate.
pub const NAMED: f64 = 0.3;

/// Smallest eigenvalue of the inertia matrix, scaled to unit diagonal, relative to the same of the arm file, below which rollouts answer to torques as no arm
/// does.
pub const CONDITIONED: f64 = 0.2;
