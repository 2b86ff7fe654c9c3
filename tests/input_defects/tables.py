"""Tables of Markdown, and percentages."""

from __future__ import annotations

from collections.abc import Sequence


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table with a header row."""
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def percent(part: int, whole: int) -> str:
    """Return a share as text, such as ``97.5 % (39 of 40)``; ``-`` if the whole is zero."""
    return f"{100 * part / whole:.1f} % ({part} of {whole})" if whole else "-"
