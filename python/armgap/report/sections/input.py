"""What the figures are counted in: the arm's conventions, and each log's columns and units."""

from __future__ import annotations

from armgap.report.conventions import section
from armgap.report.page import Section
from armgap.report.sections.model_labels import Data

__all__ = ["conventions"]


def conventions(data: Data) -> Section | None:
    """Zero, positive direction, sign of the torque; and which column of which log was used in which unit."""
    given = data.get("input") or {}
    return section(str((data.get("arm") or {}).get("kind", "")), given.get("logs"), given.get("units"))
