"""Make the runs of a seed, estimate parameters, print bias and coverage: ``python -m tests.feedback_study --help``."""

from __future__ import annotations

import functools
from pathlib import Path

import click


@click.command(name="python -m tests.feedback_study", context_settings={"max_content_width": 100, "show_default": True})
@click.option("--seed", type=click.IntRange(0), required=True, help="Seed of the arm and all runs.")
@click.option("--runs", type=click.IntRange(2), default=50, help="Runs.")
@click.option(
    "--share", type=click.FloatRange(0), default=0.05, help="Disturbance, as a share of each joint's RMS torque."
)
@click.option("--jobs", type=click.IntRange(1), default=1, help="Processes side by side, of one thread each.")
@click.option(
    "--json", "file", type=click.Path(dir_okay=False, path_type=Path), help="File for the answers, one a line."
)
def main(seed: int, runs: int, share: float, *, jobs: int, file: Path | None) -> None:
    """Measure bias and coverage of a serial arm's parameters from logs in closed loop."""
    from tests.serial_trial.records import collect

    from .estimates import ask
    from .report import report

    records = collect(functools.partial(ask, share=share), seed, range(runs), jobs=jobs, file=file)
    click.echo(report(records))


if __name__ == "__main__":
    main()
