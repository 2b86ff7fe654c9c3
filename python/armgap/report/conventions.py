"""Conventions of each kind of arm (zero, angles, signs): sentences, and a report section with the logs' columns and units."""

from __future__ import annotations

import re
from typing import Any

from armgap.literals import SERIAL
from armgap.report.page import Section, Table
from armgap.report.sketch import panel

__all__ = ["TITLE", "WORDS", "brief", "section"]

Data = dict[str, Any]

TITLE = "Conventions, columns and units"
_TORQUE = (
    "Positive torque turns its joint towards greater q. It is the torque at the joint, behind the gear, commanded at t and held until "
    "the next row."
)
_SENSE = "The positive direction is the one in which q grows. Either sense of rotation is fine"

WORDS: dict[str, tuple[str, ...]] = {
    "axis": (
        "q1 = 0 may be anywhere on the rail. The positive direction is the one in which q1 grows.",
        "Positive force pushes towards greater q1. It is commanded at t and held until the next row.",
        "theta2 is the weight along the axis: positive where gravity pulls towards smaller q1 (uphill is positive), 0 on a horizontal axis.",
    ),
    "pendulum": (
        "q1 = 0: the link hangs straight down.",
        f"{_SENSE}, as long as the torque counts the same way.",
        _TORQUE,
        "Gravity pulls the link back to q1 = 0: holding it at 0 < q1 < pi takes the positive torque m g l sin(q1).",
    ),
    "two-link": (
        "q1 = 0: link 1 hangs straight down.",
        "q2 is the angle of link 2 relative to link 1, not to the world. q2 = 0: the arm is straight.",
        f"{_SENSE}, as long as both joints and both torques count the same way.",
        _TORQUE,
        "Gravity pulls the arm back to q1 = q2 = 0: holding it takes theta4 sin(q1) + theta5 sin(q1 + q2) at joint 1 and "
        "theta5 sin(q1 + q2) at joint 2.",
    ),
}
"""Conventions by kind of arm, a few sentences each."""

_OF_SERIAL_ARMS = (
    "q = 0 and the positive direction of each joint are those of the description that the arm file names, or of its [[link]] tables.",
    f"{_TORQUE.replace('its joint', 'a revolute joint')} Positive force pushes a prismatic joint towards greater q.",
    "Gravity is given in the frame of the base.",
)

_BRIEF = {
    SERIAL: "zeros and directions are those of the chain's description; positive torque or force moves its joint towards greater q.",
    "axis": "positive force pushes towards greater q1.",
    "pendulum": "q1 = 0 hangs straight down; positive torque turns the joint towards greater q1.",
    "two-link": "q = 0 hangs straight down; q2 is relative to link 1; positive torque turns its joint towards greater q.",
}
_QUANTITIES = {
    "t": "time",
    "t_tau": "time of the torques",
    "q": "position of joint {}",
    "tau": "torque of joint {}",
    "dq": "velocity of joint {}",
    "tau_meas": "measured torque of joint {}",
    "q_link": "position of joint {} on the link's side",
}
_FORCE = {"tau": "force of joint {}", "tau_meas": "measured force of joint {}"}
_FOLD = "Columns of the logs, and their units"
_KEY = re.compile(r"(t_tau|t|q|tau|dq|tau_meas|q_link)([0-9]*)")
_SHOWN = {"Nm": "N m", "mNm": "mN m"}


def brief(kind: str) -> str:
    """Return the conventions of a kind of arm in one line; empty for an unknown kind."""
    return _BRIEF.get(kind, "")


def section(kind: str, logs: list[Data] | None = None, si: Data | None = None) -> Section | None:
    """Return the report section of an arm's conventions.

    Parameters
    ----------
    kind : str
        Kind of arm.
    logs : list of dict, optional
        ``input.logs`` of a diagnosis: columns and units of each log.
    si : dict, optional
        ``input.units`` of a diagnosis: SI unit of each group of columns.
    """
    if kind not in WORDS and kind != SERIAL:
        return None
    tables = _tables(kind, logs or [], si or {})
    title = TITLE if tables else "Conventions"
    if kind == SERIAL:
        return Section(title, points=_OF_SERIAL_ARMS, tables=tables, name="conventions")
    return Section(title, sketch=panel(kind), points=WORDS[kind], tables=tables, name="conventions")


def _tables(kind: str, logs: list[Data], si: Data) -> list[Table]:
    """Return tables of columns and units, one for all logs with equal column names and units."""
    groups: dict[str, tuple[Data, list[str]]] = {}
    for log in logs:
        names = groups.setdefault(repr((log["columns"], log["units"])), (log, []))[1]
        names += [log["name"]] if log["name"] not in names else []
    return [
        Table(
            ("column", "what it is", f"in {', '.join(names)}", "unit there", "used as"),
            _rows(kind, log, si),
            fold=_FOLD * (kind == SERIAL),
        )
        for log, names in groups.values()
        if log["columns"]
    ]


def _rows(kind: str, log: Data, si: Data) -> list[tuple[str, ...]]:
    return [_row(kind, key, name, log["units"].get(key, ""), si) for key, name in log["columns"].items()]


def _row(kind: str, key: str, name: str, unit: str, si: Data) -> tuple[str, ...]:
    from armgap.log.conversion.units import COUNTED, FACTORS

    match = _KEY.fullmatch(key)
    group, joint = match.groups() if match else (key, "")
    words = _QUANTITIES | (_FORCE if kind == "axis" else {})
    of_group = group.partition("_")[0]
    used = str(si.get(of_group, ""))
    factor = FACTORS.get(of_group, {}).get(unit, 1.0)
    converted = used if factor == 1.0 else f"{used}, times {factor:.4g}"
    if unit == COUNTED.get(of_group):
        converted = f"{used}, by counts_per_rev of the arm file"
    return key, words.get(group, "").format(joint), name, _SHOWN.get(unit, unit), converted
