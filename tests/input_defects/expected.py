"""What an answer to a case with a defect has to say, and the options that remedies are written in."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

#: Largest relative error of a number in a remedy that counts as right.
TOLERANCE = 0.1
#: Options with a number: ``--zero q1=90deg`` adds 90 degrees to the column, whose zero lies at 90 degrees of the model's angle;
#: ``--factor tau1=12.5`` multiplies the column; ``--shift tau=-0.005`` adds -0.005 s to the time stamps of the torque.
NUMBERED = ("zero", "factor", "shift")
#: Options of which each column counts as a change of its own; for other options the whole list of columns is one change.
COLUMN_BY_COLUMN = ("flip", "absolute", "relative", "zero", "factor", "shift", "map", "units")
#: Other names of options, mapped to the names used here: two options rename columns.
SPELLINGS = {"columns": "map"}

_OPTION = re.compile(r"--([a-z]+)[ =]+([^\s|;]+)")
_OR = re.compile(r"\s*\|\s*|\s*;\s*or\s+|,?\s+or\s+")
_NUMBER = re.compile(r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class Option:
    """One correction of columns: ``--zero q1=90deg`` is ``Option("zero", "q1", "", 90.0)``, ``--units q=deg`` is ``Option("units", "q", "deg")``."""

    name: str
    target: str
    word: str = ""
    number: float | None = None

    def agrees(self, other: Option) -> bool:
        """Return whether both options make the same change, with numbers equal to a relative error of :data:`TOLERANCE`."""
        if (self.name, self.target, self.word) != (other.name, other.target, other.word):
            return False
        if self.number is None or other.number is None:
            return self.number is other.number
        a, b = self.number, other.number
        if self.name == "zero" and abs(abs(a) - 180) < 1 and abs(abs(b) - 180) <= 18:
            return True
        return abs(a - b) <= TOLERANCE * abs(a)


Remedy = tuple[Option, ...]


def remedies(text: str, n_joints: int) -> list[Remedy]:
    """Read the alternatives of a remedy's text, such as ``--flip tau1 | --flip q1``; each is one option or several together."""
    found = [tuple(_options(part, n_joints)) for part in _OR.split(text)]
    return [remedy for remedy in found if remedy]


def _options(text: str, n_joints: int) -> Iterable[Option]:
    for name, value in _OPTION.findall(text):
        name, value = SPELLINGS.get(name, name), value.strip("`'\"().,:")
        if name not in COLUMN_BY_COLUMN:
            yield Option(name, ",".join(sorted(value.split(","))))
            continue
        for entry in value.split(","):
            target, _, amount = entry.partition("=")
            for column in _columns(name, target, n_joints):
                yield _option(name, column, amount)


def _columns(name: str, target: str, n_joints: int) -> list[str]:
    """Return the columns of a target: those of all joints for ``q`` or ``tau``, but the target itself for units and time shifts."""
    if target in ("q", "tau") and name not in ("units", "shift"):
        return [f"{target}{j + 1}" for j in range(n_joints)]
    return [target]


def _option(name: str, column: str, amount: str) -> Option:
    if name not in NUMBERED:
        return Option(name, column, amount if name == "units" else "")
    number = _NUMBER.match(amount)
    return Option(name, column, "", float(number.group()) if number else None)


def listed(wanted: Remedy, offered: Iterable[Remedy]) -> bool:
    """Return whether the wanted remedy is offered, as one alternative or as the union of several (one check per joint)."""
    parts = [o for remedy in offered if within(remedy, wanted) for o in remedy]
    return all(any(w.agrees(o) for o in parts) for w in wanted)


def within(remedy: Remedy, whole: Remedy) -> bool:
    """Return whether every option of `remedy` agrees with one of `whole`."""
    return all(any(w.agrees(o) for w in whole) for o in remedy)


@dataclass(frozen=True)
class Expected:
    """What counts as a right answer to a case with a defect.

    Attributes
    ----------
    checks : tuple of str
        Names of checks, any of which is right; ``"*"`` for any check.
    severities : tuple of str
        Severities that the right check may have.
    remedies : tuple of str
        Remedies that all have to be offered.
    also : tuple of str
        Remedies that are right too, but need not be offered.
    rows : tuple of (log, first, last)
        Rows of a log (0-based) that a check has to point to, any of them; empty where rows are not asked for.
    verdicts : tuple of str
        Verdicts that are right if none of the checks fires.
    allowed : tuple of str
        Effects that may be named in spite of the defect, on any joint.
    """

    checks: tuple[str, ...]
    severities: tuple[str, ...]
    remedies: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    rows: tuple[tuple[str, int, int], ...] = ()
    verdicts: tuple[str, ...] = ()
    allowed: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the expectation as a dictionary, as a record keeps it."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Expected:
        """Build the expectation from a dictionary that `to_dict` returned."""
        rows = tuple((str(log), int(a), int(b)) for log, a, b in data["rows"])
        return cls(**{k: tuple(v) for k, v in data.items() if k != "rows"}, rows=rows)
