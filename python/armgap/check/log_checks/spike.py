"""Spikes: single rows of a position that returns at once, or of an absurdly large torque without a response of the arm.

A position is a spike if for one to three rows it lies off the straight line between the rows around it by several times what the
joint moves per row next to it: even a joint that is struck, and reverses within a row, does not get that far. A torque is a spike
if it is far beyond the largest torques of the log for one to three rows, and no joint accelerates more than otherwise.

A row with a spike of position is left out. At a spike of torque the true torque is unknown, so there the log is split in two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.log_checks.outcome import NOTHING, Outcome, ranges, seconds, with_rows
from armgap.log.log import Log

__all__ = ["look"]

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

# Longest run of spike rows; the longest that leaves prediction windows whole.
_MAX_SPIKE_ROWS = 3
# Distance of a spike from the line through its neighbours, in units of the travel per row around it. A blow reverses a joint within a row: up to 2.
_TIMES_MOTION = 3.0
# Distance of a spike from the line through its neighbours, in units of the change of travel per row that is exceeded in 5 % of the rows.
_TIMES_USUAL = 20.0
# Distance of a spike at an end of a log, where neighbours are on one side only, in units of the usual change of travel per row.
_TIMES_AT_END = 10.0
# Share of rows of a log up to which rows with deviating positions or torques count as spikes.
_MAX_SPIKE_SHARE = 0.005
# Ratio to the torque exceeded in 0.5 % of the rows from which a torque is a candidate, and from which it is absurd whatever the arm does.
_SPIKE_TORQUE_RATIO, _TORQUE_ABSURD = 30.0, 1e3
# Share of rows with non-zero torque below which a torque has no usual size.
_TORQUE_ACTIVE = 0.05
# Rows that each part of a log needs for the log to be split in two.
_FEWEST_LEFT = 16
# Number of rows over which the speed on either side of a torque spike is computed.
_SPEED_ROWS = 5
# Length left out around a torque spike [s; periods]: predictions end where samples are missing for 10 periods and a quarter of the usual horizon.
_BREAK, _BREAK_PERIODS = 0.07, 12
# Largest number of rows from which scales of travel and torque are computed.
_MAX_SCALE_ROWS = 200_000


def look(log: Log, arm: Arm | None) -> Outcome:
    """Leave out rows with spikes of position, and rows around a spike of torque."""
    if len(log) < 4 * _MAX_SPIKE_ROWS + 4:
        return NOTHING
    found = []
    wild = np.zeros(len(log), dtype=bool)
    valid = np.ones(log.tau.shape, dtype=bool)
    for j in range(log.n_joints):
        q = np.ascontiguousarray(log.q[:, j])
        columns = [(f"q{j + 1}", q, _positions(q))]
        if log.has_torques:
            tau = np.ascontiguousarray(log.tau[:, j])
            columns.append((f"tau{j + 1}", tau, _torques(log.t, q, tau)))
        for name, values, rows in columns:
            if not len(rows) or len(rows) > max(_MAX_SPIKE_ROWS, _MAX_SPIKE_SHARE * len(log)):
                continue
            wild[rows] = True
            if name[0] != "q":
                valid[rows, j] = False
            found.append(_said(log, name, values, rows, j))
    if not found:
        return NOTHING
    unknown = np.flatnonzero(~valid.all(axis=1))
    beside = max(_BREAK, _BREAK_PERIODS * log.sample_period)
    for row in unknown:
        wild |= np.abs(log.t - log.t[row]) < 0.5 * beside
    kept = np.flatnonzero(~wild)
    if len(kept) < _FEWEST_LEFT:
        return NOTHING
    deed = f"left out, and {seconds(beside)} around a torque that nobody knows" if len(unknown) else "left out"
    return Outcome(tuple(found), with_rows(log, kept, valid), kept, deed)


def _said(log: Log, name: str, values: Array, rows: Rows, j: int) -> Check:
    row = int(rows[np.argmax(np.abs(values[rows]))])
    beside = values[row + 1 if row + 1 not in rows and row + 1 < len(log) else max(int(rows[0]) - 1, 0)]
    many = "" if len(rows) == 1 else f" ({len(rows)} rows in all)"
    said = f"{name} is {values[row]:.6g} at {seconds(log.t[row])} beside {beside:.4g}, which no motion explains{many}"
    return Check("spike", "repaired", said, (), j + 1, log.name, ranges(rows))


def _positions(q: Array) -> Rows:
    steps = np.diff(q)
    bends = np.abs(np.diff(steps))
    thin = bends[:: max(1, len(bends) // _MAX_SCALE_ROWS)]
    floor = _TIMES_USUAL * float(np.quantile(thin, 0.95)) + 1e-9 * float(np.median(np.abs(q)))
    steps = np.abs(steps)
    wild: list[Rows] = [_at_start(q, floor), len(q) - 1 - _at_start(q[::-1], floor)]
    # A spike that begins at row k makes a second difference of about its size at row k - 1, which is entry k - 2 of `bends`.
    first = np.flatnonzero(bends > floor / 4) + 2
    for m in range(1, _MAX_SPIKE_ROWS + 1):
        k = first[(first >= 3) & (first < len(q) - m - 2)]
        if not len(k):
            continue
        through = np.abs(q[k + m] - q[k - 1]) / (m + 1)
        around = np.max([steps[k - 2], steps[k - 3], steps[k + m], steps[k + m + 1], through], axis=0)
        off = np.min(np.abs([q[k + i] - _line(q, k, m, i) for i in range(m)]), axis=0)
        k = k[off > 0.5 * (m + 1) * _TIMES_MOTION * around + floor]
        wild += [k + i for i in range(m)]
    return np.unique(np.concatenate(wild))


def _line(q: Array, k: Rows, m: int, i: int) -> Array:
    part = (i + 1) / (m + 1)
    return np.asarray((1 - part) * q[k - 1] + part * q[k + m])


def _at_start(q: Array, floor: float) -> Rows:
    """Return the first one to three rows if they lie far off the straight line through the rows after them; else no row."""
    for m in range(_MAX_SPIKE_ROWS, 0, -1):
        around = float(np.max(np.abs(np.diff(q[m : m + 4]))))
        pace = q[m + 1] - q[m]
        off = np.abs(q[:m] - (q[m] - pace * np.arange(m, 0, -1)))
        if np.min(off) > m * _TIMES_AT_END * around + 2 * floor:
            return np.arange(m)
    return np.arange(0)


def _torques(t: Array, q: Array, tau: Array) -> Rows:
    size = np.abs(tau)
    thin = size[:: max(1, len(size) // _MAX_SCALE_ROWS)]
    usual = float(np.quantile(thin, 0.995))
    if usual == 0 or float(np.mean(thin > 0)) < _TORQUE_ACTIVE:
        return np.arange(0)
    wild: list[int] = []
    for first, last in ranges(np.flatnonzero(size > _SPIKE_TORQUE_RATIO * usual)):
        if last - first >= _MAX_SPIKE_ROWS:
            continue
        absurd = float(size[first : last + 1].min()) > _TORQUE_ABSURD * usual
        if absurd or not _answered(t, q, first, last):
            wild += range(first, last + 1)
    return np.array(wild, dtype=np.intp)


def _answered(t: Array, q: Array, first: int, last: int) -> bool:
    """Whether the joint's speed changes over the rows of a torque spike by more than over equally many rows elsewhere."""
    w = _SPEED_ROWS
    if first < w or last + 1 + w >= len(q):
        return False
    thin = slice(0, min(len(q), _MAX_SCALE_ROWS))
    speed = (q[thin][w:] - q[thin][:-w]) / (t[thin][w:] - t[thin][:-w])
    apart = w + 1 + last - first
    usual = float(np.quantile(np.abs(speed[apart:] - speed[:-apart]), 0.99))
    before = (q[first] - q[first - w]) / (t[first] - t[first - w])
    after = (q[last + 1 + w] - q[last + 1]) / (t[last + 1 + w] - t[last + 1])
    return bool(abs(after - before) > 1.5 * usual)
