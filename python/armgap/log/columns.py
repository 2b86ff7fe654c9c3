"""From a table's own columns to ``t, q, tau, dq``."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from armgap.errors import ColumnError, LogShapeError, SampleError

if TYPE_CHECKING:
    from armgap.arm import Arm

__all__ = ["Arrays", "Names", "extract", "resolve", "unused_velocities"]

_CANONICAL = re.compile(r"^(t|(q|tau|dq)(?P<joint>[1-9][0-9]*))$")
_LISTED = 24
_TICKS_S = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3}


@dataclass(frozen=True)
class Names:
    """The table's names of the columns in use."""

    t: str
    q: tuple[str, ...]
    tau: tuple[str, ...]
    dq: tuple[str, ...] | None


@dataclass(frozen=True)
class Arrays:
    """Columns as arrays, not yet checked against each other."""

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    dq: NDArray[np.float64] | None


def resolve(frame: pl.DataFrame, place: Path | str, mapping: Mapping[str, str], arm: Arm | None) -> Names:
    """Find the columns in use.

    A name given in `mapping` must exist. The arm file's names come next; a log that has the standard name instead,
    such as one that armgap wrote, is read by that.
    """
    names = {**_from_arm(frame, arm), **mapping}
    n = arm.n_joints if arm is not None else _count(frame, names)
    _check_mapping(names, place, n)
    if arm is not None and f"q{n + 1}" in frame.columns:
        raise LogShapeError(
            f"there is a joint {n + 1}, but a {arm.kind} has {n} joint{'s' if n > 1 else ''}",
            remedy="use the arm file that belongs to this log",
            file=place,
            column=f"q{n + 1}",
        )

    def several(prefix: str) -> tuple[str, ...]:
        return tuple(_pick(frame, place, names, f"{prefix}{j}") for j in range(1, n + 1))

    wanted = [f"dq{j}" for j in range(1, n + 1)]
    has_dq = any(key in mapping for key in wanted) or all(names.get(key, key) in frame.columns for key in wanted)
    return Names(_pick(frame, place, names, "t"), several("q"), several("tau"), several("dq") if has_dq else None)


def unused_velocities(frame: pl.DataFrame, names: Names) -> list[str]:
    """Return the velocity columns that are left out because others are missing."""
    if names.dq is not None:
        return []
    return [name for name in frame.columns if re.fullmatch(r"dq[1-9][0-9]*", name)]


def _from_arm(frame: pl.DataFrame, arm: Arm | None) -> dict[str, str]:
    if arm is None:
        return {}
    return {key: name for key, name in arm.columns.items() if name in frame.columns or key not in frame.columns}


def _check_mapping(names: Mapping[str, str], place: Path | str, n: int) -> None:
    by_source: dict[str, str] = {}
    for key, source in names.items():
        match = _CANONICAL.match(key)
        if match is None:
            raise ColumnError(
                f"`{key}` is not a column of a log",
                remedy="map t, q1 ..., tau1 ... or dq1 ... to the file's names",
                file=place,
                column=key,
            )
        if key != "t" and int(match["joint"]) > n:
            raise ColumnError(
                f"is mapped, but there {'are' if n > 1 else 'is'} {n} joint{'s' if n > 1 else ''}",
                remedy="map the joints from 1 on, without holes",
                file=place,
                column=key,
            )
        if source in by_source:
            raise ColumnError(
                f"is mapped to both `{by_source[source]}` and `{key}`",
                remedy="map each column once",
                file=place,
                column=source,
            )
        by_source[source] = key


def _count(frame: pl.DataFrame, names: Mapping[str, str]) -> int:
    n = 0
    while names.get(f"q{n + 1}", f"q{n + 1}") in frame.columns:
        n += 1
    mapped = [int(match["joint"]) for key in names if (match := _CANONICAL.match(key)) and key != "t"]
    return max(n, 1, *mapped)


def _pick(frame: pl.DataFrame, place: Path | str, names: Mapping[str, str], key: str) -> str:
    source = names.get(key, key)
    if source not in frame.columns:
        available = ", ".join(frame.columns[:_LISTED]) + (", ..." if frame.width > _LISTED else "")
        mapped = f"it is mapped to {key}, but" if key in names else "it"
        raise ColumnError(
            f"{mapped} is missing",
            remedy=f"map it with --columns {key}=NAME or [columns] in the arm file; the log has {available}",
            file=place,
            column=source,
        )
    return source


def extract(frame: pl.DataFrame, place: Path | str, names: Names) -> Arrays:
    """Return the columns in use as finite arrays."""
    if frame.height == 0:
        raise LogShapeError("holds no samples", remedy="give a log with samples", file=place)

    def several(group: tuple[str, ...]) -> NDArray[np.float64]:
        return np.ascontiguousarray(np.column_stack([_column(frame, place, name) for name in group]))

    t, q, tau = _times(frame, place, names.t), several(names.q), several(names.tau)
    return Arrays(t, q, tau, None if names.dq is None else several(names.dq))


def _times(frame: pl.DataFrame, place: Path | str, name: str) -> NDArray[np.float64]:
    series = frame[name]
    if isinstance(series.dtype, pl.Datetime | pl.Duration) and series.null_count() == 0:
        # The type says its own unit, so the conversion guesses nothing.
        ticks = series.to_physical()
        seconds = (ticks - ticks[0]).cast(pl.Float64) * _TICKS_S[series.dtype.time_unit or "us"]
        return np.array(seconds.to_numpy(), dtype=np.float64)
    return _column(frame, place, name)


def _column(frame: pl.DataFrame, place: Path | str, name: str) -> NDArray[np.float64]:
    series = _numbers(frame[name], place, name)
    values = np.array(series.cast(pl.Float64).to_numpy(), dtype=np.float64)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        row = int(bad[0])
        what = "missing" if series[row] is None else f"{values[row]:g}"
        if len(bad) > 1:
            what += f", the first of {len(bad)} values that are missing or not finite"
        raise SampleError(
            f"the value is {what}",
            remedy="drop the rows or cut the log there; armgap fills nothing in",
            file=place,
            column=name,
            row=row + 1,
        )
    return values


def _numbers(series: pl.Series, place: Path | str, name: str) -> pl.Series:
    """Return a column of numbers; texts that are numbers count as such."""
    if series.dtype.is_numeric() or series.dtype == pl.Null:
        return series
    if series.dtype != pl.String:
        raise ColumnError(
            f"holds {series.dtype}, not numbers",
            remedy="export it as numbers",
            file=place,
            column=name,
            row=1,
        )
    texts = series.str.strip_chars()
    numbers = texts.cast(pl.Float64, strict=False)
    bad = (numbers.is_null() & texts.is_not_null() & (texts != "")).arg_true()
    if len(bad):
        row = int(bad[0])
        more = f" (nor {'are' if len(bad) > 2 else 'is'} {len(bad) - 1} more)" if len(bad) > 1 else ""
        comma = "," in str(series[row])
        raise ColumnError(
            f"`{str(series[row])[:40]}` is not a number{more}",
            remedy="write decimal points, not commas" if comma else "correct it, or map another column",
            file=place,
            column=name,
            row=row + 1,
        )
    return numbers
