"""Positions held over several rows while the joint moves: the repair keeps only rows with a new position.

A held position is followed by a step that makes up for the rows of the hold. A joint that stops shows no such step, and
a joint that moves by a few encoder counts per row or less repeats its position by nature.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.log_checks.numbers import blocks, grid_step, travel_per_row
from armgap.check.log_checks.outcome import NOTHING, Outcome, ranges, with_rows
from armgap.log.log import Log

__all__ = ["look"]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Encoder counts per row from which a moving joint does not repeat a position by itself.
_FAST_COUNTS = 8.0
# Encoder counts per row from which a repeated position counts as held, in a log where positions are held at all.
_SLOW_COUNTS = 2.0
# Range of the position's step after a hold, relative to the travel of the motion over the rows of the hold.
_MAKES_UP = (0.5, 2.0)
# Share of the rows in motion with held positions, and number of these rows, from which a hold is reported.
_SHARE, _MIN_HELD_ROWS = 0.1, 20
# Rows to either side over which motion is judged at least (else twice the usual hold), and rows of the longest hold.
_AROUND, _MAX_HOLD_ROWS = 8, 64
# Share of held rows in common from which two joints are held together.
_AGREE = 0.9
# Share of holds of equal length from which a joint's held positions have a regular pattern.
_REGULAR = 0.95


@dataclass(frozen=True)
class _Held:
    """Holds of one joint: rows that repeat the previous position, rows in fast motion and in any motion, share of rows held, length of a hold."""

    again: Flags
    fast: Flags
    moves: Flags
    share: float
    length: float


def look(log: Log, arm: Arm | None) -> Outcome:
    """Find joints with held positions; repair the log if the joints are held together, or the other joints do not move."""
    joints = [_held(np.ascontiguousarray(log.q[:, j])) for j in range(log.n_joints)]
    held = [j for j, h in enumerate(joints) if h.share >= _SHARE]
    if not held:
        return NOTHING
    together = all(_agree(joints[held[0]], other) for other in joints)
    severity = "repaired" if together else "warning"
    kept = _fresh(log, [joints[j] for j in held]) if together else np.arange(len(log))
    gone = np.setdiff1d(np.arange(len(log)), kept, assume_unique=True)
    checks = tuple(_said(log, j, joints[j], gone, severity) for j in held)
    if not together:
        return Outcome(checks)
    deed = f"the {len(kept)} rows with fresh positions are kept, each with the mean torque until the next"
    return Outcome(checks, with_rows(log, kept), kept, deed)


def _said(log: Log, j: int, held: _Held, gone: NDArray[np.intp], severity: str) -> Check:
    apart = "" if severity == "repaired" else ", the joints each in their own rows"
    said = (
        f"q{j + 1} repeats its last value in {100 * held.share:.0f} % of the rows in which the joint moves, "
        f"held over {held.length:.2g} rows as a rule{apart}"
    )
    remedy = () if severity == "repaired" else ("log every joint's position when it is read",)
    return Check(
        "repeated_positions", "repaired" if severity == "repaired" else "warning", said, remedy, j + 1, log.name,
        ranges(gone),
    )  # fmt: skip


def _held(q: Array) -> _Held:
    again = np.append(False, q[1:] == q[:-1])
    pieces = [q[rows] for rows in blocks(len(q))]
    step = grid_step(np.concatenate(pieces)) or 0.0
    held = moving = 0
    lengths: list[Array] = []
    for piece in pieces:
        count, rows, run = _holds(piece, step)
        held, moving = held + count, moving + rows
        lengths.append(run)
    runs = np.concatenate(lengths)
    length = float(np.median(runs)) if len(runs) else 1.0
    pace = travel_per_row(q, _reach(length))
    share = held / max(moving, 1) if held >= _MIN_HELD_ROWS else 0.0
    return _Held(again, pace > _FAST_COUNTS * step, pace > _SLOW_COUNTS * step, share, length)


def _reach(length: float) -> int:
    return int(max(_AROUND, 2 * length))


def _holds(q: Array, step: float) -> tuple[int, int, Array]:
    """Return the number of rows held, the number of rows in fast motion, and the length of each hold, rows."""
    starts = np.append(0, np.flatnonzero(q[1:] != q[:-1]) + 1)
    if len(starts) < 4:
        return 0, 0, np.empty(0)
    length = np.diff(starts).astype(np.float64)[1:-1]  # lengths of the holds that have a step on either side
    steps = q[starts[1:]] - q[starts[:-1]]
    into, out = steps[:-2], steps[1:-1]
    first = starts[1:-2]
    reach = _reach(min(float(np.median(length[length > 1])) if np.any(length > 1) else 1.0, _MAX_HOLD_ROWS))
    pace = travel_per_row(q, reach)[first]
    fast = (pace > _FAST_COUNTS * step) & (length <= _MAX_HOLD_ROWS)
    asked = length * pace
    makes_up = (into * out > 0) & (np.abs(out) > _MAKES_UP[0] * asked) & (np.abs(out) < _MAKES_UP[1] * asked)
    held = fast & makes_up & (length > 1)
    return int(np.sum(length[held] - 1)), int(np.sum(length[fast])), length[held]


def _agree(held: _Held, other: _Held) -> bool:
    """Whether the position columns of two joints repeat their last value in the same rows, among the rows in which both joints move."""
    both = held.fast & other.fast
    if np.count_nonzero(both) < _MIN_HELD_ROWS:
        return True
    # The smaller count of the two joints: a joint that stops at times repeats its position without being held.
    one, two = np.count_nonzero(held.again & both), np.count_nonzero(other.again & both)
    rarer = min(one, two) if other.share >= _SHARE else one
    return bool(np.count_nonzero(held.again & other.again & both) >= _AGREE * rarer)


def _fresh(log: Log, held: list[_Held]) -> NDArray[np.intp]:
    """Return the rows with new positions: one row per period of a regular hold, otherwise all rows in which no moving joint is held."""
    rows = np.arange(len(log))
    beat = _beat(held)
    if beat is not None:
        period, phase = beat
        return np.flatnonzero((rows % period == phase) | (rows == 0))
    stale = np.zeros(len(log), dtype=bool)
    for h in held:
        stale |= h.again & h.moves
    return np.flatnonzero(~stale)


def _beat(held: list[_Held]) -> tuple[int, int] | None:
    """Return period and phase [rows] at which new positions follow a regular hold; None for an irregular hold."""
    fresh = np.unique(np.concatenate([np.flatnonzero(~h.again & h.fast) for h in held]))
    if len(fresh) < _MIN_HELD_ROWS:
        return None
    period = int(np.median(np.diff(fresh)))
    if period < 2:
        return None
    counts = np.bincount(fresh % period, minlength=period)
    phase = int(np.argmax(counts))
    return (period, phase) if counts[phase] >= _REGULAR * len(fresh) else None
