"""Parameters that grow from some visit on, and robots that differ from the others.

A series is taken relative to the first visits, in logarithms, and less the median of all robots of its visit: what a day does to all is no
drift. A ramp from an unknown visit on is looked for by the generalised likelihood ratio (Basseville and Nikiforov 1993, section 2.4.3): for
every onset the slope by least squares, its square over its variance, the largest of all. The scatter is that of differences between
neighbouring visits, which a ramp hardly changes, pooled over the fleet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Drift", "drifts", "odd_ones"]

Array = NDArray[np.float64]
# A ramp counts from this many standard deviations of its slope on. With 20 robots, 30 visits and ten parameters, looked at after every visit,
# noise alone gets there in one fleet of a hundred.
_DRIFTS = 5.0
# Visits before a ramp that say where it started from, and fewest visits on it.
_FEWEST_BEFORE, _FEWEST_ON = 3, 3
# Robots without which there is no fleet to compare with.
_FEWEST_ROBOTS = 4
# A robot is odd from this many robust standard deviations on.
_ODD = 5.0
# Standard deviation of normal numbers over the median of their absolute values.
_MAD = 1.4826


@dataclass(frozen=True)
class Drift:
    """A parameter of one robot that changes steadily.

    Attributes
    ----------
    robot : int
        Row of the table.
    onset : int
        Visit from which it changes.
    rate : float
        Relative change per visit.
    evidence : float
        Standard deviations by which the rate differs from zero.
    """

    robot: int
    onset: int
    rate: float
    evidence: float


def drifts(values: Array) -> list[Drift]:
    """Return the series that hold a ramp up to their last visit, the surest first.

    Parameters
    ----------
    values : ndarray, shape (n_robots, n_visits)
        One parameter; NaN where it was not estimated. Series with values of both signs are left out.
    """
    series = relative(values)
    scatter = _scatter(series)
    if not np.isfinite(scatter) or scatter <= 0:
        return []
    found = (_ramp(row, scatter, robot) for robot, row in enumerate(series))
    return sorted((drift for drift in found if drift is not None), key=lambda drift: -drift.evidence)


def relative(values: Array) -> Array:
    """Return logarithms of sizes, less the fleet's median of each visit and the robot's own level."""
    values = np.asarray(values, dtype=np.float64)
    one_sign = np.nanmin(np.where(np.isnan(values), 1.0, np.sign(values)), axis=1) > 0
    one_sign |= np.nanmax(np.where(np.isnan(values), -1.0, np.sign(values)), axis=1) < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        series = np.where(one_sign[:, None], np.log(np.abs(values)), np.nan)
    series = series - _median(series, axis=1)[:, None]
    if np.count_nonzero(one_sign) >= _FEWEST_ROBOTS:
        series = series - _median(series, axis=0)[None, :]
    return np.asarray(series)


def _median(x: Array, axis: int) -> Array:
    known = np.isfinite(x).any(axis=axis, keepdims=True)
    return np.asarray(np.nanmedian(np.where(known, x, 0.0), axis=axis))


def _scatter(series: Array) -> float:
    steps = np.diff(series, axis=1)
    steps = steps[np.isfinite(steps)]
    return float(_MAD * np.median(np.abs(steps)) / np.sqrt(2.0)) if len(steps) else float("nan")


def _ramp(row: Array, scatter: float, robot: int) -> Drift | None:
    visits = np.flatnonzero(np.isfinite(row))
    best: Drift | None = None
    for onset in visits[_FEWEST_BEFORE : len(visits) - _FEWEST_ON + 1]:
        ramp = np.maximum(visits - onset + 1, 0).astype(np.float64)
        ramp -= ramp.mean()
        square = float(ramp @ ramp)
        slope = float(ramp @ row[visits]) / square
        evidence = abs(slope) * np.sqrt(square) / scatter
        if evidence > _DRIFTS and (best is None or evidence > best.evidence):
            best = Drift(robot, int(onset), float(np.expm1(slope)), float(evidence))
    return best


def odd_ones(values: Array) -> list[tuple[int, float]]:
    """Return robots whose usual value lies far from the others', and by how many robust standard deviations.

    Parameters
    ----------
    values : ndarray, shape (n_robots, n_visits)
        One parameter; NaN where it was not estimated.
    """
    usual = np.array([np.median(row[np.isfinite(row)]) if np.isfinite(row).any() else np.nan for row in values])
    known = np.isfinite(usual)
    if np.count_nonzero(known) < _FEWEST_ROBOTS:
        return []
    middle = float(np.median(usual[known]))
    spread = _MAD * float(np.median(np.abs(usual[known] - middle)))
    if spread <= 0:
        return []
    apart = (usual - middle) / spread
    return [(int(i), float(apart[i])) for i in np.argsort(-np.abs(apart)) if known[i] and abs(apart[i]) > _ODD]
