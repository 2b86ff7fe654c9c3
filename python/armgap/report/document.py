"""Contents of a report, independent of its form (HTML, Markdown, terminal)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from armgap.report import conventions, words
from armgap.report.page import Section

if TYPE_CHECKING:
    from armgap.diagnosis.result import Diagnosis

__all__ = ["Document", "diagnosis_document"]


@dataclass(frozen=True)
class Document:
    """Contents of a report, independent of its form (HTML, Markdown, terminal).

    Attributes
    ----------
    title, lead : str
        Heading and the sentence below it.
    answers : sequence of SummaryAnswer
        Answers shown on the first screen.
    sections : sequence of Section
        Sections after the answers; pictures of the first section belong to the first screen.
    brief : str
        The arm's conventions in one line.
    before : Section, optional
        Section before the answers.
    """

    title: str
    lead: str
    answers: Sequence[words.SummaryAnswer]
    sections: Sequence[Section]
    brief: str = ""
    before: Section | None = None


def diagnosis_document(diagnosis: Diagnosis | dict[str, Any]) -> Document:
    """Return the report of a diagnosis, given as an object or as its JSON object."""
    from armgap.report.sections.all import SECTIONS
    from armgap.report.sections.checks import input_checks

    data = diagnosis if isinstance(diagnosis, dict) else diagnosis.to_dict()
    arm = data.get("arm") or {}
    sections = [made for section in SECTIONS if (made := section(data)) is not None]
    return Document(
        f"Diagnosis: {arm.get('name') or 'arm'}",
        words.verdict(data),
        words.answers(data),
        sections,
        conventions.brief(str(arm.get("kind", ""))),
        input_checks(data) if data["verdict"] == "input" else None,
    )
