"""Jitter of time stamps: stamps scatter around the even times at which the samples were taken.

Stamps and even times are compared by how well positions follow smooth curves (the cubic through two rows before and two after). A stamp that
is off by e makes a position of a joint at speed v look off by v e. Where even times explain the positions clearly better, and the errors over
even times do not correlate with the scatter, even times replace the stamps. Where both explain the positions equally well the stamps stay.
Rows may be missing from the even times, and the clock may drift slowly.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.log_checks.numbers import blocks, from_neighbours
from armgap.check.log_checks.outcome import NOTHING, Outcome
from armgap.log.log import Log

__all__ = ["look"]

Array = NDArray[np.float64]

# Scatter of time stamps, in sample periods, below which they count as even.
_EVEN_STAMP_SCATTER = 0.01
# Even times are better if they leave less than the first part of the stamps' error variance on some joint, and on no joint more than the second
# number times it, in the share of rows (third number) where jitter shows most.
_BETTER_VARIANCE_RATIO, _WORSE_VARIANCE_RATIO, _LOUD = 0.5, 1.2, 0.2
# Largest regression coefficient of position errors over even times on the errors that right stamps would make: 1 where stamps are right, 0 where
# even times are right.
_SHOWN = 0.15
# Rows that the comparison of stamps and even times needs.
_MIN_COMPARED_ROWS = 100
# Step between stamps, in periods, that may hide a missing row; a row is missing if the later stamps are late by this part of a period.
_LONG, _LATE = 1.3, 0.6
# Iterations of the search for missing rows, each with a new line through the stamps.
_MISSING_ROW_ITERATIONS = 12
# Rows to either side of a long step whose mean lateness is compared.
_BESIDE = 12
# Largest distance of even times from the stamps' mean over so many rows, in periods; a clock's drift is slower.
_NEAR, _MEAN_ROWS = 0.35, 25
# Rows over which the clock's drift is averaged, and standard deviations from which a drift is followed.
_DRIFT_ROWS, _DRIFT_STANDS_OUT = 128, 4.0


def look(log: Log, arm: Arm | None) -> Outcome:
    """Replace time stamps by even times if the positions fit even times better."""
    if len(log) < 2 * _MIN_COMPARED_ROWS:
        return NOTHING
    period = log.sample_period
    steps = np.diff(log.t)
    # Steps by whole periods, where rows may be missing, count as even.
    if float(np.mean(np.abs(steps / period - np.maximum(np.round(steps / period), 1)))) < _EVEN_STAMP_SCATTER:
        return NOTHING
    even = _even_times(log.t, steps, period)
    if even is None:
        return NOTHING
    better = _better(log, even)
    if better is None:
        return NOTHING
    scatter = float(np.std(log.t - even))
    said = (
        f"stamps scatter by {1e3 * scatter:.3g} ms around even times {1e3 * float(np.median(np.diff(even))):.4g} ms apart, "
        f"over which positions are {better:.3g} times as smooth"
    )
    check = Check("stamp_jitter", "repaired", said, (), None, log.name, ((0, len(log) - 1),))
    start = even[0] if log.t[0] == 0 else 0.0
    return Outcome((check,), replace(log, t=even - start), None, "even times are used")


def _better(log: Log, even: Array) -> float | None:
    """Return the ratio of position errors over the stamps to those over even times; None unless even times are clearly better."""
    rows = blocks(len(log))
    joined = [_misses(log.t[r], even[r], log.q[r]) for r in rows]
    stamped, evenly, shown = (np.concatenate(columns) for columns in zip(*joined, strict=True))
    ratios = []
    for j in range(log.n_joints):
        size = np.abs(shown[:, j])
        loud = (size >= np.quantile(size, 1 - _LOUD)) & (size > 0)
        if np.count_nonzero(loud) < _MIN_COMPARED_ROWS:
            continue
        ratio = _middle(evenly[loud, j]) / max(_middle(stamped[loud, j]), 1e-300)
        trace = abs(float(evenly[loud, j] @ shown[loud, j])) / max(float(shown[loud, j] @ shown[loud, j]), 1e-300)
        if ratio > _WORSE_VARIANCE_RATIO or (ratio < _BETTER_VARIANCE_RATIO and trace > _SHOWN):
            return None
        ratios.append(ratio)
    return float(1 / np.sqrt(min(ratios))) if ratios and min(ratios) < _BETTER_VARIANCE_RATIO else None


def _misses(t: Array, even: Array, q: Array) -> tuple[Array, Array, Array]:
    """Return errors of positions from cubics: over the stamps, over even times, and expected over even times if the stamps were right."""
    speed = np.gradient(q, even, axis=0)
    by_scatter = from_neighbours(even, speed * (t - even)[:, None])
    return from_neighbours(t, q), from_neighbours(even, q), by_scatter


def _middle(values: Array) -> float:
    """Return the mean square of the smaller nine tenths of the interpolation errors, so that impacts do not decide."""
    values = np.abs(values)
    chosen = values[values <= np.quantile(values, 0.9)]
    return float(chosen @ chosen) / max(len(chosen), 1)


def _even_times(t: Array, steps: Array, period: float) -> Array | None:
    """Return even times for the rows of a log [s], a whole number of periods apart; None if the stamps do not scatter around even times."""
    missing = _missing(t, steps, period)
    index = np.arange(len(t)) + np.append(0, np.cumsum(missing))
    start, period = _straight(index, t)
    for _ in range(_MISSING_ROW_ITERATIONS):
        settled = _settled(missing, t - start - period * index, steps, period)
        if np.array_equal(settled, missing):
            break
        missing = settled
        index = np.arange(len(t)) + np.append(0, np.cumsum(missing))
        start, period = _straight(index, t)
    late = t - start - period * index
    drift = _drift(late)
    bends = drift[2 * _DRIFT_ROWS :] - 2 * drift[_DRIFT_ROWS:-_DRIFT_ROWS] + drift[: -2 * _DRIFT_ROWS]
    if float(np.max(np.abs(bends), initial=0.0)) > _NEAR * period:
        return None
    even = start + period * index + drift
    late = late - drift
    if len(t) > _MEAN_ROWS:
        sums = np.cumsum(np.append(0.0, late))
        mean = (sums[_MEAN_ROWS:] - sums[:-_MEAN_ROWS]) / _MEAN_ROWS
        if float(np.max(np.abs(mean))) > _NEAR * period:
            return None
    return even if bool(np.all(np.diff(even) > 0)) else None


def _missing(t: Array, steps: Array, period: float) -> NDArray[np.intp]:
    """Return the number of missing rows in each step between stamps: the whole periods by which the stamps after the step are late."""
    missing = np.zeros(len(steps), dtype=np.intp)
    at = np.flatnonzero(steps > _LONG * period)
    if not len(at):
        return missing
    late = t - period * np.arange(len(t))
    sums = np.append(0.0, np.cumsum(late - late[0]))

    def mean(first: NDArray[np.intp], last: NDArray[np.intp]) -> Array:
        first, last = np.maximum(first, 0), np.minimum(last, len(t))
        return np.asarray((sums[last] - sums[first]) / (last - first))

    shift = (mean(at + 1, at + 1 + _BESIDE) - mean(at + 1 - _BESIDE, at + 1)) / period
    clear = shift > _LATE
    at, shift = at[clear], shift[clear]
    first, last = np.searchsorted(at, at - _BESIDE + 1), np.searchsorted(at, at + _BESIDE)
    # A missing row also shifts the means at nearby steps: it is assigned to the longest of these steps.
    for i in np.argsort(-steps[at]):
        close = at[first[i] : last[i]]
        left = shift[i] - float(np.sum(missing[close] * (1 - np.abs(close - at[i]) / _BESIDE)))
        longest = steps[at[i]] / period - 1 + 2 * _LATE
        if left > _LATE:
            missing[at[i]] = round(min(left, longest))
    return missing


def _settled(missing: NDArray[np.intp], late: Array, steps: Array, period: float) -> NDArray[np.intp]:
    """Return the numbers of missing rows after a second pass, which moves stamps between two long steps by the whole periods of their lateness."""
    if not missing.any():
        return missing
    edges = np.append(0, np.flatnonzero((steps > _LONG * period) | (missing > 0)) + 1)
    rows = np.diff(np.append(edges, len(late)))
    mean = np.add.reduceat(late, edges) / rows / period
    move = np.where(np.abs(mean) > 0.5 + 0.25 / np.sqrt(rows), np.round(mean), 0.0).astype(np.intp)
    if not move.any():
        move = _jump(late / period, edges)
    settled = missing.copy()
    settled[edges[1:] - 1] += np.diff(move)
    return np.maximum(settled, 0)


def _jump(late: Array, edges: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return by how many periods to move the stamps after each edge at which the mean lateness jumps, largest jumps first."""
    sums = np.append(0.0, np.cumsum(late))
    low, high = np.maximum(edges - 2 * _BESIDE, 0), np.minimum(edges + 2 * _BESIDE, len(late))
    shift = (sums[high] - sums[edges]) / (high - edges) - (sums[edges] - sums[low]) / np.maximum(edges - low, 1)
    shift[edges < _BESIDE] = 0.0
    move = np.zeros(len(edges), dtype=np.intp)
    taken = np.zeros(len(late) + 1, dtype=bool)
    large = np.flatnonzero(np.abs(shift) > _LATE)
    for at in large[np.argsort(-np.abs(shift[large]))]:
        if not taken[edges[at]]:
            taken[max(edges[at] - 4 * _BESIDE, 0) : edges[at] + 4 * _BESIDE] = True
            move[at:] += round(float(shift[at]))
    return move


def _straight(index: NDArray[np.intp], t: Array) -> tuple[float, float]:
    """Return start [s] and slope [s per row] of the line through time stamps, outliers left out."""
    x = index - index.mean()
    slope = float(x @ (t - t.mean()) / (x @ x))
    left = t - t.mean() - slope * x
    near = np.abs(left - np.median(left)) <= 3 * slope
    if 2 <= np.count_nonzero(near) < len(t):
        x, y = index[near] - index[near].mean(), t[near]
        slope = float(x @ (y - y.mean()) / (x @ x))
        return float(y.mean() - slope * index[near].mean()), slope
    return float(t.mean() - slope * index.mean()), slope


def _drift(late: Array) -> Array:
    """Return the slow part of the stamps' lateness [s], the clock's drift; zeros if the scatter of the stamps explains the slow part."""
    count = len(late) // _DRIFT_ROWS
    if count < 2:
        return np.zeros_like(late)
    means = late[: count * _DRIFT_ROWS].reshape(count, _DRIFT_ROWS).mean(axis=1)
    scatter = float(np.std(np.diff(late))) / np.sqrt(2 * _DRIFT_ROWS)
    if float(np.std(means)) <= _DRIFT_STANDS_OUT * scatter / np.sqrt(max(count, 1)) + scatter:
        return np.zeros_like(late)
    centres = (np.arange(count) + 0.5) * _DRIFT_ROWS - 0.5
    slow = np.interp(np.arange(len(late)), centres, means)
    for end, inner in ((0, 1), (-1, -2)):  # extrapolate linearly beyond the outer centres
        slope = (means[end] - means[inner]) / (centres[end] - centres[inner])
        rows = np.arange(int(centres[0]) + 1) if end == 0 else np.arange(int(centres[-1]), len(late))
        slow[rows] = means[end] + slope * (rows - centres[end])
    return np.asarray(slow)
