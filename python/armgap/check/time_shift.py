"""`time_shift`: torque and position columns shifted in time against each other.

Torques that come too late in the file would act before they are commanded, which is not causal: they are shifted back. Torques
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
from armgap.check.contradiction import BETTER, Refit
from armgap.check.dead_stretch import without_constant
from armgap.check.drive_limit import deliver, delivered
from armgap.check.equation_error import EquationError, Rows, bounds
from armgap.log.log import Log
from armgap.several_joints import by_joint

Mask = NDArray[np.bool_]

__all__ = ["acausal", "causal", "confirmed", "early", "explains_better", "taken_back"]

# Largest shift of the torques that is tried [samples].
_MAX_SHIFT_SAMPLES = 8
# Cut-off of the filters [rad/s]: a shift shows in the motion; a controller's response to encoder noise would hide it. On 74 cases without delay or
# lag the middle 80 % of the estimates are -0.02 to 0.22 samples at 10, 20 and 30 rad/s; the least are -1.5, -0.5 and -0.6 samples. With
# rows that remember a standstill the middle 80 % are 0 to 0.9 samples.
_SHIFT_CUTOFF = 20.0
# Smallest shift of the torques that counts, in samples. On simulated logs with hidden effects the estimate is -0.25 to 0.85 samples off, and
# a lag of a drive cannot make the shift negative.
_COUNTS = 0.6
# Share of the halves of all logs that have to agree on late torques, each half with a shift of at least half of `_COUNTS`.
_AGREEING = 0.75
# Least mean decrease of the logarithm of unexplained torque by a shift. Torques late by four samples gave 0.03 to 5.7 on 38 cases with hidden
# effects, late by two 0.004 to 4.4 (four below 0.03); of 300 cases without this defect one, beside a contact, looked late by four, and gave 0.013.
_LEAST_GAIN = 0.03
# Largest ratio of prediction errors with the shift to prediction errors without it.
_AS_GOOD = 1.02
# Largest ratio of prediction errors with one more sample of shift to those without it, and largest ratio for the first sample of shift. On 24
# development cases torques late by one sample gave 0.01 to 0.72, but for four where an unmodelled effect hides the shift (0.99 to 1.07); on 180 logs
# without this defect the least ratios were 0.87 and 0.89.
_CLEARLY = 0.9
_AT_FIRST = 0.8
# Largest ratio of prediction errors with the shift to those without it, for torques that come early where no delays were named. On three
# arms without effects and with torques early by three samples the ratio was 0.008 to 0.11; for a delay of one joint of two the shift makes
# predictions of the other joint worse.
_MOSTLY = 0.5
# Share of unexplained torque that counts as zero when shifts of the torques are compared.
_SHIFT_SHARE_FLOOR = 1e-7
# Rows of the equation of motion that each half of a log needs for an estimate of the torques' shift.
_MIN_HALF_LOG_ROWS = 200
# Delays of all joints are one shift of the file if they differ by less than this part of a sample, or of their standard deviations.
_EQUAL = 0.5
_EQUAL_SIGMAS = 3.0
# Share of a repaired shift from which delays that a diagnosis names on all joints revoke the repair. Where hysteresis had been taken for late
# torques, the delays were all of the shift (0.99 and 1.00, two cases); a true shift leaves at most the fraction of a sample by which it was rounded.
_TAKEN_BACK = 0.7


def acausal(logs: Sequence[Log], arm: Arm) -> int | None:
    """Return by how many samples the torques of all logs come late in the file; 0 if predictions have to show it first, None if nothing does.

    Predictions have to where only a part of the logs shows a shift, or where it hardly lowers the unexplained torque.
    """
    logs = [without_constant(log) for log in logs]
    logs = deliver(logs, delivered(logs, arm).levels)
    halves = [half for log in logs for half in _halves(log, arm)]
    curves = [_curve(rows, moving, arm) for rows, moving in halves]
    says = [-_minimum(curve) > 0.5 * _COUNTS for curve in curves]
    if not any(says):
        return None
    curve = np.sum(curves, axis=0)
    late = -_minimum(curve)
    gain = (curve[_MAX_SHIFT_SAMPLES] - curve.min()) / sum(moving.sum() for _, moving in halves)
    if not _COUNTS <= late < _MAX_SHIFT_SAMPLES or np.mean(says) < _AGREEING or gain < _LEAST_GAIN:
        return 0
    return max(1, round(late))


def _halves(log: Log, arm: Arm) -> list[tuple[Rows, Mask]]:
    """Return the rows of the equation of motion in two halves of the log, for independent estimates, each with its mask of moving joints.

    Joints that move for fewer than `_MIN_HALF_LOG_ROWS` rows of a half do not count in it; a half without moving joints is left out.
    """
    rows = Rows.of(log, arm, _SHIFT_CUTOFF)
    if len(rows.y) < 2 * _MIN_HALF_LOG_ROWS:
        return []
    moving = rows.moving(log)
    middle = len(rows.y) // 2
    parts = [slice(0, middle), slice(middle, None)]
    halves = [(rows.at(part), moving[part]) for part in parts]
    enough = [(half, mask & (mask.sum(axis=0) >= _MIN_HALF_LOG_ROWS)) for half, mask in halves]
    return [(half, mask) for half, mask in enough if mask.any()]


def _curve(rows: Rows, moving: Mask, arm: Arm) -> NDArray[np.float64]:
    """Return the negative log-likelihood of every shift from -8 to 8 samples by the rows of moving joints, weighted by their unexplained torque.

    Rows within 8 samples of a hole in the log do not count.
    """
    low, high = bounds(arm)
    count = len(rows.y)
    inner = slice(_MAX_SHIFT_SAMPLES, count - _MAX_SHIFT_SAMPLES)
    reach = 2 * _MAX_SHIFT_SAMPLES
    unbroken = rows.samples[reach:] - rows.samples[:-reach] == reach
    counts = moving[inner] & unbroken[:, None]
    weight = counts.sum(axis=0)
    base = EquationError([rows.at(inner).within(counts)], arm)
    shifted = [
        rows.y[_MAX_SHIFT_SAMPLES - s : count - _MAX_SHIFT_SAMPLES - s] * counts
        for s in range(-_MAX_SHIFT_SAMPLES, _MAX_SHIFT_SAMPLES + 1)
    ]
    return np.array(
        [float(np.sum(weight * np.log(base.fit(low, high, [y]).share + _SHIFT_SHARE_FLOOR))) for y in shifted]
    )


def _minimum(costs: NDArray[np.float64]) -> float:
    """Return the minimum of the parabola through the least cost and its neighbours: a shift [samples]; 0 where all shifts cost the same."""
    if np.ptp(costs) == 0:
        return 0.0
    i = int(np.argmin(costs))
    if i in (0, len(costs) - 1):
        return float(i - _MAX_SHIFT_SAMPLES)
    a, b, c = costs[i - 1 : i + 2]
    return float(i - _MAX_SHIFT_SAMPLES + 0.5 * (a - c) / (a - 2 * b + c))


def confirmed(
    samples: int, training: Sequence[Log], holdout: Sequence[Log], arm: Arm, horizon: float
) -> Corrections | None:
    """Return the shift of torques that predictions prefer, or None; `samples` is the shift [samples] by the equation of motion.

    From `samples` the shift changes by one sample at a time for as long as predictions clearly improve. With a large unmodelled effect predictions
    hardly change with a shift, so a shift by several samples is accepted unless predictions get worse. A shift by one sample may come from
    an effect, so it is accepted only if predictions are clearly worse on either side, and better than that of no motion. A shift that needs
    parameters outside the bounds is rejected.
    """
    period = float(np.median(np.concatenate([np.diff(log.t) for log in training])))
    as_is = Refit.within_limits(arm, training, holdout, horizon)
    if samples <= 1:
        as_is = as_is.bounded_by_motion()

    @cache
    def error(k: int) -> float:
        if k == 0 or abs(k) > _MAX_SHIFT_SAMPLES:
            return 1.0 if k == 0 else math.inf
        corrections = Corrections(shift={"tau": -k * period})
        read = [[corrections.on_log(log) for log in group] for group in (training, holdout)]
        refit = Refit.within_limits(arm, read[0], read[1], horizon)
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
    """Return whether named delays on all joints cancel a repaired shift [s] of the torques, so that the shift did not exist."""
    delays = {
        c["joint"]: c["parameters"]["delay"]["value"] for c in by_joint(causes) if c["effect"] == "actuator_delay"
    }
    return shift < 0.0 and len(delays) == n_joints and min(delays.values()) > -_TAKEN_BACK * shift


def explains_better(unshifted: Mapping[str, Any], shifted: Mapping[str, Any]) -> bool:
    """Return whether a diagnosis of unshifted logs leaves clearly smaller prediction errors than the diagnosis of logs with a repaired shift.

    Both arguments are the `gap` of a diagnosis. With presliding friction a joint's torque reverses before its velocity, as with torques that come
    late in the file; a repair that leaves a gap unexplained is therefore compared with the effects of the library on the log as it stands.
    """
    ratios = [a / max(b, np.finfo(float).tiny) for a, b in zip(unshifted["after"], shifted["after"], strict=True)]
    return math.exp(float(np.mean(np.log(np.maximum(ratios, np.finfo(float).tiny))))) < BETTER


def causal(causes: Sequence[Mapping[str, Any]], n_joints: int, period: float) -> Check | None:
    """Return the warning that named delays, equal on all joints, may be torques that stand too early in the file.

    Parameters
    ----------
    causes : sequence of mapping
        Causes of a diagnosis.
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
    """Return the warning that torques stand too early in the file, by predictions alone: for a diagnosis that named no delays.

    Where friction or another effect hides part of the shift, a diagnosis may name no delay of any joint although one shift of all torques
    explains most of the prediction error.
    """
    period = float(np.median(np.concatenate([np.diff(log.t) for log in training])))
    as_is = Refit.within_limits(arm, training, holdout, horizon).bounded_by_motion()
    best, least = 0, 1.0
    while best < _MAX_SHIFT_SAMPLES:
        corrections = Corrections(shift={"tau": (best + 1) * period})
        read = [[corrections.on_log(log) for log in group] for group in (training, holdout)]
        missed = Refit.within_limits(arm, read[0], read[1], horizon).against(as_is)
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
