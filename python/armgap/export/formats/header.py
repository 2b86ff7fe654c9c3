"""Comment at the head of every exported file: origin of the model, and remarks."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

from armgap._native import __version__

if TYPE_CHECKING:
    from armgap.export.corrected import Corrected

__all__ = ["comment", "in_comment", "lines", "written"]

_STAGES = {"with_causes": "re-estimated values with the causes found", "refit": "re-estimated values without causes"}


def lines(model: Corrected, form: str) -> list[str]:
    """Return the remarks on a model in a format: its origin, effects without a field, and choices."""
    return written(model, model.remarks(form))


def written(model: Corrected, remarks: Iterable[str]) -> list[str]:
    """Return the origin of a model, and remarks, as lines without line breaks."""
    first = f"{model.arm.name}: {_STAGES[model.stage]}, armgap {__version__}, verdict: {model.verdict}"
    return [_one_line(line) for line in (first, *remarks)]


def comment(line: str) -> Any:
    """Return an XML comment with a line of text."""
    return ET.Comment(f" {in_comment(line)} ")


def in_comment(line: str) -> str:
    """Return a line made valid for an XML comment, in which two adjacent hyphens are not allowed."""
    while "--" in line:
        line = line.replace("--", "- -")
    return line


def _one_line(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
