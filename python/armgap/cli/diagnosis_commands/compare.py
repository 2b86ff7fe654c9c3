"""Sub-command ``armgap compare``: changes between two diagnoses."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.common import console, json_option, quiet_option, report_option
from armgap.cli.files import Command, InputFile
from armgap.files.output import is_stdout, write
from armgap.files.reading import printable

__all__ = ["command"]


@click.command("compare", cls=Command)
@click.argument("before", type=InputFile(), metavar="BEFORE.json")
@click.argument("after", type=InputFile(), metavar="AFTER.json")
@report_option
@json_option
@quiet_option
def command(before: str, after: str, report_file: str | None, json_file: str | None, quiet: bool) -> None:
    """Say what changed between two diagnoses of one arm, as before and after a repair."""
    from armgap.diagnosis.comparison import compare, read_diagnosis
    from armgap.report.compared import comparison_document, comparison_summary
    from armgap.report.output import check_report, render_report

    check_report(report_file)
    result = compare(read_diagnosis(before), read_diagnosis(after), _names(before, after))
    if report_file is not None:
        write(report_file, render_report(comparison_document(result), result.to_dict(), report_file))
    if json_file is not None:
        write(json_file, result.to_json(indent=2))
    if not (quiet or is_stdout(json_file, report_file)):
        say = console()
        say.print(comparison_summary(result))
        for note in result.notes:
            say.print(f"note: {note}", highlight=False, markup=False)
        if report_file is not None:
            say.print(f"report: {report_file}", highlight=False, markup=False)


def _names(before: str, after: str) -> tuple[str, str]:
    """Return names for the two diagnoses: their file names, or before and after where these are equal."""
    names = printable(Path(before).stem), printable(Path(after).stem)
    return names if names[0] != names[1] else ("before", "after")
