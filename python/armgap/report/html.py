"""A diagnosis as one self-contained HTML file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from armgap.report import words

if TYPE_CHECKING:
    from armgap.diagnosis import Diagnosis

__all__ = ["render_html", "write_html"]


def render_html(diagnosis: Diagnosis | dict[str, Any]) -> str:
    """Return the report of a diagnosis: one HTML page that loads nothing from elsewhere.

    Parameters
    ----------
    diagnosis : Diagnosis or dict
        The diagnosis, or its JSON object.
    """
    from armgap.report import page
    from armgap.report.sections import SECTIONS

    data = diagnosis if isinstance(diagnosis, dict) else diagnosis.to_dict()
    name = (data.get("arm") or {}).get("name") or "arm"
    sections = [made for section in SECTIONS if (made := section(data)) is not None]
    answers = [(a.question, a.headline, a.detail) for a in words.answers(data)]
    return page.render(f"Diagnosis: {name}", words.verdict(data), answers, sections)


def write_html(diagnosis: Diagnosis | dict[str, Any], path: str | Path) -> None:
    """Write the report of a diagnosis to a file."""
    Path(path).write_text(render_html(diagnosis), encoding="utf-8")
