"""`time_shift` of serial arms: torques that stand too late in the file, by the weak form of the equation of motion.

A shift of the torques moves no regressor, so that all shifts share one set of normal matrices. Torques that stand too early look like a delay of the
drives, which is an effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.check import Check
from armgap.check.serial.weak_form import LogRows, Rows, rows_of, taps_of, torques_averaged
from armgap.log.log import Log

__all__ = ["late_torques"]

Array = NDArray[np.float64]

# Largest shift that is tried: in samples, or in time [s] where that is more. A low-pass of logged currents delays them by some ten milliseconds.
_MOST_SAMPLES, _MOST_S = 8, 0.03
# Smallest shift that counts [samples]: torques that are held until the next row, and positions that are read within a period, scatter by half.
_COUNTS = 0.6
# Part of the halves of all logs that have to agree on late torques.
_AGREEING = 0.75
# Mean decrease, over joints, of the logarithm of the unexplained part of the mean square torque. Torques late by 10 ms gave 0.96 on a simulated arm
# of seven joints, those behind a low-pass of 20 ms 1.4 on one of six; arms without this defect gave 0 on nine of ten, and with presliding friction
# 0.03 and 0.7, which predictions tell from a shift.
_LEAST_SERIAL_GAIN = 0.2


def late_torques(logs: Sequence[Log], arm: Arm, *, repair: bool) -> tuple[Corrections, list[Check]]:
    """Find a common time by which the torques of all logs stand too late in the file.

    Parameters
    ----------
    logs : sequence of Log
        Logs of the arm.
    arm : Arm
        Nominal model, of kind ``"serial"``.
    repair : bool
        Whether torques are shifted back; otherwise they are only reported.

    Returns
    -------
    Corrections
        Shift of the torques; empty without this defect, or without repair.
    list of Check
        One check where torques stand too late.
    """
    if not all(log.has_torques for log in logs):
        return Corrections(), []
    period = float(np.median(np.concatenate([np.diff(log.t) for log in logs])))
    most = max(_MOST_SAMPLES, round(_MOST_S / period))
    found = [(log, rows) for log, rows in rows_of(logs, arm) if len(rows.first)]
    shifts = range(-most, most + 1)
    halves = [half for log, rows in found for half in _halves(log, _inner(rows, log, most))]
    if not halves:
        return Corrections(), []
    each = [_costs([half], arm, shifts) for half in halves]
    costs = _costs(halves, arm, shifts)
    best = _minimum(costs, shifts)
    agree = np.mean([_minimum(of_half, shifts) <= -0.5 * _COUNTS for of_half in each])
    if not -most < best <= -_COUNTS or agree < _AGREEING or costs[most] - costs.min() < _LEAST_SERIAL_GAIN:
        return Corrections(), []
    shift = float(f"{min(round(best), -1) * period:.6g}")
    corrections = Corrections(shift={"tau": shift})
    message = (
        f"torques stand {-1e3 * shift:.3g} ms too late in the file, or are low-passed by as much: joints answer to them before they are commanded; "
        f"{'their times were shifted back' if repair else 'shifted back they explain the motion better'}"
    )
    check = Check("time_shift", "repaired" if repair else "warning", message, corrections.options())
    return corrections if repair else Corrections(), [check]


def _inner(rows: LogRows, log: Log, margin: int) -> LogRows:
    """Return the rows that also depend on samples of the log with torques shifted by up to `margin` samples."""
    return rows.at((rows.first >= margin) & (rows.last < len(log) - margin))


def _halves(log: Log, rows: LogRows) -> list[tuple[Log, LogRows]]:
    """Return the first and the second half of a log's rows."""
    middle = len(rows.first) // 2
    index = np.arange(len(rows.first))
    return [(log, part) for part in (rows.at(index < middle), rows.at(index >= middle)) if len(part.first)]


def _costs(parts: Sequence[tuple[Log, LogRows]], arm: Arm, shifts: Sequence[int]) -> Array:
    """Return, for every shift [samples], the mean logarithm over joints of the unexplained part of the mean square torque."""

    def cost(shift: int) -> float:
        rows = [
            replace(part, y=torques_averaged(np.roll(log.tau, shift, axis=0), part.first, taps_of(log)))
            for log, part in parts
        ]
        together = Rows.of_rows(rows, [np.ones(part.y.shape, dtype=bool) for part in rows])
        if together is None:
            return 0.0
        share = together.fit(arm, np.ones(arm.n_joints)).share
        return float(np.mean(np.log(share[share > 0.0]))) if (share > 0.0).any() else 0.0

    return np.array([cost(shift) for shift in shifts])


def _minimum(costs: Array, shifts: Sequence[int]) -> float:
    """Return the minimum of the parabola through the least cost and its neighbours [samples]."""
    i = int(np.argmin(costs))
    if i in (0, len(costs) - 1) or np.ptp(costs[i - 1 : i + 2]) == 0.0:
        return float(shifts[i])
    a, b, c = costs[i - 1 : i + 2]
    return float(shifts[i] + 0.5 * (a - c) / (a - 2 * b + c))
