"""Summary of a diagnosis in a terminal, narrow or wide."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from armgap.literals import joint_units
from armgap.report import words
from armgap.report.advice import next_steps

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from armgap.diagnosis.result import Diagnosis

__all__ = ["answer_lines", "gap_table", "summary_table"]

Data = dict[str, Any]


def summary_table(diagnosis: Diagnosis | Data) -> RenderableType:
    """Return a diagnosis for `rich` to print: verdict, the three answers, and the gap per joint.

    Questions stand above their answers, so that a terminal of 60 columns holds them as well as a wide one.
    """
    from rich.console import Group
    from rich.text import Text

    data = diagnosis if isinstance(diagnosis, dict) else diagnosis.to_dict()
    parts: list[RenderableType] = [Text(words.verdict(data), style="bold reverse"), Text()]
    for answer in words.answers(data):
        parts += answer_lines(answer)
    return Group(*parts, gap_table(data), *_steps(data))


def _steps(data: Data) -> list[RenderableType]:
    """Return the recommended next steps, one per line."""
    from rich.padding import Padding
    from rich.text import Text

    lines: list[RenderableType] = [Text("What to do next", style="dim")]
    for step in next_steps(data):
        lines.append(Padding(Text(step.replace("`", "")), (0, 0, 0, 2)))
    return [*lines, Text()]


def answer_lines(answer: words.SummaryAnswer) -> list[RenderableType]:
    """Return a question with its answer, and an empty line."""
    from rich.padding import Padding
    from rich.text import Text

    lines: list[RenderableType] = [Text(answer.question, style="dim")]
    lines.append(Padding(Text(answer.headline, style="bold"), (0, 0, 0, 2)))
    if answer.detail:
        lines.append(Padding(Text(answer.detail), (0, 0, 0, 2)))
    return [*lines, Text()]


def gap_table(data: Data) -> Table:
    """Return a table of the gap: a row per joint, a column per model."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    gap = data["gap"]
    table = Table(
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        title=Text(f"RMS error over {gap['horizon_s']:g} s on held-out motion [{words.milli_unit(joint_units(data))}]"),
        title_justify="left",
    )
    table.add_column("joint")
    columns = [("arm file", "before"), ("re-estimated", "refit"), ("with causes", "after"), ("noise", "floor")]
    shown = [(name, key) for name, key in columns if key != "after" or data.get("causes")]
    for name, _ in shown:
        table.add_column(name, justify="right")
    for j in range(len(gap["before"])):
        table.add_row(str(j + 1), *(words.error_text(1e3 * gap[key][j]) for _, key in shown))
    return table
