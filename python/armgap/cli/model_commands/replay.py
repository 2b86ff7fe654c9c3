"""Sub-command ``armgap replay``: recording for the Rerun viewer."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.common import (
    arm_option,
    columns_option,
    console,
    parse_columns,
    parse_units,
    quiet_option,
    units_option,
)
from armgap.cli.files import Command, InputFile, OutputFile
from armgap.cli.progress import working
from armgap.errors import OptionError

__all__ = ["command"]

SUFFIX = ".rrd"


@click.command("replay", cls=Command)
@click.argument("log_file", type=InputFile(), metavar="LOG")
@arm_option
@click.option(
    "--diagnosis",
    "diagnosis_file",
    type=InputFile(),
    metavar="D.json",
    help="Diagnosis whose causes are predicted with too.",
)
@click.option("--horizon", default=0.25, show_default=True, help="Length of a predicted window [s].")
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    default="replay.rrd",
    show_default=True,
    metavar="OUT.rrd",
    help="Recording to write.",
)
@columns_option
@units_option
@quiet_option
def command(
    log_file: str,
    arm_file: str,
    diagnosis_file: str | None,
    horizon: float,
    output: str,
    columns: str | None,
    units: str | None,
    quiet: bool,
) -> None:
    """Write measured and predicted arm side by side as a recording for the Rerun viewer."""
    from armgap.arm.arm import Arm
    from armgap.diagnosis.comparison import read_diagnosis
    from armgap.log.log import Log
    from armgap.report.forms.replay import models, predicted, write_replay

    if Path(output).suffix != SUFFIX:
        raise OptionError("a recording has another extension", remedy=f"name it {SUFFIX}", file=output)
    if not horizon > 0:
        raise OptionError(f"the horizon is {horizon}", remedy="give a positive number of seconds")
    arm = Arm.read(Path(arm_file))
    log = Log.read(log_file, arm=arm, columns=parse_columns(columns), units=parse_units(units))
    diagnosis = None if diagnosis_file is None else read_diagnosis(diagnosis_file)
    with working("predicting", quiet=quiet):
        curves = {name: predicted(model, log, horizon) for name, model in models(arm, diagnosis).items()}
    write_replay(curves, log, arm, output)
    if not quiet:
        console().print(f"recording: {output} (open it with: rerun {output})", highlight=False, markup=False)
