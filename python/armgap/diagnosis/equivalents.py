"""What a cause may be instead, which no effect of the library is: equivalents that are added to the causes of a diagnosis."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.check.check import Check
from armgap.log.log import Log

__all__ = ["beside", "encoder_scale", "low_pass", "speed_limit", "torque_loop"]

Array = NDArray[np.float64]

#: Probability of a cause beside an equivalent that is as likely a priori, as a part of its probability without it.
_AS_LIKELY = 0.5
#: Standard deviations by which a rotor's inertia has to differ from none to be told from it.
_TOLD = 2.0
#: Shares of a log, by the mean power of the drive and by its mean torque over as long a time, below those in which a push is what a limit that falls
#: with the speed does. Of 19 such events on three simulated arms all have 0.94 and 0.90 or more; of five pushes on a real arm none has.
_POWERFUL, _STRONG = 0.94, 0.9
#: Time with more torque and more speed outside of pushes up to which a push may be a limit, as a part of its duration (from 0.25 to 2 all of 39
#: events of such limits count, on ten simulated arms); and factor on the durations of pushes within which that time does not count.
_BEYOND, _NEAR_PUSH = 0.25, 2.0
#: Share of the variance of an encoder's error along the logs that a straight line over the position has to explain for a wrong scale to do the same.
_STRAIGHT_SHARE = 0.95
#: Time over which velocities are averaged [s].
_SPEED_S = 0.01


def beside(name: str, joint: int | None, why: str, *, separates: bool = False) -> dict[str, Any]:
    """Return an entry of a cause's equivalents for what is no effect of the library; `separates` tells whether a motion tells it from the cause."""
    return {"effect": name, "joint": joint, "why": why, "motion_separates": separates}


def low_pass(data: dict[str, Any], checks: Sequence[Check]) -> None:
    """Add a low-pass of the positions to the equivalents of causes that delay a joint's torque; each gets half of the probability."""
    joints = {check.joint for check in checks if check.check == "filtered_positions"}
    for cause in data["causes"]:
        found = {j for j in cause.get("joints") or [cause["joint"]] if j in joints}
        if found and cause["effect"] in ("actuator_lag", "actuator_delay"):
            cause["probability"] *= _AS_LIKELY
            for joint in sorted(found):
                why = f"q{joint} is smoother than its encoder: a low-pass before logging delays positions as much"
                cause["equivalents"].append(beside("filtered_positions", joint, why))


def torque_loop(data: dict[str, Any]) -> None:
    """Add an underdamped torque loop to the equivalents of an elastic joint beside a delay or lag of the same joint.

    A rotor without inertia behind a spring filters the torque by ``(2 z s/w + 1) / (s^2/w^2 + 2 z s/w + 1)``, and with a lag of ``2 z/w`` it is a
    torque loop of second order. The two are the same where the logs do not tell the rotor's inertia from none and the encoder is at the link.
    """
    late = {c["joint"] for c in data["causes"] if c["effect"] in ("actuator_lag", "actuator_delay")}
    for cause in data["causes"]:
        if cause["effect"] != "joint_elasticity" or cause["joint"] not in late:
            continue
        rotor = cause["parameters"].get("rotor_inertia")
        at_link = (cause.get("sides") or {}).get("encoder") != "motor"
        if at_link and rotor is not None and not _TOLD * rotor["sigma"] < rotor["value"]:
            cause["probability"] *= _AS_LIKELY
            why = "with the delay or lag beside it: the rotor's inertia is not told from none, and a torque loop of second order does the same"
            cause["equivalents"].append(beside("torque_loop_resonance", cause["joint"], why))


def encoder_scale(data: dict[str, Any], logs: Sequence[Log]) -> None:
    """Add a wrong scale of the positions to the equivalents of an encoder's eccentricity that is nearly straight over the joint's travel.

    A wrong gear ratio, or a wrong number of counts per turn, gives an error in proportion to the position, as a sine does over less than a turn.
    """
    for cause in data["causes"]:
        if cause["effect"] != "encoder_eccentricity" or cause["joint"] is None:
            continue
        q = np.concatenate([log.q[:, cause["joint"] - 1] for log in logs])
        a, b = (float(cause["parameters"][name]["value"]) for name in ("a", "b"))
        error = a * np.sin(q) + b * np.cos(q)
        if np.ptp(q) == 0.0 or error.std() == 0.0:
            continue
        if np.corrcoef(q, error)[0, 1] ** 2 > _STRAIGHT_SHARE:
            why = "over this travel the error is nearly in proportion to the position, as with a wrong gear ratio or counts per turn"
            cause["equivalents"].append(beside("encoder_scale", cause["joint"], why, separates=True))


def speed_limit(data: dict[str, Any], logs: Sequence[Log]) -> None:
    """Add a limit of the torque that falls with the speed to the equivalents of pushes that are what such a limit does.

    A push counts if it acts against the command while the drive gives nearly as much power and torque as anywhere in the log, and if the joint hardly
    ever has more torque and more speed at once without a push: there the limit would act too. The probability is halved, and halved again for each
    further such push on the same joint, as pushes come at any time.
    """
    by_name = {log.name: log for log in logs}
    pushes = [c for c in data["causes"] if c.get("log") in by_name and c["joint"] is not None]
    found = [cause for cause in pushes if _is_limit(cause, pushes, by_name)]
    count = Counter(cause["joint"] for cause in found)
    for cause in found:
        cause["probability"] *= _AS_LIKELY ** count[cause["joint"]]
        why = (
            "it acts against the command where the drive gives nearly as much power as anywhere in the log: a limit that falls with the speed, as by "
            "the supply voltage, does the same, and comes back when the motion is repeated"
        )
        cause["equivalents"].append(beside("torque_speed_limit", cause["joint"], why, separates=True))


def _is_limit(push: dict[str, Any], pushes: Sequence[dict[str, Any]], logs: dict[str, Log]) -> bool:
    log, j = logs[push["log"]], push["joint"] - 1
    during = _during(push, log, 1.0)
    if not during.any():
        return False
    tau, speed = log.tau[:, j], _speed(log, j)
    at_push = float(tau[during].mean()), float(speed[during].mean())
    against = float(push["parameters"]["impulse"]["value"]) * at_push[0] < 0.0
    drives = at_push[0] * at_push[1] > 0.0
    samples = int(during.sum())
    ranks = [
        float(np.mean(_mean(x, samples) < x[during].mean())) for x in (tau * speed, np.sign(tau[during].sum()) * tau)
    ]
    if not (against and drives and ranks[0] >= _POWERFUL and ranks[1] >= _STRONG):
        return False
    beyond = 0.0
    for other in logs.values():
        free = np.ones(len(other), dtype=bool)
        for known in pushes:
            if known["joint"] == push["joint"] and known["log"] == other.name:
                free &= ~_during(known, other, _NEAR_PUSH)
        ratio = [x / at for x, at in zip((other.tau[:, j], _speed(other, j)), at_push, strict=True)]
        # The same direction as at the push, or both the other way round.
        more = (ratio[0] * ratio[1] > 0.0) & (np.minimum(np.abs(ratio[0]), np.abs(ratio[1])) >= 1.0)
        beyond += float(np.count_nonzero(more & free)) * other.sample_period
    return beyond <= _BEYOND * samples * log.sample_period


def _during(push: dict[str, Any], log: Log, wide: float) -> NDArray[np.bool_]:
    """Return a mask of a log's samples within a push, whose duration is multiplied by `wide`."""
    time, duration = (float(push["parameters"][name]["value"]) for name in ("time", "duration"))
    return np.abs(log.t - time) <= 0.5 * wide * duration


def _speed(log: Log, j: int) -> Array:
    """Return the velocity of joint `j` (from 0), averaged over `_SPEED_S`."""
    return _mean(np.gradient(log.q[:, j], log.t), round(_SPEED_S / log.sample_period))


def _mean(x: Array, samples: int) -> Array:
    """Return the running mean over some samples, at least one."""
    width = max(samples, 1)
    return np.convolve(x, np.full(width, 1.0 / width), "same")
