"""Sub-commands ``armgap trial run`` and ``armgap trial baselines``: answers to the cases of a trial."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from armgap.cli.common import console, quiet_option
from armgap.cli.files import Command, Words
from armgap.cli.numbers import Number
from armgap.cli.trial_commands.common import folder_argument, progress, workers_option

__all__ = ["answer_all", "baselines", "former_name", "limit_option", "run"]

LONGEST_S = 1e6
"""Largest time limit for one case [s]: eleven days, within the range of a system's timers."""
limit_option = click.option(
    "--limit",
    "limit_s",
    default=300.0,
    show_default=True,
    type=Number(1.0, LONGEST_S),
    help="Longest time for one case [s].",
)
again_option = click.option("--again", is_flag=True, help="Answer anew what is answered already.")


@click.command("run", cls=Command)
@folder_argument
@workers_option
@limit_option
@again_option
@quiet_option
def run(folder: Path, workers: int, limit_s: float, again: bool, quiet: bool) -> None:
    """Diagnose the cases of DIR with armgap, keys closed. Goes on where it stopped."""
    answer_all(folder, ["armgap"], workers, limit_s, again, quiet)


@click.command("baselines", cls=Command)
@folder_argument
@click.option(
    "--only",
    multiple=True,
    type=Words(),
    metavar="NAME",
    help="Only this method; may be repeated. All baselines by default.",
)
@workers_option
@limit_option
@again_option
@quiet_option
def baselines(folder: Path, only: tuple[str, ...], workers: int, limit_s: float, again: bool, quiet: bool) -> None:
    """Let other methods, the baselines, name the causes in DIR, keys closed. Goes on where it stopped."""
    from armgap.errors import OptionError
    from armgap.trial.methods import methods

    known = [name for name in methods() if name != "armgap"]
    unknown = [name for name in only if name not in known]
    if unknown:
        raise OptionError(f"--only: no method `{unknown[0]}`", remedy=f"take one of {', '.join(known)}")
    answer_all(folder, list(only) or known, workers, limit_s, again, quiet)


#: Former name ``peers`` of the command ``armgap trial baselines``; removed in 0.3.0.
former_name = Command(
    "peers", callback=baselines.callback, params=baselines.params, help=baselines.help, hidden=True, deprecated=True
)


def answer_all(folder: Path, names: Sequence[str], workers: int, limit_s: float, again: bool, quiet: bool) -> None:
    """Let the named methods answer all cases that they have not answered yet."""
    from armgap.trial.cases.sealed import case_folders
    from armgap.trial.methods import methods
    from armgap.trial.running import answer_cases, open_cases

    total = len(case_folders(folder))
    for method in (methods()[name] for name in names):
        method.check()
        left = open_cases(folder, method, again)
        answers = answer_cases(left, method, workers=workers, limit_s=limit_s)
        done = [a for _, a in progress(answers, len(left), method.title, quiet=quiet)]
        failed = sum(a.error is not None for a in done)
        if not quiet:
            note = f", {failed} without an answer" if failed else ""
            console().print(
                f"{method.title}: {len(done)} cases answered, {total - len(left)} were before{note}", highlight=False
            )
