"""Sub-command ``armgap fleet``: diagnoses of many robots."""

from __future__ import annotations

import os
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import click

from armgap.cli.common import console, quiet_option
from armgap.cli.files import Command, InputFile, OutputFolder, Words
from armgap.cli.progress import working
from armgap.fleet.engines import ENGINES
from armgap.fleet.folder import LIMIT_S, belongs
from armgap.progress import report_progress

__all__ = ["command"]

# Command-line options that are passed on to each diagnosis of the fleet.
_SETTINGS = ("horizon", "max_causes")
# Drifts listed on the terminal at most; the HTML page lists all.
_DRIFTS = 10


@click.command("fleet", cls=Command)
@click.argument("manifest", type=InputFile(), metavar="MANIFEST")
@click.option("-o", "--output", "folder", type=OutputFolder(belongs), required=True, metavar="FOLDER", help="Where to.")
@click.option(
    "--engine", type=click.Choice(list(ENGINES)), default="local", show_default=True, help="Where to compute."
)
@click.option("--address", type=Words(), metavar="HOST:PORT", help="A Ray cluster that runs already.")
@click.option(
    "--workers", type=click.IntRange(min=1), default=os.cpu_count() or 1, show_default="all cores", help="Processes."
)
@click.option("--horizon", type=click.FloatRange(min=0, min_open=True), help="Prediction horizon [s].")
@click.option(
    "--max-causes",
    type=click.IntRange(min=0),
    help="Effects named at most, beside pushes; 0 estimates parameters only.",
)
@click.option(
    "--limit",
    "limit_s",
    type=click.FloatRange(min=0, min_open=True),
    default=LIMIT_S,
    show_default=True,
    help="Longest time for one entry [s].",
)
@click.option("--again", is_flag=True, help="Diagnose also what stands in the folder.")
@quiet_option
def command(manifest: str, folder: Path, engine: str, quiet: bool, **options: Any) -> None:
    """Diagnose every entry of a manifest: causes by robot, values that drift over time, robots unlike the others.

    The MANIFEST is CSV, Parquet or TOML with the columns robot, arm, logs, holdout, time; several logs are separated by ;.
    A run that was interrupted goes on where it stopped.
    """
    from armgap.fleet.folder import run_fleet
    from armgap.fleet.manifest import read_manifest
    from armgap.fleet.page import moved, plain_time
    from armgap.fleet.series import moving

    def progress(done: int, total: int) -> None:
        report_progress(f"{done} of {total} entries", done / max(total, 1))

    entries = read_manifest(manifest)
    settings = {name: given for name in _SETTINGS if (given := options.pop(name)) is not None}
    with working("reading the manifest", quiet=quiet):
        fleet = run_fleet(entries, folder, settings, engine=engine, progress=progress, **options)
    if quiet:
        return
    say = partial(console().print, highlight=False, markup=False, soft_wrap=True)
    stood = len(entries) - fleet.answered
    say(
        f"{len(entries)} entries: {fleet.answered} computed now, {stood} stood there; {fleet.failed.height} without a diagnosis"
    )
    for row in fleet.failed.to_dicts():
        say(f"{row['robot']} {plain_time(row['time'])}: {row['error']}")
    for move in islice(moving(fleet.parameters), _DRIFTS):
        say(f"drifts: {moved(move)}")
    say(f"tables and page: {fleet.folder}")
