"""Sub-command ``armgap trial make``: sealed cases of a trial."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.common import console, quiet_option
from armgap.cli.files import Command
from armgap.cli.trial_commands.common import (
    cases_option,
    duration_option,
    output_option,
    progress,
    seed_option,
    workers_option,
)

__all__ = ["make", "make_them"]


@click.command("make", cls=Command)
@cases_option
@seed_option
@output_option
@duration_option
@workers_option
@quiet_option
def make(cases: int, seed: int | None, folder: Path, duration: float, workers: int, quiet: bool) -> None:
    """Make sealed cases: logs, arm files and keys whose hashes are shown. Goes on where it stopped."""
    make_them(folder, cases, seed, duration, workers, quiet)


def make_them(folder: Path, cases: int, seed: int | None, duration: float, workers: int, quiet: bool) -> list[Path]:
    """Make the missing cases of a trial, and print the hashes of their keys."""
    from armgap.trial.cases.making import make_cases, read_manifest, seal_of_all
    from armgap.trial.trial import fresh_seed

    if seed is None:
        known = read_manifest(folder)
        seed = fresh_seed() if known is None else known.seed
    found = list(progress(make_cases(folder, seed, cases, duration, workers), cases, "making cases", quiet=quiet))
    if not quiet:
        console().print(
            f"{folder}: {len(found)} sealed cases of seed {seed}; one hash over all seals: {seal_of_all(found)}",
            highlight=False,
            soft_wrap=True,
        )
    return found
