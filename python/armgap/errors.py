"""Exceptions of armgap, in one class hierarchy; each message is one line.

Each error has a place (`file`, `column`, `row`) and a `remedy`; its text names all of
them. Rows count data rows from 1; a row of ``None`` means the whole column or file.
"""

from __future__ import annotations

from os import PathLike

__all__ = [
    "CATALOGUE",
    "ArmFileError",
    "ArmgapError",
    "ColumnError",
    "LogReadError",
    "LogShapeError",
    "ModelFileError",
    "OptionError",
    "ResultError",
    "SampleError",
    "TimeError",
    "UnitError",
]


class ArmgapError(Exception):
    """Base of all errors of this package.

    Parameters
    ----------
    problem : str
        Problem in words, without a full stop.
    remedy : str
        Remedy in words.
    file : path-like, optional
        File with the problem.
    column : str, optional
        Column of a log, or key of an arm file.
    row : int, optional
        Data row, counted from 1.
    """

    part = "column"
    """Word before the name `column` in the message of the error: ``"column"``, ``"key"`` or ``"element"``."""

    def __init__(
        self,
        problem: str,
        *,
        remedy: str = "",
        file: str | PathLike[str] | None = None,
        column: str | None = None,
        row: int | None = None,
    ) -> None:
        self.problem = problem
        self.remedy = remedy
        self.file = None if file is None else str(file)
        self.column = column
        self.row = row
        place = [str(file)] if file is not None else []
        place += [f"{self.part} `{column}`"] if column is not None else []
        place += [f"row {row}"] if row is not None else []
        text = f"{', '.join(place)}: {problem}" if place else problem
        text = text.encode("utf-8", "surrogateescape").decode(
            "utf-8", "backslashreplace"
        )  # a file's name may contain bytes that are no valid text
        super().__init__(" ".join((f"{text}; {remedy}" if remedy else text).split()))


class LogReadError(ArmgapError, OSError):
    """A log cannot be read at all: the file is missing, a folder, or not in the format that its name states."""

    def __str__(self) -> str:
        """Return the error as one line of text."""
        return str(self.args[0])


class ColumnError(ArmgapError, ValueError):
    """A column is missing, named twice, or holds something other than numbers."""


class SampleError(ArmgapError, ValueError):
    """A sample of a log is missing or not finite."""


class TimeError(ArmgapError, ValueError):
    """Times repeat, run backwards, or leave a hole that cannot be bridged."""


class UnitError(ArmgapError, ValueError):
    """Values of a log's column have the magnitude of another unit than stated or assumed."""


class LogShapeError(ArmgapError, ValueError):
    """A log is too short, does not move, or does not fit the arm."""


class ArmFileError(ArmgapError, ValueError):
    """An arm file is missing, not TOML, or describes no possible arm."""

    part = "key"


class ModelFileError(ArmgapError, ValueError):
    """A description of a robot, URDF or MJCF, is missing, damaged, or has no serial arm between the given links; `row` is a line of the file."""

    part = "element"


class OptionError(ArmgapError, ValueError):
    """An option or argument has an impossible value."""


class ResultError(ArmgapError, OSError):
    """A result cannot be written to the requested file."""

    def __str__(self) -> str:
        """Return the error as one line of text."""
        return str(self.args[0])


CATALOGUE: tuple[type[ArmgapError], ...] = (
    LogReadError,
    ColumnError,
    SampleError,
    TimeError,
    UnitError,
    LogShapeError,
    ArmFileError,
    ModelFileError,
    OptionError,
    ResultError,
)
"""All concrete error classes; the tests hold a bad input for each."""
