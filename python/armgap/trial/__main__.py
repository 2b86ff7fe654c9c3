"""Command ``python -m armgap.trial --seed N -o FOLDER``: makes a sealed demo case."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.files import Command, OutputFolder
from armgap.cli.numbers import Seed
from armgap.errors import OptionError
from armgap.trial.cases.demo import DEMO_SEED, make_demo_case


@click.command(cls=Command)
@click.option("--seed", type=Seed(), default=DEMO_SEED, show_default=True, help="Number that decides everything.")
@click.option("-o", "--output", type=OutputFolder(), required=True, metavar="DIR", help="New folder to write.")
def main(seed: int, output: Path) -> None:
    """Make a sealed demo case: one arm, one hidden effect, two logs."""
    if output.exists() and any(output.iterdir()):
        raise OptionError("exists and is not empty", remedy="name a new folder", file=output)
    case = make_demo_case(seed)
    case.write(output)
    click.echo(f"{output}: {', '.join(case.logs)}, arm.toml; key sealed as sha256 {case.key.sha256[:16]}…")


if __name__ == "__main__":
    main(prog_name="python -m armgap.trial")
