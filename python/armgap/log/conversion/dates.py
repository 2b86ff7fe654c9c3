"""Dates as text (ISO 8601), in UTC, with an offset from UTC, or without a time zone."""

from __future__ import annotations

import numpy as np
import polars as pl
from numpy.typing import NDArray

__all__ = ["nanoseconds", "odd_row"]

# A date and a time of day, then the offset from UTC as pandas, polars and databases write it: Z, +01:00, +0100 or +01.
_DATE = r"^\s*(?P<date>\d{4}-\d{2}-\d{2}[T ]\d{2}:\d{2}:\d{2}(?:\.\d{1,9})?) ?(?P<zone>Z|(?P<sign>[+-])(?P<hours>\d{2}):?(?P<minutes>\d{2})?)?\s*$"
_NS_PER_MINUTE = 60 * 10**9


def nanoseconds(series: pl.Series) -> NDArray[np.int64] | None:
    """Return times since 1970 [ns] from dates as text; None for a column that holds anything else.

    A time with an offset is converted to UTC, so that a change between winter and summer time is no jump. Where no row has an offset,
    times count as UTC.

    Parameters
    ----------
    series : polars.Series
        Column of a log, of any type.

    Returns
    -------
    ndarray of int, shape (n_samples,), or None
        None also where some rows state an offset, or UTC, and others do not.

    Examples
    --------
    >>> nanoseconds(pl.Series(["1970-01-01 01:00:00.004+01:00", "1969-12-31T23:00:01-01:00"])).tolist()
    [4000000, 1000000000]
    >>> nanoseconds(pl.Series(["1970-01-01 00:00:00", "noon"])) is None
    True
    """
    if series.dtype != pl.String or not len(series) or series.null_count():
        return None
    if not series.str.contains(_DATE).all():
        return None
    parts = series.str.extract_groups(_DATE).struct.unnest()
    if 0 < parts["zone"].null_count() < len(series):
        return None
    times = parts["date"].str.replace("T", " ").to_numpy().astype("datetime64[ns]").astype(np.int64)
    minutes = parts["hours"].cast(pl.Int64).fill_null(0) * 60 + parts["minutes"].cast(pl.Int64).fill_null(0)
    signs = (parts["sign"] == "-").fill_null(value=False).to_numpy()
    offset = np.where(signs, -1, 1) * minutes.to_numpy() * _NS_PER_MINUTE
    return np.asarray(times - offset, dtype=np.int64)


def odd_row(series: pl.Series) -> int | None:
    """Return the first row, from 0, that is empty or no date in a column of text whose other rows mostly are dates; None without such a row.

    Examples
    --------
    >>> odd_row(pl.Series(["1970-01-01 00:00:00", "1970-01-01 00:00:01", "ERR", "1970-01-01 00:00:03"]))
    2
    >>> odd_row(pl.Series(["1970-01-01 00:00:00", "1.0", "2.0"])) is None
    True
    """
    if series.dtype != pl.String:
        return None
    fine = series.str.contains(_DATE).fill_null(value=False)
    return None if fine.all() or 2 * fine.sum() <= len(series) else int((~fine).arg_true()[0])
