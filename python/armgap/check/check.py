"""Result of a check of the input: a defect, its severity, and its remedies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, TypedDict, get_args

__all__ = ["NAMES", "SEVERITIES", "Check", "CheckEntry", "CheckName", "Severity"]

CheckName = Literal[
    "torque_sign",
    "position_sign",
    "joint_order",
    "relative_angle",
    "position_zero",
    "gravity_sign",
    "gravity_direction",
    "gravity_missing",
    "torque_is_position",
    "torque_unit",
    "position_unit",
    "time_shift",
    "repeated_positions",
    "filtered_positions",
    "quantized_torque",
    "wrapped_positions",
    "spike",
    "stamp_jitter",
    "dead_stretch",
    "copied_holdout",
    "logs_differ",
]
Severity = Literal["error", "repaired", "warning"]

NAMES: tuple[CheckName, ...] = get_args(CheckName)
SEVERITIES: tuple[Severity, ...] = get_args(Severity)


class CheckEntry(TypedDict):
    """Entry of a diagnosis' ``checks``: a `Check` of the input as a JSON object."""

    check: Annotated[CheckName, "Which defect."]
    joint: Annotated[int | None, "1-based joint; null for the whole log or arm."]
    log: Annotated[str | None, "Name of the log; null if it concerns all."]
    severity: Severity
    message: Annotated[str, "One sentence with the figures."]
    remedy: Annotated[str, "All remedies in one line."]
    remedies: Annotated[list[str], "What mends it; several where no log tells them apart."]
    rows: Annotated[list[list[int]], "Ranges of rows, first and last, from 0, both included."]


@dataclass(frozen=True)
class Check:
    """A defect of the input.

    Attributes
    ----------
    check : str
        Identifier of the defect, one of `NAMES`.
    severity : {"error", "repaired", "warning"}
        ``"error"``: log and arm file contradict each other, the verdict is ``"input"``; ``"repaired"``: the log was repaired and the
        diagnosis goes on with it; ``"warning"``: the log was not changed.
    message : str
        One sentence with the figures of the defect.
    remedies : tuple of str
        Remedies of the defect: command-line options, or lines of the arm file. Several where no log tells them apart.
    joint : int, optional
        Joint, from 1; None for the whole log or arm.
    log : str, optional
        Name of the log; None if the defect concerns all logs.
    rows : tuple of (int, int)
        Ranges of rows ``(first, last)`` of the log, from 0, both included.
    """

    check: CheckName
    severity: Severity
    message: str
    remedies: tuple[str, ...] = ()
    joint: int | None = None
    log: str | None = None
    rows: tuple[tuple[int, int], ...] = ()

    @property
    def remedy(self) -> str:
        """All remedies of the defect in one line."""
        return " or ".join(self.remedies)

    def line(self, log: str | None = None) -> str:
        """Return the check's result as one line of text; `log` is the log's name to be used where the check names no log."""
        place = f"{name}: " if (name := self.log or log) else ""
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{self.severity}: {place}{self.message}{remedy}"

    def to_dict(self) -> CheckEntry:
        """Return the entry of a diagnosis' ``checks``."""
        return {
            "check": self.check,
            "joint": self.joint,
            "log": self.log,
            "severity": self.severity,
            "message": self.message,
            "remedy": self.remedy,
            "remedies": list(self.remedies),
            "rows": [list(r) for r in self.rows],
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Check:
        """Build a check from an entry of a diagnosis' ``checks``."""
        return cls(
            check=data["check"],
            severity=data["severity"],
            message=data["message"],
            remedies=tuple(data.get("remedies") or filter(None, [data.get("remedy")])),
            joint=data.get("joint"),
            log=data.get("log"),
            rows=tuple((int(a), int(b)) for a, b in data.get("rows", ())),
        )

    def of(self, log: str | None) -> Check:
        """Return a copy of the check with `log` as the name of its log; None for all logs."""
        return replace(self, log=log)
