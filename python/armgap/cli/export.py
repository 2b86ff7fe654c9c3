"""``armgap export``."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.common import arm_option, quiet_option
from armgap.cli.files import Command, InputFile, OutputFile
from armgap.errors import OptionError
from armgap.output import write

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
@quiet_option
def command(
    diagnosis_file: str, arm_file: str, output: str, form: str | None, stage: str, keep_lengths: bool, quiet: bool
) -> None:
    """Write what a diagnosis found as a model for a simulator: MJCF, URDF, an arm file, or JSON."""
    from armgap.arm import Arm
    from armgap.export import correct, read_diagnosis

    chosen = form or _FORMATS.get(Path(output).suffix.lower())
    if chosen is None:
        raise OptionError(
            f"`{output}` does not tell the format", remedy="end it in .xml, .urdf, .toml or .json, or give --format"
        )
    model = correct(read_diagnosis(diagnosis_file), Arm.read(Path(arm_file)), stage=stage, keep_lengths=keep_lengths)
    write(output, model.render(chosen))
    for line in () if quiet else model.remarks(chosen):
        click.echo(f"note: {line}", err=True)
