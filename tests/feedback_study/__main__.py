"""Make the runs of a seed, estimate, print bias and coverage: ``python -m tests.feedback_study --help``."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import click

#: What decides how many threads a process takes; each process has one.
THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")


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
    os.environ.update(dict.fromkeys(THREADS, "1"))
    from pebble import ProcessPool

    from .estimates import ask
    from .report import report

    records: list[dict[str, Any]] = []
    with ProcessPool(jobs) as pool:
        tasks = [(number, pool.schedule(ask, args=[seed, number, share])) for number in range(runs)]
        for number, task in tasks:
            try:
                record = task.result()
            except Exception as error:  # one run that fails must not end the study; it is counted
                record = {"number": number, "seed": seed, "failed": f"{type(error).__name__}: {error}"}
            records.append(record)
            if file is not None:
                file.write_text("".join(json.dumps(r) + "\n" for r in records))
            click.echo(f"{len(records)} of {runs}", err=True)
    click.echo(report(records))


if __name__ == "__main__":
    main()
