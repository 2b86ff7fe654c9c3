"""What every exported file says at its head."""

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
    """Return the remarks on a model in a format: where it comes from, what has no field, what was chosen."""
    return written(model, model.remarks(form))


def written(model: Corrected, remarks: Iterable[str]) -> list[str]:
    """Return where a model comes from, and remarks, as lines without line breaks."""
    first = f"{model.arm.name}: {_STAGES[model.stage]}, armgap {__version__}, verdict: {model.verdict}"
    return [_one_line(line) for line in (first, *remarks)]


def comment(line: str) -> Any:
    """Return an XML comment."""
    return ET.Comment(f" {in_comment(line)} ")


def in_comment(line: str) -> str:
    """Return a line as it may stand in an XML comment, in which two hyphens must not meet."""
    while "--" in line:
        line = line.replace("--", "- -")
    return line


def _one_line(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
