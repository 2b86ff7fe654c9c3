"""Selection of a recording's columns for ``t, q, tau, dq, tau_meas, q_link``, or ``q_ref, dq_ref`` in place of torques."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from armgap.errors import ColumnError, LogShapeError, SampleError, UnitError
from armgap.log.conversion.dates import nanoseconds, odd_row
from armgap.log.conversion.index import Index
from armgap.log.conversion.joint_names import named_after_joints
from armgap.log.conversion.spellings import is_current
from armgap.log.findings import Finding
from armgap.log.recording import Recording
from armgap.progress import report_progress

if TYPE_CHECKING:
    from armgap.arm.arm import Arm

__all__ = [
    "OPTIONAL",
    "Arrays",
    "Names",
    "Raw",
    "extract",
    "group_of",
    "left_out",
    "no_controller",
    "resolve",
    "unknown_unit",
]

_CANONICAL = re.compile(r"^(t|t_tau|(q|tau|dq|tau_meas|q_link|q_ref|dq_ref)(?P<joint>[1-9][0-9]*))$")
_TIMES = ("t", "t_tau")
OPTIONAL = {
    "dq": "velocities",
    "tau_meas": "measured torques",
    "q_link": "positions on the link's side",
    "dq_ref": "velocities",
}
"""Optional groups of columns, used only if every joint has one, with the words for each group in messages."""
#: Largest number of columns that an error message lists.
_LISTED_COLUMNS = 24
_TICKS_S = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3}


@dataclass(frozen=True)
class Names:
    """Names of the recording's columns in use, by standard name, and their stated units, known and unknown; either `tau` or `q_ref` is empty."""

    t: str
    q: tuple[str, ...]
    tau: tuple[str, ...]
    dq: tuple[str, ...] | None
    t_tau: str | None = None
    q_ref: tuple[str, ...] = ()
    dq_ref: tuple[str, ...] | None = None
    tau_meas: tuple[str, ...] | None = None
    q_link: tuple[str, ...] | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    foreign_units: Mapping[str, str] = field(default_factory=dict)

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Pairs of standard name and the recording's own name, for all columns in use."""
        groups = (
            ("q", self.q), ("tau", self.tau), ("dq", self.dq or ()), ("tau_meas", self.tau_meas or ()), ("q_link", self.q_link or ()),
            ("q_ref", self.q_ref), ("dq_ref", self.dq_ref or ()),
        )  # fmt: skip
        joints = [(f"{prefix}{j}", name) for prefix, group in groups for j, name in enumerate(group, start=1)]
        return [("t", self.t), *joints, *([("t_tau", self.t_tau)] if self.t_tau else [])]

    @property
    def by_key(self) -> dict[str, str]:
        """The recording's own names of the columns in use, by standard name."""
        return dict(self.pairs)

    def order(self, column: str) -> float:
        """Return the share of the columns in use that come before `column`, a measure of the progress of reading."""
        columns = [name for _, name in self.pairs]
        return columns.index(column) / len(columns)


@dataclass(frozen=True)
class Arrays:
    """Columns of a log as arrays, before checks; `tau` of a log of references has no columns."""

    t: NDArray[np.float64]
    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    dq: NDArray[np.float64] | None
    q_ref: NDArray[np.float64] | None = None
    dq_ref: NDArray[np.float64] | None = None
    tau_meas: NDArray[np.float64] | None = None
    q_link: NDArray[np.float64] | None = None

    def rows(self, kept: NDArray[Any]) -> Arrays:
        """Return a selection of rows, by index or mask."""
        parts = (self.t, self.q, self.tau, self.dq, self.q_ref, self.dq_ref, self.tau_meas, self.q_link)
        return Arrays(*(None if x is None else x[kept] for x in parts))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Raw:
    """Columns as in the file: times as numbers of any kind, torques with their own times if they have them.

    Attributes
    ----------
    tick_s : float, optional
        Seconds per unit of `t`, where the type of the column says so.
    """

    t: NDArray[np.float64] | NDArray[np.int64]
    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    dq: NDArray[np.float64] | None
    t_tau: NDArray[np.float64] | NDArray[np.int64] | None
    tick_s: float | None
    tau_tick_s: float | None
    q_ref: NDArray[np.float64] | None = None
    dq_ref: NDArray[np.float64] | None = None
    tau_meas: NDArray[np.float64] | None = None
    q_link: NDArray[np.float64] | None = None


def resolve(
    recording: Recording, place: Path | str, mapping: Mapping[str, str], arm: Arm | None
) -> tuple[Names, list[Finding]]:
    """Find the columns of a recording for all standard names.

    A name given in `mapping` must exist. The arm file's names come next; a log with standard names instead,
    such as one written by armgap, is read by these. For a serial arm columns called ``joint/position``, ``/velocity`` and ``/effort`` are found by
    the names of the chain's joints, see `named_after_joints`. Remaining columns are taken as the file itself suggests.
    """
    index = Index(recording, place)
    given = {**_from_arm(index, arm), **mapping}
    by_joint, findings = named_after_joints(index, arm, given)
    names = {**by_joint, **given}
    n = arm.n_joints if arm is not None else None
    if recording.suggest is not None:
        suggestion = recording.suggest(n, names)
        findings += suggestion.findings
        names = {**suggestion.names, **names}
    n = n if n is not None else _count(index, names)
    _check_mapping(names, place, n)
    if arm is not None and f"q{n + 1}" in recording.columns:
        raise LogShapeError(
            f"there is a joint {n + 1}, but a {arm.kind} has {n} joint{'s' if n > 1 else ''}",
            remedy="use the arm file that belongs to this log",
            file=place,
            column=f"q{n + 1}",
        )
    return _pick_all(index, names, mapping, n, arm), findings


def _pick_all(index: Index, names: Mapping[str, str], mapping: Mapping[str, str], n: int, arm: Arm | None) -> Names:
    first = index.find(names.get("q1", "q1"), "q1")
    t = _time(index, names, first)
    q = tuple(_pick(index, names, f"q{j}", t) for j in range(1, n + 1))
    _one_clock(index, t, q, "positions")
    if _commanded(index, names, t, n, arm):
        tau: tuple[str, ...] = ()
        t_tau = None
        q_ref: tuple[str, ...] = tuple(_pick(index, names, f"q_ref{j}", t) for j in range(1, n + 1))
        _one_clock(index, t, q_ref, "references and positions")
        dq_ref = _if_all(index, names, mapping, "dq_ref", n, t)
    else:
        tau = tuple(_pick(index, names, f"tau{j}", t) for j in range(1, n + 1))
        t_tau = _torque_clock(index, names, t, tau)
        _one_clock(index, t_tau or t, tau, "torques")
        q_ref, dq_ref = (), None
    used = (*q, *tau, *q_ref)
    dq, tau_meas, q_link = (
        _if_all(index, names, mapping, prefix, n, t, used) for prefix in ("dq", "tau_meas", "q_link")
    )
    found = Names(t, q, tau, dq, t_tau, q_ref, dq_ref, tau_meas, q_link)
    _check_once(index, found)
    return replace(
        found,
        units={c: unit for key, c in found.pairs if (unit := index.unit(c, group_of(key))) is not None},
        foreign_units={c: unit for key, c in found.pairs if (unit := index.foreign_unit(c, group_of(key))) is not None},
    )


def _if_all(
    index: Index,
    names: Mapping[str, str],
    mapping: Mapping[str, str],
    prefix: str,
    n: int,
    t: str,
    used: Sequence[str] = (),
) -> tuple[str, ...] | None:
    """Return the columns of a group if every joint has one on the clock of `t` that is not in `used`; raise if `mapping` names a missing column."""
    wanted = [f"{prefix}{j}" for j in range(1, n + 1)]
    needed = any(key in mapping for key in wanted)
    found = None
    if needed or all(index.find(names.get(key, key), key, within=t) for key in wanted):
        found = tuple(_pick(index, names, key, t) for key in wanted)
    free = found is not None and all(c in index.recording.stream_of(t).columns and c not in used for c in found)
    if found is not None and (needed or free):
        _one_clock(index, t, found, OPTIONAL[prefix])
        return found
    return None


def _commanded(index: Index, names: Mapping[str, str], t: str, n: int, arm: Arm | None) -> bool:
    """Whether a log holds references of a position controller in place of torques, which a serial arm can be diagnosed from."""

    def there(prefix: str) -> bool:
        keys = [f"{prefix}{j}" for j in range(1, n + 1)]
        return any(index.find(names.get(key, key), key, within=t) is not None for key in keys)

    if (
        there("tau")
        or any(re.fullmatch(r"tau[1-9][0-9]*", key) for key in names)
        or (arm is not None and arm.chain is None)
    ):
        return False
    if arm is not None and not there("q_ref"):
        raise ColumnError(
            "is missing, and so are references `q_ref1` in its place",
            remedy="map torques with --columns tau1=NAME, or references with --columns q_ref1=NAME beside a [controller] in the arm file",
            file=index.place,
            column="tau1",
        )
    if arm is not None and arm.controller is None:
        raise no_controller(arm, index.place)
    return there("q_ref")


def no_controller(arm: Arm, place: Path | str) -> ColumnError:
    """Return the error for a log of references whose arm has no controller."""
    return ColumnError(
        f"is missing, and {arm.path or arm.name} has no [controller] that makes torques of the references `q_ref1`",
        remedy="map torques with --columns tau1=NAME, or add [controller] with kp and kd to the arm file",
        file=place,
        column="tau1",
    )


def _time(index: Index, names: Mapping[str, str], first: str | None) -> str:
    """Return the time column of the positions: that of their own clock if the recording has several clocks."""
    t = index.find(names.get("t", "t"), "t", within=first)
    alone = len(index.recording.streams) == 1 and index.recording.suggest is None
    if "t" in names or first is None or alone:
        return t or _pick(index, names, "t", first)
    stream = index.recording.stream_of(first)
    if t is not None and t in stream.columns:
        return t
    return stream.time or _pick(index, names, "t", first)


def _check_once(index: Index, found: Names) -> None:
    """Raise if one column stands for two standard names."""
    seen: dict[str, str] = {}
    for key, column in found.pairs:
        if column in seen:
            raise ColumnError(
                f"is mapped to both `{seen[column]}` and `{key}`",
                remedy="map each column once",
                file=index.place,
                column=column,
            )
        seen[column] = key


def _torque_clock(index: Index, names: Mapping[str, str], t: str, tau: tuple[str, ...]) -> str | None:
    """Return the time column of the torques if it differs from that of the positions; else None."""
    given = index.find(names.get("t_tau", "t_tau"), "t_tau", within=tau[0])
    if given is None and "t_tau" in names:
        return _pick(index, names, "t_tau", tau[0])
    if given is not None and given != t:
        return given
    stream = index.recording.stream_of(tau[0])
    if t in stream.columns:
        return None
    if stream.time is None:
        raise ColumnError(
            "is not on the positions' clock, and its own times are not known",
            remedy="name them with --columns t_tau=NAME",
            file=index.place,
            column=tau[0],
        )
    return stream.time


def _one_clock(index: Index, t: str, columns: tuple[str, ...], what: str) -> None:
    """Raise unless all columns have the clock of time column `t`."""
    stream = index.recording.stream_of(t)
    for column in columns:
        if column not in stream.columns:
            raise ColumnError(
                f"is not on the clock of `{t}`, as the other {what} are",
                remedy="store the joints with common times, or map other columns",
                file=index.place,
                column=column,
            )


def left_out(recording: Recording, names: Names, prefix: str) -> list[str]:
    """Return the columns of a group in `OPTIONAL` that are left out because the group is incomplete."""
    if getattr(names, prefix) is not None:
        return []
    used = [column for _, column in names.pairs]
    return [name for name in recording.columns if re.fullmatch(rf"{prefix}[1-9][0-9]*", name) and name not in used]


def _from_arm(index: Index, arm: Arm | None) -> dict[str, str]:
    if arm is None:
        return {}
    columns = index.recording.columns
    return {
        key: name
        for key, name in arm.columns.items()
        if _CANONICAL.match(key) and (key not in columns or name in columns or index.find(name, key) is not None)
    }


def _check_mapping(names: Mapping[str, str], place: Path | str, n: int) -> None:
    for key in names:
        match = _CANONICAL.match(key)
        if match is None:
            raise ColumnError(
                f"`{key}` is not a column of a log",
                remedy="map t, q1 ..., tau1 ..., dq1 ..., tau_meas1 ..., q_link1 ..., q_ref1 ... or dq_ref1 ... to the file's names",
                file=place,
                column=key,
            )
        if key not in _TIMES and int(match["joint"]) > n:
            raise ColumnError(
                f"is mapped, but there {'are' if n > 1 else 'is'} {n} joint{'s' if n > 1 else ''}",
                remedy="map the joints from 1 on, without holes",
                file=place,
                column=key,
            )


def _count(index: Index, names: Mapping[str, str]) -> int:
    n = 0
    while index.find(names.get(f"q{n + 1}", f"q{n + 1}"), f"q{n + 1}") is not None:
        n += 1
    mapped = [int(match["joint"]) for key in names if (match := _CANONICAL.match(key)) and key not in _TIMES]
    return max(n, 1, *mapped)


def _pick(index: Index, names: Mapping[str, str], key: str, within: str | None) -> str:
    source = names.get(key, key)
    found = index.find(source, key, within=within)
    if found is None:
        if (other := index.in_foreign_unit(source)) is not None:
            raise unknown_unit(other, index.foreign_unit(other) or "", key, index.place, mapped=False)
        columns = index.recording.columns
        available = ", ".join(columns[:_LISTED_COLUMNS]) + (", ..." if len(columns) > _LISTED_COLUMNS else "")
        mapped = f"it is mapped to {key}, but" if key in names else "it"
        raise ColumnError(
            f"{mapped} is missing",
            remedy=f"map it with --columns {key}=NAME or [columns] in the arm file; the log has {available}",
            file=index.place,
            column=source,
        )
    return found


def group_of(key: str) -> str:
    """Return the group whose units a standard name has: ``tau`` for ``tau_meas1``, ``t`` for ``t_tau``."""
    return key.rstrip("0123456789").partition("_")[0]


def unknown_unit(column: str, unit: str, key: str, place: Path | str, *, mapped: bool) -> UnitError:
    """Return the error for a column whose stated unit is not known; with `mapped` the column is already mapped to the standard name `key`."""
    group = group_of(key)
    mapping = "" if mapped else f"--columns {key}='{column}' "
    declared = {"t": "t=s", "q": "q=rad", "dq": "dq=rad/s", "tau": "tau=Nm"}[group]
    factor = f" and a factor with --factor {key}=VALUE" if group == "tau" else ""
    if is_current(unit):
        factor = f" and --factor {key}=VALUE, N m at the joint per {unit}: torque constant times gear ratio"
    return UnitError(
        f"is in `{unit}`, a unit that is not known",
        remedy=f"convert it in the file, or read it as it is with {mapping}--units {declared}{factor}",
        file=place,
        column=column,
    )


def extract(recording: Recording, place: Path | str, names: Names) -> Raw:
    """Return the columns in use as arrays of finite numbers."""

    def several(group: tuple[str, ...]) -> NDArray[np.float64]:
        values = np.empty((len(t), 0)) if not group else None
        for j, name in enumerate(group):
            report_progress(f"reading {label}", names.order(name))
            column = _column(recording.stream_of(name).fetch(name), place, name)
            values = np.empty((len(column), len(group))) if values is None else values
            values[:, j] = column
        assert values is not None
        return values

    label = place.name if isinstance(place, Path) else place
    t, tick_s = _times(recording, place, names.t)
    if len(t) == 0:
        raise LogShapeError("holds no samples", remedy="give a log with samples", file=place)
    t_tau, tau_tick_s = (None, None) if names.t_tau is None else _times(recording, place, names.t_tau)
    optional = (names.dq, names.dq_ref, names.tau_meas, names.q_link)
    dq, dq_ref, tau_meas, q_link = (None if group is None else several(group) for group in optional)
    q_ref = several(names.q_ref) if names.q_ref else None
    return Raw(t, several(names.q), several(names.tau), dq, t_tau, tick_s, tau_tick_s, q_ref, dq_ref, tau_meas, q_link)


def _times(
    recording: Recording, place: Path | str, name: str
) -> tuple[NDArray[np.float64] | NDArray[np.int64], float | None]:
    """Return times as in the file, whole numbers exactly, and the seconds per unit if the column's type states it."""
    series = recording.stream_of(name).fetch(name)
    if isinstance(series.dtype, pl.Datetime | pl.Duration) and series.null_count() == 0:
        # The type of the column states the unit of its times, so the unit need not be recognised.
        return series.to_physical().to_numpy().astype(np.int64), _TICKS_S[series.dtype.time_unit or "us"]
    if (dates := nanoseconds(series)) is not None:
        return dates, _TICKS_S["ns"]
    if (row := odd_row(series)) is not None:
        what = (
            "the value is missing"
            if series[row] is None
            else f"`{str(series[row])[:40]}` is not a date, as the other times are"
        )
        remedy = "correct it or drop the row; dates are written like 2026-01-05T12:00:00.004+01:00"
        raise ColumnError(what, remedy=remedy, file=place, column=name, row=row + 1)
    if series.dtype.is_integer() and series.null_count() == 0:
        return series.cast(pl.Int64, wrap_numerical=True).to_numpy(), None
    return _column(series, place, name, "give numbers, or dates like 2026-01-05T12:00:00.004"), None


def _column(series: pl.Series, place: Path | str, name: str, remedy: str = "") -> NDArray[np.float64]:
    series = _numbers(series, place, name, remedy or "correct it, or map another column")
    values = series.cast(pl.Float64).to_numpy()
    if series.null_count() == 0 and np.isfinite(values.sum()):
        return values
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        row = int(bad[0])
        what = "missing" if series[row] is None else f"{values[row]:g}"
        if len(bad) > 1:
            what += f", the first of {len(bad)} values that are missing or not finite"
        raise SampleError(
            f"the value is {what}",
            remedy="drop the rows or cut the log there; armgap fills nothing in",
            file=place,
            column=name,
            row=row + 1,
        )
    return values


def _numbers(series: pl.Series, place: Path | str, name: str, remedy: str) -> pl.Series:
    """Return a column as numbers; texts that spell numbers are converted, for other texts the error has the given remedy."""
    if series.dtype.is_numeric() or series.dtype == pl.Null:
        return series
    if series.dtype != pl.String:
        raise ColumnError(
            f"holds {series.dtype}, not numbers",
            remedy="export it as numbers",
            file=place,
            column=name,
            row=1,
        )
    texts = series.str.strip_chars()
    numbers = texts.cast(pl.Float64, strict=False)
    bad = (numbers.is_null() & texts.is_not_null() & (texts != "")).arg_true()
    if len(bad):
        row = int(bad[0])
        more = f" (nor {'are' if len(bad) > 2 else 'is'} {len(bad) - 1} more)" if len(bad) > 1 else ""
        comma = re.fullmatch(r"[-+\d.eE]*,[-+\d.eE]*", texts[row]) is not None
        raise ColumnError(
            f"`{str(series[row])[:40]}` is not a number{more}",
            remedy="write decimal points, not commas" if comma else remedy,
            file=place,
            column=name,
            row=row + 1,
        )
    return numbers
