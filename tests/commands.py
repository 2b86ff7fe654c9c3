"""Commands of the command line as tests that loop over all of them need it: declared parameters, and calls in a process."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import click

from armgap.cli import COMMANDS, cli


def leaves(command: click.Command, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Yield the command and all its sub-commands, each with the words that call it; a group only if it can be called without sub-command."""
    if not isinstance(command, click.Group):
        yield words, command
        return
    if command.invoke_without_command:
        yield words, command
    for name, inner in command.commands.items():
        yield from leaves(inner, (*words, name))


def every_command() -> list[tuple[tuple[str, ...], click.Command]]:
    found: list[tuple[tuple[str, ...], click.Command]] = []
    context = click.Context(cli)
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command is not None
        found += leaves(command, (name,))
    return found


EVERY = every_command()


def parameters(command: click.Command, kind: type | tuple[type, ...]) -> list[click.Parameter]:
    return [p for p in command.params if isinstance(p.type, kind)]


def called(parameter: click.Parameter) -> str:
    """Return the name by which error messages call a parameter: its longest option, or the argument's name."""
    if isinstance(parameter, click.Argument):
        return str(parameter.metavar).strip("[]…")
    return max(parameter.opts, key=len)


def snapshot(folder: Path) -> dict[str, bytes | None]:
    return {str(p): p.read_bytes() if p.is_file() else None for p in sorted(folder.rglob("*"))}


def refused(run: Callable[..., tuple[int, str, str]], words: list[str], *names: str) -> str:
    status, out, err = run(*words)
    assert (status, out, err.count("\n")) == (2, "", 1), err
    for name in names:
        assert name in err
    return err


def armgap_process(*words: object, **options: object) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-c", "from armgap.cli import main; main()", *map(str, words)]
    return subprocess.run(command, capture_output="stdout" not in options, check=False, timeout=120, **options)  # type: ignore[call-overload]
