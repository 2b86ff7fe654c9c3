"""Diagnose an arm from random choices of its logs, at random horizons, and count what is named: ``python -m tests.log_splits --help``."""

from __future__ import annotations

import functools
from pathlib import Path

import click

from .draws import answer, line, named


@click.command(name="python -m tests.log_splits", context_settings={"max_content_width": 100, "show_default": True})
@click.argument("logs", nargs=-1, required=True, type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--arm", "arm_file", type=click.Path(exists=True, dir_okay=False, path_type=Path), required=True)
@click.option("--seed", type=click.IntRange(0), required=True, help="Seed of the draws.")
@click.option("--draws", type=click.IntRange(1), default=24, help="Draws.")
@click.option("--jobs", type=click.IntRange(1), default=1, help="Processes side by side, of one thread each.")
@click.option(
    "--json", "file", type=click.Path(dir_okay=False, path_type=Path), help="File for the answers, one a line."
)
def main(logs: tuple[Path, ...], arm_file: Path, seed: int, draws: int, jobs: int, file: Path | None) -> None:
    """Name the causes of the gap from 1 to 5 of LOGS, judged on 1 to 3 others, at horizons of 0.1 to 0.3 s."""
    from tests.serial_trial.records import collect

    ask = functools.partial(answer, logs=logs, arm_file=arm_file)
    records = collect(ask, seed, range(draws), jobs=jobs, file=file)
    for record in records:
        click.echo(line(record))
    click.echo("\n".join(named(records)))


if __name__ == "__main__":
    main()
