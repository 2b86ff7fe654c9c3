"""What the sub-commands share: options, column mappings, progress, and writing results whole or not at all."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from armgap.errors import OptionError, ResultError

__all__ = ["arm_option", "columns_option", "console", "json_option", "parse_columns", "quiet_option", "working", "write"]

arm_option = click.option("--arm", "arm_file", required=True, metavar="ARM.toml", help="Arm file: the nominal model.")
columns_option = click.option(
    "--columns", metavar="q1=NAME,…", help="The log's own names of its columns, for example t=time,q1=shoulder_pos."
)
json_option = click.option("--json", "json_file", metavar="OUT", help="Write the result as JSON; - is standard output.")
quiet_option = click.option("--quiet", is_flag=True, help="No progress and no summary.")


def console(*, error: bool = False) -> Console:
    """Return a console that honours ``NO_COLOR`` and pipes."""
    return Console(stderr=error, no_color=bool(os.environ.get("NO_COLOR")) or None)


def parse_columns(text: str | None) -> dict[str, str]:
    """Read ``q1=name,q2=name``."""
    mapping: dict[str, str] = {}
    for pair in filter(None, (text or "").split(",")):
        key, sep, name = (part.strip() for part in pair.partition("="))
        if not sep or not key or not name:
            raise OptionError(f"--columns: `{pair}` is not a pair", remedy="write --columns q1=NAME,tau1=NAME")
        if key in mapping:
            raise OptionError(f"--columns: `{key}` is mapped twice", remedy="map each column once")
        mapping[key] = name
    return mapping


@contextmanager
def working(message: str, *, quiet: bool) -> Iterator[None]:
    """Show that work goes on, on standard error, unless quiet or not at a terminal."""
    if quiet or not sys.stderr.isatty():
        yield
        return
    with console(error=True).status(message):
        yield


def write(path: str | Path, content: str | Callable[[Path], Any]) -> None:
    """Write text, or let `content` write, to a temporary file that takes its place only when it is complete."""
    if str(path) == "-":
        click.echo(content if isinstance(content, str) else "")
        return
    target = Path(path)
    temporary = target.with_name(f".{target.name}.partial")
    try:
        if isinstance(content, str):
            temporary.write_text(content, encoding="utf-8")
        else:
            content(temporary)
        temporary.replace(target)
    except OSError as error:
        reason = error.strerror or str(error)
        raise ResultError(f"cannot be written ({reason})", remedy="choose another place", file=target) from None
    finally:
        temporary.unlink(missing_ok=True)
