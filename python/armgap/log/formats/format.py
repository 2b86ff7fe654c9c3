"""Interface of a log format, and helpers that the readers share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from armgap.errors import ArmgapError, LogReadError
from armgap.log.recording import Recording, Source

__all__ = ["Format", "first_line", "load", "reading"]


@dataclass(frozen=True)
class Format:
    """A format of log files: how its files are recognised and read.

    Attributes
    ----------
    name : str
        Name of the format for messages.
    endings : tuple of str
        Endings of file names, in lower case.
    read : callable
        Function that reads a `Source` into a `Recording`.
    recognises : callable
        Function of a file's first bytes: whether they are those of the format.
    """

    name: str
    endings: tuple[str, ...]
    read: Callable[[Source], Recording]
    recognises: Callable[[bytes], bool] = lambda head: False


def load(module: str, extra: str, what: str, path: Path) -> Any:
    """Import a library of an optional extra.

    Raises
    ------
    LogReadError
        If the library is not installed; the remedy names the extra.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as missing:
        raise LogReadError(
            f"is a {what}; reading it needs {missing.name}, which is not installed",
            remedy=f"install it with pip install 'armgap[{extra}]'",
            file=path,
        ) from None


@contextmanager
def reading(what: str, path: Path) -> Iterator[None]:
    """Convert any exception of a library inside the ``with`` block, raised by a damaged file, to one error that names the file."""
    try:
        yield
    except ArmgapError:
        raise
    except PermissionError as error:
        reason = error.strerror or str(error)
        raise LogReadError(f"cannot be read ({reason})", remedy="give the path of a log", file=path) from None
    except Exception as error:
        raise LogReadError(
            f"is not a readable {what} ({first_line(error)})", remedy="copy or write it again", file=path
        ) from None


def first_line(error: BaseException) -> str:
    """Return the first line of an exception's text."""
    lines = str(error).strip().splitlines()
    return lines[0][:160] if lines else type(error).__name__
