"""Tables of Markdown."""

from __future__ import annotations

from collections.abc import Sequence


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table with a head."""
    rows = [head, ["---"] * len(head), *lines]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def percent(part: int, whole: int) -> str:
    """``97.5 % (39 of 40)``."""
    return f"{100 * part / whole:.1f} % ({part} of {whole})" if whole else "-"
