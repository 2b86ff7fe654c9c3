"""Report section on the arm's parameters: nominal, re-estimated, with causes; their changes and physical plausibility."""

from __future__ import annotations

from typing import Any

from armgap.literals import SERIAL
from armgap.report import charts
from armgap.report.page import Cell, IntervalLine, Section, Table
from armgap.report.sections.model_labels import Data
from armgap.report.words import figure, named, parameter_text, unit_text, value

__all__ = ["parameters"]

#: Half widths of the line on which parameters are drawn, and of its shaded middle, in standard deviations of the arm file.
_LINE_HALF_WIDTH = 5.0
MIDDLE = 2.0
_LINK_NUMBERS = 10


def parameters(data: Data) -> Section:
    """Return the section with parameters, intervals, and physical plausibility."""
    text = [
        "Value ± one standard deviation; for the arm file, how far it is trusted. On the line, the shaded middle is two of these standard "
        "deviations around the arm file's value, the ends are five; yellow is re-estimated, blue with causes."
    ]
    tables = [_values(data)] if not _is_serial(data) else _values_of_serial_arm(data)
    return Section("Parameters", text=text, tables=[*tables, *_plausibility(data)], notes=_impossible(data))


def _is_serial(data: Data) -> bool:
    return (data.get("arm") or {}).get("kind") == SERIAL


def _values_of_serial_arm(data: Data) -> list[Table]:
    """Return tables for a serial arm: causes, rotor inertias and friction; and, folded, ten inertial parameters per link."""
    table, causes = _values(data), data.get("causes") or []
    count = _LINK_NUMBERS * int(data["arm"]["n_joints"])
    last = len(table.rows) - sum(len(cause["parameters"]) for cause in causes)
    shown, links = [*table.rows[last:], *table.rows[count:last]], table.rows[:count]
    return [
        Table(table.header, shown),
        Table(table.header, links, fold="Masses, first moments and inertias of the links"),
    ]


def _values(data: Data) -> Table:
    tables, causes = data["parameters"], data.get("causes") or []
    names = list((data.get("arm") or {}).get("parameter_names") or tables["nominal"])
    kind = str((data.get("arm") or {}).get("kind", ""))
    rows: list[tuple[Cell, ...]] = []
    for name in names:
        entries = [tables[key].get(name) for key in ("nominal", "refit", "with_causes")]
        meaning = parameter_text(kind, name)
        rows.append((name, meaning, *map(value, entries), _moved(entries, causes=bool(causes))))
    for cause in causes:
        rows += [(name, named(cause), "", "", value(p), "") for name, p in cause["parameters"].items()]
    return Table(
        ("parameter", "what it is", "arm file", "re-estimated", "with causes", "against the arm file's trust"), rows
    )


def _moved(entries: list[Any], *, causes: bool) -> Cell:
    """Return a table cell with both estimates of a parameter on a line, in standard deviations of the arm file."""
    nominal, refit, final = entries
    if not all(isinstance(e, dict) for e in entries) or not nominal["sigma"]:
        return ""
    away = [(e["value"] - nominal["value"]) / nominal["sigma"] for e in (refit, final)]
    dots = [(min(max(away[0] / _LINE_HALF_WIDTH, -1.0), 1.0), charts.REFIT)]
    words = f"re-estimated {figure(away[0], 2)} sigma away"
    if causes:
        dots.append((min(max(away[1] / _LINE_HALF_WIDTH, -1.0), 1.0), charts.AFTER))
        words += f", with causes {figure(away[1], 2)}"
    return IntervalLine(dots, MIDDLE / _LINE_HALF_WIDTH, words)


def _plausibility(data: Data) -> list[Table]:
    checks = data.get("plausibility") or []
    rows = [("holds" if c["holds"] else "does NOT hold", c["check"], unit_text(c["figure"])) for c in checks]
    return [Table(("physically possible?", "what", "figure"), rows)] if rows else []


def _impossible(data: Data) -> list[str]:
    broken = [c["check"] for c in data.get("plausibility") or [] if not c["holds"]]
    if not broken:
        return []
    if _is_serial(data):
        return [
            "Motion determines sums of the links' numbers, not each by itself: a single link may come out as no body can be while the arm's "
            "torques are right. Use the values of all links together, or keep the arm file's."
        ]
    return [f"Not physically possible: that {', and that '.join(broken)}, does not hold. Something else is wrong."]
