"""Calibration of probabilities: of the causes named with 90 %, nine in ten should be right.

References
----------
Brier (1950), Monthly Weather Review 78, 1-3. Naeini, Cooper and Hauskrecht (2015), AAAI: expected calibration error.
Wilson (1927), J. Am. Stat. Assoc. 22, 209-212.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["EDGES", "Bin", "Calibration", "calibrate", "wilson"]

#: Edges of the bins of probability; a probability on an edge belongs to the upper bin.
EDGES = (0.0, 0.25, 0.5, 0.75, 0.9, 0.99, 1.0)
#: Two-sided 95 % quantile of the normal distribution, in standard deviations.
Z_95 = 1.96


@dataclass(frozen=True)
class Bin:
    """Causes named with a probability from `low` up to `high`: number, number of right ones, mean probability."""

    low: float
    high: float
    count: int
    right: int
    mean: float


@dataclass(frozen=True)
class Calibration:
    """Calibration of a set of named causes.

    Attributes
    ----------
    bins : tuple of Bin
        Bins that are not empty.
    brier : float or None
        Brier score: mean squared difference between probability and outcome (0 or 1); None without causes.
    ece : float or None
        Expected calibration error: mean absolute difference of mean probability and share right over the bins, weighted by counts.
    """

    bins: tuple[Bin, ...]
    brier: float | None
    ece: float | None


def calibrate(claims: Sequence[tuple[float, bool]]) -> Calibration:
    """Return the calibration of named causes, each given by its probability and whether it was right.

    Examples
    --------
    >>> made = calibrate([(0.95, True), (0.95, True), (0.3, False)])
    >>> [(b.low, b.count, b.right) for b in made.bins], round(made.brier, 4), round(made.ece, 3)
    ([(0.25, 1, 0), (0.9, 2, 2)], 0.0317, 0.133)
    """
    bins = tuple(b for b in (_bin(claims, i) for i in range(len(EDGES) - 1)) if b.count)
    if not claims:
        return Calibration((), None, None)
    brier = sum((p - right) ** 2 for p, right in claims) / len(claims)
    ece = sum(abs(b.mean * b.count - b.right) for b in bins) / len(claims)
    return Calibration(bins, brier, ece)


def wilson(right: int, of: int) -> tuple[float, float]:
    """Return Wilson's 95 % confidence interval of the share ``right / of``.

    Examples
    --------
    >>> [round(x, 3) for x in wilson(9, 10)]
    [0.596, 0.982]
    """
    if of == 0:
        return 0.0, 1.0
    p, z2 = right / of, Z_95**2
    centre = (p + z2 / (2 * of)) / (1 + z2 / of)
    half = Z_95 / (1 + z2 / of) * math.sqrt(p * (1 - p) / of + z2 / (4 * of * of))
    return max(0.0, centre - half), min(1.0, centre + half)


def _bin(claims: Sequence[tuple[float, bool]], i: int) -> Bin:
    low, high = EDGES[i], EDGES[i + 1]
    last = i == len(EDGES) - 2
    inside = [(p, right) for p, right in claims if low <= p < high or (last and p == high)]
    mean = sum(p for p, _ in inside) / len(inside) if inside else math.nan
    return Bin(low, high, len(inside), sum(right for _, right in inside), mean)
