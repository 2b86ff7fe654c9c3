"""The arm's parameters: arm file, re-estimated, with causes; how far they moved, and whether they are possible."""

from __future__ import annotations

from typing import Any

from armgap.report import charts
from armgap.report.page import Cell, IntervalLine, Section, Table
from armgap.report.sections.model_labels import Data
from armgap.report.words import figure, named, parameter_text, unit_text, value

__all__ = ["parameters"]

#: Half of the line on which values are shown, in sigmas of the arm file's trust; the shaded middle is two of them.
REACH = 5.0
MIDDLE = 2.0


def parameters(data: Data) -> Section:
    """Values with intervals, and physical plausibility."""
    text = [
        "Value ± one standard deviation; for the arm file, how far it is trusted. On the line, the shaded middle is two of these standard "
        "deviations around the arm file's value, the ends are five; yellow is re-estimated, blue with causes."
    ]
    return Section("Parameters", text=text, tables=[_values(data), *_plausibility(data)], notes=_impossible(data))


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
    """Where the two estimates lie on a line of the arm file's sigmas."""
    nominal, refit, final = entries
    if not all(isinstance(e, dict) for e in entries) or not nominal["sigma"]:
        return ""
    away = [(e["value"] - nominal["value"]) / nominal["sigma"] for e in (refit, final)]
    dots = [(min(max(away[0] / REACH, -1.0), 1.0), charts.REFIT)]
    words = f"re-estimated {figure(away[0], 2)} sigma away"
    if causes:
        dots.append((min(max(away[1] / REACH, -1.0), 1.0), charts.AFTER))
        words += f", with causes {figure(away[1], 2)}"
    return IntervalLine(dots, MIDDLE / REACH, words)


def _plausibility(data: Data) -> list[Table]:
    checks = data.get("plausibility") or []
    rows = [("holds" if c["holds"] else "does NOT hold", c["check"], unit_text(c["figure"])) for c in checks]
    return [Table(("physically possible?", "what", "figure"), rows)] if rows else []


def _impossible(data: Data) -> list[str]:
    broken = [c["check"] for c in data.get("plausibility") or [] if not c["holds"]]
    if not broken:
        return []
    return [f"Not physically possible: that {', and that '.join(broken)}, does not hold. Something else is wrong."]
