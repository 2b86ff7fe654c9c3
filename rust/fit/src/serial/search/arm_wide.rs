//! One law on several joints at once, found as one cause in one step of the model search.
//!
//! Friction laws, delays and lags usually act on every joint. The candidate has an amplitude per joint, or one value for all joints where the law is
//! a delay or a gain, and is judged as a term on one joint is, by its number of parameters. The candidate has to be significant on each of its
//! joints, and on at least half of the moving joints. In addition, what it explains beyond the same law on a single joint, the one where the law
//! explains most, has to be accepted by itself.

use crate::serial::constants::{ARM_WIDE, CONSEQUENCE, NOTICED, PRICE};
use crate::serial::search::Search;
use crate::serial::search::evidence::consequence;
use crate::serial::search::fitting::Fitted;
use crate::serial::term::Term;
use crate::serial::weak_form::rows::Regression;

/// Smallest number of joints that a law has to be found on to be one cause of the whole arm; where fewer joints move, all moving joints.
const FEWEST_JOINTS: usize = 3;

impl Search<'_> {
    /// Models with one more law on several joints at once, fitted and accepted; tried are the `most` laws that promise most in the first-order
    /// tests `screened`.
    pub(in crate::serial) fn on_several_joints(
        &self,
        regression: &Regression,
        model: &Fitted,
        screened: &[(Term, f64)],
        most: usize,
    ) -> Vec<Fitted> {
        let mut laws: Vec<(Vec<Term>, f64)> = Vec::new();
        let names = screened.iter().filter(|(term, _)| term.is_of_a_joint()).map(|(term, _)| term);
        for first in names {
            if laws.iter().any(|(terms, _)| terms[0].name() == first.name()) {
                continue;
            }
            let alike: Vec<&(Term, f64)> =
                screened.iter().filter(|(term, _)| self.is_same_law(term, first)).collect();
            let gain: f64 = alike.iter().map(|(_, gain)| gain).sum();
            laws.push((alike.iter().map(|(term, _)| term.clone()).collect(), gain));
        }
        let degrees = |terms: &[Term]| terms.iter().map(|term| term.degrees).sum::<f64>();
        laws.retain(|(terms, gain)| terms.len() >= self.fewest() && *gain > PRICE + 2.0 * degrees(terms));
        laws.sort_by(|a, b| (b.1 - 2.0 * degrees(&b.0)).total_cmp(&(a.1 - 2.0 * degrees(&a.0))));
        let finalists = laws.into_iter().take(most);
        finalists.filter_map(|(terms, _)| self.one_cause(regression, model, terms)).collect()
    }

    /// Whether two terms are the same law with parameters in the same units, on any joints.
    fn is_same_law(&self, a: &Term, b: &Term) -> bool {
        let units = |term: &Term| -> Vec<&'static str> {
            term.parameters(self.rotary_of(term)).iter().map(|p| p.unit).collect()
        };
        a.is_of_a_joint() && a.name() == b.name() && units(a) == units(b)
    }

    /// Smallest number of joints that a law has to be found on to be one cause of the whole arm, from the number of joints that move.
    fn fewest(&self) -> usize {
        let moving = self.training.rows().joints.iter().filter(|r| !r.y.is_empty()).count();
        let half = (ARM_WIDE * moving as f64).ceil() as usize;
        half.max(FEWEST_JOINTS.min(moving)).max(2)
    }

    /// The model with one law (`terms`, joint by joint) added on all joints where it is significant, if accepted as one cause.
    fn one_cause(&self, regression: &Regression, model: &Fitted, terms: Vec<Term>) -> Option<Fitted> {
        let last = model.terms.len();
        let with = |term: Term| {
            let mut terms = model.terms.clone();
            terms.push(term);
            self.fit(regression, terms, &model.estimate.theta)
        };
        let has_common = terms[0].is_delay() || terms[0].is_gain();
        let all = with(Term::on_joints(terms));
        let noticed = self.noticed(regression, model, &all, last);
        if noticed.len() < self.fewest() {
            return None;
        }
        let everywhere = has_common.then(|| self.on_every_joint(model, &noticed));
        let is_kept = noticed.len() == all.terms[last].joints().len();
        let mut best = if is_kept { all } else { with(Term::on_joints(noticed)) };
        if let Some(everywhere) = everywhere {
            let common = with(everywhere);
            if common.total() < best.total() {
                best = common;
            }
        }
        let is_noticed = self.noticed(regression, model, &best, last).len() >= self.fewest();
        let is_accepted = is_noticed
            && self.evidence(regression, model, &best, last).is_accepted()
            && self.is_more_than_on_one_joint(regression, model, &best);
        is_accepted.then_some(best)
    }

    /// The law of the terms `noticed` with one value for all joints, the mean over `noticed`, on every moving joint on which the model does not have
    /// this law yet.
    fn on_every_joint(&self, model: &Fitted, noticed: &[Term]) -> Term {
        let rows = &self.training.rows().joints;
        let moves = |term: &Term| {
            term.joint().is_some_and(|joint| !rows[joint - 1].y.is_empty())
                && !model.terms.iter().any(|known| known.same_place(term))
        };
        let alike = self.candidates.iter().filter_map(|group| group.first());
        let members =
            alike.filter(|term| self.is_same_law(term, &noticed[0]) && moves(term)).cloned().collect();
        Term::common(members).with(Term::common(noticed.to_vec()).p)
    }

    /// Those members, one for each joint, of the term of index `last` in the model `with` that are significant on the training logs, have a relative
    /// RMS torque above [`CONSEQUENCE`], and on whose joint this model has a lower holdout cost than the model `without` the term.
    fn noticed(&self, regression: &Regression, without: &Fitted, with: &Fitted, last: usize) -> Vec<Term> {
        let held = |set: &Fitted, joint: usize| set.costs[1][joint - 1].iter().sum::<f64>();
        let is_noticed = |member: &Term| {
            let signal = self.training.signal(member, &with.estimate.theta);
            let column = std::slice::from_ref(&signal);
            let statistic = regression.score(&with.estimate, column, &[0.0]).map_or(0.0, |score| {
                1.0 / regression.sandwich(&with.estimate.residual, column, &score)[(0, 0)]
                    .max(f64::MIN_POSITIVE)
            });
            let joint = member.joint().unwrap_or(1);
            statistic > NOTICED
                && consequence(self.training.rows(), &signal) > CONSEQUENCE
                && held(with, joint) < held(without, joint)
        };
        with.terms[last].members().into_iter().filter(is_noticed).collect()
    }

    /// Whether the last term of the model `with`, on its joints other than the one where its law explains most, is accepted in addition to the same
    /// law on that joint.
    fn is_more_than_on_one_joint(&self, regression: &Regression, model: &Fitted, with: &Fitted) -> bool {
        let last = model.terms.len();
        let fell = |term: &Term| {
            let joint = term.joint().unwrap_or(1) - 1;
            let cost = |set: &Fitted| set.costs.iter().flat_map(|sets| &sets[joint]).sum::<f64>();
            cost(model) - cost(with)
        };
        let mut members = with.terms[last].members();
        let Some(strongest) =
            (0..members.len()).max_by(|a, b| fell(&members[*a]).total_cmp(&fell(&members[*b])))
        else {
            return false;
        };
        let mut terms = model.terms.clone();
        terms.push(members.swap_remove(strongest));
        let alone = self.fit(regression, terms.clone(), &model.estimate.theta);
        let common = with.terms[last].has_common_value();
        terms.push(if common { Term::common(members) } else { Term::on_joints(members) });
        let apart = Fitted { terms, ..with.clone() };
        self.evidence(regression, &alone, &apart, last + 1).is_accepted()
    }

    /// The terms of a model with `added` as a further one; terms of one law on enough joints to be a cause of the whole arm become one term.
    pub(in crate::serial) fn joined(&self, terms: Vec<Term>, added: Term) -> Vec<Term> {
        let first = added.members().swap_remove(0);
        let (same, mut joined): (Vec<Term>, Vec<Term>) =
            terms.into_iter().partition(|term| self.is_same_law(&term.members()[0], &first));
        let members: Vec<Term> = same.iter().flat_map(Term::members).chain(added.members()).collect();
        if !same.is_empty() && members.len() >= self.fewest() {
            joined.push(Term::on_joints(members));
        } else {
            joined.extend(same);
            joined.push(added);
        }
        joined
    }
}
