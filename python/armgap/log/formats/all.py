"""List of all log formats, and recognition of a file's format."""

from __future__ import annotations

import sys
from pathlib import Path

from armgap.errors import LogReadError
from armgap.files.reading import printable
from armgap.log.formats import hdf5, matlab, mcap, npz, parquet, rosbag, text
from armgap.log.formats.format import Format
from armgap.log.recording import Recording, Source

__all__ = ["FORMATS", "record"]

FORMATS: tuple[Format, ...] = (
    parquet.FORMAT,
    text.FORMAT,
    npz.FORMAT,
    matlab.FORMAT,
    hdf5.FORMAT,
    mcap.FORMAT,
    rosbag.FORMAT,
)
"""Log formats, in the order in which a file is tested for them."""

#: Number of bytes at the beginning of a file by which its format is recognised.
_HEAD = 1024


def record(path: str | Path) -> tuple[Recording, str, Path]:
    """Return a file's contents as a recording, a name for the log, and its path; ``-`` is standard input.

    Raises
    ------
    LogReadError, ColumnError
        If the file cannot be read; the message names the file, and the place if known.
    """
    path = Path(path)
    if str(path) == "-":
        source, name = Source(path, sys.stdin.buffer.read()), "stdin"
    else:
        source, name = Source(path), printable(path.stem)
    return _format(source).read(source), name, path


def _format(source: Source) -> Format:
    """Return the format by a file's first bytes, else by its ending."""
    if source.data is None and source.path.is_dir():
        if rosbag.is_bag(source.path):
            return rosbag.FORMAT
        raise LogReadError(
            "is a folder",
            remedy="give the path of a log file, or a pattern in quotes such as 'logs/*.parquet'",
            file=source.path,
        )
    head = _head(source)
    if not head.strip():
        raise LogReadError("is empty", remedy="give a log with samples", file=source.path)
    suffix = source.path.suffix.lower()
    for known in FORMATS:
        if known.recognises(head):
            return known
    for known in FORMATS:
        if suffix in known.endings or (source.data is not None and known is text.FORMAT):
            return known
    endings = ", ".join(ending for known in FORMATS for ending in known.endings)
    raise LogReadError(f"has the unknown ending `{source.path.suffix}`", remedy=f"known: {endings}", file=source.path)


def _head(source: Source) -> bytes:
    try:
        return source.head(_HEAD)
    except OSError as error:
        reason = error.strerror or str(error)
        raise LogReadError(f"cannot be read ({reason})", remedy="give the path of a log", file=source.path) from None
