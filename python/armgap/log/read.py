"""Tables from files."""

from __future__ import annotations

import sys
from pathlib import Path

import polars as pl

from armgap.errors import LogReadError

__all__ = ["table"]

_SEPARATORS = (",", ";", "\t")


def table(path: str | Path) -> tuple[pl.DataFrame, str, Path]:
    """Return a file's table, a name for it, and its path."""
    path = Path(path)
    if str(path) == "-":
        return _csv(sys.stdin.buffer.read(), path), "stdin", path
    if path.is_dir():
        raise LogReadError("is a folder", remedy="give the path of a log file", file=path)
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise LogReadError(f"cannot be read ({reason})", remedy="give the path of a log", file=path) from None
    if not data:
        raise LogReadError("is empty", remedy="give a log with samples", file=path)
    suffix = path.suffix.lower()
    if suffix in (".parquet", ".pq") or data[:4] == b"PAR1":
        return _parquet(data, path), path.stem, path
    if suffix in (".csv", ".tsv", ".txt"):
        return _csv(data, path), path.stem, path
    raise LogReadError(
        f"has the unknown ending `{path.suffix}`", remedy="known: .parquet, .csv, .tsv, .txt", file=path
    )


def _parquet(data: bytes, path: Path) -> pl.DataFrame:
    try:
        return pl.read_parquet(data)
    except Exception as error:
        raise LogReadError(
            f"is not a readable Parquet file ({_first_line(error)})",
            remedy="write it again; it may be cut short",
            file=path,
        ) from None


def _csv(data: bytes, path: Path) -> pl.DataFrame:
    lines = [line for line in data.splitlines() if line.strip() and not line.startswith(b"#")]
    if not lines:
        raise LogReadError("holds no rows", remedy="give a log with samples", file=path)
    header = lines[0].decode("utf-8", errors="replace")
    separator = max(_SEPARATORS, key=header.count)
    decimal_comma = separator == ";" and len(lines) > 1 and b"," in lines[1]
    try:
        return pl.read_csv(
            b"\n".join(lines) + b"\n",
            separator=separator,
            decimal_comma=decimal_comma,
            infer_schema_length=None,
            null_values=["", "NA", "null"],
        )
    except Exception as error:
        raise LogReadError(
            f"is not a readable table ({_first_line(error)})",
            remedy="every row needs as many values as the header has names",
            file=path,
        ) from None


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0][:160] if lines else type(error).__name__
