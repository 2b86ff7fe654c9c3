"""``armgap reproduce``."""

from __future__ import annotations

import click

from armgap.reproduction.experiment import Reproduction, reproduce

__all__ = ["command"]


@click.command("reproduce")
@click.option("--report", "report_file", default="armgap-reproduction.html", show_default=True, metavar="OUT.html")
@click.option("--json", "json_file", metavar="OUT", help="Write estimates and findings as JSON; - is standard output.")
@click.option("--quiet", is_flag=True, help="No summary.")
def command(report_file: str, json_file: str | None, quiet: bool) -> None:
    """Repeat the seed paper's experiment: Table II, Figures 2 to 7, and what explains their deviations."""
    from armgap.cli.common import check_outputs, write
    from armgap.reproduction.page import render

    check_outputs(report_file, json_file)
    result = reproduce()
    write(report_file, render(result))
    if json_file is not None:
        write(json_file, result.to_json(indent=2))
    if not quiet and json_file != "-":
        _summarise(result, report_file)


def _summarise(result: Reproduction, report_file: str) -> None:
    from rich.table import Table

    from armgap.cli.common import console
    from armgap.reproduction.page import table_two

    header, rows = table_two(result)
    table = Table(title="Table II, beside a simulated run with everything as in the paper")
    for name in header:
        table.add_column(name.replace(": ", "\n"), justify="left" if name == "parameter" else "right")
    for row in rows:
        table.add_row(*("-" if cell == "no convergence" else cell for cell in row))
    console().print(table)
    for title, text in result.findings():
        console().print(f"[bold]{title}.[/bold] {text}\n")
    console().print(f"report: {report_file}")
