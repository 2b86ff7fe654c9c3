"""Manifest of a fleet: arms, their logs, and times of recording."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import polars as pl

from armgap.errors import ArmgapError, OptionError

__all__ = ["COLUMNS", "Entry", "ManifestError", "is_url", "read_manifest"]

COLUMNS = ("robot", "arm", "logs", "holdout", "time")
"""Columns of a manifest; `holdout` and `time` may be missing or empty."""
_NEEDED = ("robot", "arm", "logs")
_SEPARATOR = ";"


class ManifestError(ArmgapError):
    """Error: a manifest cannot be read, or one of its rows is no valid entry."""


@dataclass(frozen=True)
class Entry:
    """One entry of a fleet's manifest: the input of one diagnosis.

    Attributes
    ----------
    robot : str
        Name of the robot.
    arm : str
        Path of the robot's arm file.
    logs, holdout : tuple of str
        Paths or URLs of the robot's logs; without a holdout the last part of every log is held out.
    time : str
        Time at which the logs were recorded, ISO 8601; empty where it is unknown.
    row : int
        Number of the entry's row in the manifest, from 1.
    """

    robot: str
    arm: str
    logs: tuple[str, ...]
    holdout: tuple[str, ...]
    time: str
    row: int

    @property
    def files(self) -> tuple[str, ...]:
        """All files and URLs that the diagnosis of the entry reads."""
        return (self.arm, *self.logs, *self.holdout)


def is_url(word: str) -> bool:
    """Return whether a log is given by a URL, not by a path."""
    return "://" in word


def read_manifest(path: str | Path) -> list[Entry]:
    """Read a manifest: CSV, Parquet, or TOML with one ``[[entry]]`` table per entry.

    Parameters
    ----------
    path : path-like
        File with the columns `COLUMNS`; several logs are separated by ``;`` or, in TOML, listed. Paths are relative to the manifest.

    Raises
    ------
    ManifestError
        If the manifest cannot be read, lacks a column, or has a row without robot, arm or log, with several arms, with an invalid time, or that
        repeats another one.
    OptionError
        If the name does not end in ``.csv``, ``.parquet`` or ``.toml``.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise OptionError(f"`{path.name}` is no manifest", remedy=f"name a file that ends in {', '.join(_READERS)}")
    try:
        rows = reader(path)
    except OSError as error:
        raise ManifestError(f"cannot be read ({error.strerror or error})", remedy="give its path", file=path) from None
    except (pl.exceptions.PolarsError, tomllib.TOMLDecodeError, UnicodeDecodeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ManifestError(f"cannot be read: {reason}", remedy="correct the file", file=path) from None
    if not rows:
        raise ManifestError("holds no entry", remedy="write one row per diagnosis", file=path)
    entries = [_entry(row, number, path) for number, row in enumerate(rows, start=1)]
    _check_repeated(entries, path)
    return entries


def _csv(path: Path) -> list[dict[str, Any]]:
    return pl.read_csv(path, infer_schema=False).to_dicts()


def _parquet(path: Path) -> list[dict[str, Any]]:
    return pl.read_parquet(path).to_dicts()


def _toml(path: Path) -> list[dict[str, Any]]:
    with path.open("rb") as file:
        found = tomllib.load(file).get("entry", [])
    if not isinstance(found, list) or not all(isinstance(row, dict) for row in found):
        raise ValueError("`entry` is no list of tables")
    return found


_READERS: dict[str, Callable[[Path], list[dict[str, Any]]]] = {".csv": _csv, ".parquet": _parquet, ".toml": _toml}


def _entry(row: dict[str, Any], number: int, manifest: Path) -> Entry:
    for name in row:
        if name not in COLUMNS:
            raise ManifestError(
                "is no column of a manifest", remedy=f"known: {', '.join(COLUMNS)}", file=manifest, column=name
            )
    for name in _NEEDED:
        if name not in row:
            raise ManifestError("is missing", remedy=f"add the column {name}", file=manifest, column=name)
    arms, logs, holdout = (_places(row.get(name), manifest, name, number) for name in ("arm", "logs", "holdout"))
    robot = _word(row["robot"], manifest, "robot", number)
    for name, found in (("robot", robot), ("arm", arms), ("logs", logs)):
        if not found:
            raise ManifestError("is empty", remedy="fill it in", file=manifest, column=name, row=number)
    if len(arms) > 1:
        problem = f"names {len(arms)} arm files"
        raise ManifestError(problem, remedy="name one, as a robot has one arm", file=manifest, column="arm", row=number)
    return Entry(robot, arms[0], logs, holdout, _time(row.get("time"), manifest, number), number)


def _places(value: Any, manifest: Path, column: str, number: int) -> tuple[str, ...]:
    """Return the paths or URLs of a cell: a list, or text with separators."""
    words = value if isinstance(value, list) else _word(value, manifest, column, number).split(_SEPARATOR)
    stripped = [_word(word, manifest, column, number) for word in words]
    return tuple(word if is_url(word) else str(manifest.parent / word) for word in stripped if word)


def _word(value: Any, manifest: Path, column: str, number: int) -> str:
    """Return a cell as text without blanks around it; empty for none."""
    if value is not None and (isinstance(value, bool) or not isinstance(value, str | int | float)):
        raise ManifestError(f"`{value}` is no text", remedy="write text", file=manifest, column=column, row=number)
    return "" if value is None else str(value).strip()


def _check_repeated(entries: list[Entry], manifest: Path) -> None:
    """Raise an error if two rows are one recording of one robot, which would count as two visits."""
    first: dict[tuple[Any, ...], int] = {}
    for entry in entries:
        recording = (entry.robot, entry.arm, entry.logs, entry.holdout)
        if recording in first:
            problem = f"repeats row {first[recording]}: the same robot, arm and logs"
            raise ManifestError(problem, remedy="remove one of the two rows", file=manifest, row=entry.row)
        first[recording] = entry.row


def _time(value: Any, manifest: Path, number: int) -> str:
    if value is None or value == "":
        return ""
    try:
        when = value if isinstance(value, datetime) else datetime.fromisoformat(str(value))
    except ValueError:
        raise ManifestError(
            f"`{value}` is no time",
            remedy="write ISO 8601: 2026-11-23T07:05:00",
            file=manifest,
            column="time",
            row=number,
        ) from None
    return when.isoformat()
