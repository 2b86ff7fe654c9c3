"""Sub-command ``armgap trial score``: scores of all methods on the cases of a trial."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from armgap.cli.common import console, json_option, quiet_option
from armgap.cli.files import Command, OutputFile
from armgap.cli.trial_commands.common import folder_argument
from armgap.files.output import is_stdout, write

if TYPE_CHECKING:
    from rich.table import Table

    from armgap.trial.scoring.figures import Figures

__all__ = ["md_option", "score", "score_all"]

md_option = click.option(
    "--md",
    "md_file",
    type=OutputFile(),
    metavar="OUT.md",
    help="Write the tables as Markdown; - is standard output.",
)


@click.command("score", cls=Command)
@folder_argument
@json_option
@md_option
@quiet_option
def score(folder: Path, json_file: str | None, md_file: str | None, quiet: bool) -> None:
    """Open the keys of DIR and score armgap and every baseline that has answered all cases."""
    score_all(folder, json_file, md_file, quiet)


def score_all(folder: Path, json_file: str | None, md_file: str | None, quiet: bool) -> None:
    """Score all methods that answered every case, and write the requested files."""
    from armgap.trial.cases.making import read_manifest, seal_of_all
    from armgap.trial.cases.sealed import case_folders
    from armgap.trial.scoring.figures import figures, opened_keys
    from armgap.trial.scoring.page import page

    cases = case_folders(folder)
    names, partly = _answered(cases)
    keys = opened_keys(cases)
    found = [figures(cases, keys, name) for name in names]
    manifest = read_manifest(folder)
    if json_file is not None:
        origin = None if manifest is None else dict(manifest.__dict__)
        data = {"schema": "armgap.trial-scores/1", "trial": origin, "methods": [f.to_dict() for f in found]}
        write(json_file, json.dumps(data, indent=1))
    if md_file is not None:
        write(md_file, page(found, manifest, seal_of_all(cases)))
    if not (quiet or is_stdout(json_file, md_file)):
        console().print(_table(found))
        for note in partly:
            console().print(note, highlight=False)


def _answered(cases: list[Path]) -> tuple[list[str], list[str]]:
    """Return the methods that have answered every case, armgap first, and a note on each method that has answered only some."""
    from armgap.errors import OptionError
    from armgap.trial.methods import methods
    from armgap.trial.running import answer_file

    missing = {name: sum(not answer_file(c, name).is_file() for c in cases) for name in methods()}
    if missing["armgap"]:
        text = f"{missing['armgap']} of {len(cases)} cases are not answered"
        raise OptionError(text, remedy="run armgap trial run DIR first", file=cases[0].parent)
    partly = [
        f"not scored: {methods()[name].title} has answered {len(cases) - count} of {len(cases)} cases"
        for name, count in missing.items()
        if 0 < count < len(cases)
    ]
    return [name for name, count in missing.items() if not count], partly


def _table(found: list[Figures]) -> Table:
    from rich.table import Table

    from armgap.trial.methods import methods

    table = Table(title="blind trial", caption="right: first cause and joint, of the visible effects of the library")
    for head in ("method", "right", "false alarms", "wrong of p ≥ 0.9", "extra per case", "CPU s"):
        table.add_column(head, justify="left" if head == "method" else "right")
    for f in found:
        alarms = sum(bool(c.named) for c in f.quiet)
        table.add_row(
            methods()[f.method].title,
            f"{f.headline.right} of {f.headline.of}",
            f"{alarms} of {len(f.quiet)}",
            f"{f.confident.of - f.confident.right} of {f.confident.of}",
            f"{f.extra:.2f}",
            f"{f.seconds[0]:.2g}",
        )
    return table
