//! The model search: one cause after another is added, and causes that have become idle are dropped.
//!
//! After every addition all causes are fitted together again.

use crate::candidates::traces::Traces;
use crate::likelihood::context::{DiagnosisContext, SplitWeighting};
use crate::likelihood::encoder_zero::EncoderZeros;
use crate::likelihood::solve::{Effort, Fit};
use crate::model::hypothesis::{EffectInstance, Hypothesis};
use crate::search::acceptance::{
    CLEAR, FAINTEST, Ground, RELEVANT, TRUST_GAIN, UNEXPLAINED, certain, choose, min_relevance,
};
use crate::search::attribute::{Candidate, SearchNode};
use crate::search::belief::{Cause, name};
use armgap_core::arm::Arm;

/// Result of a model search: the models, the accepted causes and the search nodes.
pub struct Attribution<const N: usize, const P: usize> {
    /// The arm with its parameters re-estimated and no effects.
    pub refit: Fit<P>,
    /// The final model, fitted to the training logs.
    pub model: Fit<P>,
    /// The final model, fitted to the holdout.
    pub on_holdout: Fit<P>,
    /// Fits to the training logs without one of the final model's effects each, in the order of the effects, as
    /// far as pruning made them; those after the last are unknown.
    pub without: Vec<Fit<P>>,
    /// Accepted causes, strongest first.
    pub causes: Vec<Cause>,
    /// All search nodes in order, one per step of the search; at the last one nothing was accepted.
    pub nodes: Vec<SearchNode<N, P>>,
}

impl<const N: usize, const P: usize> Attribution<N, P> {
    /// The effect that the search added to the model of the search node with index `node`; none if it added none.
    pub fn added(&self, node: usize) -> Option<&EffectInstance> {
        added(&self.nodes.iter().collect::<Vec<_>>(), node)
    }

    /// Whether the final model leaves a gap of consequence whose cost exceeds the noise floor by more than the factor `UNEXPLAINED`.
    pub fn is_unexplained(&self) -> bool {
        self.nodes.last().is_some_and(SearchNode::is_unexplained)
    }

    /// Whether the final model leaves a gap as [`Self::is_unexplained`] says, and leaves it in typical windows too: a few windows far above others that are at
    /// the noise floor show pushes, and no lack of the model.
    pub fn leaves_a_remainder(&self) -> bool {
        self.is_unexplained() && !self.nodes.last().is_some_and(SearchNode::is_typically_noise)
    }
}

/// The effect that the search added to the model of the search node with index `node`; none if it added none.
pub(crate) fn added<'a, const N: usize, const P: usize>(
    nodes: &[&'a SearchNode<N, P>],
    node: usize,
) -> Option<&'a EffectInstance> {
    let effects = |i: usize| nodes.get(i).map(|s| &s.settled.hypothesis.effects);
    let before = effects(node)?;
    effects(node + 1)?.iter().find(|e| !before.iter().any(|known| known.same_place(e)))
}

/// State of a model search: accepted causes, current and previous search nodes.
pub(crate) struct ModelSearch<const N: usize, const P: usize> {
    /// Causes accepted so far.
    pub causes: Vec<Cause>,
    /// Search nodes before the current one, in order.
    pub nodes: Vec<SearchNode<N, P>>,
    /// Current search node.
    pub node: SearchNode<N, P>,
    /// Whether friction is regularised in the current model.
    pub regularised: bool,
    /// Whether the widths of friction regularisation have been fitted where no candidate was accepted, which is done once.
    pub regularisation_fitted: bool,
    /// Smallest RMS improvement of the predictions on the holdout for a candidate to be accepted, relative to the motion within the windows.
    pub threshold: f64,
    /// Whether the search has already replaced a cause by a rival candidate, which is done once at most.
    pub turned: bool,
}

impl<const N: usize, const P: usize> ModelSearch<N, P> {
    /// Moves the search on to `node`. Of the nodes before it only the first keeps its traces, for a rival of the first cause.
    fn move_to(&mut self, node: SearchNode<N, P>) {
        let mut before = std::mem::replace(&mut self.node, node);
        if !self.nodes.is_empty() {
            before.traces = None;
        }
        self.nodes.push(before);
    }
}

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> DiagnosisContext<A, N, P> {
    /// Attributes the gap to at most `max_causes` effects, one of which (`known`) may be given beforehand.
    pub fn attribute(&self, max_causes: usize, seed: u64, known: Option<Cause>) -> Attribution<N, P> {
        let start = self.settle_rigid(true).0;
        let scale = self.rough_scale(&start);
        let (settled, mut node) = self.first_node(&start, scale);
        let refit = node.settled.clone();
        let min_relevance = min_relevance(node.relative_error());
        let threshold = self.look_closer(&mut node, settled, min_relevance, CLEAR);
        let (causes, nodes) = (Vec::new(), Vec::new());
        let mut search = ModelSearch {
            causes,
            nodes,
            node,
            regularised: false,
            regularisation_fitted: false,
            threshold,
            turned: false,
        };
        if let Some(cause) = known.filter(|_| max_causes > 0) {
            let with = search.node.settled.hypothesis.with(cause.effect);
            let fit = self.problem(&search.node.weights.training).solve(&with, Effort::FULL);
            search.causes.push(cause);
            self.advance(&mut search, &fit, min_relevance);
        }
        self.pursue(&mut search, min_relevance, max_causes, seed);
        let ModelSearch { mut causes, mut nodes, node, .. } = search;
        let mut model = node.settled.clone();
        let without = self.prune(&mut model, &mut causes, &node);
        for earlier in &mut nodes {
            earlier.traces = None;
        }
        let on_holdout = self.apply_dispersion_factor(&mut model, &node.weights);
        nodes.push(SearchNode { traces: None, ..node });
        refresh(&model, &mut causes);
        Attribution { refit, model, on_holdout, without, causes, nodes }
    }

    /// The first search node, around the arm with its parameters re-estimated, with or without encoder zeros that differ between recordings.
    ///
    /// Encoder zeros that differ between recordings also take up the mean error that a large unmodelled effect makes in a recording; other effects
    /// would then be fitted to the rest. So the first cause is sought with such zeros only where the zeros explain more than the cause would, or
    /// where no cause is found without such zeros; later nodes always have them.
    fn first_node(
        &self,
        start: &Hypothesis<P>,
        scale: [f64; N],
    ) -> ((Fit<P>, SplitWeighting<N>), SearchNode<N, P>) {
        let with_zeros = |known: Option<&Traces<N>>| {
            let settled = self.settle(start, scale);
            (settled.clone(), self.node_around(settled, RELEVANT, known))
        };
        if !EncoderZeros::can_be_told_from(&self.training.data) {
            return with_zeros(None);
        }
        let settled = self.settle_without_zeros(start, scale);
        let node = self.node_around(settled.clone(), RELEVANT, None);
        // Under the node's weights, which its best candidate makes: under those of an arm that misses an effect, the zeros do as well as the effect.
        let explains_more = |(choice, _): (usize, Ground)| {
            let with_cause: f64 = node.candidates[choice].training.iter().sum();
            with_cause < self.cost_with_zeros(&settled.0, &node.weights.training)
        };
        if choose(&node, false, min_relevance(node.relative_error())).is_some_and(explains_more) {
            (settled, node)
        } else {
            with_zeros(node.traces.as_deref())
        }
    }

    /// Adds one cause after another until no candidate is accepted.
    pub(crate) fn pursue(
        &self,
        search: &mut ModelSearch<N, P>,
        min_relevance: f64,
        max_causes: usize,
        seed: u64,
    ) {
        loop {
            // A cause accepted in place of a better rival leaves a gap to which further effects would be fitted.
            if let Some(other) = self.reconsidered(search, false, min_relevance, max_causes, seed) {
                *search = other;
                return;
            }
            if search.causes.len() >= max_causes {
                break;
            }
            let chosen = choose(&search.node, search.regularised, search.threshold);
            let has_room = search.causes.len() + 2 <= max_causes;
            if let Some(pair) = has_room.then(|| self.better_pair(search, chosen, seed)).flatten() {
                self.accept_pair(search, &pair, min_relevance, seed);
                continue;
            }
            let node = &search.node;
            let next = if let Some((choice, ground)) = chosen {
                let chosen = &node.candidates[choice];
                if chosen.effect.is_some() {
                    search.causes.push(name(node, choice, ground, seed));
                    chosen.fit.clone()
                } else {
                    search.regularised = true;
                    self.with_widths_refined(node, chosen.clone()).fit
                }
            } else {
                let wanted = !search.regularisation_fitted;
                let Some(fit) = wanted.then(|| self.regularisation(node)).flatten() else { break };
                (search.regularised, search.regularisation_fitted) = (true, true);
                fit
            };
            self.advance(search, &next, min_relevance);
        }
        if let Some(other) = self.reconsidered(search, true, min_relevance, max_causes, seed) {
            *search = other;
        }
    }

    /// Moves a search on to the node around the fit `next`.
    pub(crate) fn advance(&self, search: &mut ModelSearch<N, P>, next: &Fit<P>, min_relevance: f64) {
        let settled = self.settle(&next.hypothesis, search.node.weights.training.scale);
        let node = self.node_around(settled.clone(), min_relevance, search.node.traces.as_deref());
        search.move_to(node);
        search.threshold = self.look_closer(&mut search.node, settled, min_relevance, UNEXPLAINED);
    }

    /// Repeats a node with the threshold `FAINTEST` where its gap is too small to matter by itself and yet exceeds the noise floor by the factor
    /// `clear`; returns the smallest RMS improvement that counts, relative to the motion. `settled` is the fit that `node` was made around.
    fn look_closer(
        &self,
        node: &mut SearchNode<N, P>,
        settled: (Fit<P>, SplitWeighting<N>),
        min_relevance: f64,
        clear: f64,
    ) -> f64 {
        if !(FAINTEST..=min_relevance).contains(&node.relative_error()) || node.excess() <= clear {
            return min_relevance;
        }
        *node = self.node_around(settled, FAINTEST, node.traces.as_deref());
        FAINTEST
    }

    /// Drops causes that the other causes, or regularised friction, have made idle; returns the fits without each of the others, as far as they were
    /// needed.
    pub(crate) fn prune(
        &self,
        model: &mut Fit<P>,
        causes: &mut Vec<Cause>,
        node: &SearchNode<N, P>,
    ) -> Vec<Fit<P>> {
        let (mut i, mut kept) = (0, Vec::new());
        while (causes.len() > 1 || model.hypothesis.is_rounded()) && i < causes.len() {
            let full = self.judged(node, model.clone(), None);
            let mut without = model.hypothesis.clone();
            without.effects.remove(i);
            let fit = self.problem(&node.weights.training).solve(&without, Effort::FULL);
            let reduced = self.judged(node, fit, None);
            let idle = full.z_over(&reduced) < certain(Some(&model.hypothesis.effects[i]))
                && !node.takes_outliers(&full, &reduced)
                && reduced.fit.prior_cost - full.fit.prior_cost < TRUST_GAIN;
            if idle {
                *model = reduced.fit;
                causes.remove(i);
                (i, kept) = (0, Vec::new());
            } else {
                kept.push(reduced.fit);
                i += 1;
            }
        }
        kept
    }

    /// A fit as a candidate with the costs of all windows under the weights of `node`, for comparison with other fits.
    fn judged(&self, node: &SearchNode<N, P>, fit: Fit<P>, effect: Option<EffectInstance>) -> Candidate<P> {
        let training = self.problem(&node.weights.training).window_costs(&fit.hypothesis);
        let (holdout, error) = self.judged_on_holdout(&node.weights, &fit);
        Candidate { effect, size: 0.0, fit, training, holdout, error }
    }
}

/// Updates the values and standard deviations of causes from the final model, and sorts the causes by relevance, strongest first.
pub(crate) fn refresh<const P: usize>(model: &Fit<P>, causes: &mut [Cause]) {
    for cause in causes.iter_mut() {
        let mut first = P;
        for effect in &model.hypothesis.effects {
            if effect.same_place(&cause.effect) {
                cause.effect = *effect;
                // A value that the training windows do not show may be known from the holdout: the smaller standard deviation is kept.
                let known = cause.sigma.iter().copied().chain(std::iter::repeat(f64::INFINITY));
                let fitted = (first..first + effect.len()).map(|i| model.sigma(i));
                cause.sigma = fitted.zip(known).map(|(fitted, known)| fitted.min(known)).collect();
            }
            first += effect.len();
        }
    }
    causes.sort_by(|a, b| b.relevance.total_cmp(&a.relevance));
}
