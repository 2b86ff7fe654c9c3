"""Conversion of named arrays from NumPy, HDF5 and MATLAB files to streams of columns.

Arrays of equal length form one stream. Where lengths differ, or where groups have their own times, every length and group is a clock.
An array of n rows and k columns stands for columns ``name1`` to ``namek``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from armgap.errors import LogReadError
from armgap.log.findings import Finding
from armgap.log.recording import Recording, Stream

__all__ = ["record"]

_TIME = re.compile(r"^(t|t_.*|.*_t|.*time.*|.*stamp.*)$", re.IGNORECASE)
_WIDEST = 64  # an array with more columns holds something else, such as images
Arrays = Mapping[str, NDArray[Any]]


def record(
    arrays: Arrays, path: Path | str, what: str, units: Mapping[str, str] | None = None, notes: tuple[Finding, ...] = ()
) -> Recording:
    """Return arrays as a recording.

    Parameters
    ----------
    arrays : mapping
        Arrays by path (``"log/q"``), as the file holds them.
    path : path-like
        File, for error messages.
    what : str
        Format of the file in words, for error messages.
    units : mapping, optional
        Units by path, where the file states them.
    notes : tuple of Finding
        Findings from reading the file.
    """
    found: list[Finding] = list(notes)
    columns, stated = _columns(arrays, dict(units or {}), found)
    if not columns:
        raise LogReadError(
            f"holds no columns of numbers: it is a {what} with {_listed(arrays) or 'nothing in it'}",
            remedy="store t, q and tau as arrays with one row per sample",
            file=path,
        )
    clocks: dict[tuple[str, int], dict[str, NDArray[Any]]] = {}
    for name, values in columns.items():
        clocks.setdefault(_clock(name, len(values), columns), {})[name] = values
    streams = tuple(_stream(members, stated) for members in clocks.values())
    return Recording(streams, tuple(found))


def _columns(
    arrays: Arrays, units: dict[str, str], found: list[Finding]
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Return one-dimensional columns, and the units that are stated for them."""
    lengths = {len(line) for a in arrays.values() if (line := _line(a)) is not None}
    columns: dict[str, NDArray[Any]] = {}
    stated: dict[str, str] = {}
    for name, array in arrays.items():
        for key, values in _split(name, array, lengths, found):
            columns[key] = values
            if name in units:
                stated[key] = units[name]
    return columns, stated


def _split(name: str, array: NDArray[Any], lengths: set[int], found: list[Finding]) -> list[tuple[str, NDArray[Any]]]:
    """Return an array's columns with their names; empty for an array that cannot be columns."""
    if array.dtype.names:
        return [
            column
            for part in array.dtype.names
            for column in _split(f"{name}/{part}" if name else part, np.asarray(array[part]), lengths, found)
        ]
    if array.dtype.kind not in "fiubmM" or array.dtype.itemsize > 8:
        return []
    if (line := _line(array)) is not None:
        return [(name, line)] if len(line) > 1 else []
    if array.ndim != 2 or min(array.shape) > _WIDEST or min(array.shape) < 1:
        return []
    if array.shape[1] in lengths and array.shape[0] not in lengths:
        found.append(Finding("format", f"`{name}` has one column per sample and was turned round"))
        array = array.T
    dash = "_" if name[-1:].isdigit() else ""
    return [(f"{name}{dash}{j + 1}", array[:, j]) for j in range(array.shape[1])] if array.shape[1] <= _WIDEST else []


def _line(array: NDArray[Any]) -> NDArray[Any] | None:
    """Return a one-dimensional array, also for a stored single row or column; None for other shapes."""
    if array.dtype.names or array.dtype.kind not in "fiubmM":
        return None
    if array.ndim == 1:
        return array
    return array.reshape(-1) if array.ndim == 2 and 1 in array.shape and array.size > 1 else None


def _clock(name: str, length: int, columns: Mapping[str, NDArray[Any]]) -> tuple[str, int]:
    """Return the group with the times of a column, and the column's length."""
    group = name.rpartition("/")[0]
    while group:
        inside = (c for c, values in columns.items() if c.rpartition("/")[0] == group and len(values) == length)
        if any(_is_time(c) for c in inside):
            return group, length
        group = group.rpartition("/")[0]
    return "", length


def _is_time(name: str) -> bool:
    return _TIME.match(name.rpartition("/")[2]) is not None


def _stream(members: dict[str, NDArray[Any]], units: Mapping[str, str]) -> Stream:
    times = [name for name in members if _is_time(name)]
    frame = pl.DataFrame({name: _plain(values) for name, values in members.items()})
    return Stream.of(frame, times[0] if len(times) == 1 else None, {k: u for k, u in units.items() if k in members})


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """Return a contiguous array in native byte order."""
    values = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("="))
    if values.dtype.kind == "f" and values.dtype.itemsize == 2:
        return values.astype(np.float32)
    return values


def _listed(arrays: Arrays) -> str:
    return ", ".join(f"`{name}` {array.shape}" for name, array in list(arrays.items())[:12])
