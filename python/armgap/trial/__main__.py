"""``python -m armgap.trial --seed N -o FOLDER``: make a sealed demo case."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.trial.demo import DEMO_SEED, make_demo_case


@click.command()
@click.option("--seed", type=int, default=DEMO_SEED, show_default=True, help="Number that decides everything.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder to write."
)
def main(seed: int, output: Path) -> None:
    """Make a sealed demo case: one arm, one hidden effect, two logs."""
    case = make_demo_case(seed)
    case.write(output)
    click.echo(f"{output}: {', '.join(case.logs)}, arm.toml; key sealed as sha256 {case.key.sha256[:16]}…")


if __name__ == "__main__":
    main(prog_name="python -m armgap.trial")
