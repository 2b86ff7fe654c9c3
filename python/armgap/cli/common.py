"""Parts that the sub-commands share: options, column mappings, consoles and interrupts."""

from __future__ import annotations

import math
import os
import sys
import threading
from collections.abc import Callable, Mapping
from contextvars import copy_context
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar, get_args

import click
from rich.console import Console

from armgap.cli.files import Command, InputFile, OutputFile, Words
from armgap.errors import OptionError
from armgap.literals import GravityCorrection

if TYPE_CHECKING:
    from armgap.arm.arm import Arm
    from armgap.arm.corrections import Corrections

__all__ = [
    "ManyValues",
    "arm_option",
    "columns_option",
    "console",
    "corrections_options",
    "freeze_option",
    "frozen_positions",
    "interruptible",
    "json_option",
    "parse_columns",
    "parse_units",
    "quiet_option",
    "read_arm",
    "read_corrections",
    "report_option",
    "units_option",
]

Result = TypeVar("Result")
#: Interval at which a long computation checks for an interrupt, s: below what a user notices.
_POLL_S = 0.05
#: Width of tables on a standard output that is no terminal, in characters.
_PIPE_WIDTH = 120

arm_option = click.option(
    "--arm", "arm_file", type=InputFile(), required=True, metavar="ARM.toml", help="Arm file: the nominal model."
)
columns_option = click.option(
    "--columns",
    type=Words(),
    metavar="q1=NAME,…",
    help="The log's own names of its columns, for example t=time,q1=shoulder_pos.",
)
units_option = click.option(
    "--units",
    type=Words(),
    metavar="t=ms,q=deg",
    help="Units of the log where they are not SI; also settles what looks like another unit.",
)
freeze_option = click.option(
    "--freeze",
    multiple=True,
    type=Words(),
    metavar="JOINT=VALUE",
    help="Joint that stands still, with its position [rad or m]; may be repeated.",
)
json_option = click.option(
    "--json", "json_file", type=OutputFile(), metavar="OUT", help="Write the result as JSON; - is standard output."
)
report_option = click.option(
    "--report",
    "report_file",
    type=OutputFile(),
    metavar="OUT",
    help="Write the report: .html, .md for pull requests, or .json.",
)
_CORRECTIONS = {
    "flip": ("tau1,…", "Columns that count the other way than the arm file means."),
    "zero": ("q1=180deg", "Where the zero of a position column lies in the model's angle; it is added."),
    "swap": ("q1,q2", "Two columns that stand for each other."),
    "absolute": ("q2", "Position columns that count from the world, not from the link before."),
    "relative": ("q2", "Position columns that count from the link before, not from the world."),
    "factor": ("tau1=12.5", "Factor that makes torques of a torque column."),
    "shift": ("tau=-0.005", "Seconds to be added to the times of all torques."),
    "skip": ("[LOG:]0-2.5", "Times of a log, in seconds from its start, that are left out."),
}


def corrections_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the command-line options that correct signs, zeros, units or order of a log's columns."""
    gravity = click.Choice(get_args(GravityCorrection))
    command = click.option(
        "--gravity",
        type=gravity,
        help="Gravity acts the other way or along an axis of the base, torques carry no weight, or the arm file of a serial arm leaves out gravity.",
    )(command)
    for name, (metavar, text) in reversed(_CORRECTIONS.items()):
        command = click.option(f"--{name}", multiple=True, type=Words(), metavar=metavar, help=text)(command)
    return command


def read_corrections(given: Mapping[str, Any]) -> Corrections:
    """Read the command line's corrections of columns and gravity."""
    from armgap.arm.corrections import Corrections

    return Corrections.parse(**{name: given[name] for name in (*_CORRECTIONS, "gravity")})


def read_arm(path: str, given: Mapping[str, Any]) -> Arm:
    """Read an arm file, with the command line's corrections of columns added to those of the file."""
    from armgap.arm.arm import Arm

    arm = Arm.read(Path(path))
    wanted = read_corrections(given)
    merged = wanted if arm.corrections is None else arm.corrections.merged(wanted)
    return wanted.on_arm(replace(arm, corrections=merged or None))


quiet_option = click.option("--quiet", is_flag=True, help="No progress and no summary.")


class _Console(Console):
    def on_broken_pipe(self) -> NoReturn:
        """Raise to `main`, which ends the program when the reader of the console's output is gone."""
        self.quiet = True
        raise


def console(*, error: bool = False) -> Console:
    """Return a console that honours ``NO_COLOR`` and pipes, and raises `BrokenPipeError` like any stream."""
    stream = sys.stderr if error else sys.stdout
    width = None if stream.isatty() else _PIPE_WIDTH
    return _Console(stderr=error, width=width, no_color=bool(os.environ.get("NO_COLOR")) or None)


class ManyValues(Command):
    """A command whose ``--holdout`` takes every value up to the next option."""

    spread = ("--holdout",)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the option ``--holdout`` before each of its values, as click requires."""
        written: list[str] = []
        repeat: str | None = None
        for index, word in enumerate(args):
            if word == "--":
                written += args[index:]
                break
            if word.startswith("-") and word != "-":
                repeat = word if word in self.spread else None
                written.append(word)
            elif repeat is not None and written[-1] != repeat:
                written += [repeat, word]
            else:
                written.append(word)
        return super().parse_args(ctx, written)


def parse_columns(text: str | None) -> dict[str, str]:
    """Read the text of option ``--columns``: ``q1=name,q2=name``."""
    return _pairs("--columns", text, "q1=NAME,tau1=NAME")


def parse_units(text: str | None) -> dict[str, str]:
    """Read the text of option ``--units``: ``t=ms,q=deg``."""
    return _pairs("--units", text, "t=ms,q=deg")


def _pairs(option: str, text: str | None, example: str) -> dict[str, str]:
    mapping: dict[str, str] = {}
    for pair in filter(None, (text or "").split(",")):
        key, sep, name = (part.strip() for part in pair.partition("="))
        if not sep or not key or not name:
            raise OptionError(f"{option}: `{pair}` is not a pair", remedy=f"write {option} {example}")
        if key in mapping:
            raise OptionError(f"{option}: `{key}` is given twice", remedy=f"write {option} {example}")
        mapping[key] = name
    return mapping


def interruptible(work: Callable[[], Result]) -> Result:
    """Run `work` in a thread, so that an interrupt ends the program at once; `work` must write no files."""
    done: list[Result] = []
    failed: list[BaseException] = []

    def attempt() -> None:
        try:
            done.append(work())
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=copy_context().run, args=(attempt,), daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_POLL_S)
    if failed:
        raise failed[0]
    return done[0]


def frozen_positions(words: tuple[str, ...]) -> dict[str, float]:
    """Read the values of option ``--freeze``, ``JOINT=VALUE`` each, as positions by joint name [rad or m]."""
    frozen: dict[str, float] = {}
    for word in words:
        joint, _, text = (part.strip() for part in word.rpartition("="))
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not joint or not math.isfinite(value):
            raise OptionError(f"--freeze: `{word}` is no joint and position", remedy="write --freeze JOINT=0.04")
        if joint in frozen:
            raise OptionError(f"--freeze: `{joint}` is given twice", remedy="give each joint one position")
        frozen[joint] = value
    return frozen
