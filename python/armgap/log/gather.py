"""Reading of several logs: paths, patterns, tables, and sequences of these."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armgap.errors import LogReadError, OptionError
from armgap.log.frames import is_table
from armgap.log.log import Log

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["gather", "paths"]


def paths(words: Iterable[str | os.PathLike[str]]) -> list[Path]:
    """Return the files given by paths or patterns; a word that is no file may be a pattern such as ``logs/*.parquet``.

    Raises
    ------
    LogReadError
        If a pattern matches nothing.
    """
    found: list[Path] = []
    for word in words:
        text = os.fspath(word)
        if not glob.has_magic(text) or os.path.lexists(text):
            found.append(Path(text))
            continue
        matches = sorted(Path(match) for match in glob.glob(text, recursive=True))
        if not matches:
            raise LogReadError("matches no file", remedy="see which files there are with ls", file=text)
        found += matches
    return found


def gather(
    logs: Any,
    arm: Arm | None = None,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> list[Log]:
    """Return a list of logs; paths, patterns and tables are read.

    Parameters
    ----------
    logs : Log, path, pattern, table, or sequence of these
        Input to read; for tables see `Log.from_frame`.
    arm, columns, units
        Arm of the logs, the files' own names of columns, and units that are not SI, as in `Log.read`.

    Raises
    ------
    OptionError
        If an item has none of these types; other errors as for `Log.read`.
    """
    found: list[Log] = []
    alone = isinstance(logs, Log | str | os.PathLike) or is_table(logs) or not isinstance(logs, Iterable)
    several = [logs] if alone else list(logs)
    for number, log in enumerate(several, start=1):
        if isinstance(log, Log):
            found.append(log)
        elif isinstance(log, str | os.PathLike):
            found += [Log.read(path, arm=arm, columns=columns, units=units) for path in paths([log])]
        elif is_table(log):
            name = "log" if len(several) == 1 else f"log {number}"
            found.append(Log.from_frame(log, name=name, arm=arm, columns=columns, units=units))
        else:
            raise OptionError(f"a {type(log).__name__} is not a log", remedy="give a Log, a path, a pattern or a table")
    return found
