"""The command ``armgap``: one file per sub-command, loaded when it is used."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from contextlib import suppress
from importlib import import_module
from typing import Any, NoReturn

import click

from armgap._native import __version__
from armgap.cli.streams import EndedError, abandon_stdout, ended_by_signals, open_streams
from armgap.errors import ArmgapError

__all__ = ["main"]

COMMANDS = {
    "diagnose": ("armgap.cli.diagnosis_commands.diagnose", "Where the gap lies, what causes it, how far it shrinks."),
    "plan": (
        "armgap.cli.diagnosis_commands.plan",
        "The next experiment: the motion that settles what a diagnosis left open.",
    ),
    "compare": ("armgap.cli.diagnosis_commands.compare", "Two diagnoses of one arm, as before and after a repair."),
    "fleet": ("armgap.cli.diagnosis_commands.fleet", "Many robots: the same diagnosis for every entry of a manifest."),
    "model": ("armgap.cli.model_commands.model", "A URDF or MJCF model as an arm file."),
    "inspect": ("armgap.cli.diagnosis_commands.inspect", "What logs hold, and what they tell about an arm."),
    "identify": ("armgap.cli.diagnosis_commands.identify", "Estimate the arm's parameters from logs."),
    "simulate": ("armgap.cli.model_commands.simulate", "Simulate an arm, with effects on request."),
    "export": ("armgap.cli.model_commands.export", "What was found, as a model for a simulator."),
    "bench": ("armgap.cli.bench", "Cost per sample on this machine against the sample period."),
    "demo": ("armgap.cli.demo", "Diagnose the sample log and open its sealed key."),
    "replay": ("armgap.cli.model_commands.replay", "Measured and predicted arm side by side, for the Rerun viewer."),
    "reproduce": ("armgap.cli.reproduce", "The seed paper's tables and figures beside our own."),
    "trial": ("armgap.cli.trial", "Blind trials: sealed cases, diagnosed and scored."),
}
"""Sub-commands: name, the module whose ``command`` is the sub-command, and one line of help about it."""

#: Exit statuses of the program: for unusable input or wrong usage as in `click`, and 128 plus the number of SIGINT for an interrupt.
UNUSABLE_INPUT = 2
INTERRUPTED = 130
_SIGNALLED = 128
"""Exit status of a program that a signal ended, less the signal's number."""

_GARBAGE_EVERY = 50_000
"""Objects allocated between two runs of the garbage collector: most objects of a command, modules and charts, live until it ends."""


class LazyGroup(click.Group):
    """A group of commands whose modules are imported only when they are used."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the sub-command; if the reader of standard output closes it early, end without a message."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            abandon_stdout()
            raise click.exceptions.Exit(0) from None

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the names of all sub-commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a sub-command by name, importing its module."""
        if cmd_name not in COMMANDS:
            return None
        try:
            command = import_module(COMMANDS[cmd_name][0]).command
        except ModuleNotFoundError as missing:
            remedy = "install it with pip install 'armgap[trial]'"
            raise click.UsageError(f"`{cmd_name}` needs {missing.name}, which is not installed; {remedy}") from None
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the sub-commands in the help text without importing their modules."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="armgap")
def cli() -> None:
    """Find out why a real robot arm does not do what the simulation said."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; unusable input ends it with status 2 and one line on standard error."""
    gc.set_threshold(_GARBAGE_EVERY)
    atexit.register(gc.freeze)  # objects that remain at the end are not searched by the garbage collector
    open_streams()
    try:
        with ended_by_signals():
            status = _run(arguments)
            sys.stdout.flush()  # a full disk may cause an error only here
    except ArmgapError as error:
        _fail(str(error))
    except click.ClickException as error:
        _fail(" ".join(error.format_message().split()))
    except (click.Abort, KeyboardInterrupt) as stop:
        cause = stop if isinstance(stop, EndedError) else stop.__cause__
        _interrupted(_SIGNALLED + cause.number if isinstance(cause, EndedError) else INTERRUPTED)
    except BrokenPipeError:
        abandon_stdout()
        sys.exit(0)
    except OSError as error:
        _unreachable(error)
    except MemoryError:
        _fail("there is not enough memory for this; give less at once")
    sys.exit(status)


def _run(arguments: list[str] | None) -> int:
    try:
        status = cli.main(args=arguments, prog_name="armgap", standalone_mode=False)
    except click.exceptions.Exit as stop:
        return stop.exit_code
    return status if isinstance(status, int) else 0


def _interrupted(status: int) -> NoReturn:
    """End the process at once after an interrupt: half-written files have been removed already, and threads that still compute are not waited for."""
    click.echo("armgap: interrupted", err=True)
    with suppress(OSError):
        sys.stdout.flush()
    os._exit(status)


def _unreachable(error: OSError) -> NoReturn:
    """End the process with a message about a file or stream that failed outside of reading and writing, as a rule standard output."""
    abandon_stdout()
    place = error.filename if error.filename is not None else "standard output"
    _fail(f"{place}: cannot be used ({error.strerror or error}); choose another place")


def _fail(message: str) -> NoReturn:
    with suppress(OSError):
        click.echo(f"armgap: {message}", err=True)
    try:
        sys.stdout.flush()
    except OSError:
        abandon_stdout()
    sys.exit(UNUSABLE_INPUT)
