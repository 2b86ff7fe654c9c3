"""Sub-command ``armgap inspect``: contents of logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from armgap.cli.common import (
    columns_option,
    console,
    corrections_options,
    interruptible,
    json_option,
    parse_columns,
    parse_units,
    quiet_option,
    read_arm,
    units_option,
)
from armgap.cli.files import Command, InputFile, OutputFile
from armgap.cli.progress import working
from armgap.files.output import is_stdout, write

if TYPE_CHECKING:
    from armgap.arm.arm import Arm
    from armgap.inspection.inspection import Inspection
    from armgap.inspection.unmapped import Columns

__all__ = ["command"]


@click.command("inspect", cls=Command)
@click.argument("logs", nargs=-1, required=True, type=InputFile(), metavar="LOG…")
@click.option(
    "--arm",
    "arm_file",
    type=InputFile(),
    metavar="ARM.toml",
    help="Arm file; tells what the log says about its parameters.",
)
@click.option("--report", "report_file", type=OutputFile(), metavar="OUT.html", help="Write a page with pictures.")
@click.option("--no-repair", is_flag=True, help="Say what is wrong with the logs and repair nothing.")
@corrections_options
@json_option
@columns_option
@units_option
@quiet_option
def command(
    logs: tuple[str, ...],
    arm_file: str | None,
    report_file: str | None,
    json_file: str | None,
    columns: str | None,
    units: str | None,
    quiet: bool,
    no_repair: bool,
    **corrections: Any,
) -> None:
    """Say what LOGs hold: columns, sampling, steps, saturation, motion, and what they tell about an arm's parameters.

    Of a log whose columns have other names, and without a mapping, it lists the columns and proposes one.
    """
    import json

    from armgap.inspection.unmapped import Columns
    from armgap.log.gather import paths

    naming = {"columns": parse_columns(columns), "units": parse_units(units)}
    arm = read_arm(arm_file, corrections) if arm_file is not None else None
    with working("reading", quiet=quiet):
        files = paths(logs)
        options = {"listing": report_file is None, "repair": not no_repair}
        found = interruptible(lambda: [_inspected(path, arm, naming, **options) for path in files])
    if report_file is not None:
        from armgap.inspection.page import render

        write(report_file, render([one for one in found if not isinstance(one, Columns)]))
    if json_file is not None:
        results = [f.to_dict() for f in found]
        write(json_file, json.dumps(results[0] if len(results) == 1 else results, indent=2, allow_nan=False))
    if quiet or is_stdout(json_file, report_file):
        return
    from armgap.inspection.terminal import column_table, tables

    say = console()
    for path, one in zip(files, found, strict=True):
        if isinstance(one, Columns):
            say.print(column_table(one, str(path)))
            continue
        say.print(tables(one))
        for check in one.checks:
            say.print(check.line(one.log), highlight=False, markup=False)
        for finding in one.findings:
            say.print(f"note: {one.log}: {finding.message}", highlight=False, markup=False)
    if report_file is not None:
        say.print(f"report: {report_file}", highlight=False, markup=False)


def _inspected(
    path: Path, arm: Arm | None, naming: dict[str, Any], *, listing: bool, repair: bool
) -> Inspection | Columns:
    """Return the inspection of a log; or, for unknown column names without a mapping, the columns with a proposed mapping.

    An error that names a row is about a cell of a column that was found, so a mapping is no remedy.
    """
    from armgap.errors import ColumnError
    from armgap.inspection.inspection import inspect
    from armgap.inspection.unmapped import columns_of
    from armgap.log.log import Log

    try:
        return inspect(Log.read(path, arm=arm, **naming), arm, repair=repair)
    except ColumnError as error:
        mapped = naming["columns"] or (arm is not None and arm.columns)
        if mapped or error.row is not None or not listing or str(path) == "-":
            raise
        return columns_of(path, arm)
