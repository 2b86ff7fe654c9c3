//! What decides in the diagnosis of a serial arm: every constant with its unit, its reason, and what other values did.

/// Robust test statistic (squared, sandwich over blocks) that a term needs on training logs and holdout together: five standard deviations on the
/// former, which one of 300 candidates exceeds by chance once in 6,000 searches, and three on the latter. A stop may be met in the holdout only.
pub const SIGNIFICANT: f64 = 34.0;

/// Part of it that the training logs have to give alone: three standard deviations.
pub const NOTICED: f64 = 9.0;

/// Decrease of the training cost, per parameter, that pays for it: twice the logarithm of some hundred candidates.
pub const PRICE: f64 = 12.0;

/// Standard deviations by which the size that the holdout gives a term differs from zero: one false term in 700 passes by chance, after the
/// training logs let it pass.
pub const HOLDOUT_DEVIATIONS: f64 = 3.0;

/// Share of what one joint's holdout rows leave that a term has to take.
pub const MATTERS: f64 = 0.1;

/// Torque of a term, RMS, beside the torque of the joint it acts on most: below it makes no difference to anyone.
pub const CONSEQUENCE: f64 = 0.005;

/// Decrease of the squared distance from the arm file's values from which a term that only restores these is believed: this much, and
/// `RESTORES_EACH` more for every parameter of the term. Values as far off as their standard deviations say give a load of four parameters more
/// than that once in 2,000 logs.
pub const RESTORES: f64 = 14.0;

/// See [`RESTORES`].
pub const RESTORES_EACH: f64 = 1.5;

/// Standard deviations of the arm file within which a term that replaces values of a link keeps what motion does not tell of them.
pub const LOOSE: f64 = 10.0;

/// Two models whose costs differ by less than this part of what the term explains, or by less than `ALIKE_COST`, are alike.
pub const ALIKE: f64 = 0.05;

/// See [`ALIKE`]; in units of the cost, two standard deviations squared.
pub const ALIKE_COST: f64 = 4.0;

/// Candidates that are fitted after all were tested to first order.
pub const FINALISTS: usize = 8;

/// Iterations of a fit at most, and the relative decrease of the cost that ends it; with twelve the answers are the same.
pub const ITERATIONS: usize = 6;

/// See [`ITERATIONS`].
pub const ENOUGH: f64 = 1e-3;

/// Resamples of the blocks behind a probability.
pub const RESAMPLES: usize = 400;

/// Part of the joints that move on which a law has to be found to be one cause of the whole arm.
pub const ARM_WIDE: f64 = 0.5;

/// Laws that are tried on all joints at once, of those that explain most to first order.
pub const ARM_WIDE_FINALISTS: usize = 2;

/// Probability below which a cause is only a candidate.
pub const NAMED: f64 = 0.3;

/// Smallest eigenvalue of the inertia matrix, scaled to unit diagonal, beside that of the arm file: below, rollouts answer to torques as no arm does.
pub const CONDITIONED: f64 = 0.2;
