"""Parquet files as logs, read column by column on demand."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import polars as pl

from armgap.errors import ArmgapError, LogReadError
from armgap.files.reading import is_text
from armgap.log.formats import parquet_structure
from armgap.log.formats.format import Format, first_line
from armgap.log.recording import Recording, Source, Stream

__all__ = ["FORMAT"]

_MAGIC = b"PAR1"


def read(source: Source) -> Recording:
    """Read a Parquet file as a recording."""
    _ends(source)
    with _careful(source.path):
        with source.open() as stream:
            parquet_structure.check(stream, source.path)
        columns = tuple(_scan(source).collect_schema().names())

    def fetch(name: str) -> pl.Series:
        with _careful(source.path):
            return _scan(source).select(pl.col(name)).collect().to_series()

    return Recording((Stream(columns, fetch),))


def _scan(source: Source) -> pl.LazyFrame:
    data = source.data
    if data is None and not is_text(source.path):
        data = source.path.read_bytes()  # polars accepts only names that are valid text
    return pl.scan_parquet(source.path if data is None else data, glob=False)


def _ends(source: Source) -> None:
    """Raise unless a file starts and ends with the Parquet marker bytes."""
    with source.open() as stream:
        first = stream.read(len(_MAGIC))
        stream.seek(max(0, source.size - len(_MAGIC)))
        last = stream.read()
    if first != _MAGIC:
        raise LogReadError(
            "is not a Parquet file", remedy="name it .csv if it is text, or write it again", file=source.path
        )
    if last != _MAGIC or source.size < 12:
        raise LogReadError("is a Parquet file that was cut short", remedy="copy or write it again", file=source.path)


@contextmanager
def _careful(path: Path) -> Iterator[None]:
    """Convert errors and panics of the Parquet decoder inside the ``with`` block to one error that names the file."""
    try:
        with _silence():
            yield
    except ArmgapError:
        raise
    except (Exception, pl.exceptions.PanicException) as error:
        raise LogReadError(
            f"is a damaged Parquet file ({first_line(error)})", remedy="copy or write it again", file=path
        ) from None


@contextmanager
def _silence() -> Iterator[None]:
    """Discard what the Parquet decoder itself writes to standard error when damaged data make it panic."""
    try:
        kept = os.dup(2)
    except OSError:  # standard error is closed
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(nowhere)
        os.close(kept)


FORMAT = Format("Parquet", (".parquet", ".pq"), read, lambda head: head[:4] == _MAGIC)
