"""Columns of a log file without a mapping to standard names: contents of each column, and a mapping proposed by names and trends.

The proposal is for the user to confirm; no log is read with it.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from armgap.errors import ArmgapError, UnitError
from armgap.log.conversion.dates import nanoseconds
from armgap.log.conversion.index import Index
from armgap.log.conversion.spellings import current_of
from armgap.log.conversion.units import FACTORS, has_factor
from armgap.log.formats.all import record
from armgap.log.log import Log

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = ["FACTOR_PLACEHOLDER", "Column", "Columns", "columns_of"]

#: Words in a column's name that suggest a quantity, in the order in which they are tried: "pos_vel" is a velocity, "target_position" no measurement.
_WORDS: dict[str, re.Pattern[str]] = {
    "skip": re.compile(
        r"(target|desired|des|ref|reference|setpoint|goal|temp|temperature|voltage|error|err|status|acc|acceleration)"
    ),
    "dq": re.compile(r"(dq[0-9]*|qd[0-9]*|qdot[0-9]*|vel|velocity|speed|omega|rate)"),
    "tau": re.compile(r"(tau[0-9]*|torque|effort|trq|cmd|command|force|u[0-9]*)"),
    "q": re.compile(r"(q[0-9]*|pos|position|angle|ang|theta[0-9]*|phi[0-9]*|enc|encoder|joint[0-9]*)"),
}
_TIME = re.compile(r"(t|time|stamp|timestamp|sec|secs|seconds|clock|ms|us|ns|nanosec)")
_JOINT = ("q", "tau", "dq")
#: Placeholder in a proposed mapping for a standard name without a suggested column.
_PLACEHOLDER = "NAME"
FACTOR_PLACEHOLDER = "VALUE"
"""Placeholder in a proposed mapping for the factor that makes torques of a current."""


@dataclass(frozen=True)
class Column:
    """Contents of one column of a log file.

    Attributes
    ----------
    name, dtype : str
        Name and type of the column in the file.
    unit : str or None
        Unit that the file states.
    rows, missing : int
        Number of rows, and of rows without a finite number.
    low, high : float or None
        Smallest and largest number; None for a column without numbers.
    trend : str
        ``"rising"`` (as times do), ``"constant"``, ``"varies"``, or ``"text"``.
    """

    name: str
    dtype: str
    unit: str | None
    rows: int
    missing: int
    low: float | None
    high: float | None
    trend: str


@dataclass(frozen=True)
class Columns:
    """Columns of a log file without a mapping to standard names, and a proposed mapping.

    Attributes
    ----------
    log : str
        Name of the file without its ending.
    columns : tuple of Column
        Every column of the file.
    proposed : dict
        Name of the suggested column for each standard name; ``"NAME"`` where no column is suggested.
    units : dict
        Units by group that the proposed mapping needs beside those that names and file state, such as ``{"q": "deg"}``.
    currents : dict
        Unit (``"mA"``; empty where the file states none) of each proposed torque that is a current by its name, by standard name; a torque is made of
        it by a factor that only the user knows.
    problem : str
        Error with which reading by the proposed mapping and units ends; empty where it does not.
    """

    log: str
    columns: tuple[Column, ...]
    proposed: dict[str, str]
    units: dict[str, str]
    currents: dict[str, str] = field(default_factory=dict)
    problem: str = ""

    @property
    def options(self) -> str:
        """Proposed mapping as command-line options."""
        words = f"--columns {shlex.quote(_pairs(self.proposed))}"
        words += f" --units {_pairs(self.units)}" if self.units else ""
        return words + "".join(f" --factor {key}={FACTOR_PLACEHOLDER}" for key in self.currents)

    def to_dict(self) -> dict[str, Any]:
        """Return the columns and the proposed mapping as a JSON object, schema ``armgap.columns/1``."""
        return {
            "schema": "armgap.columns/1",
            "log": self.log,
            "columns": [asdict(c) for c in self.columns],
            "proposed": self.proposed,
            "units": self.units,
            "currents": self.currents,
            "problem": self.problem,
            "options": self.options,
        }


def columns_of(path: str | Path, arm: Arm | None = None) -> Columns:
    """List the columns of a file, and propose a mapping by their names and their trend.

    Parameters
    ----------
    path : path-like
        Log of any format.
    arm : Arm, optional
        Arm of the log, for the number of joints.

    Raises
    ------
    LogReadError
        If the file cannot be read.
    """
    recording, name, _ = record(path)
    index = Index(recording, name)
    listed = tuple(_column(index, column) for column in recording.columns)
    proposed = _proposed(listed, None if arm is None else arm.n_joints)
    torques = {key: column for key, column in proposed.items() if key.startswith("tau") and not has_factor(key, arm)}
    currents = {key: unit for key, column in torques.items() if (unit := current_of(column)) is not None}
    units, problem = _units(path, proposed, arm)
    return Columns(name, listed, proposed, units, currents, problem)


def _column(index: Index, name: str) -> Column:
    stream = index.recording.stream_of(name)
    series = stream.fetch(name)
    units = (unit for group in FACTORS for unit in (index.unit(name, group), index.foreign_unit(name, group)))
    unit = next(filter(None, units), None)
    if series.dtype.is_temporal():
        series = series.to_physical()
    elif (dates := nanoseconds(series)) is not None:
        series = pl.Series(name, dates)
    if not series.dtype.is_numeric():
        numbers = series.cast(pl.Float64, strict=False) if series.dtype == pl.String else None
        if numbers is None or numbers.null_count() == len(numbers):
            return Column(name, str(stream.fetch(name).dtype), unit, len(series), len(series), None, None, "text")
        series = numbers
    values = series.cast(pl.Float64).to_numpy()
    fine = values[np.isfinite(values)]
    low, high = (float(fine.min()), float(fine.max())) if len(fine) else (None, None)
    missing = len(values) - len(fine)
    return Column(name, str(stream.fetch(name).dtype), unit, len(values), missing, low, high, _course(fine))


def _course(values: NDArray[np.float64]) -> str:
    if len(values) < 2:
        return "constant"
    steps = np.diff(values)
    if not steps.any():
        return "constant"
    return "rising" if bool(np.all(steps >= 0)) and float(np.mean(steps > 0)) > 0.5 else "varies"


def _proposed(columns: tuple[Column, ...], n_joints: int | None) -> dict[str, str]:
    """Return suggested columns by standard name, in the order of standard names."""
    usable = [c for c in columns if c.low is not None]
    kinds = {c.name: _kind(c) for c in usable}
    rising = [c.name for c in usable if c.trend == "rising"]
    time = next((name for name in rising if kinds[name] == "t"), rising[0] if rising else _PLACEHOLDER)
    groups = {kind: _numbered([c.name for c in usable if kinds[c.name] == kind and c.name != time]) for kind in _JOINT}
    n = n_joints or max(len(groups["q"]), len(groups["tau"]), 1)
    named = {"t": time}
    for kind in ("q", "tau"):
        named |= {f"{kind}{j + 1}": (groups[kind] + [_PLACEHOLDER] * n)[j] for j in range(n)}
    if len(groups["dq"]) == n:
        named |= {f"dq{j + 1}": name for j, name in enumerate(groups["dq"])}
    return named


def _numbered(names: list[str]) -> list[str]:
    """Return names sorted by the first number in each, if every name has one; else in the order of the file."""
    numbers = [re.search(r"[0-9]+", name) for name in names]
    return sorted(names, key=lambda name: int(re.findall(r"[0-9]+", name)[0])) if all(numbers) else names


def _kind(column: Column) -> str | None:
    """Return the quantity that a column seems to hold, by the words of its name; None if unknown. The values of a time also have to rise."""
    words = [w for w in re.split(r"[^a-z0-9]+", _spread(column.name)) if w]
    if column.trend == "rising" and any(_TIME.fullmatch(w) for w in words):
        return "t"
    for kind, pattern in _WORDS.items():
        if any(pattern.fullmatch(w) for w in words):
            return None if kind == "skip" else kind
    return "tau" if current_of(column.name) is not None else None


def _spread(name: str) -> str:
    """Return a name in small letters with its words separated: ``shoulderPos1`` becomes ``shoulder pos1``, and ``pos1`` becomes ``pos 1``."""
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name).lower()
    return re.sub(r"(?<=[a-z]{2})(?=[0-9])", " ", apart)


def _units(path: str | Path, proposed: dict[str, str], arm: Arm | None) -> tuple[dict[str, str], str]:
    """Return the units, by group, that reading with the proposed mapping would ask for, and the error with which it would end all the same."""
    units: dict[str, str] = {}
    if _PLACEHOLDER in proposed.values() or str(path) == "-":
        return units, ""
    while True:  # each turn adds the unit of one more of the four groups, or is the last
        try:
            Log.read(path, columns=proposed, units=units, arm=arm)
        except ArmgapError as error:
            asked = re.search(r"--units (\w+)=([\w/]+)", error.remedy) if isinstance(error, UnitError) else None
            if asked is None or asked[1] in units:
                return units, str(error)
            units[asked[1]] = asked[2]
        else:
            return units, ""


def _pairs(mapping: dict[str, str]) -> str:
    return ",".join(f"{key}={name}" for key, name in mapping.items())
