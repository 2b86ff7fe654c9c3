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

__all__ = ["Arrays", "Names", "extract", "resolve"]

_CANONICAL = re.compile(r"^(t|(q|tau|dq)[1-9][0-9]*)$")


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
    """Find the columns in use, by the mapping given, the arm file's, and the standard names."""
    names = {**(arm.columns if arm is not None else {}), **mapping}
    for key in names:
        if not _CANONICAL.match(key):
            raise ColumnError(
                f"`{key}` is not a column of a log",
                remedy="map t, q1 ..., tau1 ... or dq1 ... to the file's names",
                file=place,
            )
    by_source: dict[str, str] = {}
    for key, source in names.items():
        if source in by_source:
            raise ColumnError(
                f"is mapped to both `{by_source[source]}` and `{key}`",
                remedy="map each column once",
                file=place,
                column=source,
            )
        by_source[source] = key
    n = arm.n_joints if arm is not None else _count(frame, names)
    if arm is not None and f"q{n + 1}" in frame.columns:
        raise LogShapeError(
            f"has a column `q{n + 1}`, but a {arm.kind} has {n} joint{'s' if n > 1 else ''}",
            remedy="use the arm file that belongs to this log",
            file=place,
        )
    pick = lambda key: _pick(frame, place, names, key)  # noqa: E731
    t = pick("t")
    q = tuple(pick(f"q{j}") for j in range(1, n + 1))
    tau = tuple(pick(f"tau{j}") for j in range(1, n + 1))
    wanted = [f"dq{j}" for j in range(1, n + 1)]
    has_dq = all(names.get(key, key) in frame.columns for key in wanted)
    dq = tuple(pick(key) for key in wanted) if has_dq or any(key in names for key in wanted) else None
    return Names(t, q, tau, dq)


def _count(frame: pl.DataFrame, names: Mapping[str, str]) -> int:
    n = 0
    while names.get(f"q{n + 1}", f"q{n + 1}") in frame.columns:
        n += 1
    return max(n, 1)


def _pick(frame: pl.DataFrame, place: Path | str, names: Mapping[str, str], key: str) -> str:
    source = names.get(key, key)
    if source not in frame.columns:
        available = ", ".join(frame.columns[:12]) + (", ..." if len(frame.columns) > 12 else "")
        mapped = f"`{source}` (mapped to {key})" if key in names else f"`{source}`"
        raise ColumnError(
            f"column {mapped} is missing",
            remedy=f"map it with --columns {key}=NAME or [columns] in the arm file; the file has {available}",
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

    dq = None if names.dq is None else several(names.dq)
    return Arrays(_column(frame, place, names.t), several(names.q), several(names.tau), dq)


def _column(frame: pl.DataFrame, place: Path | str, name: str) -> NDArray[np.float64]:
    series = frame[name]
    if not series.dtype.is_numeric():
        numbers = series.cast(pl.Float64, strict=False) if series.dtype == pl.String else None
        bad = None if numbers is None else (numbers.is_null() & series.is_not_null()).arg_true()
        if numbers is None or bad is None or len(bad) == 0:
            raise ColumnError(
                f"holds {series.dtype}, not numbers", remedy="export it as numbers", file=place, column=name
            )
        row = int(bad[0])
        raise ColumnError(
            f"`{str(series[row])[:40]}` is not a number",
            remedy=f"correct the {len(bad)} value{'s' if len(bad) > 1 else ''} like this",
            file=place,
            column=name,
            row=row + 1,
        )
    values = series.cast(pl.Float64).to_numpy()
    bad_rows = np.flatnonzero(~np.isfinite(values))
    if len(bad_rows):
        row = int(bad_rows[0])
        missing = series[row] is None
        many = f"{len(bad_rows)} values are" if len(bad_rows) > 1 else "a value is"
        raise SampleError(
            f"{many} {'missing' if missing else 'not finite'}, first here",
            remedy="drop the rows or cut the log there; armgap fills nothing in",
            file=place,
            column=name,
            row=row + 1,
        )
    return np.array(values, dtype=np.float64)
