"""Report section on conventions of the arm, and on columns and units of each log."""

from __future__ import annotations

from armgap.report.conventions import section
from armgap.report.page import Section
from armgap.report.sections.model_labels import Data

__all__ = ["conventions"]


def conventions(data: Data) -> Section | None:
    """Return the section on zero, positive direction and sign of torque of an arm, and on columns and units of each log."""
    given = data.get("input") or {}
    return section(str((data.get("arm") or {}).get("kind", "")), given.get("logs"), given.get("units"))
