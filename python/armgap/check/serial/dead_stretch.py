"""`dead_stretch` on serial arms: torques that are constant over a stretch, or throughout, although the joint moves as if it were driven."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.check import Check
from armgap.check.dead_stretch import (
    DEAD_SHARE,
    MISFIT_RATIO,
    Run,
    beyond_friction,
    constant_torques,
    dead_check,
    merged,
)
from armgap.check.serial.weak_form import MOST_INTERVALS, LogRows, Rows
from armgap.log.log import Log

__all__ = ["find"]

# Share of the mean square of a joint's largest torque (inertial, or of gravity) that a torque column lacks from which a column that is constant
# throughout was not recorded. A joint without a drive moves so that these torques and friction cancel: its column lacks the model's errors.
_NOT_RECORDED = 0.3
# Mean of the sign of a joint's velocity over a test function, from which the joint moves one way throughout.
_ONE_WAY = 0.99
# Smallest number of rows of the weak form, inside and outside of a stretch, by which the stretch is judged.
_FEWEST_ROWS = 10


def find(logs: Sequence[Log], arm: Arm) -> tuple[Corrections, list[Check]]:
    """Find torques of serial arms that were not recorded.

    Parameters
    ----------
    logs : sequence of Log
        Logs of one arm; those without torque columns are not judged.
    arm : Arm
        Nominal model, of kind ``"serial"``.

    Returns
    -------
    Corrections
        Spans of the logs to leave out.
    list of Check
        One check per dead stretch of a joint, or of joints whose torques are missing over the same rows.
    """
    logs = [log for log in logs if log.has_torques]
    runs = [_runs(log) for log in logs]
    if not any(runs):
        return Corrections(), []
    most = MOST_INTERVALS // len(logs)
    pairs = [
        (LogRows.of(log, arm, *_undisturbed(log, of_log, most)), of_log) for log, of_log in zip(logs, runs, strict=True)
    ]
    known = [rows for rows, _ in pairs if rows is not None]
    if not known:
        return Corrections(), []
    alive = [_alive(rows, of_log) for rows, of_log in pairs if rows is not None]
    reference = Rows.of_rows(known, alive)
    theta = arm.theta if reference is None else reference.fit(arm, np.ones(arm.n_joints)).theta
    outside = _mean_squares([r.y - r.psi @ theta for r in known], alive)
    checks: list[Check] = []
    for log, of_log in zip(logs, runs, strict=True):
        within = {run: LogRows.of(log, arm, run[1], min(run[2], run[1] + most) + 1) for run in of_log}
        judged = (_judged(log, run, rows, arm, theta, outside) for run, rows in within.items() if rows)
        said = [check for check in judged if check]
        spans = [check for check in said if _skipped(check)]
        checks += [*merged(spans), *(check for check in said if check not in spans)]
    skip = tuple(span for check in checks for span in _skipped(check))
    return Corrections(skip=skip), [check for check in checks if not _said_before(check, checks)]


def _skipped(check: Check) -> list[str]:
    """Return the spans that the remedies of a check leave out."""
    return [word.removeprefix("--skip ") for word in check.remedies if word.startswith("--skip ")]


def _said_before(check: Check, checks: Sequence[Check]) -> bool:
    """Return whether another log comes first in `checks` whose column was not recorded either: one remedy is said once."""
    first = next(c for c in checks if c.remedies == check.remedies and c.joint == check.joint)
    return first is not check


def _mean_squares(residuals: Sequence[NDArray[np.float64]], used: Sequence[NDArray[np.bool_]]) -> NDArray[np.float64]:
    """Return the mean square of each joint's residuals over the rows that are used, of all logs; 0 for a joint with fewer than `_FEWEST_ROWS`."""
    residual, mask = np.concatenate(residuals), np.concatenate(used)
    count = mask.sum(axis=0)
    square = (mask * residual**2).sum(axis=0)
    return np.where(count < _FEWEST_ROWS, 0.0, square / np.maximum(count, 1))


def _runs(log: Log) -> list[Run]:
    """Return the stretches over which a joint's torque does not change; the whole log where it never does."""
    constant = np.flatnonzero((log.tau == log.tau[0]).all(axis=0))
    return [*constant_torques(log), *((int(j), 0, len(log) - 1) for j in constant)]


def _undisturbed(log: Log, runs: Sequence[Run], most: int) -> tuple[int, int]:
    """Return the samples, first and end, of at most `most` intervals in the middle of the longest part of a log between runs of constant torque."""
    edges = [0]
    for _, first, last in sorted(
        (run for run in runs if (run[1], run[2]) != (0, len(log) - 1)), key=lambda run: run[1]
    ):
        edges += [first, max(last, edges[-1])]
    edges.append(len(log))
    begin, end = max(zip(edges[::2], edges[1::2], strict=True), key=lambda part: part[1] - part[0])
    count = min(end - begin, most + 1)
    begin += (end - begin - count) // 2
    return begin, begin + count


def _alive(rows: LogRows, runs: Sequence[Run]) -> NDArray[np.bool_]:
    """Return which rows of which joint depend on no torque within a run of constant torque."""
    alive = np.ones(rows.y.shape, dtype=bool)
    for j, first, last in runs:
        alive[(rows.last >= first) & (rows.first <= last), j] = False
    return alive


def _judged(
    log: Log, run: Run, rows: LogRows, arm: Arm, theta: NDArray[np.float64], outside: NDArray[np.float64]
) -> Check | None:
    """Return a check of a run in which the equation of motion lacks much more torque than outside of it; None otherwise."""
    j, first, last = run
    inside = np.ones(len(rows.y), dtype=bool)
    whole = (first, last) == (0, len(log) - 1)
    if whole:
        # Friction holds a joint at rest with any torque, so that only rows count in which the joint moves one way.
        inside &= np.abs(rows.psi[:, j, 12 * log.n_joints + j]) > _ONE_WAY
    if inside.sum() < _FEWEST_ROWS:
        return None
    asked = rows.psi[inside, j] * theta
    residual = rows.y[inside, j] - asked.sum(axis=1)
    if not whole:
        coulomb = 12 * log.n_joints + j
        moving = np.abs(rows.psi[inside, j, coulomb]) > _ONE_WAY
        residual = beyond_friction(residual, moving, max(float(theta[coulomb]), float(arm.theta[coulomb])))
    within = float(np.mean(residual**2))
    inertial = 10 * rows.y.shape[1]
    largest = max(float(np.mean(asked[:, :inertial].sum(axis=1) ** 2)), float(np.mean(rows.y[:, j] ** 2)))
    if whole:
        lacks = _beside_friction(rows.psi[inside, j], residual, j)
        not_recorded = lacks > _NOT_RECORDED * largest and within > MISFIT_RATIO * outside[j]
        return _not_recorded(log, j, within) if not_recorded else None
    if within > MISFIT_RATIO * outside[j] and within > DEAD_SHARE * largest:
        return dead_check(log, run, within, float(outside[j]))
    return None


def _beside_friction(psi: NDArray[np.float64], residual: NDArray[np.float64], j: int) -> float:
    """Return the mean square of a joint's residual torque that viscous and Coulomb friction of any size leave."""
    n_joints = psi.shape[1] // 13
    friction = psi[:, [11 * n_joints + j, 12 * n_joints + j]]
    found = np.linalg.lstsq(friction, residual, rcond=None)[0]
    return float(np.mean((residual - friction @ found) ** 2))


def _not_recorded(log: Log, j: int, within: float) -> Check:
    kind = f"tau{j + 1}"
    message = (
        f"`{kind}` stays at {log.tau[0, j]:.4g} throughout {log.recording} while the joint moves as if driven: the torque that is "
        f"missing is {np.sqrt(within):.3g} (RMS); name the column that holds it, or give logs with this torque"
    )
    rows = ((log.first_row, log.first_row + len(log) - 1),)
    return Check("dead_stretch", "error", message, (f"--columns {kind}=NAME",), j + 1, log.recording, rows)
