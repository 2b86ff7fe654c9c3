"""The three answers in a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from armgap.report import words

if TYPE_CHECKING:
    from rich.console import RenderableType

    from armgap.diagnosis import Diagnosis

__all__ = ["summary_table"]


def summary_table(diagnosis: Diagnosis | dict[str, Any]) -> RenderableType:
    """Return what `rich` prints: verdict, the three answers, and the gap per joint."""
    from rich import box
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    data = diagnosis if isinstance(diagnosis, dict) else diagnosis.to_dict()
    table = Table(box=box.SIMPLE, show_header=False, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column()
    for question, answer in words.answers(data):
        table.add_row(Text(question), Text(answer))
    gap = data["gap"]
    unit = gap.get("unit", "rad")
    figures = Table(
        box=box.SIMPLE,
        title=f"RMS error over {gap['horizon_s']:g} s on held-out motion [m{unit}]",
        title_justify="left",
    )
    figures.add_column("joint")
    for name in ("arm file", "re-estimated", "with causes", "sensor floor"):
        figures.add_column(name, justify="right")
    rows = zip(gap["before"], gap["refit"], gap["after"], gap["floor"], strict=True)
    for j, row in enumerate(rows, start=1):
        figures.add_row(str(j), *(f"{1e3 * v:.3g}" for v in row))
    return Group(Text(words.verdict(data), style="bold"), table, figures)
