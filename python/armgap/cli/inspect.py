"""``armgap inspect``."""

from __future__ import annotations

from typing import Any

import click

from armgap.cli.common import (
    check_outputs,
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
    write,
)
from armgap.cli.progress import working

__all__ = ["command"]


@click.command("inspect")
@click.argument("logs", nargs=-1, required=True, metavar="LOG…")
@click.option("--arm", "arm_file", metavar="ARM.toml", help="Arm file; tells what the log says about its parameters.")
@click.option("--report", "report_file", metavar="OUT.html", help="Write a page with pictures.")
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
    """Say what LOGs hold: columns, sampling, steps, saturation, motion, and what they tell about an arm's parameters."""
    import json

    from armgap.inspection import inspect
    from armgap.log import Log, paths

    check_outputs(json_file, report_file)
    naming = {"columns": parse_columns(columns), "units": parse_units(units)}
    arm = read_arm(arm_file, corrections) if arm_file is not None else None
    with working("reading", quiet=quiet):
        found = interruptible(
            lambda: [inspect(Log.read(path, arm=arm, **naming), arm, repair=not no_repair) for path in paths(logs)]
        )
    if report_file is not None:
        from armgap.inspection.page import render

        write(report_file, render(found))
    if json_file is not None:
        results = [f.to_dict() for f in found]
        write(json_file, json.dumps(results[0] if len(results) == 1 else results, indent=2, allow_nan=False))
    if quiet or json_file == "-":
        return
    from armgap.inspection.terminal import tables

    say = console()
    for one in found:
        say.print(tables(one))
        for finding in one.findings:
            say.print(f"note: {one.log}: {finding.message}", highlight=False, markup=False)
    if report_file is not None:
        say.print(f"report: {report_file}", highlight=False, markup=False)
