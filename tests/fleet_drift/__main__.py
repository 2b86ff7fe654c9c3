"""Fleets in which the friction of one robot rises: ``python -m tests.fleet_drift --help``."""

from __future__ import annotations

import os
from pathlib import Path

import click

#: Environment variables that set the number of threads of a process; each process has one.
THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")
SETTINGS = {"max_content_width": 100, "show_default": True}


@click.group(name="python -m tests.fleet_drift", context_settings=SETTINGS)
def main() -> None:
    """Measure after how many visits a fleet reports that the friction of one robot rises, and how often it reports this falsely."""
    os.environ.update(dict.fromkeys(THREADS, "1"))


@main.command("rows")
@click.option("--seed", type=click.IntRange(0), required=True, help="Seed of all fleets.")
@click.option("--fleets", type=click.IntRange(0), default=50, help="Fleets with a drift.")
@click.option("--nulls", type=click.IntRange(0), default=0, help="Fleets without one.")
@click.option(
    "--common", type=click.FloatRange(0), default=0.0, help="Scatter that all robots have in common on a day."
)
@click.option("--spread", type=click.FloatRange(0), default=0.0, help="Spread of the robots' own scatter (logarithm).")
def from_rows(seed: int, fleets: int, nulls: int, common: float, spread: float) -> None:
    """Draw fleets as tables of estimates, ask after every visit which parameters drift, and print delays and false alarms."""
    import numpy as np

    from armgap.fleet.series import moving

    from .judging import ask, report, truth_name
    from .rows import FRICTION, table
    from .truth import Design, draw

    design = Design(common=common, spread=spread)
    answers = []
    for number in range(fleets + nulls):
        rng = np.random.default_rng([seed, number])
        truth = draw(rng, design, len(FRICTION), drift=number < fleets)
        name = truth_name(truth.rising[1], FRICTION[truth.rising[0]]) if truth.rising else None
        answers.append(
            ask(table(rng, design, truth), design, name, lambda rows: [(m.robot, m.name) for m in moving(rows)])
        )
        click.echo(f"{number + 1} of {fleets + nulls}", err=True)
    click.echo(report(answers[:fleets], answers[fleets:]))


@main.command("logs")
@click.option("--seed", type=click.IntRange(0), required=True, help="Seed of the fleet.")
@click.option("--model", type=click.Choice(["pendulum", "geared", "direct-drive"]), default="pendulum", help="Arm.")
@click.option("--robots", type=click.IntRange(4), default=20, help="Robots.")
@click.option("--duration", type=click.FloatRange(1), default=3.0, help="Length of each log [s].")
@click.option("--workers", type=click.IntRange(1), default=1, help="Processes that diagnose.")
@click.option("-o", "--output", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder.")
def from_logs(seed: int, model: str, robots: int, duration: float, workers: int, output: Path) -> None:
    """Make and diagnose the logs of one fleet, and ask which parameters drift; an interrupted run is continued."""
    from .logs import study

    click.echo(study(seed, model, robots, duration, workers, output))


if __name__ == "__main__":
    main()
