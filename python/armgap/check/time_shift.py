"""`time_shift`: torque and position columns shifted against each other.

Torques that come too late in the file would act before they are commanded, which nothing in an arm does: they are shifted back. Torques
that come too early look like a delay of the drive, which is an effect (`actuator_delay`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm import Arm
from armgap.check.check import Check
from armgap.check.contradiction import Refit
from armgap.check.corrections import Corrections
from armgap.check.equation_error import EquationError, Rows, bounds
from armgap.log import Log

__all__ = ["acausal", "causal", "confirmed"]

# Shifts that are tried [samples].
_LARGEST = 8
# A shift is looked at more closely from this part of a sample on; friction that is not modelled moves the estimate by as much.
_COUNTS = 0.3
# Predictions with the shift have to miss by less than this part of what they miss without.
_BETTER = 0.9
# Delays of all joints are one shift of the file if they differ by less than this part of a sample, or by this many of their deviations.
_EQUAL = 0.5
_EQUAL_SIGMAS = 3.0
# Blocks of rows that have to agree, and how sure they have to be [standard deviations].
_BLOCKS = 12
_SURE = 3.0


def acausal(logs: Sequence[Log], arm: Arm) -> int:
    """Return by how many samples the torques of all logs come late in the file; 0 if they do not."""
    estimates = []
    for log in logs:
        rows = Rows.of(log, arm)
        if len(rows.y) < 10 * _BLOCKS:
            continue
        estimates += _by_block(rows, arm)
    if len(estimates) < _BLOCKS:
        return 0
    late = -np.asarray(estimates)
    middle = float(np.median(late))
    deviation = 1.2533 * float(np.median(np.abs(late - middle))) * 1.4826 / np.sqrt(len(late))
    if middle < _COUNTS or middle < _SURE * deviation:
        return 0
    return min(max(1, round(middle)), _LARGEST)


def _by_block(rows: Rows, arm: Arm) -> list[float]:
    """Return the shift that explains each block of rows best, under the parameters that explain all of them best [samples]."""
    low, high = bounds(arm)
    shifts = np.arange(-_LARGEST, _LARGEST + 1)
    base = EquationError([rows], arm)
    costs = [base.fit(low, high, [np.roll(rows.y, s, axis=0)]).cost for s in shifts]
    best = int(shifts[int(np.argmin(costs))])
    theta = base.fit(low, high, [np.roll(rows.y, best, axis=0)]).theta
    expected = rows.psi @ theta
    inside = slice(_LARGEST, len(rows.y) - _LARGEST)
    blocks = np.array_split(np.arange(len(rows.y))[inside], _BLOCKS)
    found = []
    for block in blocks:
        squares = np.array([_square(expected[block], rows.y[block - s], base.scale) for s in shifts])
        at = _minimum(shifts, squares)
        if at is not None:
            found.append(at)
    return found


def _square(expected: NDArray[np.float64], y: NDArray[np.float64], scale: NDArray[np.float64]) -> float:
    return float(np.sum((y - expected) ** 2 / scale))


def _minimum(shifts: NDArray[np.intp], squares: NDArray[np.float64]) -> float | None:
    """Return where a parabola through the least value and its neighbours is least; None where the least lies at an end."""
    i = int(np.argmin(squares))
    if i in (0, len(squares) - 1):
        return None
    a, b, c = squares[i - 1 : i + 2]
    curvature = a - 2 * b + c
    return float(shifts[i] + 0.5 * (a - c) / curvature) if curvature > 0 else None


def confirmed(
    samples: int, training: Sequence[Log], holdout: Sequence[Log], arm: Arm, horizon: float
) -> Corrections | None:
    """Return the shift that predictions confirm: better than none, and than one sample more or less.

    Prediction errors grow in proportion to a shift that is left, so a descent from `samples` finds the least.
    """
    period = float(np.median(np.concatenate([np.diff(log.t) for log in training])))
    as_is = Refit.of(arm, training, holdout, horizon)
    errors = {0: 1.0}

    def error(k: int) -> float:
        if k not in errors:
            corrections = Corrections(shift={"tau": -k * period})
            read = [[corrections.on_log(log) for log in group] for group in (training, holdout)]
            errors[k] = Refit.of(arm, read[0], read[1], horizon).against(as_is)
        return errors[k]

    best = samples
    while 0 < best < 2 * _LARGEST:
        near = min((best - 1, best, best + 1), key=error)
        if near == best:
            break
        best = near
    if best <= 0 or error(best) > _BETTER:
        return None
    return Corrections(shift={"tau": float(f"{-best * period:.6g}")})


def causal(causes: Sequence[Mapping[str, Any]], n_joints: int, period: float) -> Check | None:
    """Return the warning that named delays, equal on all joints, may be torques that stand too early in the file.

    Parameters
    ----------
    causes : sequence of mapping
        The causes of a diagnosis.
    n_joints : int
        Number of joints.
    period : float
        Sample period [s].
    """
    delays = {cause["joint"]: cause["parameters"]["delay"] for cause in causes if cause["effect"] == "actuator_delay"}
    if len(delays) < n_joints:
        return None
    values = [delay["value"] for delay in delays.values()]
    sigmas = [delay["sigma"] for delay in delays.values()]
    if max(values) - min(values) > max(_EQUAL * period, _EQUAL_SIGMAS * float(np.hypot.reduce(sigmas))):
        return None
    shift = float(np.mean(values))
    message = (
        f"all joints answer {1e3 * shift:.3g} ms late: a delay of the drives, or torques that stand that much too early in the file; "
        "no log of motion tells the two apart"
    )
    return Check("time_shift", "warning", message, (f"--shift tau={shift:.4g}",))
