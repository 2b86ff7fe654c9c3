"""Options and progress bar that the sub-commands of ``armgap trial`` share."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from typing import TypeVar

import click

from armgap.cli.files import InputFolder, OutputFolder
from armgap.cli.numbers import Number, Seed
from armgap.trial.cases.layout import MOST_CASES, belongs

__all__ = [
    "cases_option",
    "duration_option",
    "folder_argument",
    "output_option",
    "progress",
    "seed_option",
    "workers_option",
]

Item = TypeVar("Item")
#: Largest number of worker processes.
MOST_WORKERS = 1024

folder_argument = click.argument("folder", metavar="DIR", type=InputFolder(belongs, exists=True))
output_option = click.option(
    "-o",
    "--output",
    "folder",
    required=True,
    metavar="DIR",
    type=OutputFolder(belongs),
    help="Folder of the trial.",
)
cases_option = click.option(
    "-n", "--cases", default=200, show_default=True, type=click.IntRange(1, MOST_CASES), help="Number of cases."
)
seed_option = click.option("--seed", type=Seed(), help="Seed of the cases; a fresh one by default.")
duration_option = click.option(
    "--duration", default=10.0, show_default=True, type=Number(1.0, 600.0), help="Length of each log [s]."
)
workers_option = click.option(
    "--workers",
    default=os.cpu_count() or 1,
    show_default="one per processor",
    type=click.IntRange(1, MOST_WORKERS),
    help="Processes, of one thread each.",
)


def progress(items: Iterable[Item], total: int, label: str, *, quiet: bool) -> Iterator[Item]:
    """Yield the items, with a progress bar on standard error at a terminal."""
    from armgap.cli.common import console

    say = console(error=True)
    if quiet or not say.is_terminal:
        yield from items
        return
    from rich.progress import track

    yield from track(items, description=label, total=total, console=say, transient=True)
