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
"""Sub-commands, the module whose ``command`` each one is, and one line about it."""

#: Exit statuses: of `click` for wrong usage, and 128 with the number of SIGINT.
UNUSABLE_INPUT = 2
INTERRUPTED = 130
_SIGNALLED = 128
"""Status of a program that a signal ended, less the signal's number."""

_GARBAGE_EVERY = 50_000
"""Objects between two searches for garbage: most of what a command makes, modules and charts, stays until it ends."""


class LazyGroup(click.Group):
    """A group whose commands are imported when they are asked for."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the sub-command; a reader of standard output that has seen enough ends it quietly."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:
            abandon_stdout()
            raise click.exceptions.Exit(0) from None

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the names of all sub-commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a sub-command by name."""
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
        """List the sub-commands without loading them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="armgap")
def cli() -> None:
    """Find out why a real robot arm does not do what the simulation said."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; unusable input ends it with status 2 and one line on standard error."""
    gc.set_threshold(_GARBAGE_EVERY)
    atexit.register(gc.freeze)  # what is left at the end goes with the process, without being searched
    open_streams()
    try:
        with ended_by_signals():
            status = _run(arguments)
            sys.stdout.flush()  # a full disk may show itself only now
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
    """End at once: everything half done has been cleared away on the way here, and threads that still compute are not waited for."""
    click.echo("armgap: interrupted", err=True)
    with suppress(OSError):
        sys.stdout.flush()
    os._exit(status)


def _unreachable(error: OSError) -> NoReturn:
    """A file or stream failed outside of what reads logs and writes results: as a rule the summary on standard output."""
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
