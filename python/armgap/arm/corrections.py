"""Corrections of the input by options or by an arm file: sign, zero, order, unit, factor or time shift of a log's columns."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from armgap.errors import ColumnError, OptionError
from armgap.literals import GravityCorrection
from armgap.log.findings import Finding, counted
from armgap.log.log import SIGNALS

if TYPE_CHECKING:
    from armgap.arm.arm import Arm
    from armgap.log.log import Log

__all__ = ["CORRECTIONS", "Corrections", "PositionUnit"]

PositionUnit = Literal["deg", "turns"]

_COLUMN = re.compile(r"(q|dq|tau|q_link|tau_meas)([1-9]\d*)")
_POSITION = re.compile(r"q([1-9]\d*)")
_ZERO = re.compile(r"(q|q_link)([1-9]\d*)")
_TORQUE = re.compile(r"tau([1-9]\d*)?")
_FACTOR = re.compile(r"(tau|tau_meas)([1-9]\d*)?")
# Distance of a time shift from a whole number of sample periods, in periods, up to which the shift counts as whole.
_WHOLE = 0.05
# Arrays of a log that a correction of sign or joint changes, by kind of column: whatever is measured at a joint changes with the joint's sign.
_TOGETHER = {
    "q": ("q", "dq", "q_ref", "dq_ref", "q_link"),
    "dq": ("dq",),
    "tau": ("tau", "moment", "tau_meas"),
    "q_link": ("q_link",),
    "tau_meas": ("tau_meas",),
}
# Arrays of a log that a correction of zero or unit changes, by kind of position column, and arrays that a factor on torques
# changes; a measured torque has a unit of its own and is not among them.
_POSITIONS = {"q": ("q", "q_ref", "q_link"), "q_link": ("q_link",)}
_FACTORS = {"tau": ("tau", "moment"), "tau_meas": ("tau_meas",)}
# Arrays of a log that a time shift of the torques moves; measured torques are not among them, for they are sampled with the positions.
_SHIFTED = ("tau", "moment")
_ANGLE = re.compile(r"(?P<number>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>deg|rad|m|turns)?")
_ANGLE_UNITS = {"deg": math.pi / 180, "rad": 1.0, "m": 1.0, "turns": 2 * math.pi, None: 1.0}
_SPAN = re.compile(r"(?:(?P<log>.+):)?(?P<first>[\d.]+)-(?P<last>[\d.]+)")
# Standard acceleration of gravity in the frame of the base [m/s^2].
_STANDARD_GRAVITY = np.array([0.0, 0.0, -9.81])
# Standard deviation [SI] of gravity parameters that are known to be zero.
_NO_GRAVITY_SIGMA = 1e-9


@dataclass(frozen=True)
class Corrections:
    """Corrections that bring the columns of logs to the conventions of the arm file.

    Corrections are applied in this order: `unit`, `swap`, `flip`, `zero`, `absolute` and `relative`, `factor`, `skip`, `shift`; `gravity` changes
    the arm. Corrections of a position column hold for the joint's second encoder ``q_link`` too; sign and joint of a torque column hold for
    ``tau_meas`` too, factor and shift do not. ``q_link`` and ``tau_meas`` can be named alone for signs, joints, zeros or factors.

    Attributes
    ----------
    flip : tuple of str
        Columns with reversed sign: ``"q1"``, ``"tau2"``.
    zero : mapping of str to float
        Model position at the zero of a position column [rad or m], added to the column.
    swap : tuple of (str, str)
        Pairs of exchanged columns: ``("q1", "q2")``.
    absolute : tuple of str
        Columns with positions relative to the world where the model's are relative to the preceding link.
    relative : tuple of str
        Columns with positions relative to the preceding link where the model's are relative to the world.
    factor : mapping of str to float
        Factors from torque columns to torques [N m or N]; velocities are not scaled.
    shift : mapping of str to float
        ``{"tau": s}``: seconds to be added to the times of all torques.
    gravity : {"reversed", "compensated", "standard", "+x", "-x", "+y", "-y", "+z", "-z"}, optional
        ``"reversed"``: gravity acts the other way than the arm file says; ``"compensated"``: logged torques lack the part
        that carries the arm's weight, or the arm moves in a horizontal plane; ``"standard"``, for serial arms: 9.81 m/s^2 against the z axis of
        the base; ``"-y"`` and the like, for serial arms: gravity acts in this direction of the base.
    unit : {"deg", "turns"}, optional
        Unit of all positions; None for rad.
    skip : tuple of str
        Times of a log that are left out, in seconds from its first sample: ``"0-2.5"``, or ``"run1:0-2.5"`` for the log ``run1`` alone.

    Examples
    --------
    >>> Corrections.parse(flip=["tau1"], zero=["q1=180deg"]).options()
    ('--flip tau1', '--zero q1=180deg')
    """

    flip: tuple[str, ...] = ()
    zero: Mapping[str, float] = field(default_factory=dict)
    swap: tuple[tuple[str, str], ...] = ()
    absolute: tuple[str, ...] = ()
    relative: tuple[str, ...] = ()
    factor: Mapping[str, float] = field(default_factory=dict)
    shift: Mapping[str, float] = field(default_factory=dict)
    gravity: GravityCorrection | None = None
    unit: PositionUnit | None = None
    skip: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether any correction is set."""
        return any(getattr(self, f.name) for f in fields(self))

    @classmethod
    def parse(cls, **values: Any) -> Corrections:
        """Read corrections from lists of words, as command-line options give them, or from mappings, as an arm file does.

        Parameters
        ----------
        **values
            Value per name of a correction: a word such as ``"tau1,tau2"`` or ``"q1=180deg"``, a list of words, or a mapping.

        Raises
        ------
        OptionError
            If a word is not understood.
        """
        known = {f.name for f in fields(cls)}
        for name in values:
            if name not in known:
                raise OptionError(f"`{name}` is no correction", remedy=f"known: {', '.join(sorted(known))}")
        given = {name: value for name, value in values.items() if value}
        gravity = given.get("gravity")
        if gravity is not None and gravity not in get_args(GravityCorrection):
            raise OptionError(
                f"gravity cannot be `{gravity}`", remedy=f"write {', '.join(get_args(GravityCorrection))}"
            )
        unit = given.get("unit")
        if unit is not None and unit not in get_args(PositionUnit):
            raise OptionError(f"positions cannot be in `{unit}`", remedy="write deg or turns")
        return cls(
            flip=tuple(_column("flip", word) for word in _words(given.get("flip", ()))),
            zero={k: _angle(v) for k, v in _pairs("zero", given.get("zero", ()), _ZERO, "q1=180deg")},
            swap=_exchanges(given.get("swap", ())),
            absolute=tuple(_position("absolute", word) for word in _words(given.get("absolute", ()))),
            relative=tuple(_position("relative", word) for word in _words(given.get("relative", ()))),
            factor={
                k: _number("factor", v) for k, v in _pairs("factor", given.get("factor", ()), _FACTOR, "tau1=12.5")
            },
            shift={k: _seconds(v) for k, v in _pairs("shift", given.get("shift", ()), _TORQUE, "tau=-0.005")},
            gravity=gravity,
            unit=unit,
            skip=tuple(_span(word) for word in _words(given.get("skip", ()))),
        )

    def merged(self, other: Corrections) -> Corrections:
        """Return the union of two sets of corrections; for a column that both correct, `other` wins."""
        return Corrections(
            flip=tuple(dict.fromkeys((*self.flip, *other.flip))),
            zero={**self.zero, **other.zero},
            swap=(*self.swap, *(pair for pair in other.swap if pair not in self.swap)),
            absolute=tuple(dict.fromkeys((*self.absolute, *other.absolute))),
            relative=tuple(dict.fromkeys((*self.relative, *other.relative))),
            factor={**self.factor, **other.factor},
            shift={**self.shift, **other.shift},
            gravity=other.gravity or self.gravity,
            unit=other.unit or self.unit,
            skip=tuple(dict.fromkeys((*self.skip, *other.skip))),
        )

    def options(self) -> tuple[str, ...]:
        """Return the command-line options that state these corrections."""
        words = [f"--units q={self.unit}"] if self.unit else []
        words += [f"--flip {','.join(self.flip)}"] if self.flip else []
        words += [f"--zero {column}={_in_degrees(value)}" for column, value in self.zero.items()]
        words += [f"--swap {a},{b}" for a, b in self.swap]
        words += [f"--absolute {column}" for column in self.absolute]
        words += [f"--relative {column}" for column in self.relative]
        words += [f"--factor {column}={value:.4g}" for column, value in self.factor.items()]
        words += [f"--shift {column}={value:.4g}" for column, value in self.shift.items()]
        words += [f"--skip {span}" for span in self.skip]
        return (*words, *((f"--gravity {self.gravity}",) if self.gravity else ()))

    def to_dict(self) -> dict[str, Any]:
        """Return the corrections that are set as a dict ready for JSON."""
        given = {f.name: getattr(self, f.name) for f in fields(self)}
        plain = {
            k: list(v) if isinstance(v, tuple) else dict(v) if isinstance(v, Mapping) else v for k, v in given.items()
        }
        return {k: v for k, v in plain.items() if v}

    def toml_lines(self) -> list[str]:
        """Return the lines of an arm file's ``[corrections]`` table, without gravity, which the arm's parameters already include."""
        lines = [f"unit = {json.dumps(self.unit)}"] if self.unit else []
        lines += [
            f"{name} = {json.dumps(list(getattr(self, name)))}"
            for name in ("flip", "absolute", "relative", "skip")
            if getattr(self, name)
        ]
        lines += [f"swap = {json.dumps([list(pair) for pair in self.swap])}"] if self.swap else []
        for name in ("zero", "factor", "shift"):
            if values := getattr(self, name):
                lines.append(f"{name} = {{ {', '.join(f'{k} = {v!r}' for k, v in values.items())} }}")
        return lines

    def on_log(self, log: Log) -> Log:
        """Return the log with its columns corrected; each correction is added to the log's findings.

        Raises
        ------
        ColumnError
            If the log lacks a column that is to be corrected.
        """
        about_log = replace(self, gravity=None, skip=self.spans_of(log))
        if not about_log:
            return log
        self._check_joints(log)
        columns: dict[str, Any] = {
            name: None if (values := getattr(log, name)) is None else values.copy() for name in ("t", *SIGNALS)
        }
        self._positions(columns)
        for column, value in self.factor.items():
            match = _FACTOR.fullmatch(column)
            assert match is not None
            for values in _of(columns, _FACTORS[match[1]]):
                values[:, slice(None) if match[2] is None else int(match[2]) - 1] *= value
        if about_log.skip:
            keep = ~about_log._skipped(log)
            if not keep.any():
                raise OptionError(f"--skip leaves nothing of {log.name}", remedy="leave out less")
            columns = {name: None if x is None else x[keep] for name, x in columns.items()}
        if self.shift:
            keep, held = _shifted(columns["t"], log.sample_period, self.shift.get("tau", 0.0))
            rows = {name: held if name in _SHIFTED else keep for name in columns}
            columns = {name: None if x is None else x[rows[name]] for name, x in columns.items()}
        said = Finding("corrected", f"read with {' '.join(about_log.options())}")
        return replace(log, **columns, findings=(*log.findings, said))

    def _positions(self, columns: dict[str, Any]) -> None:
        """Correct unit, order, signs, zeros and reference link of position columns in place."""
        if self.unit is not None:
            for values in _of(columns, _POSITIONS["q"]):
                values *= _ANGLE_UNITS[self.unit]
        for a, b in self.swap:
            (kind, i), (_, j) = _split(a), _split(b)
            for values in _of(columns, _TOGETHER[kind]):
                values[:, [i, j]] = values[:, [j, i]]
        for column in self.flip:
            kind, j = _split(column)
            for values in _of(columns, _TOGETHER[kind]):
                values[:, j] *= -1.0
        for column, value in self.zero.items():
            kind, j = _split(column)
            for values in _of(columns, _POSITIONS[kind]):
                values[:, j] += value
        for names, sign in ((self.absolute, -1.0), (self.relative, 1.0)):
            # An angle from the world is taken from those of later joints before its own becomes relative; the reverse the other way round.
            for j in sorted((_split(column)[1] for column in names), reverse=sign < 0):
                for values in _of(columns, _TOGETHER["q"]):
                    values[:, j] += sign * values[:, j - 1]

    def _skipped(self, log: Log) -> Any:
        """Return a mask of the samples within the spans of `skip`, which are all of this log."""
        skipped = np.zeros(len(log), dtype=bool)
        for span in self.skip:
            match = _SPAN.fullmatch(span)
            assert match is not None
            skipped |= (log.t >= float(match["first"])) & (log.t <= float(match["last"]))
        return skipped

    def spans_of(self, log: Log) -> tuple[str, ...]:
        """Return the spans that are left out of a log: those that name no log, its name, or its file with or without the ending."""

        def of_it(name: str | None) -> bool:
            return name is None or log.recording in (name, Path(name).name, Path(name).stem)

        matches = ((span, _SPAN.fullmatch(span)) for span in self.skip)
        return tuple(span for span, match in matches if match is not None and of_it(match["log"]))

    def on_arm(self, arm: Arm) -> Arm:
        """Return the arm with gravity corrected: reversed, compensated, or the standard one.

        Raises
        ------
        OptionError
            If standard gravity, or gravity along an axis, is asked for an arm whose gravity parameters do not follow from its masses.
        """
        if self.gravity is None:
            return arm
        if arm.chain is not None:
            by_name = {"reversed": -1.0 * arm.chain.gravity, "compensated": np.zeros(3), "standard": _STANDARD_GRAVITY}
            size = float(np.linalg.norm(arm.chain.gravity)) or float(np.linalg.norm(_STANDARD_GRAVITY))
            by_name |= {
                f"{sign}{axis}": float(f"{sign}1") * size * np.eye(3)["xyz".index(axis)]
                for sign, axis in product("+-", "xyz")
            }
            gravity = by_name[self.gravity]
            chain = replace(arm.chain, gravity=gravity)
            return replace(arm, chain=chain, gravity=float(np.linalg.norm(gravity)))
        if self.gravity not in ("reversed", "compensated"):
            raise OptionError(
                f"gravity cannot be `{self.gravity}` for an arm of kind `{arm.kind}`, whose parameters hold it",
                remedy="give its gravity parameters in the arm file",
            )
        theta, sigma = arm.theta.copy(), arm.sigma.copy()
        weights = arm.gravity_parameters
        if self.gravity == "reversed":
            theta[weights] *= -1.0
        else:
            theta[weights], sigma[weights] = 0.0, _NO_GRAVITY_SIGMA
        return replace(arm, theta=theta, sigma=sigma)

    def _check_joints(self, log: Log) -> None:
        columns = [*self.flip, *self.zero, *(c for pair in self.swap for c in pair), *self.absolute, *self.relative]
        columns += [column for column in self.factor if column not in _FACTORS]
        for column in columns:
            if _split(column)[1] >= log.n_joints:
                raise ColumnError(
                    f"is not there to be corrected, the log has {counted(log.n_joints, 'joint')}",
                    remedy="correct the option",
                    file=log.path or log.name,
                    column=column,
                )
        for column in (*self.absolute, *self.relative):
            if _split(column)[1] == 0:
                raise OptionError(f"`{column}` has no link before it", remedy="name a later joint, for example q2")
        for column in self.shift:
            if column != "tau":
                raise OptionError(f"`{column}` cannot be shifted alone", remedy="write --shift tau=SECONDS")


CORRECTIONS: tuple[str, ...] = tuple(f.name for f in fields(Corrections))


def _of(columns: Mapping[str, Any], names: Iterable[str]) -> list[Any]:
    """Return the arrays in `columns` with the given names, without those that the log lacks, such as the torques of a log of references."""
    return [x for name in names if (x := columns[name]) is not None and x.shape[1]]


def _shifted(t: Any, period: float, seconds: float) -> tuple[Any, Any]:
    """Return the rows whose torques are known after a time shift by `seconds`, and the rows that hold these torques before the shift.

    Each torque is held until the next row. A shift by whole sample periods moves every torque by as many rows, however the time stamps scatter.
    """
    rows = np.arange(len(t))
    samples = seconds / period
    if abs(samples - round(samples)) < _WHOLE:
        held = rows - round(samples)
    else:
        held = np.searchsorted(t + seconds, t + 1e-9, side="right") - 1
        held[t > t[-1] + seconds] = -1
    keep = (held >= 0) & (held < len(t))
    return rows[keep], held[keep]


def _split(column: str) -> tuple[str, int]:
    match = _COLUMN.fullmatch(column)
    assert match is not None
    return match[1], int(match[2]) - 1


def _words(value: str | Iterable[str]) -> list[str]:
    given = [value] if isinstance(value, str) else list(value)
    return [word.strip() for text in given for word in str(text).split(",") if word.strip()]


def _column(option: str, word: str) -> str:
    if not _COLUMN.fullmatch(word):
        raise OptionError(
            f"--{option}: `{word}` is no column of a log", remedy=f"write --{option} tau1 or --{option} q1"
        )
    return word


def _position(option: str, word: str) -> str:
    if not _POSITION.fullmatch(word):
        raise OptionError(f"--{option}: `{word}` is no position column", remedy=f"write --{option} q2")
    return word


def _pairs(option: str, value: Any, column: re.Pattern[str], example: str) -> list[tuple[str, Any]]:
    if isinstance(value, Mapping):
        pairs = [(str(k), v) for k, v in value.items()]
    else:
        pairs = []
        for word in _words(value):
            key, sep, number = (part.strip() for part in word.partition("="))
            if not sep or not number:
                raise OptionError(f"--{option}: `{word}` is not a pair", remedy=f"write --{option} {example}")
            pairs.append((key, number))
    for key, _ in pairs:
        if not column.fullmatch(key):
            raise OptionError(
                f"--{option}: `{key}` is not a column that it is about", remedy=f"write --{option} {example}"
            )
    return pairs


def _exchanges(value: Any) -> tuple[tuple[str, str], ...]:
    given = [value] if isinstance(value, str) else list(value)
    pairs = [tuple(_words(item)) for item in given]
    for pair in pairs:
        kinds = {match[1] for word in pair if (match := _COLUMN.fullmatch(word))}
        if len(pair) != 2 or len(kinds) != 1 or pair[0] == pair[1] or not all(_COLUMN.fullmatch(w) for w in pair):
            raise OptionError(
                f"--swap: `{','.join(pair)}` are not two columns of one kind",
                remedy="write --swap q1,q2 or --swap tau1,tau2",
            )
    return tuple((a, b) for a, b in pairs)


def _angle(value: Any) -> float:
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _finite("zero", float(value))
    match = _ANGLE.fullmatch(str(value).strip())
    if match is None:
        raise OptionError(f"--zero: `{value}` is no position", remedy="write --zero q1=180deg or --zero q1=3.14159")
    return _finite("zero", float(match["number"]) * _ANGLE_UNITS[match["unit"]])


def _seconds(value: Any) -> float:
    return _number("shift", str(value).removesuffix("s").strip() if isinstance(value, str) else value)


def _number(option: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise OptionError(f"--{option}: `{value}` is not a number", remedy="correct it") from None
    if option == "factor" and number == 0:
        raise OptionError("--factor: a factor of 0 leaves no torque", remedy="give another")
    return _finite(option, number)


def _finite(option: str, number: float) -> float:
    if not math.isfinite(number):
        raise OptionError(f"--{option}: {number} is not a finite number", remedy="correct it")
    return number


def _span(word: str) -> str:
    match = _SPAN.fullmatch(word)
    try:
        good = match is not None and float(match["first"]) < float(match["last"])
    except ValueError:
        good = False
    if not good:
        raise OptionError(
            f"--skip: `{word}` are no times", remedy="write --skip 0-2.5 or --skip NAME:0-2.5, in seconds"
        )
    return word


def _in_degrees(value: float) -> str:
    degrees = round(math.degrees(value), 6)
    return f"{degrees:g}deg" if abs(degrees - round(degrees)) < 1e-6 else f"{value:.6g}"
