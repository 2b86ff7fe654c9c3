//! Two effects that explain about the same, each under the weights it deserves.
//!
//! Windows are weighed, and their starts fitted, around the best contender. That flatters it: a start that had to be moved far for it
//! is trusted less from then on, and lets the rival's advantage there pass. Of two that are close, each is therefore judged under
//! weights made around either, and the one with the clearer win in its own has the last word.

use crate::attribute::{Contender, Stage};
use crate::decide::MATTERS;
use crate::equivalent;
use crate::model::Hypothesis;
use crate::solve::Effort;
use crate::study::Study;
use armgap_core::arm::Arm;

/// A rival that is worse by less than this, in standard errors of the mean advantage per window, is close.
const CLOSE: f64 = 3.0;

impl<A: Arm<f64, N, P>, const N: usize, const P: usize> Study<A, N, P> {
    /// The stage under the weights of its best contender or of the best one's rival, whichever wins more clearly there.
    pub(crate) fn duel(&self, stage: Stage<N, P>) -> Stage<N, P> {
        let Some((best, rival)) = close_pair(&stage) else { return stage };
        let current = stage.settled.hypothesis.clone();
        let own = self.around(&current, &stage, best);
        let other = self.around(&current, &stage, rival);
        if lead(&other) > lead(&own) { other } else { own }
    }

    /// The same finalists under weights made around one of them.
    fn around(&self, current: &Hypothesis<P>, stage: &Stage<N, P>, one: usize) -> Stage<N, P> {
        let chosen = &stage.contenders[one].fit.hypothesis;
        let (_, weights) = self.settle(chosen, stage.weights.training.scale);
        let starts = stage.contenders.iter().map(|c| c.fit.hypothesis.clone()).collect();
        let contenders = self.contend(&weights, current, starts, Effort::FULL, &[]);
        let base = self.contender(&weights, current, current.effects.len(), Effort::FULL, &[]);
        let (settled, field) = (stage.settled.clone(), stage.field.clone());
        let (floor, motion) = (self.floor(&weights), self.motion(&weights));
        Stage { settled, base, contenders, field, screened: Vec::new(), weights, floor, motion }
    }
}

/// The best contender and the first that is close to it, if motion can tell their effects apart.
fn close_pair<const N: usize, const P: usize>(stage: &Stage<N, P>) -> Option<(usize, usize)> {
    let (best, others) = stage.contenders.split_first()?;
    if stage.share(best) < MATTERS {
        return None;
    }
    let rival = others.iter().position(|c| is_close(stage, best, c))?;
    Some((0, rival + 1))
}

fn is_close<const N: usize, const P: usize>(
    stage: &Stage<N, P>,
    best: &Contender<P>,
    other: &Contender<P>,
) -> bool {
    let (Some(a), Some(b)) = (best.effect, other.effect) else { return false };
    let alike = stage.is_alike(best, other) || best.z_over(other) < CLOSE;
    alike && other.z_over(&stage.base) > CLOSE && !equivalent::are(&a, &b, N)
}

/// By how much the best contender of a stage leads, in standard errors.
fn lead<const N: usize, const P: usize>(stage: &Stage<N, P>) -> f64 {
    match &stage.contenders[..] {
        [best, second, ..] => best.z_over(second),
        _ => 0.0,
    }
}
