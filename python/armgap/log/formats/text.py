"""Text tables as logs: CSV in its dialects, read in blocks of lines, so that a long file needs no more memory than its numbers.

Separators are commas, semicolons, tabs or blanks; decimal commas are allowed unless commas separate. A byte order mark, comments, units
in the header or in a row below it, and a separator at the end of every row are understood.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from pathlib import Path

import polars as pl

from armgap.errors import ColumnError, LogReadError
from armgap.log.conversion.spellings import is_foreign, unit_of
from armgap.log.findings import Finding
from armgap.log.formats.format import Format, first_line
from armgap.log.recording import Recording, Source, Stream
from armgap.progress import report_progress

__all__ = ["FORMAT"]

_SEPARATORS = (",", ";", "\t")
_COMMENTS = ("#", "%", "//")
_COMMA = re.compile(r"(?:^|[;\s\"])[+-]?\d*,\d+(?:[eE][+-]?\d+)?(?:$|[;\s\"])")
_POINT = re.compile(r"(?:^|[;\s\"])[+-]?\d*\.\d+(?:[eE][+-]?\d+)?(?:$|[;\s\"])")
_MISSING = ("", "NA", "null")  # spellings of a missing value
_BLOCK = 100_000  # lines that are parsed at once
_PROGRESS_LINES = 10_000  # lines between two updates of the number of bytes read
_SAMPLE = 1000  # lines by which decimal commas are recognised
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


@dataclass(frozen=True)
class _Dialect:
    """Dialect of a text table: separator, decimal mark, and names and units of its columns."""

    separator: str
    blanks: bool
    names: tuple[str, ...]
    units: dict[str, str]
    decimal_comma: bool = False
    trailing: bool = False

    @property
    def width(self) -> int:
        """Number of values in a row of the text table."""
        return len(self.names) + self.trailing


@dataclass
class _Lines:
    """Iterator over the lines of a text table other than comments and empty lines; keeps the last comment, and whether the last line is complete."""

    source: Source
    encoding: str
    comment: str = ""
    complete: bool = True
    read: int = 0  # bytes read so far

    def __iter__(self) -> Iterator[str]:
        stream = self.source.open()
        with io.TextIOWrapper(stream, encoding=self.encoding, errors="replace") as text:
            for number, raw in enumerate(text):
                if number % _PROGRESS_LINES == 0:
                    self.read = stream.tell()
                line = raw.rstrip("\r\n")
                bare = line.strip()
                if bare.startswith(_COMMENTS):
                    self.comment = bare
                elif bare:
                    self.complete = raw.endswith("\n")
                    yield line


@dataclass
class _Table:
    """Blocks of a text table read so far, with findings."""

    frames: list[pl.DataFrame] = field(default_factory=list)
    rows: int = 0
    findings: list[Finding] = field(default_factory=list)


def read(source: Source) -> Recording:
    """Read a text table as a recording."""
    encoding = _encoding(source.head(1 << 16))
    lines = _Lines(source, encoding)
    rows = iter(lines)
    findings = []
    if encoding not in ("utf-8", "utf-8-sig"):
        findings.append(Finding("format", f"read as {encoding}"))
    first = next(rows, None)
    if first is None:
        raise LogReadError("holds only comments", remedy="give a log with samples", file=source.path)
    dialect, rows, said = _dialect(first, lines.comment, rows, source.path)
    table = _Table(findings=findings + said)
    while block := list(islice(rows, _BLOCK)):
        report_progress(f"reading {source.path.name}", lines.read / max(source.size, lines.read, 1))
        _add(table, block, dialect, lines, source.path)
    if not table.rows:
        raise LogReadError("holds a header and no samples", remedy="give a log with samples", file=source.path)
    return Recording((Stream.of(_whole(table.frames), units=dialect.units),), tuple(table.findings))


def _encoding(head: bytes) -> str:
    for mark, encoding in _MARKS.items():
        if head.startswith(mark):
            return encoding
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _dialect(
    first: str, comment: str, rows: Iterator[str], path: Path
) -> tuple[_Dialect, Iterator[str], list[Finding]]:
    """Return the dialect of a text table, an iterator over its rows, and findings."""
    findings = []
    blanks = not any(mark in first for mark in _SEPARATORS)
    separator = "\t" if blanks else max(_SEPARATORS, key=first.count)
    header = first
    if all(_is_number(cell, separator) for cell in _cells(first, separator, blanks)):
        header = comment.lstrip("".join(_COMMENTS)).strip()
        if len(_cells(header, separator, blanks)) != len(_cells(first, separator, blanks)):
            raise _no_header(_cells(first, separator, blanks), path)
        rows = chain([first], rows)
        findings.append(Finding("format", "the names of the columns were taken from the comment above the first row"))
    cells = _cells(header, separator, blanks)
    sample = list(islice(rows, _SAMPLE))
    below = _cells(sample[0], separator, blanks) if sample else []
    units_row = _is_units_row(below)
    if units_row:
        sample = sample[1:]
    names, units = _names(cells, below if units_row else [], path)
    decimal_comma = separator != "," and _decimal_commas(sample)
    if decimal_comma:
        findings.append(Finding("format", "numbers are read with decimal commas"))
    dialect = _Dialect(separator, blanks, names, units, decimal_comma)
    return _ends(dialect, cells, sample), chain(sample, rows), findings


def _decimal_commas(sample: list[str]) -> bool:
    """Whether numbers in sample rows have decimal commas, and none has a decimal point."""
    return any(map(_COMMA.search, sample)) and not any(map(_POINT.search, sample))


def _cells(line: str, separator: str, blanks: bool) -> list[str]:
    if blanks:
        return re.sub(r"\s+(?=[\[(])", "", line.strip()).split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [""])]


def _no_header(cells: list[str], path: Path) -> ColumnError:
    return ColumnError(
        "the first row holds numbers, not names",
        remedy="add a header such as t,q1,tau1",
        file=path,
        column=cells[0],
    )


def _is_units_row(cells: list[str]) -> bool:
    """Whether a row below the header holds only units, one of them known."""
    bare = [cell.strip("[]()") for cell in cells]
    return any(map(unit_of, bare)) and all(unit_of(cell) or is_foreign(cell) or cell in ("", "-") for cell in bare)


def _names(cells: list[str], below: list[str], path: Path) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return column names, and units by name from the row below the header."""
    names = [cell or f"unnamed{i + 1}" for i, cell in enumerate(cells)]
    stated = {name: cell.strip("[]()") for name, cell in zip(names, below, strict=False)}
    units = {name: unit_of(text) or text for name, text in stated.items() if unit_of(text) or is_foreign(text)}
    for name in names:
        if names.count(name) > 1:
            raise ColumnError(
                f"stands {names.count(name)} times in the header",
                remedy="name each column once",
                file=path,
                column=name,
            )
    return tuple(names), units


def _ends(dialect: _Dialect, cells: list[str], sample: list[str]) -> _Dialect:
    """Return the dialect with a trailing separator of header or rows resolved: an empty last column, or none."""
    if not sample or dialect.blanks:
        return dialect
    first = _cells(sample[0], dialect.separator, dialect.blanks)
    if cells[-1] == "" and len(first) == len(cells) - 1:
        return replace(dialect, names=dialect.names[:-1])
    return replace(dialect, trailing=len(first) == len(cells) + 1 and first[-1] == "")


def _add(table: _Table, block: list[str], dialect: _Dialect, lines: _Lines, path: Path) -> None:
    """Check a block of lines of a text table and add it to the table."""
    if dialect.blanks:
        block = [re.sub(r"\s+", "\t", line.strip()) for line in block]
    if not lines.complete:
        _drop_torn(table, block, dialect)
    _check_widths(block, dialect, table.rows, path)
    if block:
        table.frames.append(_parse(block, dialect, path))
        table.rows += len(block)


def _drop_torn(table: _Table, block: list[str], dialect: _Dialect) -> None:
    """Remove a last line of a text table that was not completely written."""
    first, last = (line.split(dialect.separator) for line in (block[0], block[-1]))
    whole = last[-1].strip() in _MISSING[1:] or _is_number(last[-1], dialect.separator)
    torn = '"' not in block[-1] and (
        len(last) < dialect.width or (_is_number(first[-1], dialect.separator) and not whole)
    )
    if torn and table.rows + len(block) > 1:
        del block[-1]
        table.findings.append(Finding("cleaned", "the last row was cut short while it was written; it is left out"))


def _check_widths(block: list[str], dialect: _Dialect, before: int, path: Path) -> None:
    """Raise for the first row whose number of values differs from the number of names."""
    quoted = any('"' in line for line in block)
    separator = dialect.separator
    rows = csv.reader(block, delimiter=separator) if quoted else (line.split(separator) for line in block)
    names, width = dialect.names, dialect.width
    for row, values in enumerate(rows, start=before + 1):
        if len(values) != width or (dialect.trailing and values[-1].strip()):
            count = len(values) - (dialect.trailing and not values[-1].strip())
            raise ColumnError(
                f"there are {count} values, the header has {len(names)} names",
                remedy="correct the row; it may be cut short",
                file=path,
                column=names[min(count, len(names)) - 1],
                row=row,
            )


def _parse(block: list[str], dialect: _Dialect, path: Path) -> pl.DataFrame:
    names = [*dialect.names, "\0"] if dialect.trailing else list(dialect.names)
    try:
        frame = pl.read_csv(
            ("\n".join(block) + "\n").encode(),
            has_header=False,
            new_columns=names,
            separator=dialect.separator,
            decimal_comma=dialect.decimal_comma,
            infer_schema_length=None,
            null_values=list(_MISSING),
        )
    except (Exception, pl.exceptions.PanicException) as error:
        raise LogReadError(
            f"is not a readable table ({first_line(error)})",
            remedy="write it again as CSV or Parquet",
            file=path,
        ) from None
    return frame.drop("\0") if dialect.trailing else frame


def _whole(frames: list[pl.DataFrame]) -> pl.DataFrame:
    """Return blocks joined into one table; a column with numbers in one block and words in another becomes words."""
    if len(frames) == 1:
        return frames[0]
    columns = []
    for name in frames[0].columns:
        parts = [frame[name] for frame in frames]
        kinds = {part.dtype for part in parts} - {pl.Null}
        if len(kinds) > 1:
            target = pl.Float64 if all(kind.is_numeric() for kind in kinds) else pl.String
            parts = [part.cast(target) for part in parts]
        elif kinds:
            parts = [part.cast(next(iter(kinds))) for part in parts]
        columns.append(pl.concat(parts))
    return pl.DataFrame(columns)


def _is_number(text: str, separator: str) -> bool:
    try:
        float(text.replace(",", ".") if separator != "," else text)
    except ValueError:
        return False
    return True


FORMAT = Format("CSV", (".csv", ".tsv", ".txt", ".dat"), read)
