"""A report as Markdown, for pull requests and chats: tables and bars of text, no pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from armgap.report.document import Document
from armgap.report.page import Bar, Cell, Drawing, HeatMap, IntervalLine, Section, Table, Tile
from armgap.report.words import SummaryAnswer

__all__ = ["markdown_of"]

#: Width of a full text bar, in characters.
BAR = 12
_SPECIAL = re.compile(r"([\\`*_\[\]<>|#~&])")


def escape(text: str) -> str:
    r"""Return a text escaped for Markdown, on one line, so that none of it is markup.

    Examples
    --------
    >>> print(escape("<b>|a_b"))
    \<b\>\|a\_b
    """
    return _SPECIAL.sub(r"\\\1", " ".join(text.split()))


def markdown_of(document: Document) -> str:
    """Return a report as Markdown."""
    return "\n\n".join(_blocks(document)) + "\n"


def _blocks(document: Document) -> Iterator[str]:
    yield f"## {escape(document.title)}"
    yield f"**{escape(document.lead)}**"
    if document.brief:
        yield escape(f"Conventions: {document.brief}")
    if document.before is not None:
        yield from _section(document.before)
    rows = [(escape(a.question), _answer(a)) for a in document.answers]
    yield _grid(["", ""], rows)
    for section in document.sections:
        yield from _section(section)


def _answer(answer: SummaryAnswer) -> str:
    headline = f"**{escape(answer.headline)}**" if answer.headline else ""
    return "<br>".join(filter(None, (headline, escape(answer.detail))))


def _section(section: Section) -> Iterator[str]:
    tables = [f.table for f in section.figures if isinstance(f, Drawing) and f.table is not None]
    tables += [t if isinstance(t, Table) else Table(*t) for t in section.tables]
    if not (tables or section.heats or section.notes or section.points):
        return  # only pictures
    if section.title:
        yield f"### {escape(section.title)}"
    if section.points:
        yield "\n".join(f"- {_coded(point)}" for point in section.points)
    yield from (_table(t) for t in tables if not t.fold)
    yield from (_folded(h.caption, _grid(*_heat(h))) for h in section.heats)
    yield from (_table(t) for t in tables if t.fold)
    if section.notes:
        yield "\n".join(f"- {escape(note)}" for note in section.notes)


def _coded(text: str, *, cell: bool = False) -> str:
    """Return a text escaped for Markdown with its words between backticks as code; in a table cell a vertical bar is escaped too."""
    parts = text.split("`")
    if len(parts) % 2 == 0:
        return escape(text)
    code = [" ".join(p.split()).replace("|", "\\|" if cell else "|") for p in parts]
    return "".join(f"`{code[i]}`" if i % 2 else _escaped_within(p) for i, p in enumerate(parts))


def _escaped_within(text: str) -> str:
    """Return a text escaped for Markdown, with the blanks at its ends kept."""
    return _SPECIAL.sub(r"\\\1", re.sub(r"\s+", " ", text))


def _table(table: Table) -> str:
    rows = [[_cell(c) for c in row] for row in table.rows]
    grid = _grid([escape(h) for h in table.header], rows)
    return _folded(table.fold, grid) if table.fold else grid


def _grid(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _folded(summary: str, body: str) -> str:
    return f"<details><summary>{_entities(summary)}</summary>\n\n{body}\n\n</details>"


def _entities(text: str) -> str:
    """Return a text escaped for the inside of an HTML element, where backslashes do not escape."""
    from html import escape as as_html

    return as_html(" ".join(text.split()))


def _cell(cell: Cell) -> str:
    if isinstance(cell, Bar):
        return f"`{bar(cell.share)}` {escape(cell.text)}"
    return escape(cell.text) if isinstance(cell, IntervalLine) else _coded(cell, cell=True)


def bar(share: float, width: int = BAR) -> str:
    """Return a share from 0 to 1 as a bar of text; any share above 0 has a mark.

    Examples
    --------
    >>> bar(0.5, 4), bar(0.001, 4), bar(0.0, 4)
    ('██░░', '▏░░░', '░░░░')
    """
    full = round(min(max(share, 0.0), 1.0) * width)
    head = "▏" if share > 0 and not full else "█" * full
    return head + "░" * (width - len(head))


def _heat(heat: HeatMap) -> tuple[list[str], list[list[str]]]:
    """Return a heat map as header and rows of a table; the text of a marked tile is bold."""
    width = max(len(tiles) for _, tiles in heat.rows)
    header = ["", *(["low"] + [""] * (width - 2) + ["high"] if width > 1 else [""])]
    rows = [
        [
            escape(label),
            *(_tile(t) for t in tiles),
            *([""] * (width - len(tiles))),
        ]
        for label, tiles in heat.rows
    ]
    return header, rows


def _tile(tile: Tile) -> str:
    """Return the value of a heat map's tile, with the limits of its range below."""
    text = f"**{escape(tile.text)}**" if tile.marked else escape(tile.text)
    return f"{text}<br>{escape(tile.low)} to {escape(tile.high)}" if tile.low else text
