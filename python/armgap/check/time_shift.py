"""`time_shift`: torque and position columns shifted against each other.

Torques that come too late in the file would act before they are commanded, which nothing in an arm does: they are shifted back. Torques
that come too early look like a delay of the drive, which is an effect (`actuator_delay`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.arm.corrections import Corrections
from armgap.check.check import Check
from armgap.check.contradiction import Refit
from armgap.check.equation_error import EquationError, Rows, bounds
from armgap.log.log import Log
from armgap.several_joints import by_joint

__all__ = ["acausal", "causal", "confirmed", "early", "taken_back"]

# Shifts that are tried [samples].
_LARGEST = 8
# Cut-off of the filters [rad/s]: a shift shows in the motion itself; what a controller makes of encoder noise would hide it.
_CUTOFF = 10.0
# A shift counts from this part of a sample on. On simulated logs with hidden effects the estimate is -0.25 to 0.85 samples off, and
# earlier (a negative shift) is the side that no drive's lag is on.
_COUNTS = 0.6
# So many of the halves of all logs have to agree, each by half as much.
_AGREEING = 0.75
# Predictions with the shift may miss by no more than this part of what they miss without.
_AS_GOOD = 1.02
# A shift by one more sample has to lower the misses to this part; the first one to that part. On 24 development cases torques late by one sample
# gave 0.01 to 0.72, but for four where an unmodelled effect hides it (0.99 to 1.07); on 180 logs in order the least were 0.87 and 0.89.
_CLEARLY = 0.9
_AT_FIRST = 0.8
# Torques that come early, where no delays say so: predictions with the shift miss by less than this part of what they miss without. On three
# arms without effects and torques early by three samples they missed by 0.008 to 0.11; one joint of two that is late makes the other worse.
_MOSTLY = 0.5
# A share of torque that nothing tells from none.
_EXACT = 1e-7
# A half needs so many rows.
_FEWEST = 200
# Delays of all joints are one shift of the file if they differ by less than this part of a sample, or by this many of their deviations.
_EQUAL = 0.5
_EQUAL_SIGMAS = 3.0
# Delays of all joints that make up this part of a repaired shift take it back. Where hysteresis had passed for late torques they made up all of it
# (0.99 and 1.00, two cases); a shift that is there leaves at most the fraction of a sample that it was rounded by.
_TAKEN_BACK = 0.7


def acausal(logs: Sequence[Log], arm: Arm) -> int | None:
    """Return by how many samples the torques of all logs come late in the file; 0 if only a part of them says so, None if nothing does."""
    curves = [_curve(half, arm) for log in logs for half in _halves(Rows.of(log, arm, _CUTOFF))]
    says = [-_minimum(curve) > 0.5 * _COUNTS for curve in curves]
    if not any(says):
        return None
    late = -_minimum(np.sum(curves, axis=0))
    if not _COUNTS <= late < _LARGEST or np.mean(says) < _AGREEING:
        return 0
    return max(1, round(late))


def _halves(rows: Rows) -> list[Rows]:
    """Return the rows in two halves, for estimates that are independent of each other."""
    middle = len(rows.y) // 2
    parts = [slice(0, middle), slice(middle, None)]
    halves = [Rows(rows.psi[part], rows.y[part], rows.samples[part]) for part in parts]
    return [half for half in halves if len(half.y) >= _FEWEST]


def _curve(rows: Rows, arm: Arm) -> NDArray[np.float64]:
    """Return the log-likelihood's cost of every shift, joints weighted by what they leave unexplained."""
    low, high = bounds(arm)
    count = len(rows.y)
    inner = slice(_LARGEST, count - _LARGEST)
    base = EquationError([Rows(rows.psi[inner], rows.y[inner], rows.samples[inner])], arm)
    shifted = [rows.y[_LARGEST - s : count - _LARGEST - s] for s in range(-_LARGEST, _LARGEST + 1)]
    return np.array([count * float(np.sum(np.log(base.fit(low, high, [y]).share + _EXACT))) for y in shifted])


def _minimum(costs: NDArray[np.float64]) -> float:
    """Return the shift where a parabola through the least cost and its neighbours is least [samples]."""
    i = int(np.argmin(costs))
    if i in (0, len(costs) - 1):
        return float(i - _LARGEST)
    a, b, c = costs[i - 1 : i + 2]
    return float(i - _LARGEST + 0.5 * (a - c) / (a - 2 * b + c))


def confirmed(
    samples: int, training: Sequence[Log], holdout: Sequence[Log], arm: Arm, horizon: float
) -> Corrections | None:
    """Return the shift that predictions prefer, or none; `samples` is what the equation of motion says.

    From there the shift moves on, a sample at a time, for as long as predictions clearly gain. Beside a large unmodelled effect they hardly
    change with a shift, so they need not gain where the equation of motion has found several samples: only not lose. A single sample may be the
    doing of an effect, so there predictions decide, and only where they are clearly worse on either side. A shift with which the log wants
    parameters that no arm has explains nothing.
    """
    period = float(np.median(np.concatenate([np.diff(log.t) for log in training])))
    as_is = Refit.of(arm, training, holdout, horizon)

    @cache
    def error(k: int) -> float:
        if k == 0 or abs(k) > _LARGEST:
            return 1.0 if k == 0 else math.inf
        corrections = Corrections(shift={"tau": -k * period})
        read = [[corrections.on_log(log) for log in group] for group in (training, holdout)]
        refit = Refit.of(arm, read[0], read[1], horizon)
        return refit.against(as_is) if refit.possible(arm) else math.inf

    best = samples if samples > 1 else 0
    while error(k := min((best - 1, best + 1), key=error)) < (_CLEARLY if best else _AT_FIRST) * error(best):
        best = k
    if best <= 0 or error(best) > _AS_GOOD:
        return None
    if samples <= 1 and error(best) > _CLEARLY * error(best + 1):
        return None
    return Corrections(shift={"tau": float(f"{-best * period:.6g}")})


def taken_back(causes: Sequence[Mapping[str, Any]], n_joints: int, shift: float) -> bool:
    """Return whether named delays on all joints undo a shift [s] of the torques that was repaired before: then none was there."""
    delays = {
        c["joint"]: c["parameters"]["delay"]["value"] for c in by_joint(causes) if c["effect"] == "actuator_delay"
    }
    return shift < 0.0 and len(delays) == n_joints and min(delays.values()) > -_TAKEN_BACK * shift


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
    delays = {
        cause["joint"]: cause["parameters"]["delay"]
        for cause in by_joint(causes)
        if cause["effect"] == "actuator_delay"
    }
    if len(delays) < n_joints:
        return None
    values = [delay["value"] for delay in delays.values()]
    sigmas = [delay["sigma"] for delay in delays.values()]
    if max(values) - min(values) > max(_EQUAL * period, _EQUAL_SIGMAS * float(np.hypot.reduce(sigmas))):
        return None
    return _said(float(np.mean(values)))


def early(training: Sequence[Log], holdout: Sequence[Log], arm: Arm, horizon: float) -> Check | None:
    """Return the warning that torques stand too early in the file, by predictions alone: for a gap that no delays were named for.

    Where friction or another effect hides a part of it the diagnosis may find no delay of each joint that it could name, though one shift of
    all torques explains most of what is missed.
    """
    period = float(np.median(np.concatenate([np.diff(log.t) for log in training])))
    as_is = Refit.of(arm, training, holdout, horizon)
    best, least = 0, 1.0
    while best < _LARGEST:
        corrections = Corrections(shift={"tau": (best + 1) * period})
        read = [[corrections.on_log(log) for log in group] for group in (training, holdout)]
        missed = Refit.of(arm, read[0], read[1], horizon).against(as_is)
        if missed > (_CLEARLY if best else _AT_FIRST) * least:
            break
        best, least = best + 1, missed
    return _said(best * period) if least < _MOSTLY else None


def _said(shift: float) -> Check:
    message = (
        f"all joints answer {1e3 * shift:.3g} ms late: a delay of the drives, or torques that stand that much too early in the file; "
        "no log of motion tells the two apart"
    )
    return Check("time_shift", "warning", message, (f"--shift tau={shift:.4g}",))
