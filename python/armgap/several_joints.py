"""Causes on several joints at once: their location in words, and conversion to causes of single joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

__all__ = ["by_joint", "joint_text", "place_text"]


def joint_text(joint: int | None) -> str:
    """Return the location of an effect on one joint, or on the whole arm, in words."""
    return "whole arm" if joint is None else f"joint {joint}"


def place_text(entry: Mapping[str, Any]) -> str:
    """Return the location of a cause, candidate or equivalent effect of a diagnosis in words.

    Examples
    --------
    >>> place_text({"joint": 2}), place_text({"joint": None}), place_text({"joint": None, "joints": [1, 2, 4]})
    ('joint 2', 'whole arm', 'joints 1, 2 and 4')
    >>> place_text({"joint": None, "joints": [5, 6], "row": [1, -1]})
    'difference of joints 5 and 6'
    """
    joints = entry.get("joints")
    if not joints:
        return joint_text(entry["joint"])
    *first, last = map(str, joints)
    text = f"joints {', '.join(first)} and {last}"
    row = entry.get("row")
    return text if not row else f"{'sum' if row[1] > 0 else 'difference'} of {text}"


def by_joint(causes: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return causes of a diagnosis with one cause per joint in place of a cause with a common law on several joints.

    Examples
    --------
    >>> values = {"value": [0.01, 0.02], "sigma": [0.001, 0.001], "unit": "s"}
    >>> cause = {"effect": "actuator_delay", "joint": None, "joints": [1, 3], "parameters": {"delay": values}}
    >>> [(c["joint"], c["parameters"]["delay"]["value"]) for c in by_joint([cause])]
    [(1, 0.01), (3, 0.02)]
    """
    found: list[dict[str, Any]] = []
    for cause in causes:
        if not cause.get("joints") or cause.get("row"):
            found.append(dict(cause))
            continue
        rest = {key: value for key, value in cause.items() if key != "joints"}
        for i, joint in enumerate(cause["joints"]):
            parameters = {
                name: {**v, "value": v["value"][i], "sigma": v["sigma"][i]} for name, v in cause["parameters"].items()
            }
            found.append({**rest, "joint": joint, "parameters": parameters})
    return found
