"""Result of a check of one log's columns, and removal of rows from a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.check.check import Check
from armgap.log.log import Log

__all__ = ["NOTHING", "Outcome", "ranges", "seconds", "with_rows"]

# Largest number of row ranges that a check lists.
_LISTED_RANGES = 200


@dataclass(frozen=True)
class Outcome:
    """Result of the check of one log's columns.

    Attributes
    ----------
    checks : tuple of Check
        Defects that were found; severity ``"repaired"`` where `repaired` is the log without them.
    repaired : Log, optional
        The log without the defect.
    kept : ndarray, optional
        Rows of the log that `repaired` keeps; None if it keeps all.
    deed : str
        The repair in words.
    """

    checks: tuple[Check, ...] = ()
    repaired: Log | None = None
    kept: NDArray[np.intp] | None = None
    deed: str = ""


NOTHING = Outcome()


def ranges(rows: NDArray[np.intp] | Sequence[int]) -> tuple[tuple[int, int], ...]:
    """Return sorted rows as ranges ``(first, last)``, 200 ranges at most.

    Examples
    --------
    >>> ranges([3, 4, 5, 9])
    ((3, 5), (9, 9))
    """
    rows = np.asarray(rows, dtype=np.intp)
    if not len(rows):
        return ()
    ends = np.flatnonzero(np.diff(rows) > 1)
    first, last = rows[np.r_[0, ends + 1]], rows[np.r_[ends, len(rows) - 1]]
    return tuple((int(a), int(b)) for a, b in zip(first[:_LISTED_RANGES], last[:_LISTED_RANGES], strict=True))


def seconds(time: float) -> str:
    """Return a time [s] in words, with its unit."""
    return f"{time:.4g} s"


def with_rows(log: Log, kept: NDArray[np.intp], valid: NDArray[np.bool_] | None = None) -> Log:
    """Return the rows `kept` of a log, each with the mean torque, or reference, from its own time to that of the next kept row.

    The torque's impulse over every interval and its first moment are preserved, so that an arm gains the same momentum and travels the same
    distance.

    Parameters
    ----------
    log : Log
        Log, of n samples.
    kept : ndarray
        Rows to keep, increasing.
    valid : ndarray, shape (n_samples, n_joints), optional
        Mask of valid torques; an interval without a valid torque takes the torque before it.
    """
    held = np.append(np.diff(log.t), log.sample_period)[:, None]
    weight = np.broadcast_to(held, log.tau.shape) if valid is None or not log.has_torques else held * valid
    first = int(kept[0])
    starts = kept - first
    impulse = np.add.reduceat(np.where(weight > 0, log.tau, 0.0)[first:] * weight[first:], starts)
    duration = np.add.reduceat(weight[first:], starts)
    empty = duration <= 0
    tau = impulse / np.where(empty, 1.0, duration)
    alone = np.diff(np.append(kept, len(log))) == 1
    tau[alone] = log.tau[kept[alone]]  # no rounding where nothing was left out
    for row, j in np.argwhere(empty):
        tau[row, j] = tau[row - 1, j] if row else 0.0
    arrays: dict[str, Any] = {
        name: None if (x := getattr(log, name)) is None else x[kept]
        for name in ("t", "q", "dq", "dq_ref", "tau_meas", "q_link")
    }
    q_ref = None
    if log.q_ref is not None:
        q_ref = np.add.reduceat((log.q_ref * held)[first:], starts) / np.add.reduceat(held[first:], starts)
        q_ref[alone] = log.q_ref[kept[alone]]
    moment = _moment(log, kept, tau, valid) if log.has_torques else None
    return replace(log, **arrays, tau=tau, q_ref=q_ref, moment=moment)


def _moment(
    log: Log, kept: NDArray[np.intp], mean: NDArray[np.float64], valid: NDArray[np.bool_] | None
) -> NDArray[np.float64]:
    """Return the first moment of the torque about the middle of every interval between kept rows; zero where a torque is not valid."""
    first, counts = int(kept[0]), np.diff(np.append(kept, len(log)))
    ends = np.append(log.t[1:], log.t[-1] + log.sample_period)
    middle = np.repeat(0.5 * (log.t[kept] + np.append(log.t[kept[1:]], ends[-1])), counts)
    held, centre = (ends - log.t)[first:], 0.5 * (ends + log.t)[first:]
    apart = (log.tau[first:] - np.repeat(mean, counts, axis=0)) * (held * (centre - middle))[:, None]
    moment = np.add.reduceat(apart, kept - first)
    if log.moment is not None:
        moment += np.add.reduceat(log.moment[first:], kept - first)
    if valid is not None:
        moment[~np.logical_and.reduceat(valid[first:], kept - first)] = 0.0
    return moment
