"""What to do next."""

from __future__ import annotations

from armgap.report.advice import next_steps
from armgap.report.page import Section
from armgap.report.sections.model_labels import Data

__all__ = ["what_next"]

TITLE = "What to do next"


def what_next(data: Data) -> Section:
    """What follows from the verdict."""
    return Section(TITLE, points=next_steps(data), name="next")
