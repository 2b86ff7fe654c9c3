"""Sub-command ``armgap trial``: make sealed cases, diagnose them, open the keys, score.

The steps are sub-commands; without one, a few cases are made, diagnosed and scored in one go.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from armgap.cli.common import console, interruptible, json_option, quiet_option
from armgap.cli.files import Group, InputFolder, OutputFolder
from armgap.cli.numbers import Seed
from armgap.cli.progress import working
from armgap.cli.trial_commands import make, run, score
from armgap.cli.trial_commands.all import all_of_it
from armgap.cli.trial_commands.run import baselines, former_name
from armgap.errors import OptionError
from armgap.files.output import is_stdout, write
from armgap.options import positive
from armgap.progress import report_progress, use_callback
from armgap.trial.cases.layout import MOST_CASES, belongs, case_folders_in

if TYPE_CHECKING:
    from rich.table import Table

    from armgap.trial.verdict import Judgement

__all__ = ["command"]


@click.group("trial", cls=Group, invoke_without_command=True)
@click.option(
    "--cases", default=10, show_default=True, type=click.IntRange(1, MOST_CASES), help="Number of cases to make."
)
@click.option("--seed", type=Seed(), help="Seed of the cases; a fresh one by default.")
@click.option("--duration", default=10.0, show_default=True, help="Length of each log [s].")
@click.option("--horizon", default=0.25, show_default=True, help="Prediction horizon [s].")
@click.option("--folder", type=OutputFolder(belongs), metavar="DIR", help="Keep the cases in a new folder.")
@click.option("--make-only", is_flag=True, help="Make the cases and stop; needs --folder.")
@click.option("--score", "made", type=InputFolder(belongs), metavar="DIR", help="Score the cases of a folder.")
@json_option
@quiet_option
@click.pass_context
def command(
    context: click.Context,
    cases: int,
    seed: int | None,
    duration: float,
    horizon: float,
    folder: Path | None,
    make_only: bool,
    made: Path | None,
    json_file: str | None,
    quiet: bool,
) -> None:
    """Score the diagnosis on blind cases made by MuJoCo, whose hidden effects are sealed by a hash."""
    if context.invoked_subcommand is not None:
        _only(context)
        return
    _check(folder, make_only, made, duration)
    horizon = positive(horizon, "horizon")
    if made is None and horizon > duration:
        raise OptionError(f"the horizon is {horizon:g} s", remedy=f"give less than the {duration:g} s of a log")
    say = console()
    say.quiet = quiet or is_stdout(json_file)
    with _cases(made, folder, lambda target: _make(target, cases, seed, duration, quiet)) as found:
        if make_only:
            say.print(f"{folder}: {len(found)} sealed cases")
            return
        scores = []
        with working("diagnosing", quiet=quiet):
            for i, case in enumerate(found):
                report_progress(f"diagnosing case {i + 1} of {len(found)}", i / len(found))
                with use_callback(_ignore):
                    scores.append(interruptible(partial(_score, case, horizon)))
    right = sum(judgement.right for _, judgement, _ in scores)
    if json_file is not None:
        write(json_file, json.dumps(_as_json(scores), indent=2))
    say.print(_table(scores))
    say.print(f"right: {right} of {len(scores)}")


for _step in (make, run, score, baselines, former_name, all_of_it):
    command.add_command(_step)


def _only(context: click.Context) -> None:
    """Raise if options stand before a sub-command of ``armgap trial``, where they would be ignored."""
    given = [p for p in context.params if context.get_parameter_source(p) is click.core.ParameterSource.COMMANDLINE]
    if given:
        raise OptionError(
            f"options stand before `{context.invoked_subcommand}`",
            remedy=f"write them after `{context.invoked_subcommand}`",
        )


def _check(folder: Path | None, make_only: bool, made: Path | None, duration: float) -> None:
    if make_only and folder is None:
        raise OptionError("the cases would be lost", remedy="say where they go with --folder")
    if made is not None and (folder is not None or make_only):
        raise OptionError("--score takes cases that exist", remedy="leave --folder and --make-only out")
    if folder is not None and folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise OptionError("exists and is not empty", remedy="name a new folder", file=folder)
    if not 1.0 <= duration <= 600.0:
        raise OptionError(f"the duration is {duration} s", remedy="give 1 to 600 s")


@contextmanager
def _cases(made: Path | None, folder: Path | None, make: Callable[[Path], list[Path]]) -> Iterator[list[Path]]:
    """Yield the case folders: existing ones, or new ones in `folder` or in a temporary folder."""
    if made is not None:
        found = case_folders_in(made)
        if not found:
            raise OptionError("holds no cases", remedy="make some with --make-only --folder", file=made)
        yield found
    elif folder is not None:
        yield make(folder)
    else:
        with tempfile.TemporaryDirectory(prefix="armgap-trial-") as scratch:
            yield make(Path(scratch))


def _make(target: Path, cases: int, seed: int | None, duration: float, quiet: bool) -> list[Path]:
    from armgap.trial.trial import fresh_seed, make_trial

    chosen = fresh_seed() if seed is None else seed
    with working(f"making {cases} cases of seed {chosen}", quiet=quiet):
        return make_trial(chosen, cases, folder=target, duration=duration)


def _ignore(_: str, __: float) -> None:
    """Ignore the progress of one case, as the bar shows that of all cases."""


def _score(case: Path, horizon: float) -> tuple[str, Judgement, float]:
    """Diagnose one case without its key, then open the key; return the case's name, the judgement, and the closed share of the gap."""
    from armgap.diagnosis.diagnosis import diagnose
    from armgap.trial.cases.key import open_key
    from armgap.trial.verdict import judge

    training, held = (sorted(case.glob(f"{part}-*.parquet")) for part in ("train", "holdout"))
    result = diagnose(training, case / "arm.toml", holdout=held or None, horizon=horizon)
    return case.name, judge(result, open_key(case)), result.gap.closed


def _as_json(scores: list[tuple[str, Judgement, float]]) -> dict[str, Any]:
    from dataclasses import asdict

    cases = [{"case": name, **asdict(judgement), "closed": closed} for name, judgement, closed in scores]
    return {"schema": "armgap.trial/1", "right": sum(j.right for _, j, _ in scores), "of": len(scores), "cases": cases}


def _table(scores: list[tuple[str, Judgement, float]]) -> Table:
    from rich.table import Table

    table = Table("case", "hidden", "named", "answer", title="blind trial")
    table.add_column("closed", justify="right")
    for name, judgement, closed in scores:
        answer = "right" if judgement.right else "wrong"
        if judgement.right and not judgement.exact:
            answer = "right, a look-alike"
        table.add_row(name, judgement.hidden, judgement.named, answer, f"{closed:.0%}")
    return table
