"""Sub-command ``armgap plan``: motion for the questions that a diagnosis left open."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.common import arm_option, console, json_option, quiet_option, report_option
from armgap.cli.files import Command, InputFile, OutputFile, Words
from armgap.cli.numbers import Number, Seed
from armgap.cli.progress import working
from armgap.errors import OptionError
from armgap.files.output import is_stdout, write
from armgap.options import LONGEST_PLAN_S, SHORTEST_PLAN_S

__all__ = ["command"]


@click.command("plan", cls=Command)
@click.argument("diagnosis_files", type=InputFile(), nargs=-1, required=True, metavar="DIAGNOSIS.json")
@arm_option
@click.option(
    "--for",
    "wanted",
    type=Words(),
    multiple=True,
    metavar="EFFECT:JOINT",
    help="Effect to settle; may be repeated. Without it, the five open questions with the largest consequences.",
)
@click.option(
    "--duration",
    type=Number(min=SHORTEST_PLAN_S, max=LONGEST_PLAN_S),
    default=10.0,
    show_default=True,
    help="Length of the motion [s].",
)
@click.option("--seed", type=Seed(), default=1, show_default=True, help="Seed of the search.")
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    required=True,
    metavar="OUT.csv",
    help="Motion to write, .csv or .parquet; - writes CSV to standard output.",
)
@report_option
@json_option
@quiet_option
def command(
    diagnosis_files: tuple[str, ...],
    arm_file: str,
    wanted: tuple[str, ...],
    duration: float,
    seed: int,
    output: str,
    report_file: str | None,
    json_file: str | None,
    quiet: bool,
) -> None:
    """Plan the motion that settles best what a diagnosis left open, within the arm file's limits."""
    from armgap.arm.arm import Arm
    from armgap.planning.page import plan_document, plan_summary
    from armgap.planning.planning import check_output, plan
    from armgap.report.output import check_report, prepare_report, render_report

    if len(diagnosis_files) > 1:
        problem = f"{len(diagnosis_files)} diagnoses were given"
        raise OptionError(problem, remedy="give one; diagnose their logs together first", file=diagnosis_files[1])
    check_output(output)
    check_report(report_file)
    arm = Arm.read(Path(arm_file))
    with working("planning", quiet=quiet):
        prepare_report(report_file)
        result = plan(diagnosis_files[0], arm, questions=wanted, duration=duration, seed=seed)
    result.write(output)
    if report_file is not None:
        write(report_file, render_report(plan_document(result), result.to_dict(), report_file))
    if json_file is not None:
        write(json_file, result.to_json(indent=2))
    if not (quiet or is_stdout(output, json_file, report_file)):
        say = console()
        say.print(plan_summary(result))
        for note in result.notes:
            say.print(f"note: {note}", highlight=False, markup=False)
        say.print(f"motion: {output}, {len(result.t)} samples, {result.duration:.3g} s", highlight=False, markup=False)
        if report_file is not None:
            say.print(f"report: {report_file}", highlight=False, markup=False)
