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
    read_corrections,
    units_option,
)
from armgap.cli.files import Command, InputFile, OutputFile
from armgap.cli.progress import working
from armgap.errors import OptionError
from armgap.files.output import is_stdout, write

if TYPE_CHECKING:
    from armgap.arm.arm import Arm
    from armgap.arm.corrections import Corrections
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
    of_logs = None if arm_file is not None else _of_logs(corrections)
    with working("reading", quiet=quiet):
        files = paths(logs)
        options: dict[str, Any] = {
            "listing": report_file is None,
            "repair": not no_repair,
            "corrections": of_logs,
        }
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
            say.print(column_table(one, str(path), arm_file))
            continue
        say.print(tables(one))
        for check in one.checks:
            say.print(check.line(one.log), highlight=False, markup=False)
        for finding in one.findings:
            say.print(f"note: {one.log}: {finding.message}", highlight=False, markup=False)
    if report_file is not None:
        say.print(f"report: {report_file}", highlight=False, markup=False)


def _of_logs(given: dict[str, Any]) -> Corrections:
    """Return the corrections of logs without an arm."""
    if given["gravity"]:
        raise OptionError("--gravity corrects an arm, and none is given", remedy="add --arm ARM.toml")
    return read_corrections(given)


def _inspected(
    path: Path,
    arm: Arm | None,
    naming: dict[str, Any],
    *,
    listing: bool,
    repair: bool,
    corrections: Corrections | None,
) -> Inspection | Columns:
    """Return the inspection of a log; or, for unknown column names without a mapping, the columns with a proposed mapping.

    An error that names a row is about a cell of a column that was found, so a mapping is no remedy.
    """
    from armgap.errors import ColumnError
    from armgap.inspection.inspection import inspect
    from armgap.inspection.unmapped import columns_of
    from armgap.log.log import Log

    try:
        log = Log.read(path, arm=arm, **naming)
        return inspect(log if corrections is None else corrections.on_log(log), arm, repair=repair)
    except ColumnError as error:
        mapped = naming["columns"] or (arm is not None and arm.columns)
        if mapped or error.row is not None or not listing or str(path) == "-":
            raise
        return columns_of(path, arm)
