"""What a cause may be instead, which no effect of the library is: equivalents that are added to the causes of a diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armgap.arm.arm import Arm
from armgap.check.check import Check
from armgap.log.log import Log

__all__ = [
    "beside",
    "center_of_mass",
    "common_gain",
    "encoder_scale",
    "gear_losses",
    "late_positions",
    "low_pass",
    "torque_loop",
]

Array = NDArray[np.float64]

#: Probability of a cause beside an equivalent that is as likely a priori, as a part of its probability without it.
_AS_LIKELY = 0.5
#: Standard deviations by which a rotor's inertia has to differ from none to be told from it.
_TOLD = 2.0
#: Relative difference of a gain from the one that belongs to a gear's loss, up to which both are one gear that loses torque in both directions. On
#: five simulated arms of another hand whose friction is a share of the transmitted torque it was 0.01 to 0.06.
_SAME_GEAR = 0.1
#: Delay of a joint's motion beyond that of its measured torque from which the positions are late. On simulated arms of another hand it was 3.5 ms and
#: more for 11 late or low-passed encoders, and at most 0.7 ms where the drive was late [s].
_LATE_POSITIONS_S = 0.002
#: Largest excess of the prior cost with a common factor of all torques over that with a payload, per value that the payload has more.
_BY_CHANCE = 1.0
#: Share of the variance of an encoder's error along the logs that a straight line over the position has to explain for a wrong scale to do the same.
_STRAIGHT_SHARE = 0.95


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


def late_positions(data: dict[str, Any]) -> None:
    """Add late positions to the equivalents of causes that delay a joint's torque, where the measured torque follows the command sooner than that."""
    late = {"actuator_delay": "delay", "actuator_lag": "time_constant"}
    drives = {entry["joint"]: entry["parameters"]["delay"] for entry in data["chain"] if "parameters" in entry}
    for cause in data["causes"]:
        drive = drives.get(cause["joint"])
        if drive is None or cause["effect"] not in late:
            continue
        beyond = cause["parameters"][late[cause["effect"]]]["value"] - drive["value"]
        if beyond > _LATE_POSITIONS_S + _TOLD * drive["sigma"]:
            why = (
                f"the measured torque follows the command {1e3 * drive['value']:.2g} ms late: the positions are late by the other "
                f"{1e3 * beyond:.2g} ms, as by a delay or filter of the encoder"
            )
            cause["equivalents"].append(beside("late_positions", cause["joint"], why, separates=True))


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


def center_of_mass(data: dict[str, Any], arm: Arm) -> None:
    """Add a centre of mass beside the link's axis to the equivalents of an encoder offset of the last joint of a planar arm with gravity.

    Both turn the terms of gravity and of coupling by one angle, in which the last link's angle stands alone.
    """
    if not all(arm.rotary_joints) or len(arm.gravity_parameters) == 0:
        return
    why = "the last link's centre of mass beside its axis turns the same torques by the same angle; a reading at a known position tells them apart"
    for cause in data["causes"]:
        if cause["effect"] == "encoder_offset" and cause["joint"] == arm.n_joints:
            cause["equivalents"].append(beside("center_of_mass", cause["joint"], why))


def gear_losses(data: dict[str, Any]) -> None:
    """Add a gear that loses torque in both directions of power to the equivalents of a torque gain beside a gear efficiency of a planar arm.

    Friction of ``mu`` times the transmitted torque leaves ``tau / (1 + mu)`` of the motor's torque while it drives and ``tau / (1 - mu)`` while it
    brakes: a gain of ``1 / (1 - mu)`` and, beside it, a loss of ``2 mu / (1 + mu)`` while driving.
    """
    losses = {c["joint"]: c["parameters"]["loss"]["value"] for c in data["causes"] if c["effect"] == "gear_efficiency"}
    for cause in data["causes"]:
        if cause["effect"] != "torque_gain":
            continue
        gain = cause["parameters"]["gain"]["value"]
        same = {cause["joint"]: gain}
        # The inverse gain on another joint, where the two are not told apart.
        same |= {e["joint"]: 1.0 / gain for e in cause["equivalents"] if e["effect"] == "torque_gain"}
        for joint, value in same.items():
            loss = losses.get(joint)
            if loss is not None and abs(value * (1.0 - loss / (2.0 - loss)) - 1.0) < min(
                _SAME_GEAR, 0.5 * abs(value - 1.0)
            ):
                cause["probability"] *= _AS_LIKELY
                why = (
                    f"with the loss of {loss:.3g} beside it: a gear that loses torque in both directions does the same"
                )
                cause["equivalents"].append(beside("gear_losses", joint, why))
                break


def common_gain(data: dict[str, Any]) -> None:
    """Add a common factor of all torques to the equivalents of a payload that explains a planar arm's parameters no better.

    A payload is told from the arm's other values by the arm file alone. Drives that all deliver less than they are commanded raise all parameters in
    proportion, at the cost of one value where a payload has two.
    """
    nominal, refit, with_causes = (data["parameters"].get(key) for key in ("nominal", "refit", "with_causes"))
    payloads = [cause for cause in data["causes"] if cause["effect"] == "payload"]
    if not (payloads and nominal and refit and with_causes):
        return
    keys = [key for key, entry in nominal.items() if np.isfinite(entry["sigma"]) and entry["sigma"] > 0.0]
    given, sigma = (np.array([nominal[key][part] for key in keys]) for part in ("value", "sigma"))

    def cost(values: dict[str, Any], factor: float = 1.0) -> float:
        found = np.array([values[key]["value"] for key in keys])
        return float(np.sum(((found * factor - given) / sigma) ** 2))

    found = np.array([refit[key]["value"] for key in keys])
    weight = found / sigma
    factor = float(weight @ (given / sigma) / (weight @ weight))
    if cost(refit, factor) < cost(with_causes) + _BY_CHANCE:
        why = f"torques that are all {factor:.3g} of their commands explain the arm file's values as well; a weighed part tells them apart"
        for cause in payloads:
            cause["probability"] *= _AS_LIKELY
            cause["equivalents"].append(beside("torque_gain", None, why))
