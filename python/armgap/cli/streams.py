"""Standard streams and signals of the command line: every failure ends in one line and an exit status, never in a traceback."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

__all__ = ["EndedError", "abandon_stdout", "ended_by_signals", "open_streams"]

_SIGNALS = tuple(s for s in (getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")) if s is not None)


class EndedError(KeyboardInterrupt):
    """Exception for a signal other than SIGINT that asks the program to end.

    Parameters
    ----------
    number : int
        Number of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def open_streams() -> None:
    """Open standard streams that the program was started without, so that no file takes their descriptors, and make any file name printable.

    A closed standard output is opened for reading: writing to it then fails and is not lost in silence.
    """
    for number, flags in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, flags)  # gets the lowest free descriptor
    if sys.stdout is None:
        sys.stdout = open(1, "w", closefd=False, encoding="utf-8")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(2, "w", closefd=False, encoding="utf-8")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")


def abandon_stdout() -> None:
    """Redirect standard output to nowhere: its reader is gone or the disk full, and the interpreter flushes once more at exit."""
    with suppress(OSError, ValueError):
        number = sys.stdout.fileno()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, number)
        os.close(nowhere)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Raise `EndedError` inside the ``with`` block where a signal would end the program at once, so that half-written files are removed.

    Signals that are ignored, as under ``nohup``, stay ignored.
    """
    before: dict[int, Any] = {}
    for number in _SIGNALS:
        with suppress(ValueError):  # signals can be set only in the main thread
            if signal.getsignal(number) is signal.SIG_DFL:
                before[number] = signal.signal(number, _end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(number: int, _: FrameType | None) -> None:
    raise EndedError(number)
