"""Sub-command ``armgap trial all``: the whole trial in one command."""

from __future__ import annotations

from pathlib import Path

import click

from armgap.cli.common import json_option, quiet_option
from armgap.cli.files import Command
from armgap.cli.trial_commands.common import cases_option, duration_option, output_option, seed_option, workers_option
from armgap.cli.trial_commands.run import limit_option
from armgap.cli.trial_commands.score import md_option
from armgap.files.output import is_stdout

__all__ = ["all_of_it"]


@click.command("all", cls=Command)
@cases_option
@seed_option
@output_option
@duration_option
@workers_option
@limit_option
@click.option("--baselines/--no-baselines", default=True, show_default=True, help="Let other methods answer too.")
@click.option(
    "--peers/--no-peers", "former_name", default=None, hidden=True
)  # former name of --baselines; goes with 0.3.0
@json_option
@md_option
@quiet_option
def all_of_it(
    cases: int,
    seed: int | None,
    folder: Path,
    duration: float,
    workers: int,
    limit_s: float,
    baselines: bool,
    former_name: bool | None,
    json_file: str | None,
    md_file: str | None,
    quiet: bool,
) -> None:
    """Make cases, diagnose them, let the baselines name causes too, open the keys and score. Goes on where it stopped."""
    from armgap.cli.trial_commands.make import make_them
    from armgap.cli.trial_commands.run import answer_all
    from armgap.cli.trial_commands.score import score_all
    from armgap.trial.methods import methods

    names = list(methods()) if (baselines if former_name is None else former_name) else ["armgap"]
    for name in names:
        methods()[name].check()  # what is not installed is missed now, not after the cases are made
    silent = quiet or is_stdout(json_file, md_file)
    make_them(folder, cases, seed, duration, workers, silent)
    answer_all(folder, names, workers, limit_s, False, silent)
    score_all(folder, json_file, md_file, silent)
