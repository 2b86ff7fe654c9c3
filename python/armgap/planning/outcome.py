"""Expected evidence of a motion for one of two models, against the thresholds of `armgap.diagnose`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Outcome", "certainty", "settled"]

Array = NDArray[np.float64]

#: Thresholds of a diagnosis: cost of a gap over the floor's, part of the excess that an effect removes, and standard errors of the
#: windows' mean advantage, for an effect of three values (`rust/fit/src/search/acceptance.rs`): what decides for it decides for simpler ones.
ABOVE_FLOOR, MATTERS, CERTAIN = 1.25, 0.1, 3.5
#: Standard errors of the windows' mean advantage that a diagnosis needs on the holdout alone.
HELD_CERTAIN = 1.0
#: Change of a parameter of the arm towards its prior, in standard deviations, from which a diagnosis names an effect without a gap.
TRUST_SIGMAS = 4.0
#: Standard deviations of evidence above a decision's threshold from which more evidence does not count in the search.
_SUFFICIENT_SIGMAS = 3.0
#: Evidence that the search for a motion aims at, as a multiple of sufficient evidence, as an effect may be smaller than assumed.
AIM = 100.0
#: Constant `G` of a motion's merit ``log(1 + G x)/log(1 + G)`` for evidence `x`, 0 to 1: the smaller, the more the weakest condition counts.
_MERIT_CONSTANT = 1e4


class Outcome(NamedTuple):
    """Expected evidence of a motion for a pair of models, one entry per size of the effect.

    Attributes
    ----------
    fitted, plain : ndarray
        Expected log-likelihood ratio over the windows that a diagnosis fits to, with the rival fitted, and over all windows against the absence of
        the effect, with nothing fitted.
    above : ndarray
        Cost of the fitted rival above the noise, over the threshold of a diagnosis; the smaller of the values for training and holdout
        windows.
    certain : ndarray
        Mean advantage of a window, in standard errors; less if the holdout windows alone do not reach their threshold.
    prior : ndarray
        Part of `fitted` from the prior: the rival needs implausible parameters of the arm.
    weight : ndarray
        Weights of the sizes, with sum 1.
    spread : float
        Standard deviation of `above` from the noise alone.
    """

    fitted: Array
    plain: Array
    above: Array
    certain: Array
    prior: Array
    weight: Array
    spread: float

    @property
    def expected(self) -> float:
        """Expected log-likelihood ratio of the models, mean over the sizes of the effect."""
        return float(self.weight @ self.fitted)

    def settled(self, threshold: float) -> float:
        """Return the probability that a diagnosis decides the question, mean over the sizes of the effect."""
        likely = [settled(x, threshold) for x in self.fitted]
        high = [_normal((x - 1.0) / self.spread) for x in self.above]
        common = [_normal(x - CERTAIN) for x in self.certain]
        by_motion = np.min([likely, high, common], axis=0)
        by_prior = np.minimum(likely, [_normal(math.sqrt(2.0 * x) - TRUST_SIGMAS) for x in self.prior])
        return float(self.weight @ np.maximum(by_motion, by_prior))

    def merit(self, threshold: float) -> float:
        """Return how nearly the conditions of a decision are met, from 0 to 1, on a logarithmic scale, mean over the sizes of the effect."""
        enough = _enough(threshold)
        parts = (
            self.fitted / (AIM * enough),
            self.above / (AIM * (1.0 + _SUFFICIENT_SIGMAS * self.spread)),
            self.certain / (CERTAIN + _SUFFICIENT_SIGMAS),
        )
        least = np.clip(np.min(parts, axis=0), 0.0, 1.0)
        return float(self.weight @ (np.log1p(_MERIT_CONSTANT * least) / math.log1p(_MERIT_CONSTANT)))

    @property
    def kept(self) -> float:
        """Part of the difference that the effect makes that remains after the rival is fitted."""
        plain = float(self.weight @ self.plain)
        return self.expected / plain if plain > 0 else 0.0


def settled(expected: float, threshold: float) -> float:
    """Return the probability that a log-likelihood ratio exceeds a threshold: normal, with variance twice the expectation."""
    return _normal((expected - threshold) / math.sqrt(2.0 * expected)) if expected > 0 else 0.0


def _normal(x: float) -> float:
    """Return the standard normal distribution function at `x`."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def certainty(advantage: Array, share: float) -> float:
    """Return the mean advantage of windows in standard errors, if each window stands for `share` independent ones."""
    mean = float(np.mean(advantage)) if len(advantage) else 0.0
    scatter = float(np.var(advantage)) + 2.0 * mean if mean > 0 else 0.0
    return math.sqrt(share * len(advantage) / scatter) * mean if scatter > 0 else 0.0


def _enough(threshold: float) -> float:
    """Return the expected log-likelihood ratio that lies `_SUFFICIENT_SIGMAS` of its standard deviations above a threshold."""
    half = _SUFFICIENT_SIGMAS / math.sqrt(2.0)
    return (half + math.sqrt(half * half + threshold)) ** 2
