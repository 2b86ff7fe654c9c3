"""Make the cases of a seed, diagnose them, print how often the answers are right: ``python -m tests.serial_trial --help``."""

from __future__ import annotations

import functools
from pathlib import Path

import click


@click.command(name="python -m tests.serial_trial", context_settings={"max_content_width": 100, "show_default": True})
@click.option("--seed", type=click.IntRange(0), required=True, help="Seed of all cases.")
@click.option("--cases", type=click.IntRange(0), default=26, help="Cases with a hidden effect.")
@click.option("--nulls", type=click.IntRange(0), default=5, help="Cases without one.")
@click.option(
    "--outside", type=click.IntRange(0), default=0, help="Cases with an effect that the library does not have."
)
@click.option(
    "--clutter", type=click.IntRange(0), default=0, help="Cases with two to four smaller effects beside the hidden one."
)
@click.option(
    "--commanded", is_flag=True, help="Servos follow references, and the logs hold these in place of torques."
)
@click.option("--jobs", type=click.IntRange(1), default=1, help="Processes side by side, of one thread each.")
@click.option("--timeout", type=click.FloatRange(0, min_open=True), default=900.0, help="Longest time for a case [s].")
@click.option(
    "--json", "file", type=click.Path(dir_okay=False, path_type=Path), help="File for answers and keys, one a line."
)
def main(
    seed: int,
    cases: int,
    nulls: int,
    outside: int,
    clutter: int,
    *,
    commanded: bool,
    jobs: int,
    timeout: float,
    file: Path | None,
) -> None:
    """Diagnose arms of three to seven joints that a physics engine moves with hidden effects."""
    from .case import CLUTTERS, NULLS, OUTSIDES
    from .records import collect
    from .run import answer, report

    numbers = [*range(cases), *range(NULLS, NULLS + nulls)]
    numbers += [*range(OUTSIDES, OUTSIDES + outside), *range(CLUTTERS, CLUTTERS + clutter)]
    ask = functools.partial(answer, commanded=commanded)
    records = collect(ask, seed, numbers, jobs=jobs, file=file, timeout=timeout)
    click.echo(report(records))


if __name__ == "__main__":
    main()
