"""Report section on recommended next steps."""

from __future__ import annotations

from armgap.report.advice import next_steps
from armgap.report.page import Section
from armgap.report.sections.model_labels import Data

__all__ = ["what_next"]

TITLE = "What to do next"


def what_next(data: Data) -> Section:
    """Return the section on next steps that follow from the verdict."""
    return Section(TITLE, points=next_steps(data), name="next")
