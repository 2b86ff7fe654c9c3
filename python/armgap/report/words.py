"""A diagnosis in plain sentences, the same in the terminal and in the report."""

from __future__ import annotations

import functools
from typing import Any

from armgap import _native

__all__ = ["answers", "figure", "joint_text", "millis", "title"]

Data = dict[str, Any]

_DOUBTFUL = 0.5

_VERDICTS = {
    "none": "The model predicts these logs as well as the sensors can tell.",
    "parameters": "The model has the right form but the wrong values.",
    "effect": "The arm does something that its model leaves out.",
    "unexplained": "There is a gap that no effect in the library explains.",
}


@functools.cache
def _titles() -> dict[str, str]:
    return {entry["name"]: entry["title"] for entry in _native.effects()}


def title(effect: str) -> str:
    """Name of an effect for people."""
    return _titles().get(effect, effect.replace("_", " "))


def joint_text(joint: int | None) -> str:
    """Where an effect sits."""
    return "whole arm" if joint is None else f"joint {joint}"


def figure(value: float, digits: int = 3) -> str:
    """A number with a few significant digits."""
    return f"{value:.{digits}g}"


def millis(values: list[float], unit: str) -> str:
    """RMS errors per joint in thousandths."""
    return " / ".join(f"{1e3 * v:.3g}" for v in values) + f" m{unit}"


def verdict(data: Data) -> str:
    """The verdict as a sentence."""
    return _VERDICTS.get(data["verdict"], str(data["verdict"]))


def where(data: Data) -> str:
    """Answer to the first question."""
    places = data.get("where") or []
    if data["verdict"] == "none" or not places:
        return "No part of the motion stands out."
    first = places[0]
    text = f"Joint {first['joint']} bears {first['share']:.0%} of the gap"
    if first.get("range"):
        text += f", most of all at {first['regime']} ({first['detail']})"
    return text + "."


def which(data: Data) -> str:
    """Answer to the second question."""
    causes = data.get("causes") or []
    if not causes:
        return {
            "none": "No cause: nothing is left to explain.",
            "parameters": "No missing effect: the arm file's values, re-estimated, suffice.",
            "unexplained": "No effect in the library explains it; a wrong name would not help.",
        }.get(data["verdict"], "No cause was named.")
    parts = []
    for cause in causes:
        values = ", ".join(
            f"{name} {figure(p['value'])} ± {figure(p['sigma'], 2)} {p['unit']}"
            for name, p in cause["parameters"].items()
        )
        text = (
            f"{title(cause['effect'])}, {joint_text(cause['joint'])}: {values} (probability {cause['probability']:.2f})"
        )
        if cause["probability"] < _DOUBTFUL:
            text += ", the best candidate beside a gap that stays unexplained"
        others = cause.get("equivalents") or []
        if others:
            names = ", ".join(f"{title(e['effect'])} ({joint_text(e['joint'])})" for e in others)
            text += f"; these logs do not tell it from {names}"
        parts.append(text)
    return ". Then: ".join(parts) + "."


def how_far(data: Data) -> str:
    """Answer to the third question."""
    gap = data["gap"]
    unit = gap.get("unit", "rad")
    low, high = gap["closed_ci"]
    return (
        f"On held-out motion, predictions over {gap['horizon_s']:g} s miss by {millis(gap['before'], unit)} (RMS per joint) with the "
        f"arm file, {millis(gap['refit'], unit)} with its values re-estimated, {millis(gap['after'], unit)} with the causes; sensor noise "
        f"alone leaves {millis(gap['floor'], unit)}. Closed: {gap['closed']:.0%} [{low:.0%}, {high:.0%}]."
    )


def answers(data: Data) -> list[tuple[str, str]]:
    """The three questions with their answers."""
    return [
        ("Where is the gap?", where(data)),
        ("Which effect causes it?", which(data)),
        ("How far does it shrink?", how_far(data)),
    ]
