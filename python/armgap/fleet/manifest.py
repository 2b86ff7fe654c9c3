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
        If the manifest cannot be read, lacks a column, or has a row without robot, arm or log, or with an invalid time.
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
    return [_entry(row, number, path) for number, row in enumerate(rows, start=1)]


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
        if not row[name]:
            raise ManifestError("is empty", remedy="fill it in", file=manifest, column=name, row=number)
    logs, holdout = (_places(row.get(name), manifest) for name in ("logs", "holdout"))
    [arm] = _places(row["arm"], manifest)[:1]
    return Entry(str(row["robot"]), arm, logs, holdout, _time(row.get("time"), manifest, number), number)


def _places(value: Any, manifest: Path) -> tuple[str, ...]:
    words = value if isinstance(value, list) else str(value or "").split(_SEPARATOR)
    stripped = [str(word).strip() for word in words]
    return tuple(word if is_url(word) else str(manifest.parent / word) for word in stripped if word)


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
