"""Bounded reading of small files."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path

__all__ = ["is_text", "printable", "read_bounded"]


def is_text(path: str | os.PathLike[str]) -> bool:
    """Whether a file's name is valid text, which operating systems do not require."""
    try:
        os.fspath(path).encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def printable(name: str) -> str:
    r"""Return a file's name as text that can be printed and encoded, whatever its bytes are.

    Examples
    --------
    >>> printable("arm"), printable("arm\udcff")
    ('arm', 'arm\\xff')
    """
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def read_bounded(path: str | os.PathLike[str], most: int) -> bytes:
    """Return the content of a file of limited size; ``-`` is standard input.

    Parameters
    ----------
    path : path-like
        File, pipe or device.
    most : int
        Largest size [bytes]; a device may have no end.

    Raises
    ------
    OSError
        If the file cannot be read, or is larger than `most`.
    """
    if os.fspath(path) == "-":
        data = sys.stdin.buffer.read(most + 1)
    else:
        with Path(path).open("rb") as stream:
            data = stream.read(most + 1)
    if len(data) > most:
        raise OSError(errno.EFBIG, f"larger than {most // 2**20} MiB")
    return data
