"""What a motion tells about two models, and how near that is to a decision of `armgap.diagnose`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Outcome", "certainty", "settled"]

Array = NDArray[np.float64]

#: A diagnosis explains a gap whose cost is this many times the floor, with what takes this part of the excess, in windows whose
#: mean advantage is so many standard errors (`rust/fit/src/search/acceptance.rs`).
ABOVE_FLOOR, MATTERS, CERTAIN = 1.25, 0.1, 3.5
#: Standard errors of that advantage on the part of the log that it judges on alone.
HELD_CERTAIN = 1.0
#: Standard deviations from its prior that a value of the arm returns by what a diagnosis names without a gap.
TRUST_SIGMAS = 4.0
#: Standard deviations by which evidence may exceed what a decision needs before more of it is worth nothing to the search.
_ENOUGH = 3.0
#: Evidence that the search aims at, over what is enough: the effect may be smaller than thought.
AIM = 100.0
#: Growth of a merit over its range: the smaller, the more the least one counts.
_GROWTH = 1e4


class Outcome(NamedTuple):
    """What a motion tells about a pair, one entry per size of the effect.

    Attributes
    ----------
    fitted, plain : ndarray
        Expected log-likelihood ratio over the windows that a diagnosis fits to, with the rival fitted, and over all windows without.
    above : ndarray
        Cost that the fitted rival leaves above the noise, over what a diagnosis needs to explain it; the lesser of what it fits to and what
        it judges on.
    certain : ndarray
        Mean advantage of a window, in standard errors; less where what is judged on has less than its part.
    prior : ndarray
        Part of `fitted` that is the prior's: the rival needs values of the arm that are not trusted.
    weight : ndarray
        Weights of the sizes, one together.
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
        """Expected log-likelihood ratio, mean over the sizes."""
        return float(self.weight @ self.fitted)

    def settled(self, threshold: float) -> float:
        """Probability of a decision, mean over the sizes."""
        likely = [settled(x, threshold) for x in self.fitted]
        high = [_normal((x - 1.0) / self.spread) for x in self.above]
        common = [_normal(x - CERTAIN) for x in self.certain]
        by_motion = np.min([likely, high, common], axis=0)
        by_prior = np.minimum(likely, [_normal(math.sqrt(2.0 * x) - TRUST_SIGMAS) for x in self.prior])
        return float(self.weight @ np.maximum(by_motion, by_prior))

    def merit(self, threshold: float) -> float:
        """How near all that a decision by the motion needs is, from 0 to 1, mean over the sizes; it grows with the logarithm."""
        enough = _enough(threshold)
        parts = (
            self.fitted / (AIM * enough),
            self.above / (AIM * (1.0 + _ENOUGH * self.spread)),
            self.certain / (CERTAIN + _ENOUGH),
        )
        least = np.clip(np.min(parts, axis=0), 0.0, 1.0)
        return float(self.weight @ (np.log1p(_GROWTH * least) / math.log1p(_GROWTH)))

    @property
    def kept(self) -> float:
        """Part of the difference that fitting the rival leaves."""
        plain = float(self.weight @ self.plain)
        return self.expected / plain if plain > 0 else 0.0


def settled(expected: float, threshold: float) -> float:
    """Probability that a log-likelihood ratio exceeds a threshold: normal, its variance twice its expectation."""
    return _normal((expected - threshold) / math.sqrt(2.0 * expected)) if expected > 0 else 0.0


def _normal(x: float) -> float:
    """Standard normal distribution function."""
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def certainty(advantage: Array, share: float) -> float:
    """Mean advantage of windows, each of which stands for `share` of them, in standard errors."""
    mean = float(np.mean(advantage)) if len(advantage) else 0.0
    scatter = float(np.var(advantage)) + 2.0 * mean if mean > 0 else 0.0
    return math.sqrt(share * len(advantage) / scatter) * mean if scatter > 0 else 0.0


def _enough(threshold: float) -> float:
    """Expected log-likelihood ratio that lies `_ENOUGH` of its standard deviations above a threshold."""
    half = _ENOUGH / math.sqrt(2.0)
    return (half + math.sqrt(half * half + threshold)) ** 2
