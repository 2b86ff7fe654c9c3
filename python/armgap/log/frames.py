"""Tables in memory as logs: polars, pandas, pyarrow, and mappings of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl

from armgap.errors import ColumnError, OptionError
from armgap.log.formats import arrays
from armgap.log.recording import Recording, Stream

__all__ = ["is_table", "record"]

_KNOWN = "a polars, pandas or pyarrow table, or a mapping from names to arrays"


def is_table(thing: Any) -> bool:
    """Whether an object is a table in memory rather than a path or a log."""
    return isinstance(thing, pl.DataFrame | pl.LazyFrame | Mapping) or _is_pandas(thing) or _is_arrow(thing)


def record(frame: Any, name: str) -> Recording:
    """Return a table in memory as a recording.

    Raises
    ------
    OptionError
        If the object is no table.
    """
    if isinstance(frame, Mapping):
        return _mapping(frame, name)
    try:
        if isinstance(frame, pl.LazyFrame):
            frame = frame.collect()
        elif _is_pandas(frame):
            frame = _pandas(frame)
        elif not isinstance(frame, pl.DataFrame):
            frame = pl.DataFrame(frame)
    except Exception as error:
        raise OptionError(f"`{name}` is not a table ({error})", remedy=f"give {_KNOWN}") from None
    _unique(list(frame.columns), name)
    return Recording((Stream.of(frame),))


def _is_pandas(thing: Any) -> bool:
    return type(thing).__module__.partition(".")[0] == "pandas" and hasattr(thing, "columns")


def _is_arrow(thing: Any) -> bool:
    return type(thing).__module__.partition(".")[0] == "pyarrow" and hasattr(thing, "column_names")


def _pandas(frame: Any) -> pl.DataFrame:
    """Return a pandas table as a polars table; a named index becomes a column, as times often are."""
    if frame.index.name is not None and frame.index.name not in frame.columns:
        frame = frame.reset_index()
    _unique([str(column) for column in frame.columns], "table")
    return pl.DataFrame({str(column): _values(frame[column]) for column in frame.columns})


def _values(series: Any) -> Any:
    values = series.to_numpy()
    return values.tolist() if values.dtype == object else values


def _unique(columns: list[str], name: str) -> None:
    for column in columns:
        if columns.count(column) > 1:
            raise ColumnError(
                f"stands {columns.count(column)} times in the table",
                remedy="name each column once",
                file=name,
                column=column,
            )


def _mapping(frame: Mapping[str, Any], name: str) -> Recording:
    try:
        held = {str(key): np.asarray(values) for key, values in frame.items()}
    except Exception as error:
        raise OptionError(f"`{name}` holds something other than arrays ({error})", remedy=f"give {_KNOWN}") from None
    if all(array.ndim == 1 and len(array) == len(next(iter(held.values()))) for array in held.values()):
        # Columns on one clock may have any type that a table supports; words in place of numbers are reported later.
        return Recording((Stream.of(pl.DataFrame({key: frame[key] for key in held})),))
    return arrays.record(held, name, "mapping")
