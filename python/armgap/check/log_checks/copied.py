"""Detection of holdout logs that hold rows of training logs, by contents, whatever the files are called.

Two rows are equal if all positions and torques, or references, are equal. Rows that occur more than once in a log (a joint at rest) are
not compared. Equal rows have to agree in time too: one distance between the clocks for many rows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armgap.check.check import Check
from armgap.check.log_checks.outcome import ranges
from armgap.log.log import Log

__all__ = ["copied_holdout"]

# Number of equal rows at one distance in time from which rows count as copied; two runs of one experiment agree to the last digit less often.
_MIN_COPIED_ROWS = 40
# Distances in time that differ by less than this part of a sample period count as one.
_TIME_BIN_PERIODS = 0.5
# Largest hole [rows] in a copied range of rows that is filled: rows that occur twice in a log are not compared.
_MAX_FILLED_ROWS = 50


def copied_holdout(training: Sequence[Log], holdout: Sequence[Log]) -> list[Check]:
    """Return a check for every holdout log that holds rows of a training log.

    Parameters
    ----------
    training, holdout : sequence of Log
        Logs that parameters are fitted to, and logs that models are judged on.

    Returns
    -------
    list of Check
        One check for each pair of logs that shares rows, with the rows of the holdout log.
    """
    known = [_rows(log) for log in training]
    checks = []
    for held in holdout:
        its_rows = _rows(held)
        for log, theirs in zip(training, known, strict=True):
            rows = _common(log, theirs, held, its_rows)
            if len(rows):
                said = (
                    f"{100 * len(rows) / len(held):.0f} % of its rows are rows of {log.name}, which is learnt from: "
                    "its figures flatter"
                )
                remedy = ("hold out a log of another run",)
                checks.append(Check("copied_holdout", "warning", said, remedy, None, held.name, ranges(rows)))
    return checks


def _rows(log: Log) -> tuple[NDArray[np.uint64], NDArray[np.intp]]:
    """Return hash values of those rows whose contents occur once in a log, sorted, and the indices of the rows."""
    keys = np.zeros(len(log), dtype=np.uint64)
    driven = log.tau if log.q_ref is None else log.q_ref
    for column in (*log.q.T, *driven.T):
        # Multiply and shift (a mixing step of SplitMix64): equal rows give equal numbers, unequal rows hardly ever do.
        keys ^= (np.ascontiguousarray(column) + 0.0).view(np.uint64)
        keys *= np.uint64(0xBF58476D1CE4E5B9)
        keys ^= keys >> np.uint64(31)
    numbers, first, counts = np.unique(keys, return_index=True, return_counts=True)
    return numbers[counts == 1], first[counts == 1]


def _common(
    log: Log,
    theirs: tuple[NDArray[np.uint64], NDArray[np.intp]],
    held: Log,
    its_rows: tuple[NDArray[np.uint64], NDArray[np.intp]],
) -> NDArray[np.intp]:
    """Return the rows of the holdout log that also stand in the training log, at one distance in time."""
    _, here, there = np.intersect1d(its_rows[0], theirs[0], assume_unique=True, return_indices=True)
    if len(here) < _MIN_COPIED_ROWS:
        return np.arange(0)
    mine, its = its_rows[1][here], theirs[1][there]
    apart = np.round((held.t[mine] - log.t[its]) / (_TIME_BIN_PERIODS * held.sample_period))
    distances, counts = np.unique(apart, return_counts=True)
    best = distances[np.argmax(counts)]
    same = np.abs(apart - best) <= 1
    if np.count_nonzero(same) < _MIN_COPIED_ROWS:
        return np.arange(0)
    return _filled(np.sort(mine[same]))


def _filled(rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return sorted row indices with the holes of up to `_MAX_FILLED_ROWS` rows between them filled."""
    ends = np.flatnonzero(np.diff(rows) > _MAX_FILLED_ROWS)
    parts = zip(rows[np.r_[0, ends + 1]], rows[np.r_[ends, len(rows) - 1]], strict=True)
    return np.concatenate([np.arange(a, b + 1) for a, b in parts])
