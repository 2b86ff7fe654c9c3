"""Sub-command ``armgap export``: corrected model for a simulator."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.common import arm_option, freeze_option, frozen_positions, quiet_option
from armgap.cli.files import Command, InputFile, OutputFile
from armgap.errors import OptionError
from armgap.files.output import write

__all__ = ["command"]

_FORMATS = {".xml": "mjcf", ".mjcf": "mjcf", ".urdf": "urdf", ".toml": "toml", ".json": "json"}


@click.command("export", cls=Command)
@click.argument("diagnosis_file", type=InputFile(), metavar="DIAGNOSIS.json")
@arm_option
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    required=True,
    metavar="OUT",
    help="File to write: .xml, .urdf, .toml, .json; or -.",
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["mjcf", "urdf", "toml", "json"]),
    help="Format, where the ending does not tell.",
)
@click.option(
    "--stage",
    type=click.Choice(["with_causes", "refit"]),
    default="with_causes",
    show_default=True,
    help="Re-estimated values with the causes, or without them.",
)
@click.option(
    "--keep-lengths", is_flag=True, help="Keep the arm file's length of link 1, and move theta2 and theta5 to it."
)
@click.option(
    "--model",
    "model_file",
    type=InputFile(),
    metavar="FILE.urdf|FILE.xml",
    help="Write the corrected values into this description of a serial arm, and keep all else in it.",
)
@freeze_option
@click.option(
    "--randomization",
    "randomization_file",
    type=OutputFile(),
    metavar="OUT.json",
    help="Write ranges for domain randomisation: each quantity's value, standard deviation and range, and models drawn from them.",
)
@quiet_option
def command(
    diagnosis_file: str,
    arm_file: str,
    output: str,
    form: str | None,
    stage: str,
    keep_lengths: bool,
    model_file: str | None,
    freeze: tuple[str, ...],
    randomization_file: str | None,
    quiet: bool,
) -> None:
    """Write what a diagnosis found as a model for a simulator: MJCF, URDF, an arm file, or JSON."""
    from armgap.arm.arm import Arm
    from armgap.export import randomization
    from armgap.export.correction import correct
    from armgap.export.formats.original import into_description
    from armgap.export.read import read_diagnosis

    chosen = form or _FORMATS.get(Path(output).suffix.lower())
    if chosen is None:
        raise OptionError(
            f"`{output}` does not tell the format", remedy="end it in .xml, .urdf, .toml or .json, or give --format"
        )
    model = correct(read_diagnosis(diagnosis_file), Arm.read(Path(arm_file)), stage=stage, keep_lengths=keep_lengths)
    if model_file is None:
        if freeze:
            raise OptionError("--freeze stands without --model", remedy="add --model, or leave it out")
        content: str | bytes = model.render(chosen)
        remarks = model.remarks(chosen)
    else:
        described = into_description(model, model_file, frozen=frozen_positions(freeze))
        if described.form != chosen:
            wanted = {"mjcf": ".xml", "urdf": ".urdf"}[described.form]
            raise OptionError(
                f"`{model_file}` is {described.form.upper()}, the output is to be {chosen.upper()}",
                remedy=f"end the output in {wanted}",
            )
        content, remarks = described.content, described.remarks
        beside = Path(output).resolve().parent == Path(model_file).resolve().parent
        if described.names_files and not beside:
            remarks += ("it names files by relative paths: keep it in the folder of the model",)
    spread = None if randomization_file is None else randomization(model)
    write(output, content)
    if randomization_file is not None and spread is not None:
        write(randomization_file, spread)
    for line in () if quiet else remarks:
        click.echo(f"note: {line}", err=True)
