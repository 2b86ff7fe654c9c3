"""What a format's reader hands on: columns on one clock or several, before anything is named or checked."""

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
    """A file, a folder, or what came from standard input."""

    path: Path
    data: bytes | None = None

    def open(self) -> BinaryIO:
        """Return the bytes as a stream."""
        return io.BytesIO(self.data) if self.data is not None else self.path.open("rb")

    def head(self, size: int) -> bytes:
        """Return the first bytes."""
        with self.open() as stream:
            return stream.read(size)

    @property
    def size(self) -> int:
        """Number of bytes."""
        return len(self.data) if self.data is not None else self.path.stat().st_size


@dataclass(frozen=True)
class Stream:
    """Columns of one length and one clock.

    Attributes
    ----------
    columns : tuple of str
        Names, unique in the whole recording.
    fetch : callable
        Returns a column by name; reads it when it is asked for.
    time : str, optional
        Column that holds the times, where the format knows.
    units : mapping
        Units that the file states, by column, as in `armgap.log.conversion.units.FACTORS`.
    """

    columns: tuple[str, ...]
    fetch: Callable[[str], pl.Series]
    time: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, frame: pl.DataFrame, time: str | None = None, units: Mapping[str, str] | None = None) -> Stream:
        """Take the columns of a table in memory."""
        return cls(tuple(frame.columns), frame.__getitem__, time, units or {})


@dataclass(frozen=True)
class Suggestion:
    """Which column is which, said by the file itself, and what to tell about it."""

    names: Mapping[str, str]
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class Recording:
    """All columns of a log.

    Attributes
    ----------
    streams : tuple of Stream
        One per clock.
    findings : tuple of Finding
        What was noticed while reading.
    suggest : callable, optional
        ``suggest(n_joints, mapped)`` returns names for what is not mapped, where the format knows joints by itself.
    """

    streams: tuple[Stream, ...]
    findings: tuple[Finding, ...] = ()
    suggest: Callable[[int | None, Collection[str]], Suggestion] | None = None

    @property
    def columns(self) -> list[str]:
        """Names of all columns."""
        return [name for stream in self.streams for name in stream.columns]

    def stream_of(self, column: str) -> Stream:
        """Return the stream that holds a column."""
        return next(stream for stream in self.streams if column in stream.columns)
