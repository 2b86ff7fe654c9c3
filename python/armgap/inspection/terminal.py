"""Output of an inspection in a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armgap.inspection import words

if TYPE_CHECKING:
    from rich.console import RenderableType

    from armgap.inspection.inspection import Inspection
    from armgap.inspection.unmapped import Columns

__all__ = ["column_table", "tables"]


def tables(found: Inspection) -> RenderableType:
    """Return an inspection as tables for `rich`: properties of the log, of its joints, and excitation of the arm's parameters."""
    from rich import box
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    overview = Table(box=box.SIMPLE, show_header=False, pad_edge=False)
    overview.add_column(style="bold", no_wrap=True)
    overview.add_column()
    for question, answer in words.overview(found):
        overview.add_row(Text(question), Text(answer))
    parts: list[RenderableType] = [Text(found.log, style="bold"), overview]
    for title, (header, rows) in words.grids(found):
        grid = Table(box=box.SIMPLE, title=title, title_justify="left")
        grid.add_column(header[0])
        for name in header[1:]:
            grid.add_column(name, justify="right")
        for row in rows:
            grid.add_row(*(Text(cell) for cell in row))
        parts.append(grid)
    return Group(*parts)


def column_table(found: Columns, file: str, arm_file: str | None) -> RenderableType:
    """Return a table for `rich` of a file without a mapping of columns, read beside an arm file or none: its columns, and a mapping to confirm."""
    from rich import box
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    grid = Table(box=box.SIMPLE, pad_edge=False)
    for name in words.COLUMN_HEADER:
        grid.add_column(name, overflow="fold")
    for row in words.column_rows(found):
        grid.add_row(*(Text(cell) for cell in row))
    said = [Text(line, overflow="fold") for line in words.proposal(found, file, arm_file)]
    return Group(Text(found.log, style="bold"), grid, *said)
