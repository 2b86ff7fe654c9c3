//! Thresholds and settings of the diagnosis of a serial arm, each with its unit and reason. A term is an addition to the nominal model: an effect on
//! a joint, a payload, a tilt of the base, or a changed link, transmission or controller setting.

/// Squared test statistic (estimated size over its standard deviation, robust to correlated residuals) above which a term of the model is
/// significant, summed over training logs and holdout: five standard deviations on the training logs, which one of 300 candidates exceeds by chance
/// once in 6,000 searches, and three on the holdout. The sum also accepts an effect that acts mostly in the holdout, such as a joint limit.
pub const SIGNIFICANT: f64 = 34.0;

/// Squared test statistic (estimated size over its standard deviation, robust to correlated residuals) that a term of the model needs on the training
/// logs alone: three standard deviations. A candidate with more is not called absent.
pub const NOTICED: f64 = 9.0;

/// Twice the logarithm of the likelihood ratio on the training logs, per parameter of a term of the model, from which the term is accepted: twice
/// the natural logarithm of the number of candidates, some 400. A table, whose classes are not chosen among candidates one by one, pays this once,
/// and two more per class.
pub const PRICE: f64 = 12.0;

/// Number of standard deviations by which the size of a term of the model, estimated on the holdout, has to exceed zero: of 700 false terms that the
/// training logs accept, one passes by chance.
pub const HOLDOUT_DEVIATIONS: f64 = 3.0;

/// Number of standard deviations by which the size of a term that is computed from logged torques, estimated with an instrument, has to exceed zero. On
/// eight of nine simulated elastic joints it is 3.8 to 17 and on one 2.7; on 24 joints without elasticity a computation of its own had 3.4 at most in size.
pub const INSTRUMENTED_DEVIATIONS: f64 = 3.5;

/// Largest difference between the sizes of such a term with and without an instrument, relative to the latter: 0.44 at most on the nine elastic joints, and
/// 3.9 on a joint next to an elastic one.
pub const INSTRUMENTED_DIFFERENCE: f64 = 0.5;

/// Number of stretches of two seconds, counted by their shares of the decrease of the cost by a law, up to which the law acts once.
pub const AN_EVENT: f64 = 1.5;

/// Part of the cost of the one event in which a law acts that the law has to remove: 0.84 for a controller's answer to a push that passes for a saturation,
/// 0.9999 for a saturation that is reached once.
pub const WHOLE_EVENT: f64 = 0.9;

/// Smallest share, 0 to 1, of the squared holdout residuals of at least one joint that a term of the model has to remove to be accepted.
pub const MATTERS: f64 = 0.1;

/// Smallest RMS torque of a term of the model where it acts, relative to the RMS torque of the joint that it acts on most, at which the term is
/// accepted. Of the RMS over all rows, Stribeck friction that left a joint's predictions 30 noise floors off had 0.004.
pub const CONSEQUENCE: f64 = 0.005;

/// RMS prediction error of a serial arm, relative to the RMS motion within a window, below which a gap is of no consequence: what small random torques
/// on geared joints leave, besides encoder noise. Torques of 0.4 to 1 % of each joint's left 0.006 to 0.019 on twelve simulated arms without an effect.
pub const CONSEQUENTIAL_SERIAL_ERROR: f64 = 0.02;

/// Least ratio of an error of predictions on the training logs to that on the holdout, both relative to the motion, at which only the training logs show a
/// gap. At 0 three of 70 simulated sets of logs with random torques alike in both were said to.
pub const ONLY_THERE: f64 = 2.0;

/// Least deflection of presliding friction (amplitude over stiffness) in encoder steps: a smaller one is dry friction to these logs. A fit to a friction
/// that grows with the root of the speed gave a sixth of a step, with a probability of 0.97.
pub const DEFLECTION_STEPS: f64 = 2.0;

/// Decrease of the parameters' squared distance from the arm file's values, counted in standard deviations, above which a term that only brings the
/// parameters back to these values is accepted, plus [`RESTORES_EACH`] for every parameter of the term. Where the arm file's values are as uncertain
/// as their standard deviations say, a payload of four parameters exceeds `RESTORES + 4 RESTORES_EACH` by chance once in 2,000 logs.
pub const RESTORES: f64 = 14.0;

/// Further decrease of the parameters' squared distance from the arm file's values, per parameter of a term that only brings the parameters back to
/// these values, see [`RESTORES`].
pub const RESTORES_EACH: f64 = 1.5;

/// Prior standard deviation of the inertial parameters of a link whose nominal values are tested as wrong, as a multiple of the arm file's standard
/// deviation: wide, and yet narrow enough to hold the parameters that motion does not determine near the arm file's values.
pub const LOOSE: f64 = 10.0;

/// Excess of a model's cost after one of its terms has been replaced by another term, as a share of the cost that the replaced term explains, below
/// which the other term is a look-alike: it explains the logs as well. An excess below [`ALIKE_COST`] makes a look-alike in any case.
pub const ALIKE: f64 = 0.05;

/// Difference of the costs (weighted squared residuals) of two models that differ in one term, below which the one term is a look-alike of the other,
/// see [`ALIKE`]: two standard deviations, squared.
pub const ALIKE_COST: f64 = 4.0;

/// Effects that differ from dry friction near reversals alone, as does what a low-pass of positions and torques makes of dry friction: they are no
/// candidates where positions are low-passed. Learnt from half of a low-passed log of a UR10, presliding was named with 0.70.
pub const ROUNDED_BY_LOW_PASS: [&str; 2] = ["stribeck", "presliding"];

/// Number of candidate terms, the best by first-order tests, that are fitted in each step of the model search.
pub const TERM_FINALISTS: usize = 8;

/// Number of tables of torque over one variable of the motion, the best by first-order tests, that are fitted as rivals of a cause.
pub const RIVAL_FINALISTS: usize = 3;

/// Largest number of laws without a name, tables over one variable each, that results list.
pub const MOST_TABLES: usize = 3;

/// Exponent, in the odds that a cause is no substitute for something else, of the squared holdout residuals that a table in the cause's place leaves,
/// relative to those that the cause leaves; as for arms in a plane (`search::evidence`).
pub const RIVAL_POWER: i32 = 4;

/// Largest number of Gauss-Newton iterations in which the parameters of a model's terms are fitted; twelve iterations give the same diagnoses.
pub const MAX_TERM_ITERATIONS: usize = 6;

/// Relative decrease of the cost in one iteration below which the fit of a model's terms ends, see [`MAX_TERM_ITERATIONS`].
pub const ENOUGH: f64 = 1e-3;

/// Number of bootstrap resamples of the one-second blocks of the logs from which the probability of a cause is taken.
pub const RESAMPLES: usize = 400;

/// Smallest share, 0 to 1, of the moving joints on which a law has to be significant to be reported as one cause of the whole arm.
pub const ARM_WIDE: f64 = 0.5;

/// Number of laws that are fitted to all joints at once in one step of the model search: those that explain most to first order.
pub const ARM_WIDE_FINALISTS: usize = 2;

/// Number of laws that are fitted to all joints at once as rivals of a cause on several joints: those that explain most to first order.
pub const ARM_WIDE_RIVALS: usize = 4;

/// Probability below which a cause is reported as a mere candidate and not named.
pub const NAMED: f64 = 0.3;

/// Smallest eigenvalue of the inertia matrix, scaled to unit diagonal, relative to that with the arm file's parameters, below which parameters are
/// not used for simulation: no real arm has such an inertia matrix.
pub const CONDITIONED: f64 = 0.2;
