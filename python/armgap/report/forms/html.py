"""A report as one self-contained HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from armgap.files.output import write
from armgap.report.document import Document, diagnosis_document

if TYPE_CHECKING:
    from armgap.diagnosis.result import Diagnosis

__all__ = ["page_of", "render_html", "write_html"]


def page_of(document: Document) -> str:
    """Return a report as one HTML page that loads nothing from elsewhere."""
    from armgap.report import page

    return page.render(
        document.title,
        document.lead,
        document.answers,
        document.sections,
        brief=document.brief,
        before=document.before,
    )


def render_html(diagnosis: Diagnosis | dict[str, Any]) -> str:
    """Return the report of a diagnosis as HTML.

    Parameters
    ----------
    diagnosis : Diagnosis or dict
        Diagnosis, or its JSON object.
    """
    return page_of(diagnosis_document(diagnosis))


def write_html(diagnosis: Diagnosis | dict[str, Any], path: str | Path) -> None:
    """Write the report of a diagnosis to an HTML file."""
    write(path, render_html(diagnosis))
