"""Pushes of a diagnosis in a sentence: where there are more than a few, their values are left to the tables."""

from __future__ import annotations

from itertools import groupby
from typing import Any

__all__ = ["many_pushes", "times_of_pushes"]

#: Laws that a diagnosis lists as equivalents of pushes, and what they are.
LAWS = {
    "torque_rate_limit": "a limit of the drive",
    "torque_speed_limit": "a limit of the drive",
    "torque_asymmetric_limit": "a limit of the drive",
    "uneven_friction": "uneven friction",
}
#: Largest number of pushes whose values a summary gives; of more it gives joints, logs, times and probabilities.
MOST_PUSHES = 2


def many_pushes(causes: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the causes without their pushes, and a sentence on these, where there are more than `MOST_PUSHES`; else all causes and no sentence."""
    pushes = [cause for cause in causes if cause.get("log")]
    if len(pushes) <= MOST_PUSHES:
        return causes, []
    return [cause for cause in causes if not cause.get("log")], [times_of_pushes(pushes)]


def times_of_pushes(pushes: list[dict[str, Any]]) -> str:
    """Return joints, logs, times and probabilities of pushes as one sentence.

    Examples
    --------
    >>> found = [(1, 3.347, 0.50), (2, 4.447, 0.49), (1, 1.731, 0.54)]
    >>> times_of_pushes([{"joint": j, "log": "run", "parameters": {"time": {"value": t}}, "probability": p} for j, t, p in found])
    'Pushes: on joint 1 in run at 1.73 s (0.54), 3.35 s (0.50); on joint 2 in run at 4.45 s (0.49); in brackets their probabilities.'
    """

    def place(push: dict[str, Any]) -> tuple[int, str]:
        return push["joint"], push["log"]

    def time(push: dict[str, Any]) -> float:
        return float(push["parameters"]["time"]["value"])

    ordered = sorted(pushes, key=lambda push: (*place(push), time(push)))
    groups = [
        f"on joint {joint} in {log} at "
        + ", ".join(f"{time(push):.2f} s ({push['probability']:.2f})" for push in group)
        for (joint, log), group in groupby(ordered, key=place)
    ]
    text = f"Pushes: {'; '.join(groups)}; in brackets their probabilities."
    alike = {
        (LAWS[e["effect"]], e["joint"]) for push in pushes for e in push.get("equivalents") or [] if e["effect"] in LAWS
    }
    for law in sorted({law for law, _ in alike}):
        joints = " and ".join(f"joint {joint}" for other, joint in sorted(alike) if other == law)
        text += f" Those on {joints} look like {law}: repeat the motion, and it comes back."
    return text
