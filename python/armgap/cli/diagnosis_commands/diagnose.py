"""Sub-command ``armgap diagnose``: diagnosis of an arm from its logs."""

from __future__ import annotations

from typing import Any

import click

from armgap.cli.common import (
    ManyValues,
    arm_option,
    columns_option,
    console,
    corrections_options,
    json_option,
    parse_columns,
    parse_units,
    quiet_option,
    read_arm,
    report_option,
    units_option,
)
from armgap.cli.files import InputFile
from armgap.cli.numbers import Seed
from armgap.cli.progress import working
from armgap.files.output import is_stdout, write

__all__ = ["command"]


@click.command("diagnose", cls=ManyValues)
@click.argument("logs", nargs=-1, required=True, type=InputFile(), metavar="LOG…")
@arm_option
@click.option(
    "--holdout", multiple=True, type=InputFile(), metavar="LOG…", help="Logs to judge on; after the LOGs to learn from."
)
@click.option("--horizon", default=0.25, show_default=True, help="Prediction horizon [s].")
@click.option("--max-causes", default=4, show_default=True, help="Effects named at most, beside pushes.")
@click.option(
    "--seed",
    default=1,
    show_default=True,
    type=Seed(),
    help="Seed of the resampling.",
)
@click.option("--no-repair", is_flag=True, help="Say what is wrong with the logs and repair nothing.")
@corrections_options
@report_option
@json_option
@columns_option
@units_option
@quiet_option
def command(
    logs: tuple[str, ...],
    arm_file: str,
    holdout: tuple[str, ...],
    horizon: float,
    max_causes: int,
    seed: int,
    report_file: str | None,
    json_file: str | None,
    columns: str | None,
    units: str | None,
    quiet: bool,
    no_repair: bool,
    **corrections: Any,
) -> None:
    """Say where the gap between LOGs and the nominal arm lies, what causes it, and how far it shrinks."""
    from armgap.diagnosis.diagnosis import diagnose
    from armgap.log import gather
    from armgap.report.output import check_report, diagnosis_report, prepare_report

    check_report(report_file)
    arm = read_arm(arm_file, corrections)
    mapping, declared = parse_columns(columns), parse_units(units)
    with working("reading", quiet=quiet):
        training = gather(logs, arm, columns=mapping, units=declared)
        held = gather(holdout, arm, columns=mapping, units=declared) or None
        prepare_report(report_file)
        result = diagnose(
            training, arm, holdout=held, horizon=horizon, max_causes=max_causes, seed=seed, repair=not no_repair
        )
    if report_file is not None:
        write(report_file, diagnosis_report(result, report_file))
    if json_file is not None:
        write(json_file, result.to_json(indent=2))
    if not (quiet or is_stdout(json_file, report_file)):
        from armgap.report.forms.terminal import summary_table

        say = console()
        say.print(summary_table(result))
        for check in result.checks:
            if check.severity != "error":
                say.print(check.line(), highlight=False, markup=False)
        for remark in result.remarks:
            say.print(f"note: {remark}", highlight=False, markup=False)
        if report_file is not None:
            say.print(f"report: {report_file}", highlight=False, markup=False)
