"""Tables from files: Parquet, and CSV with commas, semicolons, tabs or blanks between its values."""

from __future__ import annotations

import csv
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import polars as pl

from armgap.errors import ColumnError, LogReadError

__all__ = ["table"]

_SEPARATORS = (",", ";", "\t")
_PARQUET = b"PAR1"


def table(path: str | Path) -> tuple[pl.DataFrame, str, Path]:
    """Return a file's table, a name for it, and its path; ``-`` is standard input."""
    path = Path(path)
    if str(path) == "-":
        data, name = sys.stdin.buffer.read(), "stdin"
    else:
        data, name = _bytes(path), path.stem
    if not data.strip():
        raise LogReadError("is empty", remedy="give a log with samples", file=path)
    suffix = path.suffix.lower()
    if suffix in (".parquet", ".pq") or data[:4] == _PARQUET:
        return _parquet(data, path), name, path
    if suffix in (".csv", ".tsv", ".txt") or name == "stdin":
        return _csv(data, path), name, path
    raise LogReadError(f"has the unknown ending `{path.suffix}`", remedy="known: .parquet, .csv, .tsv, .txt", file=path)


def _bytes(path: Path) -> bytes:
    if path.is_dir():
        raise LogReadError("is a folder", remedy="give the path of a log file", file=path)
    try:
        return path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise LogReadError(f"cannot be read ({reason})", remedy="give the path of a log", file=path) from None


def _parquet(data: bytes, path: Path) -> pl.DataFrame:
    if data[:4] != _PARQUET:
        raise LogReadError("is not a Parquet file", remedy="name it .csv if it is text, or write it again", file=path)
    if data[-4:] != _PARQUET:
        raise LogReadError("is a Parquet file that was cut short", remedy="copy or write it again", file=path)
    try:
        with _silence():
            return pl.read_parquet(data)
    except (Exception, pl.exceptions.PanicException) as error:
        raise LogReadError(
            f"is a damaged Parquet file ({_first_line(error)})", remedy="copy or write it again", file=path
        ) from None


@contextmanager
def _silence() -> Iterator[None]:
    """Keep what the decoder writes to standard error by itself, when damaged data make it panic, from the user."""
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


def _csv(data: bytes, path: Path) -> pl.DataFrame:
    text = data.decode("utf-8-sig", errors="replace")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise LogReadError("holds only comments", remedy="give a log with samples", file=path)
    if not any(mark in lines[0] for mark in _SEPARATORS):
        lines = [re.sub(r"\s+", ",", line.strip()) for line in lines]
    separator = max(_SEPARATORS, key=lines[0].count)
    names = _header(lines[0], separator, path)
    _widths(lines, separator, names, path)
    try:
        frame = pl.read_csv(
            ("\n".join(lines[1:]) + "\n").encode(),
            has_header=False,
            new_columns=names,
            separator=separator,
            decimal_comma=separator == ";" and any("," in line for line in lines[1:2]),
            infer_schema_length=None,
            null_values=["", "NA", "null"],
        )
    except Exception as error:
        raise LogReadError(
            f"is not a readable table ({_first_line(error)})",
            remedy="write it again as CSV or Parquet",
            file=path,
        ) from None
    return frame


def _header(line: str, separator: str, path: Path) -> list[str]:
    names = [name.strip() for name in next(csv.reader([line], delimiter=separator))]
    if all(_is_number(name) for name in names):
        raise ColumnError(
            "the first row holds numbers, not names",
            remedy="add a header such as t,q1,tau1",
            file=path,
            column=names[0],
        )
    for name in names:
        if name and names.count(name) > 1:
            raise ColumnError(
                f"stands {names.count(name)} times in the header",
                remedy="name each column once",
                file=path,
                column=name,
            )
    return [name or f"unnamed{i + 1}" for i, name in enumerate(names)]


def _widths(lines: list[str], separator: str, names: list[str], path: Path) -> None:
    """Raise on the first row with more or fewer values than the header has names."""
    if len(lines) == 1:
        raise LogReadError("holds a header and no samples", remedy="give a log with samples", file=path)
    quoted = any('"' in line for line in lines)
    rows = csv.reader(lines[1:], delimiter=separator) if quoted else (line.split(separator) for line in lines[1:])
    for row, values in enumerate(rows, start=1):
        if len(values) != len(names):
            raise ColumnError(
                f"there are {len(values)} values, the header has {len(names)} names",
                remedy="correct the row; it may be cut short",
                file=path,
                column=names[min(len(values), len(names)) - 1],
                row=row,
            )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0][:160] if lines else type(error).__name__
