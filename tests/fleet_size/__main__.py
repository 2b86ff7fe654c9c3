"""Test of a fleet of some hundred entries: ``python -m tests.fleet_size --help``."""

from __future__ import annotations

import os
from pathlib import Path

import click

#: Environment variables that set the number of threads of a process; each process has one.
THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS")
CAUSES = click.option(
    "--max-causes", type=click.IntRange(0), help="Causes named at most; those of a diagnosis by default."
)
FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)


@click.group(name="python -m tests.fleet_size", context_settings={"max_content_width": 100, "show_default": True})
def main() -> None:
    """Test a fleet made from cases of a blind trial, some of whose entries are broken."""
    os.environ.update(dict.fromkeys(THREADS, "1"))


@main.command()
@click.argument("cases", type=FOLDER)
@click.option("--broken", type=click.IntRange(0), default=10, help="Entries that are broken.")
@click.option(
    "--seconds", type=click.FloatRange(1), default=10.0, help="Part of each log that is taken, from its start [s]."
)
@click.option("-o", "--output", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder.")
def entries(cases: Path, broken: int, seconds: float, output: Path) -> None:
    """Write the manifest of the fleet, with two entries per case of the trial."""
    from .entries import write_entries

    click.echo(write_entries(cases, broken, seconds, output))


def _options(max_causes: int | None) -> list[str]:
    return [] if max_causes is None else ["--max-causes", str(max_causes)]


@main.command()
@click.argument("folder", type=FOLDER)
@click.option("--kill-after", type=click.IntRange(1), default=150, help="Results that stand when the run is killed.")
@click.option("--workers", type=click.IntRange(1), default=1, help="Processes.")
@CAUSES
def restart(folder: Path, kill_after: int, workers: int, max_causes: int | None) -> None:
    """Run the fleet command on the manifest, kill it once and start it again."""
    from .running import killed_and_restarted

    click.echo(killed_and_restarted(folder, kill_after, workers, _options(max_causes)))


@main.command()
@click.argument("folder", type=FOLDER)
@click.option("--nodes", type=click.IntRange(1), default=2, help="Nodes of one processor, all on this machine.")
@click.option(
    "--entries", "most", type=click.IntRange(2), help="First entries of the manifest, an even number; all by default."
)
@CAUSES
def ray(folder: Path, nodes: int, most: int | None, max_causes: int | None) -> None:
    """Run the manifest on a Ray cluster and compare its tables with those of the run by `restart`."""
    from .running import on_ray

    click.echo(on_ray(folder, nodes, most, _options(max_causes)))


@main.command()
@click.argument("folder", type=FOLDER)
@click.option("--entries", "count", type=click.IntRange(2), default=30, help="Entries per run.")
@CAUSES
@click.option("--pairs", type=click.IntRange(1), default=3, help="Rounds of one run with one worker and one with two.")
def scaling(folder: Path, count: int, pairs: int, max_causes: int | None) -> None:
    """Compare the times of fleets with one worker and with two."""
    from .scaling import scaling as table

    click.echo(table(folder, count, pairs, {} if max_causes is None else {"max_causes": max_causes}))


@main.command()
@click.argument("folder", type=FOLDER)
@click.option("--failing", type=click.IntRange(3), default=200, help="Entries that fail at once.")
@click.option("--rounds", type=click.IntRange(1), default=5, help="Rounds.")
@CAUSES
def overhead(folder: Path, failing: int, rounds: int, max_causes: int | None) -> None:
    """Measure the processor time of a fleet per entry apart from its diagnosis; `restart` must have been run before."""
    from .scaling import overhead as figures

    click.echo(figures(folder, failing, rounds, {} if max_causes is None else {"max_causes": max_causes}))


if __name__ == "__main__":
    main()
