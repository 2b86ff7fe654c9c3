"""All checks of a single log's columns, in the order in which one defect can hide another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.check.log_checks import filtered, quantized, repeated, spike, stamps, wrapped
from armgap.check.log_checks.copied import copied_holdout
from armgap.check.log_checks.outcome import Outcome
from armgap.log.log import Log

__all__ = ["LOG_CHECKS", "copied_holdout", "data_checks"]

LOG_CHECKS: tuple[Callable[[Log, Arm | None], Outcome], ...] = (
    wrapped.look,
    spike.look,
    repeated.look,
    stamps.look,
    filtered.look,
    quantized.look,
)

_REMEDY = "leave out --no-repair"


def data_checks(log: Log, arm: Arm | None, *, repair: bool) -> tuple[Log, list[Check]]:
    """Find defects of a single log, and repair those that can be repaired without guessing.

    Parameters
    ----------
    log : Log
        Log as read from its file.
    arm : Arm, optional
        Arm of the log, for the step of its encoders and the kind of its joints.
    repair : bool
        Whether to repair defects. If not, a repairable defect becomes a warning.

    Returns
    -------
    log : Log
        The repaired log, or `log` itself.
    checks : list of Check
        Defects that were found; row numbers refer to the log as it was given.
    """
    current, rows = log, None
    said: list[Check] = []
    for look in LOG_CHECKS:
        outcome = look(current, arm)
        said += [_worded(check, outcome, rows, repair=repair) for check in outcome.checks]
        if outcome.repaired is None:
            continue
        current = outcome.repaired
        if outcome.kept is not None:
            rows = outcome.kept if rows is None else rows[outcome.kept]
    return (current if repair else log), said


def _worded(check: Check, outcome: Outcome, rows: NDArray[np.intp] | None, *, repair: bool) -> Check:
    """Return a check with row numbers of the original log, and with a message of what was, or could be, repaired."""
    if rows is not None:
        check = replace(check, rows=tuple((int(rows[a]), int(rows[b])) for a, b in check.rows))
    if check.severity != "repaired":
        return check
    if repair:
        return replace(check, message=f"{check.message}; {outcome.deed}")
    return replace(check, severity="warning", remedies=(_REMEDY,))
