"""Raw contents of a log file: columns on one clock or several, before mapping to standard names and checks."""

from __future__ import annotations

import io
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import polars as pl

from armgap.log.findings import Finding

__all__ = ["Recording", "Source", "Stream", "Suggestion"]


@dataclass(frozen=True)
class Source:
    """Source of a log: a file, a folder, or data from standard input."""

    path: Path
    data: bytes | None = None

    def open(self) -> BinaryIO:
        """Return the source's bytes as a stream."""
        return io.BytesIO(self.data) if self.data is not None else self.path.open("rb")

    def head(self, size: int) -> bytes:
        """Return the first `size` bytes of the source."""
        with self.open() as stream:
            return stream.read(size)

    @property
    def size(self) -> int:
        """Number of bytes of the source."""
        return len(self.data) if self.data is not None else self.path.stat().st_size


@dataclass(frozen=True)
class Stream:
    """Columns of a recording with one length and one clock.

    Attributes
    ----------
    columns : tuple of str
        Names, unique in the whole recording.
    fetch : callable
        Function that reads a column, by name, on demand.
    time : str, optional
        Name of the column with the times, if the format states it.
    units : mapping
        Units that the file states, by column: as in `armgap.log.conversion.units.FACTORS`, or the file's word for a unit that is not known.
    """

    columns: tuple[str, ...]
    fetch: Callable[[str], pl.Series]
    time: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, frame: pl.DataFrame, time: str | None = None, units: Mapping[str, str] | None = None) -> Stream:
        """Return a stream with the columns of a table in memory."""
        return cls(tuple(frame.columns), frame.__getitem__, time, units or {})


@dataclass(frozen=True)
class Suggestion:
    """Mapping from standard names to the columns that a file itself suggests for them, with findings to report."""

    names: Mapping[str, str]
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class Recording:
    """All columns of a log file, before mapping to standard names.

    Attributes
    ----------
    streams : tuple of Stream
        Streams of columns, one per clock.
    findings : tuple of Finding
        Findings from reading the file.
    suggest : callable, optional
        ``suggest(n_joints, mapped)`` returns columns for unmapped standard names, if the format names joints.
    """

    streams: tuple[Stream, ...]
    findings: tuple[Finding, ...] = ()
    suggest: Callable[[int | None, Collection[str]], Suggestion] | None = None

    @property
    def columns(self) -> list[str]:
        """Names of all columns of the recording."""
        return [name for stream in self.streams for name in stream.columns]

    def stream_of(self, column: str) -> Stream:
        """Return the stream that holds a column."""
        return next(stream for stream in self.streams if column in stream.columns)
