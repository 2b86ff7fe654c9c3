"""Sub-command ``armgap reproduce``: experiment of Reyes and Kelly (1997)."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from armgap.cli.files import Command, OutputFile
from armgap.files.output import is_stdout, write
from armgap.reproduction.experiment import Reproduction, reproduce

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["command"]

#: Terminal width in characters below which Table II of Reyes and Kelly (1997) is shown scheme by scheme.
NARROW = 100


@click.command("reproduce", cls=Command)
@click.option(
    "--report",
    "report_file",
    type=OutputFile(),
    default="armgap-reproduction.html",
    show_default=True,
    metavar="OUT",
    help="Report to write: .html, .md or .json.",
)
@click.option(
    "--json",
    "json_file",
    type=OutputFile(),
    metavar="OUT",
    help="Write estimates and findings as JSON; - is standard output.",
)
@click.option("--quiet", is_flag=True, help="No summary.")
def command(report_file: str, json_file: str | None, quiet: bool) -> None:
    """Repeat the seed paper's experiment: Table II, Figures 2 to 7, and what explains their deviations."""
    from armgap.cli.common import interruptible
    from armgap.cli.progress import working
    from armgap.report.output import check_report, render_report
    from armgap.reproduction.page import document

    check_report(report_file)
    with working("simulating and identifying", quiet=quiet):
        result = interruptible(reproduce)
    write(report_file, render_report(document(result), json.loads(result.to_json()), report_file))
    if json_file is not None:
        write(json_file, result.to_json(indent=2))
    if not (quiet or is_stdout(json_file, report_file)):
        _summarise(result, report_file)


def _summarise(result: Reproduction, report_file: str) -> None:
    from rich.text import Text

    from armgap.cli.common import console

    say = console()
    for table in _tables(result, narrow=say.width < NARROW):
        say.print(table)
    for title, text in result.findings():
        say.print(Text.assemble((f"{title}. ", "bold"), text, "\n"))
    say.print(f"report: {report_file}", highlight=False, markup=False)


def _tables(result: Reproduction, *, narrow: bool) -> list[Table]:
    """Return Table II of Reyes and Kelly (1997) as one wide table, or as one table per scheme."""
    from armgap.reproduction.page import table_two

    header, rows = table_two(result)
    title = "Table II, beside a simulated run with everything as in the paper"
    if not narrow:
        return [_table(title, [name.replace(": ", "\n") for name in header], rows)]
    return [
        _table(
            header[c].removeprefix("paper: "), [*header[:3], "paper", "here"], [[*r[:3], r[c], r[c + 1]] for r in rows]
        )
        for c in range(3, len(header), 2)
    ]


def _table(title: str, header: list[str], rows: list[list[str]]) -> Table:
    from rich.table import Table

    table = Table(title=title)
    for name in header:
        table.add_column(name.replace("paper: ", ""), justify="left" if name == "parameter" else "right")
    for row in rows:
        table.add_row(*("-" if cell == "no convergence" else cell for cell in row))
    return table
