//! Model search: which candidate effects are causes of the gap.
//!
//! * `acceptance`: acceptance criteria of a cause.
//! * `attribute`: one search node, candidates fitted in full under common weights.
//! * `belief`: selection probability of a cause.
//! * `crosswise`: interleaved cross-validation, logs cut into stretches of which every other one is fitted to and the rest judged on.
//! * `evidence`: evidence for each cause in the final model, and the cause's probability.
//! * `friction_regularisation`: width over which the sign of friction is regularised, fitted as a nuisance.
//! * `model_search`: stepwise selection: one cause is added after another, and causes that become idle are dropped.
//! * `pairs`: two effects accepted at once, where neither of them is the best one alone.
//! * `reconsider`: replacement of a cause by a rival candidate that explains the windows better once the other causes are known.
//! * `rivals`: close candidates compared in pairs, equivalent effects, and a table over one variable of the motion as the rival of a named cause.
//! * `size_certainty`: whether the size of a cause is told from none, beside those of effects that are not in the arm.

pub mod acceptance;
pub mod attribute;
pub mod belief;
pub(crate) mod crosswise;
pub mod evidence;
pub(crate) mod friction_regularisation;
pub mod model_search;
pub(crate) mod pairs;
pub(crate) mod reconsider;
pub mod rivals;
mod size_certainty;
