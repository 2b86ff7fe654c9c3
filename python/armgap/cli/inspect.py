"""``armgap inspect``."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.common import (
    columns_option,
    console,
    interruptible,
    json_option,
    parse_columns,
    parse_units,
    quiet_option,
    units_option,
)
from armgap.cli.files import Command, InputFile, OutputFile
from armgap.cli.progress import working
from armgap.output import is_stdout, write

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
) -> None:
    """Say what LOGs hold: columns, sampling, steps, saturation, motion, and what they tell about an arm's parameters."""
    import json

    from armgap.arm import Arm
    from armgap.inspection import inspect
    from armgap.log import Log, paths

    naming = {"columns": parse_columns(columns), "units": parse_units(units)}
    arm = Arm.read(Path(arm_file)) if arm_file is not None else None
    with working("reading", quiet=quiet):
        found = interruptible(lambda: [inspect(Log.read(path, arm=arm, **naming), arm) for path in paths(logs)])
    if report_file is not None:
        from armgap.inspection.page import render

        write(report_file, render(found))
    if json_file is not None:
        results = [f.to_dict() for f in found]
        write(json_file, json.dumps(results[0] if len(results) == 1 else results, indent=2, allow_nan=False))
    if quiet or is_stdout(json_file, report_file):
        return
    from armgap.inspection.terminal import tables

    say = console()
    for one in found:
        say.print(tables(one))
        for finding in one.findings:
            say.print(f"note: {one.log}: {finding.message}", highlight=False, markup=False)
    if report_file is not None:
        say.print(f"report: {report_file}", highlight=False, markup=False)
