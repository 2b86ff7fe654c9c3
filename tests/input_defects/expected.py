"""What an answer to a spoilt case has to say, and the options that remedies are written in."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

#: Numbers of remedies have to be right to this share.
TOLERANCE = 0.1
#: ``--zero q1=90deg`` adds 90 degrees to the column: its zero lies at 90 degrees of the model's angle.
#: ``--factor tau1=12.5`` multiplies the column. ``--shift tau=-0.005`` adds to the stamps of the torque [s].
NUMBERED = ("zero", "factor", "shift")
#: Options whose columns are each a change of their own; of the others the whole list is one change.
COLUMN_BY_COLUMN = ("flip", "absolute", "relative", "zero", "factor", "shift", "map", "units")
#: Where columns are named again, two spellings.
SPELLINGS = {"columns": "map"}

_OPTION = re.compile(r"--([a-z]+)[ =]+([^\s|;]+)")
_OR = re.compile(r"\s*\|\s*|\s*;\s*or\s+|,?\s+or\s+")
_NUMBER = re.compile(r"[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class Option:
    """One change: ``--zero q1=90deg`` is ``Option("zero", "q1", "", 90.0)``, ``--units q=deg`` is ``Option("units", "q", "deg")``."""

    name: str
    target: str
    word: str = ""
    number: float | None = None

    def agrees(self, other: Option) -> bool:
        """Whether both are the same change, numbers to :data:`TOLERANCE`."""
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
    """Read the alternatives of a remedy, ``--flip tau1 | --flip q1``; each is one option or several together."""
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
    """A group of columns stands for each of them, except where units and times are those of the group."""
    if target in ("q", "tau") and name not in ("units", "shift"):
        return [f"{target}{j + 1}" for j in range(n_joints)]
    return [target]


def _option(name: str, column: str, amount: str) -> Option:
    if name not in NUMBERED:
        return Option(name, column, amount if name == "units" else "")
    number = _NUMBER.match(amount)
    return Option(name, column, "", float(number.group()) if number else None)


def listed(wanted: Remedy, offered: Iterable[Remedy]) -> bool:
    """Whether a remedy is offered, as one alternative or in parts (one check per joint)."""
    parts = [o for remedy in offered if within(remedy, wanted) for o in remedy]
    return all(any(w.agrees(o) for o in parts) for w in wanted)


def within(remedy: Remedy, whole: Remedy) -> bool:
    """Whether every option of a remedy is one of another's."""
    return all(any(w.agrees(o) for w in whole) for o in remedy)


@dataclass(frozen=True)
class Expected:
    """What counts as a right answer.

    Attributes
    ----------
    checks : tuple of str
        Names of checks, any of which is right; ``"*"`` for any check at all.
    severities : tuple of str
        Severities that such a check may have.
    remedies : tuple of str
        All of these have to be offered.
    also : tuple of str
        Remedies that are right too, but not asked for.
    rows : tuple of (log, first, last)
        Rows of a log (0-based) that a check has to point to, any of them; empty where rows are not asked for.
    verdicts : tuple of str
        Verdicts that are right without any such check.
    allowed : tuple of str
        Effects that may be named beside the defect, on any joint.
    """

    checks: tuple[str, ...]
    severities: tuple[str, ...]
    remedies: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    rows: tuple[tuple[str, int, int], ...] = ()
    verdicts: tuple[str, ...] = ()
    allowed: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return it as it is kept beside an answer."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Expected:
        """Build it from what `to_dict` gives."""
        rows = tuple((str(log), int(a), int(b)) for log, a, b in data["rows"])
        return cls(**{k: tuple(v) for k, v in data.items() if k != "rows"}, rows=rows)
