"""What a report says, before it becomes a page, Markdown, or anything else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from armgap.report import words
from armgap.report.page import Section

if TYPE_CHECKING:
    from armgap.diagnosis import Diagnosis

__all__ = ["Document", "diagnosis_document"]


@dataclass(frozen=True)
class Document:
    """A report.

    Attributes
    ----------
    title, lead : str
        Heading and the sentence below it.
    answers : sequence of SummaryAnswer
        The first screen.
    sections : sequence of Section
        What follows; the first one's pictures belong to the first screen.
    """

    title: str
    lead: str
    answers: Sequence[words.SummaryAnswer]
    sections: Sequence[Section]


def diagnosis_document(diagnosis: Diagnosis | dict[str, Any]) -> Document:
    """Return the report of a diagnosis, or of its JSON object."""
    from armgap.report.sections import SECTIONS

    data = diagnosis if isinstance(diagnosis, dict) else diagnosis.to_dict()
    name = (data.get("arm") or {}).get("name") or "arm"
    sections = [made for section in SECTIONS if (made := section(data)) is not None]
    return Document(f"Diagnosis: {name}", words.verdict(data), words.answers(data), sections)
