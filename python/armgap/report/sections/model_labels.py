"""Labels of the three models that a report compares, and units of a diagnosis."""

from __future__ import annotations

from typing import Any

from armgap.literals import joint_units
from armgap.report import charts
from armgap.report.words import milli_unit

__all__ = ["Data", "ModelLabel", "joint_unit", "load_text", "model_labels", "small_unit", "torque_unit"]

Data = dict[str, Any]
ModelLabel = tuple[str, str, str]

_BEFORE: ModelLabel = ("arm file", "before", charts.BEFORE)
_REFIT: ModelLabel = ("re-estimated", "refit", charts.REFIT)
_AFTER: ModelLabel = ("with causes", "after", charts.AFTER)


def model_labels(data: Data) -> tuple[ModelLabel, ...]:
    """Return name, key and colour of the models of an arm: nominal, re-estimated and, if the diagnosis names causes, with causes."""
    return (_BEFORE, _REFIT, _AFTER) if data.get("causes") else (_BEFORE, _REFIT)


def joint_unit(data: Data, joint: int) -> str:
    """Return the unit of position of a joint, counted from 1."""
    units = joint_units(data)
    return units[joint - 1] if joint <= len(units) else str(data["gap"].get("unit", "rad"))


def small_unit(data: Data) -> str:
    """Return the unit of position errors for headings: ``mrad``, ``mm``, or both."""
    return milli_unit(joint_units(data))


def _slides(data: Data) -> bool:
    return set(joint_units(data)) == {"m"}


def load_text(data: Data) -> str:
    """Return the word for the load of a diagnosed arm's joints: force for linear joints, else torque."""
    return "force" if _slides(data) else "torque"


def torque_unit(data: Data) -> str:
    """Return the unit of torques of a diagnosis."""
    return "N" if _slides(data) else "N m"
