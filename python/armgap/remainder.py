"""Whether a model of a diagnosis leaves a gap: prediction errors beyond those of a perfect model."""

from __future__ import annotations

from typing import Any

from armgap.literals import Verdict

__all__ = ["REMAINDER", "WITHIN_FLOOR", "exceeds_floor", "has_gap", "leaves_part"]

Data = dict[str, Any]
WITHIN_FLOOR = 2.0
"""Ratio of prediction errors to the noise floor up to which named causes leave no gap: complete models reach 1.7 on short holdouts."""
REMAINDER = 0.2
"""Share of the re-estimated arm's gap that remains with the causes, from which it is said: another motion changes the share by less."""
#: Verdicts with which a model has a gap beyond chance, by model; with causes that were named there may be one.
_WITH_GAP: dict[str, tuple[Verdict, ...]] = {
    "before": ("parameters", "effect", "unexplained", "input"),
    "refit": ("effect", "unexplained", "input"),
    "after": ("effect", "unexplained", "input"),
}


def has_gap(data: Data, model: str) -> bool:
    """Whether a model (``"before"``, ``"refit"`` or ``"after"``) has a gap by the verdict of a diagnosis and, with causes, by its errors.

    A gap that only the training logs show is none on the holdout.
    """
    if data["verdict"] not in _WITH_GAP[model] or data["gap"].get("training"):
        return False
    return model != "after" or data["verdict"] != "effect" or exceeds_floor(data, model)


def exceeds_floor(data: Data, model: str) -> bool:
    """Whether a model's prediction errors on the holdout exceed the noise floor by more than `WITHIN_FLOOR` on any joint."""
    gap = data["gap"]
    return any(error > WITHIN_FLOOR * floor for error, floor in zip(gap[model], gap["floor"], strict=True))


def leaves_part(data: Data) -> bool:
    """Whether the causes that a diagnosis names leave a large part of the gap."""
    if not data.get("causes"):
        return False
    return float(data["gap"].get("unexplained", 0.0)) > REMAINDER and has_gap(data, "after")
