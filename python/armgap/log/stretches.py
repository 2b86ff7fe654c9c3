"""Selection of the informative stretches of long logs for a diagnosis.

A diagnosis costs time per sample, and hours of a log mostly repeat each other or rest. Logs beyond a budget are cut into stretches of
equal length; each is described by the cells that it visits, and stretches are taken one by one, always the one that adds most
coverage. There are cells per joint: position by direction of motion, speed on a logarithmic scale, torque, and reversals at each
level of torque; and parts of the log's time, for what changes while an arm warms up. The gain of a cell shrinks with its
contents, so that rare cells are preferred to frequent ones; motion within a sensor's noise counts as rest.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.log.findings import Finding
from armgap.log.log import SIGNALS, Log

__all__ = ["BUDGET", "SHORTEST_S", "STRETCH", "STRETCH_S", "choose", "thinned"]

BUDGET = 24_000
"""Largest number of samples of all training logs, or of all holdout logs, that are diagnosed whole; of longer logs stretches are chosen."""

SHORTEST_S = 0.002
"""Shortest sample period of a serial arm's logs [s] for which logs beyond the budget are cut into stretches; denser logs are thinned before."""

STRETCH_S = 2.0
"""Length of a stretch of a long log [s]."""

STRETCH = re.compile(r" \(\S+ to \S+ s\)$")
"""Pattern of the suffix that names a stretch of a log, after the log's own name."""

_MIN_STRETCHES = 4  # number of stretches that a budget holds at least, whatever their length
_POSITIONS = 12
_SPEEDS = 6  # classes of speed below the top speed, half a decade each
_TORQUES = 8
_TIMES = 8
# Smallest share of samples with motion of a joint in a stretch that is chosen.
_MOTION = 0.02
# Speed up to which a joint is at rest: this part of the top speed of the logs, or so many position steps per span if that is more.
_REST_SHARE = 1e-3
_REST_STEPS = 2.0


@dataclass(frozen=True)
class _Ranges:
    """Ranges of position, speed and torque that the cells of coverage span, over all logs, per joint."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    speed: NDArray[np.float64]
    torque: NDArray[np.float64]


def choose(logs: Sequence[Log], budget: int = BUDGET, *, horizon: float = 0.25) -> list[Log]:
    """Return the logs, or stretches of them that together hold at most about `budget` samples.

    Parameters
    ----------
    logs : sequence of Log
        Logs of one arm.
    budget : int, default `BUDGET`
        Largest number of samples of all logs together.
    horizon : float, default 0.25
        Prediction horizon [s]; a stretch lasts four horizons at least.

    Returns
    -------
    list of Log
        The logs themselves if they are within the budget. Otherwise stretches, each a log with the times of its whole log and with its place
        in its name; the first stretch of each log has a finding on how much was chosen.
    """
    if sum(len(log) for log in logs) <= budget:
        return list(logs)
    pieces = [piece for i, log in enumerate(logs) for piece in _cut(i, log, max(STRETCH_S, 4 * horizon), budget)]
    visits = _visits(logs, pieces)
    if not visits.any():
        visits = np.ones_like(visits)  # no stretch has motion: all count alike
    chosen = _greedy(visits, [last - first for _, first, last in pieces], budget)
    return [
        log
        for i, whole in enumerate(logs)
        for log in _parts(whole, [pieces[k][1:] for k in chosen if pieces[k][0] == i])
    ]


def thinned(log: Log, every: int) -> Log:
    """Return a log with one in `every` of its samples and the mean of the torques in between, each held until the next sample.

    A remainder of less than `every` samples at the end is left out. Logs with references in place of torques are not thinned, as
    their controllers act at every sample.
    """
    if every < 2 or len(log) < 2 * every or not log.has_torques:
        return log
    kept = len(log) // every
    at = every * np.arange(kept)
    ends = np.append(log.t[1:], log.t[-1] + log.sample_period)[: kept * every]
    begins = log.t[: kept * every]
    h = (ends - begins).reshape(kept, every, 1)
    whole = h.sum(axis=1)
    tau = log.tau[: kept * every].reshape(kept, every, -1)
    mean = (h * tau).sum(axis=1) / whole
    off_centre = (0.5 * (begins + ends)).reshape(kept, every, 1) - (begins[::every, None] + 0.5 * whole)[:, None]
    moment = (h * tau * off_centre).sum(axis=1)
    if log.moment is not None:
        moment = moment + log.moment[: kept * every].reshape(kept, every, -1).sum(axis=1)
    sampled = (key for key in SIGNALS if key not in ("tau", "moment"))
    arrays: dict[str, Any] = {key: None if (x := getattr(log, key)) is None else x[at] for key in sampled}
    said = Finding("stretches", f"one in {every} samples is used, with the mean of the torques in between")
    return replace(log, t=log.t[at], tau=mean, moment=moment, findings=(*log.findings, said), **arrays)


def _cut(index: int, log: Log, length_s: float, budget: int) -> list[tuple[int, int, int]]:
    """Return stretches as ``(log, first, last)``, each within a share of the budget and without gaps in time."""
    period = log.sample_period
    rows = max(2, min(round(length_s / period), budget // _MIN_STRETCHES))
    gaps = np.flatnonzero(np.diff(log.t) > 3 * period) + 1
    edges = [0, *gaps.tolist(), len(log)]
    return [
        (index, first, min(first + rows, end))
        for start, end in pairwise(edges)
        for first in range(start, end, rows)
        if min(first + rows, end) - first >= rows // 2
    ]


def _visits(logs: Sequence[Log], pieces: list[tuple[int, int, int]]) -> NDArray[np.float64]:
    """Return the weight of each stretch in each cell of coverage, shape (n_pieces, n_cells), as by `_cells`; zero for stretches at rest."""
    speeds = [_Speeds(log) for log in logs]
    ranges = _ranges(speeds)
    cells = np.array([_cells(logs[i], speeds[i], slice(first, last), ranges) for i, first, last in pieces])
    times = np.zeros((len(pieces), len(logs) * _TIMES))
    for row, (i, first, _) in enumerate(pieces):
        times[row, i * _TIMES + min(int(_TIMES * first / len(logs[i])), _TIMES - 1)] = float(cells[row].any())
    return np.hstack([cells, times])


class _Speeds:
    """Speeds of a log over spans long enough that position steps and noise do not count as motion."""

    def __init__(self, log: Log) -> None:
        self.log = log
        self.stride = max(1, round(0.01 / log.sample_period))
        step = [_step(log.q[:, j]) for j in range(log.n_joints)]
        self.rest = _REST_STEPS * np.array(step) / (self.stride * log.sample_period)

    def of(self, rows: slice) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Return speeds, shape (n, n_joints), in a range of rows, and the rows of the speeds."""
        at = np.arange(rows.start, rows.stop, self.stride)
        moved, passed = np.diff(self.log.q[at], axis=0), np.diff(self.log.t[at])
        return moved / passed[:, None], at[:-1]


def _step(values: NDArray[np.float64]) -> float:
    """Return the typical change of position between samples at rest: the 5 % quantile of the sizes of non-zero changes."""
    moved = np.abs(np.diff(values[: 1 << 20]))
    moved = moved[moved > 0]
    return float(np.quantile(moved, 0.05)) if len(moved) else 0.0


def _ranges(speeds: Sequence[_Speeds]) -> _Ranges:
    """Return the ranges that the cells of coverage span, from speeds of all logs."""
    tops = [np.quantile(np.abs(s.of(slice(0, len(s.log)))[0]), 0.999, axis=0) for s in speeds]
    q = [s.log.q[:: s.stride] for s in speeds]
    tau = [_load(s.log, slice(None, None, s.stride)) for s in speeds]
    return _Ranges(
        np.min([x.min(axis=0) for x in q], axis=0),
        np.max([x.max(axis=0) for x in q], axis=0),
        np.max(tops, axis=0),
        np.max([x.max(axis=0) for x in tau], axis=0),
    )


def _cells(log: Log, speeds: _Speeds, rows: slice, ranges: _Ranges) -> NDArray[np.float64]:
    """Return the square root of the share of a stretch's samples in each cell of coverage, joint after joint; zeros for a stretch at rest."""
    dq, at = speeds.of(rows)
    rest = np.maximum(speeds.rest, _REST_SHARE * ranges.speed)
    moving = np.abs(dq) > rest
    if not len(at) or moving.any(axis=1).mean() < _MOTION:
        return np.zeros(log.n_joints * _width())
    return np.concatenate([_joint_cells(log, at, dq, moving, j, ranges) for j in range(log.n_joints)])


def _load(log: Log, rows: slice | NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the sizes of the torques in given rows, shape (n, n_joints); for a log of references, the sizes of ``q_ref - q``."""
    return np.abs(log.tau[rows] if log.q_ref is None or log.has_torques else log.q_ref[rows] - log.q[rows])


def _width() -> int:
    return 2 * _POSITIONS + _SPEEDS + 2 * _TORQUES


def _joint_cells(
    log: Log, at: NDArray[np.intp], dq: NDArray[np.float64], moving: NDArray[np.bool_], j: int, ranges: _Ranges
) -> NDArray[np.float64]:
    go = moving[:, j]
    span = max(float(ranges.high[j] - ranges.low[j]), 1e-12)
    place = np.clip((_POSITIONS * (log.q[at, j] - ranges.low[j]) / span).astype(int), 0, _POSITIONS - 1)
    ratio = np.abs(dq[:, j]) / max(float(ranges.speed[j]), 1e-12)
    slow = np.clip((-2 * np.log10(np.maximum(ratio, 1e-12))).astype(int), 0, _SPEEDS - 1)
    load = _load(log, at)[:, j] / max(float(ranges.torque[j]), 1e-12)
    level = np.minimum((_TORQUES * load).astype(int), _TORQUES - 1)
    turned = np.flatnonzero((np.sign(dq[1:, j]) != np.sign(dq[:-1, j])) & (go[1:] | go[:-1]))
    counts = [
        np.bincount((place + _POSITIONS * (dq[:, j] > 0))[go], minlength=2 * _POSITIONS),
        np.bincount(slow[go], minlength=_SPEEDS),
        np.bincount(level[go], minlength=_TORQUES),
        np.bincount(level[turned], minlength=_TORQUES),
    ]
    # Cells count by the square root of the share of time in them, so that short visits to many cells are worth more than long visits to few.
    return np.sqrt(np.concatenate(counts) / len(at))


def _greedy(visits: NDArray[np.float64], rows: list[int], budget: int) -> list[int]:
    """Return indices of the chosen stretches, sorted: greedily those with the largest gain in summed logarithms of coverage, within the budget."""
    covered = np.full(visits.shape[1], 0.1)
    left = set(np.flatnonzero(visits.any(axis=1)).tolist())
    chosen: list[int] = []
    spent = 0
    while left:
        order = np.array(sorted(left))
        gain = np.sum(np.log1p(visits[order] / covered), axis=1)
        best = int(order[np.argmax(gain)])
        left.discard(best)
        if spent + rows[best] <= budget:
            chosen.append(best)
            spent += rows[best]
            covered += visits[best]
        elif spent + min(rows) > budget:
            break
    return sorted(chosen)


def _parts(whole: Log, spans: list[tuple[int, ...]]) -> list[Log]:
    """Return stretches of a log as logs; the first has the log's findings and a finding on how much was chosen."""
    parts = []
    for first, last in _merged(spans):
        name = f"{whole.name} ({whole.t[first]:.6g} to {whole.t[last - 1]:.6g} s)"
        parts.append(whole.part(first, last, name, findings=()))
    if not parts:
        return []
    rows = sum(len(part) for part in parts)
    listed = ", ".join(f"{part.t[0]:.6g} to {part.t[-1]:.6g} s" for part in parts)
    said = Finding(
        "stretches",
        f"of {len(whole)} samples over {whole.duration:.4g} s, {rows} in {len(parts)} stretches are used, chosen for the "
        f"positions, speeds, torques and reversals they cover: {listed}",
    )
    return [parts[0].with_findings((*whole.findings, said)), *parts[1:]]


def _merged(spans: list[tuple[int, ...]]) -> list[tuple[int, int]]:
    """Return stretches ``(first, last)``, sorted, with adjacent stretches joined."""
    merged: list[tuple[int, int]] = []
    for first, last in sorted(spans):
        if merged and merged[-1][1] == first:
            merged[-1] = (merged[-1][0], last)
        else:
            merged.append((first, last))
    return merged
