"""The three models that a report compares, and the units of a diagnosis."""

from __future__ import annotations

from typing import Any

from armgap.report import charts

__all__ = ["Data", "ModelLabel", "length_unit", "load_text", "model_labels", "torque_unit"]

Data = dict[str, Any]
ModelLabel = tuple[str, str, str]

_BEFORE: ModelLabel = ("arm file", "before", charts.BEFORE)
_REFIT: ModelLabel = ("re-estimated", "refit", charts.REFIT)
_AFTER: ModelLabel = ("with causes", "after", charts.AFTER)


def model_labels(data: Data) -> tuple[ModelLabel, ...]:
    """Name, key and colour of each model; without causes the third is the second again and left out."""
    return (_BEFORE, _REFIT, _AFTER) if data.get("causes") else (_BEFORE, _REFIT)


def length_unit(data: Data) -> str:
    """Unit of positions."""
    return str(data["gap"].get("unit", "rad"))


def load_text(data: Data) -> str:
    """What drives a joint of this arm."""
    return "force" if length_unit(data) == "m" else "torque"


def torque_unit(data: Data) -> str:
    """Unit of torques."""
    return "N" if length_unit(data) == "m" else "N m"
